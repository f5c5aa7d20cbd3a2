"""Hangyu Zhang's CUDA rasterizer (2025), on the two GPUs that it may have run on."""
