"""Sentences of the frontier of the methods, all computed from its table."""

from typing import Any

import pandas as pd

ONE_STAGE = ("stamps", "across-polygons", "bit-mask")
TIES = {"flip": 1e-3, "wrong": 1e-5}  # differences that count for nothing: no eye sees so little (assumed)


def notes(table: pd.DataFrame, doubles: pd.DataFrame) -> list[str]:
    """Which methods are on a front, which never are and what beats them, and how they err."""
    lines = [_range(table)]
    for machine, rows in table[table.ms.notna()].groupby("machine", sort=False):
        lines += [_on_front(str(machine), rows), *_dominated(str(machine), rows)]
        missing = sorted(set(table.pipeline) - set(rows.pipeline))
        if missing:
            lines.append(f"Without a time on {machine}, for want of an instruction mix: {', '.join(missing)}.")
    return [*lines, *_one_stage(table), *_pixels(table), *_depths(table), *_doubles(doubles)]


def _range(table: pd.DataFrame) -> str:
    return (
        f"{table.method.nunique()} variants of {table.pipeline.nunique()} pipelines on {table.scene.nunique()} scenes; "
        "every time is modelled, every error is against the exact rasterizer at the same samples, and FLIP against "
        "the converged picture in the pipeline's own shading, so a method is not charged for its taste in colours. "
        f"On a front FLIP counts in steps of {TIES['flip']:g}. Pictures are small, so launches and latencies weigh "
        "more than in a game's frame; the rates of fixed function on the H200 are assumed."
    )


def _one_stage(table: pd.DataFrame) -> list[str]:
    """Studies of one stage say nothing of the time before it."""
    studies = [name for name in ONE_STAGE if name in set(table.pipeline)]
    if not studies:
        return []
    sentence = (
        f"The times of {', '.join(studies)} are those of their tests alone: polygons come diced and projected, where "
        "the other pipelines' times begin at vertices, triangles or patches."
    )
    return [sentence]


def _on_front(machine: str, rows: pd.DataFrame) -> str:
    """Pipelines on the fronts of time and FLIP, by the number of scenes."""
    drawn = rows.groupby("pipeline").scene.nunique()

    def named(column: str) -> str:
        counts = rows[rows[column]].groupby("pipeline").scene.nunique().sort_values(ascending=False)
        return ", ".join(f"{name} {count} of {drawn[name]}" for name, count in counts.items())

    return (
        f"Scenes of each pipeline on the front of time and FLIP on {machine}: {named('front_flip')}; "
        f"on that of software alone: {named('software_front_flip')}."
    )


def _dominated(machine: str, rows: pd.DataFrame) -> list[str]:
    """Software that no scene has on the front of software, and what beats each at its best."""
    lines, single = [], []
    soft = rows[~rows.fixed_function]
    for method, of_method in soft.groupby("method", sort=False):
        if of_method.software_front_flip.any():
            continue
        if soft[(soft.pipeline == of_method.pipeline.iloc[0]) & soft.software_front_flip].empty:
            single.append(of_method.sort_values(["flip", "ms"]).iloc[0])
        else:
            lines.append(str(method))
    said = [f"Dominated on {machine} in every scene, though the pipeline is not: {'; '.join(lines)}."] if lines else []
    return said + [_beaten(machine, best, soft) for best in single]


def _beaten(machine: str, best: "pd.Series[Any]", soft: pd.DataFrame) -> str:
    """A variant of a pipeline that is never on the front, and what beats it where it errs least."""
    rivals = soft[(soft.scene == best.scene) & (soft.ms <= best.ms) & (soft.flip <= best.flip + TIES["flip"])]
    rival = rivals[rivals.software_front_flip].sort_values("ms").iloc[0]
    return (
        f"Dominated on {machine} in every scene: {best.method}. At its best ({best.scene}: {best.ms:.3g} ms, "
        f"FLIP {best.flip:.4f}) it meets {rival.method} ({rival.ms:.3g} ms, {rival.flip:.4f})."
    )


def _pixels(table: pd.DataFrame) -> list[str]:
    """Wrong pixels by pipeline, holes and spills."""
    first = table[(table.machine == table.machine.iloc[0]) & table.wrong.notna()]
    lines = []
    for scene in ("0.1 px", "1000 px"):
        rows = first[first.scene == scene]
        if rows.empty:
            continue
        best = rows.groupby("pipeline").wrong.min().sort_values()
        named = ", ".join(f"{pipeline} {100 * share:.3g} %" for pipeline, share in best.items())
        lines.append(f"Wrong pixels where triangles have {scene}, the best variant of each: {named}.")
    holes = first[(first.holes > 0) | (first.spills > 0)]
    if len(holes):
        worst = holes.sort_values("holes").iloc[-1]
        lines.append(
            f"{len(holes)} of {len(first)} pictures have a pixel of a surface clearly behind or before the right one; "
            f"most holes: {worst.method}, {worst.scene}, {100 * worst.holes:.3g} % of the pixels."
        )
    return lines


def _depths(table: pd.DataFrame) -> list[str]:
    first = table[(table.machine == table.machine.iloc[0]) & table.depth_median_ulp.notna()]
    grouped = first.groupby("method", sort=False)[["depth_median_ulp", "depth_worst_ulp"]]
    worst = grouped.agg({"depth_median_ulp": "median", "depth_worst_ulp": "max"})
    named = "; ".join(
        f"{name} {row.depth_median_ulp:.2g} / {row.depth_worst_ulp:.2g}" for name, row in worst.iterrows()
    )
    return [f"Depth in units of the last place of its own format, median / worst over all scenes: {named}."]


def _doubles(doubles: pd.DataFrame) -> list[str]:
    """Double hits where edges run through samples."""
    twice = doubles[doubles.double_hits > 0]
    clean = sorted(set(doubles.method) - set(twice.method))
    lines = [f"Edges through samples: every sample once with {'; '.join(clean)}."] if clean else []
    if len(twice):
        named = "; ".join(f"{row.method} {row.double_hits} of {row.samples}" for row in twice.itertuples())
        lines.append(f"Samples on a shared edge drawn more than once: {named}.")
    return lines
