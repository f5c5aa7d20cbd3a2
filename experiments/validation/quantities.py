"""What is compared: quantities of one kernel launch, the counters that measure them, and the aims."""

from collections.abc import Callable
from dataclasses import dataclass

from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.price import price
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic

SHORTEST_US = 5.0  # kernels below are measured, and not judged
_SECTORS = "l1tex__t_sectors_pipe_lsu_mem_global_op_{}.sum"
_REQUESTS = "l1tex__t_requests_pipe_lsu_mem_global_op_{}.sum"


@dataclass(frozen=True)
class Quantity:
    """One row of the report.

    Parameters
    ----------
    name : str
    metrics : tuple of str
        Metrics whose sum measures it.
    ours : callable
        The same from a launch.
    aim : float or None
        Error aimed at, relative; absolute where ``absolute``.
    """

    name: str
    metrics: tuple[str, ...]
    ours: Callable[[Launch], float]
    aim: float | None
    absolute: bool = False


def _total(*events: E) -> Callable[[Launch], float]:
    return lambda launch: float(launch.events[:, list(events)].sum())


def _warps(launch: Launch) -> float:
    return float(launch.grid * -(-launch.block // 32))


def _efficiency(launch: Launch) -> float:
    issued = _total(*INSTRUCTION_CLASSES)(launch)
    return _total(E.LANES)(launch) / (32.0 * issued) if issued else 0.0


QUANTITIES = (
    Quantity("blocks", ("launch__grid_size",), lambda launch: float(launch.grid), 0.0),
    Quantity("warps", ("smsp__warps_launched.sum",), _warps, 0.0),
    Quantity("atomic instructions", (_REQUESTS.format("atom"), _REQUESTS.format("red")), _total(E.ATOMIC), 0.0),
    Quantity("instructions", ("smsp__inst_executed.sum",), _total(*INSTRUCTION_CLASSES), 0.02),
    Quantity("SIMD efficiency", ("derived.simd_efficiency",), _efficiency, 0.02, absolute=True),
    Quantity("load sectors", (_SECTORS.format("ld"),), _total(E.LOAD_TRANSACTIONS), 0.05),
    Quantity("store sectors", (_SECTORS.format("st"),), _total(E.STORE_TRANSACTIONS), 0.05),
    Quantity("atomic sectors", (_SECTORS.format("atom"), _SECTORS.format("red")), _total(E.ATOMIC_REQUESTS), 0.05),
)


@dataclass(frozen=True)
class Moved:
    """One row of the report that needs the caches: bytes of a launch that finds them empty.

    Parameters
    ----------
    name : str
    metrics : tuple of (str, float)
        Metrics and what each counts for.
    ours : callable
    """

    name: str
    metrics: tuple[tuple[str, float], ...]
    ours: Callable[[Launch, Traffic], float]


CODE_BYTES = {  # machine code, which a launch fetches too: sizes of the listings
    "triangleSetup": 64096,
    "binRaster": 15888,
    "coarseRaster": 48752,
    "fineRaster": 18928,
    "freepipe": 31664,
    "freepipe_early": 33152,
}
MOVED = (
    Moved(
        "L2 traffic",
        tuple(
            (_SECTORS.format(name), -32.0 if name.endswith("hit") else 32.0)
            for name in ("ld", "st", "atom", "red", "ld_lookup_hit")
        ),
        lambda _, moved: moved.l2_bytes,
    ),
    Moved(
        "DRAM traffic",
        (("dram__bytes_read.sum", 1.0), ("dram__bytes_write.sum", 1.0)),
        lambda launch, moved: moved.dram_bytes + CODE_BYTES.get(launch.kernel, 0),
    ),
)
CROSSED = 1.5  # lts counters: sectors that cross to the other half of the chip count twice (stores: 1.47 to 1.53)
MOVED_LOCAL = (
    Moved(
        "L2 traffic",
        tuple((f"lts__t_sectors_op_{name}.sum", 32.0 / CROSSED) for name in ("read", "write", "atom", "red")),
        lambda _, moved: moved.l2_bytes,
    ),
    MOVED[1],
)
"""The same of a kernel that uses local memory, which the counters of global loads and stores at L1 do not see."""
MOVED_AIM = 0.20
TIME = "time"
WALL = "wall time"  # seconds that one prediction takes us: pictures, counts and price
WALL_AIM = 1.0
TIME_METRIC = "cupti_us_median"
TIME_AIM = 0.40  # of one kernel; 0.12 on average


def warm(launch: Launch, machine: Machine) -> Timing:
    """Time of a launch that runs again and again, as the measured ones did: its buffers are in the cache."""
    return price([launch, launch], machine)[1]


def warm_microseconds(launch: Launch, machine: Machine) -> float:
    """``warm`` in microseconds."""
    return warm(launch, machine).milliseconds * 1e3
