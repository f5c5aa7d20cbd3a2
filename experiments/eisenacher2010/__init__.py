"""Eisenacher & Loop 2010, "Data-parallel Micropolygon Rasterization": tables 1 to 3, figure 4, and its claims."""

ONE_PROCESS = True  # they share frames
