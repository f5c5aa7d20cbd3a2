"""Fatahalian et al. 2009: stamps, lanes across polygons, motion blur and defocus."""
