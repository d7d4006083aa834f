"""Results as frames of pandas, by the reader that the report uses."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Optional, Sequence

import pandas as pd

from .scenes import PathLike

_SHARED = (
    "results", "results.files", "results.scene_names", "results.arithmetic", "results.clip_times", "results.record", "results.rows",
    "results.load", "ratios", "ratios.ratios", "ratios.profiles",
)  # fmt: skip


def _shared(name: str) -> ModuleType:
    """Imports a module that the package shares with the report. These import each other by plain names, and leave none behind."""
    known = sys.modules.get(f"kbvh._analysis.{name}")
    if known is not None:
        return known
    folder = str(Path(__file__).parent / "_analysis")
    hidden = {one: sys.modules.pop(one) for one in _SHARED if one in sys.modules}
    sys.path.insert(0, folder)
    try:
        for one in _SHARED:
            sys.modules[f"kbvh._analysis.{one}"] = importlib.import_module(one)
    finally:
        sys.path.remove(folder)
        for one in _SHARED:
            sys.modules.pop(one, None)
        sys.modules.update(hidden)
    return sys.modules[f"kbvh._analysis.{name}"]


def _reader() -> ModuleType:
    return _shared("results.load")


class Results:
    """The results of a folder: `runs` has one row per configuration (scene, scalar, l, contestant), `repetitions` one per
    repetition with the mean time per frame of each phase in ms; both share the column run. `notes` are sentences about lines
    that were left out."""

    def __init__(self, study: Any) -> None:
        self._study = study
        self.source: Path = study.source
        self.runs: pd.DataFrame = study.runs
        self.repetitions: pd.DataFrame = study.repetitions
        self.notes: list[str] = study.notes

    @property
    def timed(self) -> pd.DataFrame:
        """The runs with times."""
        return self.runs[self.runs["refused"] == ""]

    @property
    def refused(self) -> pd.DataFrame:
        """The runs without times; the column refused says why."""
        return self.runs[self.runs["refused"] != ""]


    def ratios(self, against: Optional[str] = None, measure: str = "with_motion") -> pd.DataFrame:
        """Returns how many times as fast each timed run is as a reference that was measured with it, on the same scene, in the same
        scalar, at the same l: the best refit, or the fastest run of the strategy `against`, both by the time of the whole clip, whatever
        the measure. Above 1 is faster than the reference.

        `ratio` is that of the clips' times, `low` and `high` are the ends of its 95 % interval (a bootstrap over whole rounds) or,
        where `interval` is false, of the range over fewer than five repetitions (nan for a single one); `paired` says whether
        repetitions ran next to each other, `disturbed` whether the machine was, `reference` is the reference's run. `measure` is
        with_motion, without_motion, update or query. Runs without a reference are left out. The report and its explorer show the
        same numbers. Raises ValueError for another measure.
        """
        rules = _shared("ratios.ratios")
        if measure not in rules.SCOPES:
            raise ValueError(f"measure is {measure!r}, but should be one of {', '.join(rules.SCOPES)}")
        rows = []
        for _, group in self._study.timed.groupby(["group", "commit", "dirty"], sort=False):
            mine = group if against is None else group[group["id"] == against].assign(baseline=True, guarantee="")
            reference = rules.best_refit(self._study, mine)
            if reference is None:
                continue
            for run, id, label in zip(group["run"], group["id"], group["label"]):
                found = rules.ratio(self._study, int(run), reference, measure)
                if found is not None:
                    several = min(self._study.raw[one].repetitions for one in (int(run), reference)) > 1
                    low, high = (found.low, found.high) if several else (float("nan"), float("nan"))
                    rows.append((run, id, label, found.middle, low, high, found.is_interval, found.paired, found.disturbed, reference))
        names = ["run", "id", "label", "ratio", "low", "high", "interval", "paired", "disturbed", "reference"]
        return pd.DataFrame(rows, columns=names).set_index("run")

    def profiles(self, within: Sequence[float] = (1, 1.25, 2)) -> pd.DataFrame:
        """Returns performance profiles (Dolan and Moré 2002), the best strategy first: how often a strategy with its fastest
        setting is within a factor of the fastest of its cell, as a share of the `cells` in which it has a time (a cell is a scene
        at one size, scalar and l), and its median `factor`. Contestants without a guarantee, with several threads, brute force and
        limits take no part, and cells with a single strategy do not count.
        """
        found = _shared("ratios.profiles").profiles(self._study)
        rows = {
            one.id: {
                **{f"within {factor:g}": one.within(factor) for factor in within},
                "factor": float(pd.Series(one.factors).median()),
                "cells": len(one.factors),
            }
            for one in found
        }
        return pd.DataFrame.from_dict(rows, orient="index")


def read(folder: PathLike) -> Results:
    """Reads `folder`/results.jsonl. Raises ValueError with one sentence if it cannot be used."""
    reader = _reader()
    try:
        return Results(reader.load(Path(folder)))
    except reader.ResultError as problem:
        raise ValueError(str(problem)) from None
