"""Tests; the slow, obvious versions that they compare with are the modules naive_*."""
