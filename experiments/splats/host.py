"""What the host adds to a frame of splats: it reads the number of pairs before it can launch the rest."""

from tilestamp.models.machine import Machine
from tilestamp.simulator.run import Run


def host_ms(machine: Machine, launches: int) -> float:
    """Milliseconds in which no kernel runs: one wait, and a gap for each launch (H200: 62 us; measured 50 to 75)."""
    return (machine.launch.sync_us + launches * machine.launch.stream_us) / 1e3


def frame_ms(run: Run) -> float:
    """Milliseconds from frame to frame."""
    return run.milliseconds + host_ms(run.machine, len(run.launches))
