"""Build the API reference from the docstrings: ``python docs/api.py FOLDER``."""

import sys
from pathlib import Path

import pdoc

import tilestamp

for name in tilestamp.__all__:
    setattr(tilestamp, name, getattr(tilestamp, name))  # loaded when first used: pdoc sees only what is there
floors = [f"tilestamp.{floor}" for floor in ("models", "simulator", "experiments", "reports")]
pdoc.render.configure(docformat="numpy")
pdoc.pdoc("tilestamp", *floors, output_directory=Path(sys.argv[1]))
