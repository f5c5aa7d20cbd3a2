"""Laine & Karras, High-Performance Software Rasterization on GPUs, HPG 2011: its tables, figures and slides."""
