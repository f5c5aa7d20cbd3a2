"""Laine & Karras, High-Performance Software Rasterization on GPUs, HPG 2011: its tables, figures and slides."""

ONE_PROCESS = True  # they share frames
