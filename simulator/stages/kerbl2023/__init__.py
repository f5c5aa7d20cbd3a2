"""Stages of the tile rasterizer for 3D Gaussians (Kerbl, Kopanas, Leimkuehler & Drettakis 2023)."""
