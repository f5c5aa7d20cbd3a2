"""Schedule: units of work played against each other on the SMs.

The machine hands units to SMs in order: a block to the SM with the most free places, not faster than the block launch
rate; an item of a queue to whichever persistent block or warp is free. What is resident shares:

*An SM.* A unit that would take ``alone`` cycles by itself and needs ``d`` cycles of its SM (schedulers, execution
units, shared memory, load path: the largest) loads the SM by ``d / alone``. While the loads of all residents add up
to S <= 1, each runs at its own pace; beyond, all of them slow down by S. So an SM has a clock of its own that runs at
1 / max(1, S), and a unit ends when that clock has advanced by ``alone``.

*The chip.* DRAM, L2, all atomic units and the fullest one are servers of the whole chip. Each unit loads them in the
same way; while the fullest is loaded by C > 1, everything slows down by C. So time itself is stretched by
max(1, C), and events need no second look.

Both loads change only when a unit starts or ends, so the play is exact and costs one step for each unit. It shows
what a roofline cannot: idle SMs when units are few, SMs that are half empty, and the tail when units are unlike.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import Asked, asked_of, longest, slots, timing
from tilestamp.models.demand import Demand
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic

MOST_UNITS = 1_000_000  # beyond, neighbours are played as one unit
SERVERS = 4  # of the whole chip: DRAM, L2, atomic units together, the fullest atomic unit
EXCESS = 1.15  # times the largest term: from here on balance or tail is what holds


def schedule(launch: Launch, machine: Machine, moved: Traffic) -> Timing:
    """Price one launch by playing its units on the SMs; parameters and errors as of ``asked_of``.

    Returns
    -------
    Timing
        Never below ``bounds``. ``details`` has ``busy_sms`` (SMs that got a unit) and ``tail_cycles`` (from the start
        of the last unit to the end).
    """
    asked = asked_of(launch, machine, moved)
    return played(asked, loads(asked))


class Loads(NamedTuple):
    """What is played: a row a unit.

    Parameters
    ----------
    sm : ndarray, (units,)
        Cycles of its SM.
    chip : ndarray, (units, SERVERS)
        Cycles of the servers of the chip.
    alone : ndarray, (units,)
        Cycles that it takes by itself.
    places : ndarray, (sms,)
        Units that each SM holds.
    interval : float
        Cycles from one start to the next; 0 where units are drawn from a queue.
    """

    sm: NDArray[np.float64]
    chip: NDArray[np.float64]
    alone: NDArray[np.float64]
    places: NDArray[np.int64]
    interval: float


def loads(asked: Asked) -> Loads:
    """What the units of a launch load the machine with."""
    launch, machine = asked.launch, asked.machine
    sm, chip, alone = _grouped(asked.units)
    blocks = launch.dispatch == "blocks"
    interval = machine.sm.clock_mhz / machine.launch.blocks_per_us * launch.grid / max(1, len(alone)) if blocks else 0.0
    return Loads(sm, chip, alone, slots(launch, machine, asked.held), interval)


def start_up(asked: Asked) -> float:
    """Cycles before a persistent block draws its first unit; each block of a grid has its own in its chain."""
    persistent = asked.launch.dispatch != "blocks" and len(asked.units.alone)
    return asked.machine.latency.block_launch_cycles if persistent else 0.0


def played(asked: Asked, units: Loads) -> Timing:
    """Play the units of what was asked."""
    end, last_start, busy = _play(*units)
    terms = asked.terms
    cycles = max(end + start_up(asked), longest(terms, asked.units))
    return timing(
        asked,
        terms["launch"] + cycles,
        _holds(terms, cycles, end - last_start, busy < asked.machine.sm.count),
        "schedule",
        busy_sms=float(busy),
        tail_cycles=end - last_start,
    )


def _holds(terms: dict[str, float], played: float, tail: float, some_idle: bool) -> str:
    """Name what holds: a term, or the lack of balance that the terms do not see."""
    largest = max(terms, key=lambda name: terms[name])
    if largest == "launch" and terms["launch"] > played:
        return largest
    roof = max(value for name, value in terms.items() if name != "launch")
    if played <= EXCESS * roof:
        return max((name for name in terms if name != "launch"), key=lambda name: terms[name])
    if some_idle:
        return "balance"
    return "tail" if tail > (played - roof) / 2 else largest


def _grouped(asked: Demand) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Cycles on the SM (units,), on the chip (units, SERVERS), and alone (units,); neighbours added where too many."""
    sm = np.maximum(np.maximum(asked.issue, asked.shared), asked.l1)
    chip = np.stack((asked.dram, asked.l2, asked.atomic, asked.queue), axis=1)
    alone = np.maximum(np.maximum(asked.alone, sm), 1.0)
    group = -(-len(alone) // MOST_UNITS)
    if group > 1:
        first = np.arange(0, len(alone), group)
        sm, chip, alone = (np.add.reduceat(column, first, axis=0) for column in (sm, chip, alone))
    return np.ascontiguousarray(sm), np.ascontiguousarray(chip), np.ascontiguousarray(alone)


@kernel
def _play(sm: Any, chip: Any, alone: Any, places: Any, interval: float) -> tuple[float, float, int]:
    """Play all units; return the end, the start of the last unit (cycles), and the SMs that got any.

    ``ends[s, p]`` is the reading of SM s's own clock at which the unit in place p ends, infinite where it is free;
    ``soonest[s]`` is the place of the first one, ``vacancies[s]`` a stack of its ``free[s]`` free places.
    ``now`` is unstretched time, ``time`` is real; ``wake[s]`` is the ``now`` of the next end on SM s, and ``first``
    a tournament tree over it.
    """
    sms = len(places)
    ends = np.full((sms, max(1, places.max())), np.inf)
    unit = np.zeros(ends.shape, np.int64)
    free = places.copy()
    vacancies = np.zeros(ends.shape, np.int64)
    for each in range(sms):
        vacancies[each, : places[each]] = np.arange(places[each])[::-1]
    soonest = np.zeros(sms, np.int64)
    load = np.zeros(sms)  # S of each SM
    clock = np.zeros(sms)  # its own clock, at ``read``
    read = np.zeros(sms)
    leaves = 1 << int(np.ceil(np.log2(max(2, sms))))
    wake = np.full(leaves, np.inf)
    first = _tournament(leaves)
    server = np.zeros((sms, SERVERS))  # what the units of an SM load the chip with, at their own pace
    chip_load = np.zeros(SERVERS)
    vacant = free.sum()
    time = 0.0
    now = 0.0
    last_start = 0.0
    started = 0
    ended = 0
    freed = 0  # SM of the last end
    while ended < len(alone):
        stretch = max(1.0, chip_load[0], chip_load[1], chip_load[2], chip_load[3])
        s = first[1]
        moment = wake[s]
        start = False
        if started < len(alone) and vacant > 0:
            ready = now + max(0.0, started * interval - time) / stretch
            start = ready <= moment
            moment = min(ready, moment)
        time += (moment - now) * stretch
        now = moment
        if start:
            s = freed if vacant == free[freed] else np.argmax(free)
        # the SM's own clock up to now, before its load changes
        clock[s] += (now - read[s]) / max(1.0, load[s])
        read[s] = now
        if start:
            place = vacancies[s, free[s] - 1]
            i = started
            ends[s, place] = clock[s] + alone[i]
            if ends[s, place] < ends[s, soonest[s]]:
                soonest[s] = place
            unit[s, place] = i
            started += 1
            last_start = time
            _change(s, i, 1.0, sm, chip, alone, load, server, chip_load)
            free[s] -= 1
            vacant -= 1
        else:
            place = soonest[s]
            i = unit[s, place]
            ends[s, place] = np.inf
            soonest[s] = _next_end(ends, s, places[s])
            vacancies[s, free[s]] = place
            ended += 1
            _change(s, i, -1.0, sm, chip, alone, load, server, chip_load)
            free[s] += 1
            vacant += 1
            freed = s
        if free[s] == places[s]:  # empty: leave no rounding behind
            load[s] = 0.0
        left = ends[s, soonest[s]] - clock[s]
        wake[s] = now + max(0.0, left) * max(1.0, load[s])
        _replay(first, wake, leaves, s)
    return time, last_start, min(len(alone), int(np.count_nonzero(places)))


@kernel
def _change(
    s: int, i: int, sign: float, sm: Any, chip: Any, alone: Any, load: Any, server: Any, chip_load: Any
) -> None:
    """Add (or take away) unit i to the loads of SM s and of the chip."""
    before = 1.0 / max(1.0, load[s])
    pace = sign / alone[i]
    load[s] = max(0.0, load[s] + pace * sm[i])
    after = 1.0 / max(1.0, load[s])
    for k in range(SERVERS):
        loaded = max(0.0, server[s, k] + pace * chip[i, k])
        chip_load[k] += loaded * after - server[s, k] * before
        server[s, k] = loaded


@kernel
def _next_end(ends: Any, s: int, places: int) -> int:
    """Place of SM s whose unit ends first."""
    best = 0
    for p in range(1, places):
        if ends[s, p] < ends[s, best]:
            best = p
    return best


@kernel
def _tournament(leaves: int) -> Any:
    """Tree over equal leaves: ``first[1]`` is the winner, the lowest leaf wins a tie."""
    first = np.zeros(2 * leaves, np.int64)
    for leaf in range(leaves):
        first[leaves + leaf] = leaf
    for node in range(leaves - 1, 0, -1):
        first[node] = first[2 * node]
    return first


@kernel
def _replay(first: Any, wake: Any, leaves: int, s: int) -> None:
    """Settle again the games of leaf s, after ``wake[s]`` changed."""
    node = (leaves + s) >> 1
    while node > 0:
        left = first[2 * node]
        right = first[2 * node + 1]
        first[node] = right if wake[right] < wake[left] else left
        node >>= 1
