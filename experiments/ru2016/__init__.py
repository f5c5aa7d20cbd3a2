"""Jian Ru's CUDA rasterizer (2016) on a GT 750M."""
