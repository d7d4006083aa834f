"""From the raw times of repetitions to one number, and how sure a ratio is; experiments/RESULTS.md says why.

The program's own code computes (experiments/study/raw_times.hpp); this module hands it tables and returns its numbers. Phases
have the program's names: motion, update, traversal, triangle_tests, changes, query, upkeep (update and changes), total, and
upkeep_with_motion and total_with_motion.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np

from results import arithmetic

#: Phases of the total, as columns of sums; the motion is apart.
PARTS = ("update", "traversal", "triangle_tests", "plan_changes", "geometry_changes")
FEWEST_OF_AN_INTERVAL = 5
DRAWS = 200


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
    disturbed: str = ""  #: why, as recorded; a study that was loaded has `doubts` here
    _handle: Optional[int] = field(default=None, repr=False, compare=False)

    @property
    def repetitions(self) -> int:
        """The number of repetitions."""
        return len(self.totals)

    @property
    def handle(self) -> int:
        """The program's object with these times, made once, with the resamples that it has computed."""
        if self._handle is None:
            functions = arithmetic.functions()
            of_rounds, frames = self.totals.shape
            begin = -1 if self.steady_from is None else self.steady_from
            tables = [
                _doubles(table, (of_rounds, columns))
                for table, columns in ((self.totals, frames), (self.motions, frames), (self.sums, len(PARTS)), (self.steady_sums, len(PARTS)))
            ]
            pointers = [None if table is None else table.ctypes.data for table in tables]
            self._handle = functions.kbvh_times_new(of_rounds, frames, *pointers, begin, self.by_clips, self.session.encode())
            weakref.finalize(self, functions.kbvh_times_delete, self._handle)
        return self._handle


def _doubles(table: Optional[np.ndarray], shape: tuple[int, int]) -> Optional[np.ndarray]:
    if table is None:
        return None
    if table.shape != shape:
        raise ValueError(f"a table of times has the shape {table.shape}, but should have {shape}")
    return np.ascontiguousarray(table, dtype=float)


def _several(call: Any, times: RawTimes, phase: str, count: int) -> np.ndarray:
    values = np.empty(count)
    call(times.handle, phase.encode(), values.ctypes.data)
    return values


def time_of(times: RawTimes, phase: str, by_clips: Optional[bool] = None, steady: bool = False) -> float:
    """Returns the time of a phase in ms per frame, over all repetitions. By frames it is the sum of each frame's median
    (phases are scaled to that total), by clips the median of the repetitions' sums. NaN for steady times where there are none.
    """
    by_clips = times.by_clips if by_clips is None else by_clips
    return float(arithmetic.functions().kbvh_times_of(times.handle, phase.encode(), steady, by_clips))


def clip_total(times: RawTimes) -> float:
    """Returns the time of the whole clip, in ms per frame, by which the best refit and the best of several configurations are chosen:
    all phases, positions included (some baselines fetch them in their own phases). The explorer's `clipTotal` is the same number.
    """
    return float(arithmetic.functions().kbvh_times_clip_total(times.handle))


def doubts(times: RawTimes) -> str:
    """Returns why times are disturbed, or "": the recorded reasons, and repetitions that differ although their work is the same."""
    return str(arithmetic.functions().kbvh_times_doubts(times.handle, times.disturbed.encode()).decode())


def best_refit(times: Sequence[Optional[RawTimes]], baseline: Sequence[bool], approximate: Sequence[bool]) -> Optional[int]:
    """Returns the index of the best refit of a table, by the program's own rule; None if there is none. Times are None where a
    contestant was refused.
    """
    handles = (ctypes.c_void_p * len(times))(*[None if one is None else one.handle for one in times])
    index = arithmetic.functions().kbvh_times_best_refit(len(times), handles, bytes(map(bool, baseline)), bytes(map(bool, approximate)))
    return None if index < 0 else int(index)


def replicates(times: RawTimes, phase: str) -> np.ndarray:
    """Returns the time over each resample of the rounds, by frames."""
    return _several(arithmetic.functions().kbvh_times_replicates, times, phase, DRAWS)


def single_times(times: RawTimes, phase: str) -> np.ndarray:
    """Returns the time of each repetition alone."""
    return _several(arithmetic.functions().kbvh_times_single, times, phase, times.repetitions)


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


def ratio_of(numerator: RawTimes, denominator: RawTimes, phase: str, steady: bool = False) -> Optional[Ratio]:
    """Returns the ratio of two times; None if one of them is 0 or unknown. If one counts by clips, both do."""
    found = (ctypes.c_double * 3)()
    facts = arithmetic.functions().kbvh_times_ratio(numerator.handle, denominator.handle, phase.encode(), steady, found)
    return Ratio(*found, bool(facts & 2), bool(facts & 4)) if facts else None


def paid_from(own: RawTimes, own_preparation: float, other: RawTimes, other_preparation: float) -> Optional[int]:
    """Returns the frame from which on preparation (ms) and frames so far take no longer than the other's; None if never."""
    frame = arithmetic.functions().kbvh_times_paid_from(own.handle, own_preparation, other.handle, other_preparation)
    return None if frame < 0 else int(frame)
