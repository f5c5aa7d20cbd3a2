"""The SIMT machine: counting rules, occupancy, memory, atomics, time. It knows no triangle, tile or patch."""
