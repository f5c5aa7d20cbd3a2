"""The SIMT machine: counting rules, occupancy, memory, atomics, time. It knows no triangle, tile or patch.

``price.price(launches, load_machine("gtx280"), "schedule")`` prices the launches of a frame.
"""
