"""An area proxy: what a machine's SMs and L2 would take on a chip, for questions of what to spend it on.

All weights are assumed, in mm2 of a 4 nm process. Only ratios mean something, and only between machines of one
generation. What is no part of it (memory controllers, fixed function, links) is taken to stay as it is.
"""

from tilestamp.models.machine import Machine

SCHEDULER = 0.10  # with its dispatch and instruction buffers
LANES = {"fp32": 0.004, "int32": 0.003, "sfu": 0.010}  # a lane of each pipe
REGISTER_MB = 1.0  # many banks and ports
SHARED_MB = 0.8
L2_MB = 0.55
REST_OF_SM = 0.8  # load and store, texture, tensor cores, instruction caches
MEGABYTE = 1 << 20


def sm_area(machine: Machine) -> float:
    """Area of one SM, mm2, by assumed weights."""
    sm = machine.sm
    lanes = sum(weight * lane_count(machine, pipe) for pipe, weight in LANES.items())
    registers, shared = 4 * sm.registers / MEGABYTE, sm.shared_bytes / MEGABYTE
    return REST_OF_SM + sm.schedulers * (SCHEDULER + lanes) + REGISTER_MB * registers + SHARED_MB * shared


def area(machine: Machine) -> float:
    """Area of all SMs and of the L2, mm2, by assumed weights."""
    return machine.sm.count * sm_area(machine) + L2_MB * machine.memory.l2_bytes / MEGABYTE


def lane_count(machine: Machine, pipe: str) -> float:
    """Lanes of a pipe of one scheduler: those that take a warp instruction in its cycles."""
    cycles = getattr(machine.pipe, pipe) or getattr(machine.issue, pipe)
    return float(machine.sm.warp_size / cycles) if cycles else 0.0
