"""Frontiers: what accuracy costs, of the methods and of the model itself."""
