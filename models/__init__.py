"""The SIMT machine: counting rules, occupancy, memory, atomics, time. It knows no triangle, tile or patch."""

from models import compile_cache

compile_cache.set_up()  # before any kernel is imported
