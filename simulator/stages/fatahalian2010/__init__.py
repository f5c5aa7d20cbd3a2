"""Fatahalian et al. 2010: quad-fragment merging."""
