"""Yao et al.: bit mask filtering."""
