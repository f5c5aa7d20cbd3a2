"""Build the API reference from the docstrings: ``python docs/api.py FOLDER``."""

import sys
from pathlib import Path
from pkgutil import walk_packages

import pdoc

import tilestamp

for name in tilestamp.__all__:
    setattr(tilestamp, name, getattr(tilestamp, name))  # loaded when first used: pdoc sees only what is there
pages = [found.name for found in walk_packages(tilestamp.__path__, "tilestamp.") if "__main__" not in found.name]
pdoc.render.configure(docformat="numpy")
pdoc.pdoc("tilestamp", *pages, output_directory=Path(sys.argv[1]))
