"""Studies: many cells (scene, camera, pipeline, options, machine, its numbers), executed once where they can be.

A study is axes; their values make cells. Cells that differ only in numbers of a machine are one execution, priced
again for each; what is computed goes cell by cell into one SQLite file (``store``), so that a second run does what is
missing.
"""
