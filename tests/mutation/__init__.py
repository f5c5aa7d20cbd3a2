"""Mutation of the project by itself: small wrong changes, each of which some test must notice.

``python -m tests.mutation`` makes and tries them (some minutes); ``survivors.toml`` names those that no test notices,
and why that is right. It is no part of the default suite.
"""
