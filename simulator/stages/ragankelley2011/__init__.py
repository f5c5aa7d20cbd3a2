"""Ragan-Kelley et al. 2011: decoupled sampling."""
