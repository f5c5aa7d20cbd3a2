"""Stages of Hangyu Zhang's CUDA rasterizer (2025): sort-middle with 128-pixel bins, 8-pixel tiles and 2x2 quads."""
