"""Benchmarks: reported, never asserted; ``python -m tests.benchmarks.history`` keeps their history."""
