"""Speed relative to the best refit, crossings of lines, and the Pareto front."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Optional

import numpy as np
import pandas as pd

from load import PHASES, Study

#: The phases of a ratio.
SCOPES: dict[str, tuple[str, ...]] = {
    "with_motion": PHASES,
    "without_motion": tuple(name for name in PHASES if name != "motion"),
    "update": ("update", "plan_changes"),
    "query": ("traversal", "triangle_tests"),
}

#: The share of a bootstrap distribution inside its interval.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Ratio:
    """Reference time over own time: above 1 is faster than the reference.

    `low` and `high` are the extremes over repetitions if `paired` (repetition i against repetition i of the same session,
    which ran next to each other), else the extremes over any two repetitions.
    """

    middle: float
    low: float
    high: float
    paired: bool
    reference: int


def times_of(study: Study, run: int, scope: str) -> np.ndarray:
    """Returns the time per frame in ms of each repetition of a run, over the phases of a scope."""
    return study.times(SCOPES[scope]).get(run, np.empty(0))


def clip_total(study: Study, run: int) -> float:
    """Returns the time of a run's whole clip, in ms per frame, by which the best refit is chosen: the median over repetitions of all
    phases. The evaluation of positions counts: some baselines fetch them in their own phases. `clip_total` of
    experiments/results/table.hpp and `clipTotal` of the explorer are the same number; tests compare the choices.
    """
    return float(np.median(times_of(study, run, "with_motion")))


def best_refit(study: Study, group: pd.DataFrame) -> Optional[int]:
    """Returns the run of the verified baseline of a group with the smallest `clip_total`, the first of equal ones; None without one.

    It is the one denominator of the group: its phases are the denominators of ratios of phases.
    """
    refits = group[group["baseline"] & (group["guarantee"] != "approximate") & (group["refused"] == "")]
    totals = {int(run): clip_total(study, int(run)) for run in refits["run"]}
    return min(totals, key=lambda run: (totals[run], run)) if totals else None


def ratio(study: Study, run: int, reference: int, scope: str) -> Optional[Ratio]:
    """Returns how many times faster `run` is than `reference`; None if one of them has no time."""
    own = times_of(study, run, scope)
    other = times_of(study, reference, scope)
    if not len(own) or not len(other) or own.min() <= 0:
        return None
    if len(own) == len(other) and study.sessions[run] == study.sessions[reference]:
        quotients = other / own
        return Ratio(float(np.median(quotients)), float(quotients.min()), float(quotients.max()), True, reference)
    return Ratio(
        float(np.median(other) / np.median(own)),
        float(other.min() / own.max()),
        float(other.max() / own.min()),
        False,
        reference,
    )


def interval(own: np.ndarray, other: np.ndarray, paired: bool) -> Optional[tuple[float, float]]:
    """Returns the percentile bootstrap's 95 % interval of a ratio other / own; None for a single repetition.

    Paired repetitions are drawn together, others independently. The distribution is not sampled but exact, so that the
    explorer computes the same interval in the browser; targets.json has 4,000 draws of the independent one.
    """
    if len(own) < 2 or len(other) < 2 or own.min() <= 0:
        return None
    if paired:
        return _percentiles(_medians(other / own))
    mine = _medians(own)
    return _percentiles([(m / n, p * q) for m, p in _medians(other) for n, q in mine])


def _medians(values: np.ndarray) -> list[tuple[float, float]]:
    """Returns the medians of all resamples (as many values, drawn with replacement), each with its probability."""
    x = sorted(map(float, values))
    n = len(x)

    def at_least(k: int, i: int) -> float:
        """The probability that k or more of n draws are among the i smallest values."""
        return sum(math.comb(n, j) * (i / n) ** j * (1 - i / n) ** (n - j) for j in range(k, n + 1))

    half = (n + 1) // 2  # the order of the median, or of the lower of the two values in the middle
    lower = [at_least(half, i + 1) - at_least(half, i) for i in range(n)]
    if n % 2:
        return list(zip(x, lower))
    result = []
    for i in range(n):
        alone = lower[i]
        for j in range(i + 1, n):
            share = ((i + 1) / n) ** half - (i / n) ** half
            share *= ((n - j) / n) ** half - ((n - j - 1) / n) ** half
            share *= math.comb(n, half)
            alone -= share
            result.append(((x[i] + x[j]) / 2, share))
        result.append((x[i], alone))
    return result


def _percentiles(weighted: list[tuple[float, float]]) -> tuple[float, float]:
    """Returns the ends of the middle 95 % of a distribution."""
    outside = (1 - CONFIDENCE) / 2
    weighted = sorted(weighted)
    below, low, high = 0.0, weighted[0][0], weighted[-1][0]
    for value, share in weighted:
        if below <= outside:
            low = value
        below += share
        if below >= 1 - outside:
            high = value
            break
    return low, high


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
