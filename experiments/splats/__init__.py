"""Gaussian splats: which tile, which GPU, and what others measured of them."""
