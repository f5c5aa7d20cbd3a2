"""Triangle setup, first half: what becomes of the triangles of a warp."""

from typing import Any

import numpy as np

from tilestamp.models.bits import popcount
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.screen_vertices import ASIDE, BEYOND, CLIP, Screen, place_of, unpacked
from tilestamp.simulator.stages.laine2011.subtriangle import (
    ABSENT,
    BACKFACE,
    BETWEEN,
    CLIPPED,
    KEPT,
    OUTSIDE,
    View,
    cull,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_count import (
    FIRST_OUTSIDE,
    ONE_SITE,
    SINGLE,
    TWO_SITES,
    Counting,
    count_clipped,
    count_vertices,
    count_warp,
    forget_warp,
    new_counting,
    note_vertices,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import (
    BLOCK,
    CUT,
    WARP,
    WHOLE,
    Scratch,
    Setup,
    clip_and_store,
    new_scratch,
    share_of,
)

GUARD_BAND = 32767  # 1/16 pixel; the largest span, too, that the coverage tables allow


@kernel(lent=True, inline=True)
def _add(lanes: Any, lane: int, where: Any) -> Any:
    """Add a lane to a mask of 32, where it belongs there."""
    return np.uint32(lanes | (np.uint32(1 << (lane & 31)) if where else np.uint32(0)))


@kernel(lent=True)
def _near_outcomes(words: Any, corners: Any, n: int, view: View, lanes: Any) -> Any:
    """Outcomes of n triangles of three corners each; False, and nothing is said, where a vertex lies aside.

    No branch, no sign of an index and no store in the loop: compiled code takes eight triangles at a time.
    """
    aside = backface = between = one = two = np.uint32(0)
    for lane in range(n):
        at = np.uint64(3 * lane)
        a, b = words[np.uint32(corners[at])], words[np.uint32(corners[at + np.uint64(1)])]
        c = words[np.uint32(corners[at + np.uint64(2)])]
        aside = _add(aside, lane, (a == ASIDE) | (b == ASIDE) | (c == ASIDE))
        ax, ay = unpacked(a)
        bx, by = unpacked(b)
        cx, cy = unpacked(c)
        _, is_backface, is_between, looks, looks_again = cull(ax, ay, bx, by, cx, cy, view)
        backface, between = _add(backface, lane, is_backface), _add(between, lane, is_between)
        one, two = _add(one, lane, looks), _add(two, lane, looks_again)
    lanes[BACKFACE], lanes[BETWEEN], lanes[ONE_SITE], lanes[TWO_SITES] = backface, between, one, two
    lanes[KEPT] = ((1 << n) - 1) & ~np.int64(backface | between)
    return aside == 0


@kernel(lent=True)
def _outcome(screen: Screen, positions: Any, i: int, j: int, k: int, view: View) -> Any:
    """Outcome of any triangle if it needs no clipping (``CLIPPED`` if it does), and the sites looked at."""
    if min(i, j, k) < 0 or max(i, j, k) >= screen.codes.size:
        return ABSENT, 0
    p, q, r = screen.codes[i], screen.codes[j], screen.codes[k]
    if p & q & r & BEYOND:
        return OUTSIDE, 0
    if (p | q | r) & CLIP:
        return CLIPPED, 0
    ax, ay = place_of(screen, positions, i, view)
    bx, by = place_of(screen, positions, j, view)
    cx, cy = place_of(screen, positions, k, view)
    low, high = min(ax, bx, cx, ay, by, cy), max(ax, bx, cx, ay, by, cy)
    if view.guard_band and (low < -GUARD_BAND - 1 or high > GUARD_BAND or high - low > GUARD_BAND):
        return CLIPPED, 0
    i32 = np.int32
    _, backface, between, one, two = cull(i32(ax), i32(ay), i32(bx), i32(by), i32(cx), i32(cy), view)
    return BACKFACE if backface else BETWEEN if between else KEPT, int(one) + int(two)


@kernel(lent=True)
def warp_outcomes(
    screen: Screen,
    positions: Any,
    triangles: Any,
    first: int,
    n: int,
    plain: bool,
    view: View,
    scratch: Scratch,
    counting: Counting,
    out: Setup,
) -> None:
    """Find what becomes of n triangles, a lane each; ``plain``: all indices are in range."""
    lanes = counting.lanes
    if plain and _near_outcomes(screen.words, triangles[3 * first : 3 * (first + n)], n, view, lanes):
        for lane in range(n):
            out.subtriangles[first + lane] = lanes[KEPT] >> lane & 1
        return
    lanes[:] = 0
    for lane in range(n):
        bit, t = 1 << lane, first + lane
        i, j, k = triangles[3 * t], triangles[3 * t + 1], triangles[3 * t + 2]
        outcome, sites = _outcome(screen, positions, i, j, k, view)
        kept = np.int64(outcome == KEPT)
        if outcome == CLIPPED:
            kept, fan = clip_and_store(scratch, positions, view, out, np.int64(-1), np.int64(-1), t, triangles)
            count_clipped(counting, bit, kept, fan, scratch.steps)
        out.subtriangles[t] = kept
        lanes[outcome] |= bit
        lanes[ONE_SITE] |= bit if sites > 0 else 0
        lanes[TWO_SITES] |= bit if sites > 1 else 0
        if outcome != ABSENT and screen.codes[i] & BEYOND:
            lanes[FIRST_OUTSIDE] |= bit


@kernel(lent=True)
def _outcome_range(
    begin: int,
    end: int,
    screen: Screen,
    positions: Any,
    triangles: Any,
    plain: bool,
    view: View,
    simt: Simt,
    out: Setup,
    masks: Any,
    scratch: Scratch,
    counting: Any,
    vertices: Any,
    table: Any,
) -> Any:
    """Outcomes of all triangles of some whole blocks; returns how many have their sub-triangle at their own slot."""
    lanes, single = counting.lanes, 0
    for warp in range(begin, end, WARP):
        n = min(WARP, end - warp)
        warp_outcomes(screen, positions, triangles, warp, n, plain, view, scratch, counting, out)
        mask = masks[warp // WARP]
        mask[WHOLE], mask[CUT] = lanes[KEPT], lanes[SINGLE]
        single += popcount(np.uint64(lanes[KEPT] | lanes[SINGLE]))
        if table is not None:
            row, second = table[warp // BLOCK], warp // WARP % 2
            corners = triangles[3 * warp : 3 * (warp + n)]
            note_vertices(counting.lines, corners, n, second, lanes[ABSENT])
            count_warp(row, counting, n, view, out, simt)
            if second or warp + WARP >= end:
                count_vertices(row, vertices, counting.lines, simt)
        forget_warp(counting)
    return single


@kernel
def outcome_part(
    part: int,
    parts: int,
    screen: Screen,
    positions: Any,
    triangles: Any,
    plain: bool,
    view: View,
    simt: Simt,
    out: Setup,
    masks: Any,
    vertices: Any,
    table: Any,
) -> Any:
    """Take a share of the blocks, through arrays without reference counts."""
    begin, end = share_of(part, parts, out.subtriangles.size)
    scratch, counting = new_scratch(), new_counting()
    screen, positions, triangles, out = borrow(screen), borrow(positions), borrow(triangles), borrow(out)
    lent, counted = (borrow(masks), borrow(scratch)), (borrow(counting), borrow(vertices[part]))
    single = _outcome_range(begin, end, screen, positions, triangles, plain, view, simt, out, *lent, *counted, table)
    scratch.steps[0] = counting.most[0] = 0  # the owners live to here
    return single
