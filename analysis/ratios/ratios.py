"""Speed relative to the best refit, crossings of lines, and the Pareto front."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Optional

import numpy as np
import pandas as pd

from results import clip_times
from results.load import Study

#: The phase of a ratio, by the program's name (clip_times).
SCOPES = {"with_motion": "total_with_motion", "without_motion": "total", "update": "upkeep", "query": "query"}


@dataclass(frozen=True)
class Ratio(clip_times.Ratio):
    """Reference time over own time: above 1 is faster than the reference."""

    reference: int
    disturbed: bool  #: on one of the sides


def clip_total(study: Study, run: int) -> float:
    """Returns the time of a run's whole clip (`clip_times.clip_total`); NaN without times."""
    return clip_times.clip_total(study.raw[run]) if run in study.raw else math.nan


def best_refit(study: Study, group: pd.DataFrame) -> Optional[int]:
    """Returns the run of a group's best refit (`clip_times.best_refit`), of equal ones the first; None without one.

    It is the one denominator of the group: its phases are the denominators of ratios of phases.
    """
    rows = group.sort_values("run")
    times = [study.raw.get(int(run)) if refused == "" else None for run, refused in zip(rows["run"], rows["refused"])]
    found = clip_times.best_refit(times, rows["baseline"], rows["guarantee"] == "approximate")
    return None if found is None else int(rows["run"].iloc[found])


def ratio(study: Study, run: int, reference: int, scope: str, steady: bool = False) -> Optional[Ratio]:
    """Returns how many times faster `run` is than `reference`; None if one of them has no time."""
    if run not in study.raw or reference not in study.raw:
        return None
    own, other = study.raw[run], study.raw[reference]
    found = clip_times.ratio_of(other, own, SCOPES[scope], steady)
    if found is None:
        return None
    disturbed = is_disturbed(study, run, reference)
    return Ratio(found.middle, found.low, found.high, found.paired, found.is_interval, reference, disturbed)


def is_disturbed(study: Study, *runs: int) -> bool:
    """Returns whether the machine was disturbed while one of these runs was timed."""
    return any(study.raw[run].disturbed for run in runs)


def ratios(study: Study, scope: str) -> dict[int, Ratio]:
    """Returns ratios of all timed runs to the best refit of the same group, commit and state of the tree."""
    result: dict[int, Ratio] = {}
    for _, group in study.timed.groupby(["group", "commit", "dirty"]):
        reference = best_refit(study, group)
        if reference is None:
            continue
        for run in group["run"]:
            one = ratio(study, int(run), reference, scope)
            if one is not None:
                result[int(run)] = one
    return result


def pareto_front(points: list[tuple[float, float]]) -> list[int]:
    """Returns indices of the points that no other dominates in both coordinates (smaller is better), by first coordinate.

    Of equal points, the first is kept; points with a coordinate that is not finite never belong.
    """
    usable = [i for i, (x, y) in enumerate(points) if math.isfinite(x) and math.isfinite(y)]
    front: list[int] = []
    best = math.inf
    for i in sorted(usable, key=lambda i: (points[i][0], points[i][1], i)):
        if points[i][1] < best:
            front.append(i)
            best = points[i][1]
    return front


def fastest_configurations(rows: pd.DataFrame) -> pd.DataFrame:
    """Keeps of each strategy only the configuration that is the fastest on average, so that lines stay readable."""
    chosen = []
    for _, same in rows.groupby("id"):
        covered = same.groupby("contestant")["group"].nunique()
        complete = same[same["contestant"].isin(covered[covered == covered.max()].index)]
        chosen.append(complete.groupby("contestant")["total_motion"].mean().idxmin())
    return rows[rows["contestant"].isin(chosen)]


def best_refit_line(rows: pd.DataFrame, column: str, x: str) -> Optional[pd.Series]:
    """Returns the time of the best refit at each x: of the baseline whose clip takes the shortest time."""
    refits = rows[rows["baseline"] & (rows["guarantee"] != "approximate")].sort_values(["total_motion", "run"])
    best = refits.drop_duplicates(x).set_index(x)[column].sort_index()
    best = best[best > 0]
    return best if len(best) else None


def period_line(rows: pd.DataFrame, column: str, x: str) -> Optional[pd.Series]:
    """Returns the time of the refit of 2006 at each x."""
    period = rows[rows["family"] == "period"].groupby(x)[column].min()
    period = period[period > 0]
    return period if len(period) else None


def without_oracles(rows: pd.DataFrame) -> pd.DataFrame:
    """Removes brute force, which would compress all others on a shared axis, unless nothing else is there."""
    others = rows[rows["family"] != "oracle"]
    return others if len(others) else rows


@dataclass(frozen=True)
class Crossing:
    """A crossing of a line with the reference: at `x`; beyond it `faster` or not."""

    x: float
    y: float
    faster: bool


def crossings(x: np.ndarray, own: np.ndarray, reference: np.ndarray) -> list[Crossing]:
    """Returns break-even points between measured ones, on log-log straight lines; never outside the measured range.

    Measured points where both are equal count only if the sides differ before and after.
    """
    result: list[Crossing] = []
    gap = np.log(own) - np.log(reference)
    unequal = np.flatnonzero(gap)
    for i, j in zip(unequal[:-1], unequal[1:]):
        if gap[i] * gap[j] > 0:
            continue
        if j > i + 1:  # equal in between: the first of these points is the break-even
            result.append(Crossing(float(x[i + 1]), float(own[i + 1]), bool(gap[j] < 0)))
            continue
        share = gap[i] / (gap[i] - gap[j])
        at = math.exp(math.log(x[i]) + share * (math.log(x[j]) - math.log(x[i])))
        level = math.exp(math.log(own[i]) + share * (math.log(own[j]) - math.log(own[i])))
        result.append(Crossing(at, level, bool(gap[j] < 0)))
    return result
