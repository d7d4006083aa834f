"""The arithmetic of times: from the raw times of repetitions to one number, and how sure a ratio is.

The same as experiments/study/raw_times.cpp; experiments/RESULTS.md says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Optional

import numpy as np

#: Phases of the total, as columns of sums; the motion is apart.
PARTS = ("update", "traversal", "triangle_tests", "plan_changes")
FEWEST_OF_AN_INTERVAL = 5
DRAWS = 200
LEFT_OUT = DRAWS // 40


@dataclass
class RawTimes:
    """The times of one run, in ms: of each repetition and frame, and sums of phases over the frames of the clip and of the
    steady frames.

    Records of schema 1 have only means per frame: these are the one frame of each repetition, and count by clips.
    """

    totals: np.ndarray  #: [repetition][frame]
    motions: np.ndarray
    sums: np.ndarray  #: [repetition][PARTS]
    steady_sums: Optional[np.ndarray]
    steady_from: Optional[int]
    by_clips: bool
    session: str
    disturbed: str = ""
    _known: dict[tuple[bool, bool], tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)

    @property
    def repetitions(self) -> int:
        """The number of repetitions."""
        return len(self.totals)

    def resampled(self, by_clips: bool, steady: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns motion, total and shares of the total ([PARTS]) of every resample; made once."""
        key = (by_clips, steady)
        if key not in self._known:
            draws = resamples(self.repetitions)
            most = max(1, 4_000_000 // self.totals.size)  # at once
            found = [_combined(self, draws[begin : begin + most], by_clips, steady) for begin in range(0, DRAWS, most)]
            motion, total, shares = (np.concatenate(list(one)) for one in zip(*found))
            self._known[key] = (motion, total, shares)
        return self._known[key]


def _combined(times: RawTimes, draws: np.ndarray, by_clips: bool, steady: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    begin = times.steady_from if steady else 0
    frames = times.totals.shape[1] - begin

    def of(table: np.ndarray) -> np.ndarray:
        part = table[:, begin:]
        if by_clips:
            return np.median(part.sum(axis=1)[draws], axis=1) / frames
        return np.median(part[draws], axis=1).sum(axis=1) / frames

    sums = times.steady_sums if steady else times.sums
    middle = np.median(sums[draws], axis=1)
    whole = middle.sum(axis=1, keepdims=True)
    return of(times.motions), of(times.totals), np.divide(middle, whole, out=np.zeros_like(middle), where=whole > 0)


def _of_phases(found: tuple[np.ndarray, np.ndarray, np.ndarray], phases: Sequence[str]) -> np.ndarray:
    motion, total, shares = found
    inner = [PARTS.index(name) for name in phases if name != "motion"]
    value = total if len(inner) == len(PARTS) else total * shares[:, inner].sum(axis=1)
    return value + motion if "motion" in phases else value


def time_of(times: RawTimes, phases: Sequence[str], by_clips: Optional[bool] = None, steady: bool = False) -> float:
    """Returns the time of some phases in ms per frame, over all repetitions. By frames it is the sum of each frame's median
    (phases are scaled to that total), by clips the median of the repetitions' sums. NaN for steady times where there are none.
    """
    if steady and times.steady_from is None:
        return float("nan")
    every = np.arange(times.repetitions)[None, :]
    return float(_of_phases(_combined(times, every, times.by_clips if by_clips is None else by_clips, steady), phases)[0])


def replicates(times: RawTimes, phases: Sequence[str], by_clips: bool = False, steady: bool = False) -> np.ndarray:
    """Returns the time over each resample of the rounds."""
    return _of_phases(times.resampled(by_clips, steady), phases)


def single_times(times: RawTimes, phases: Sequence[str]) -> np.ndarray:
    """Returns the time of each repetition alone."""
    return _of_phases(_combined(times, np.arange(times.repetitions)[:, None], times.by_clips, False), phases)


@lru_cache(maxsize=None)
def resamples(repetitions: int) -> np.ndarray:
    """Returns the resampled rounds, [draw][repetition]: the same on every machine and in the program (Steele, Lea and Flood 2014)."""
    state, mask, found = 1, (1 << 64) - 1, []
    for _ in range(DRAWS):
        draw = []
        for _ in range(repetitions):
            state = x = (state + 0x9E3779B97F4A7C15) & mask
            x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & mask
            x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & mask
            draw.append(((x ^ (x >> 31)) >> 32) * repetitions >> 32)
        found.append(draw)
    return np.array(found)


@dataclass(frozen=True)
class Ratio:
    """A time over another. `low` and `high` are the ends of the 95 % interval (percentile bootstrap over whole rounds) or, with
    fewer than five repetitions, of the range over single repetitions.
    """

    middle: float
    low: float
    high: float
    paired: bool  #: repetition i of one was played next to repetition i of the other
    is_interval: bool


def ratio_of(numerator: RawTimes, denominator: RawTimes, phases: Sequence[str], steady: bool = False) -> Optional[Ratio]:
    """Returns the ratio of two times; None if one of them is 0 or unknown. If one counts by clips, both do."""
    by_clips = numerator.by_clips or denominator.by_clips
    top, bottom = (time_of(side, phases, by_clips, steady) for side in (numerator, denominator))
    if not (top > 0 and bottom > 0):
        return None
    n, m = numerator.repetitions, denominator.repetitions
    paired = n == m and numerator.session == denominator.session
    middle = top / bottom
    if min(n, m) >= FEWEST_OF_AN_INTERVAL:
        above = replicates(numerator, phases, by_clips, steady)
        below = replicates(denominator, phases, by_clips, steady)
        # Reversed, the draws of other rounds are independent.
        ends = np.sort(above / (below if paired else below[::-1]))
        return Ratio(middle, min(float(ends[LEFT_OUT]), middle), max(float(ends[-1 - LEFT_OUT]), middle), paired, True)
    above, below = (
        _of_phases(_combined(side, np.arange(side.repetitions)[:, None], by_clips, steady), phases) for side in (numerator, denominator)
    )
    if min(n, m) < 2 or below.min() <= 0:
        return Ratio(middle, middle, middle, paired, False)
    each = above / below if paired else (above[:, None] / below[None, :]).ravel()
    return Ratio(middle, min(float(each.min()), middle), max(float(each.max()), middle), paired, False)


def paid_from(own: RawTimes, own_preparation: float, other: RawTimes, other_preparation: float) -> Optional[int]:
    """Returns the frame from which on preparation (ms) and frames so far take no longer than the other's; None if never."""
    if own.totals.shape[1] != other.totals.shape[1] or own.totals.shape[1] < 2:
        return None
    ahead = other_preparation - own_preparation + np.cumsum(np.median(other.totals, axis=0) - np.median(own.totals, axis=0))
    behind = np.flatnonzero(ahead < 0)
    first = 0 if not len(behind) else int(behind[-1]) + 1
    return first if first < len(ahead) else None
