"""Calibration: mixes written from machine code, with a few numbers fitted to hardware counters; it is no experiment."""
