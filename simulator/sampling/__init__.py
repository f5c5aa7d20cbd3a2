"""Sampling: part of the units of a stage run; every number of the whole is estimated, with its interval."""
