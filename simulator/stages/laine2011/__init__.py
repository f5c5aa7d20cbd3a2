"""Laine & Karras 2011, CudaRaster: triangle setup, bin raster, coarse raster, fine raster."""
