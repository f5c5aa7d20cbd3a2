"""Projections that bend straight edges (a road that Laine & Karras 2011 leave open)."""
