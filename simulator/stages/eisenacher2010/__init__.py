"""Eisenacher & Loop 2010: bound and split, dice, bucketing, tile raster."""
