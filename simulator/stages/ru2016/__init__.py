"""Stages of Jian Ru's CUDA rasterizer (2016): a GT 750M, one thread a triangle or one thread a pixel of a tile."""
