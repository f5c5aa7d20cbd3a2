"""Moving, defocused triangles in the tiled pipeline (Akenine-Möller et al. 2007; Laine & Karras 2011, NVR-2011-003)."""
