"""Results as frames of pandas, by the reader that the report uses."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd

from .scenes import PathLike

_SHARED = ("files", "scene_names", "load")


def _reader() -> ModuleType:
    """Imports load.py, whose modules import each other by plain names, without leaving these names behind."""
    known = sys.modules.get("kbvh._analysis.load")
    if known is not None:
        return known
    folder = str(Path(__file__).parent / "_analysis")
    hidden = {name: sys.modules.pop(name) for name in _SHARED if name in sys.modules}
    sys.path.insert(0, folder)
    try:
        reader = importlib.import_module("load")
    finally:
        sys.path.remove(folder)
        for name in _SHARED:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)
    sys.modules["kbvh._analysis.load"] = reader
    return reader


class Results:
    """The results of a folder: `runs` has one row per configuration (scene, scalar, l, contestant), `repetitions` one per
    repetition with the mean time per frame of each phase in ms; both share the column run. `notes` are sentences about lines
    that were left out."""

    def __init__(self, study: Any) -> None:
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


def read(folder: PathLike) -> Results:
    """Reads `folder`/results.jsonl. Raises ValueError with one sentence if it cannot be used."""
    reader = _reader()
    try:
        return Results(reader.load(Path(folder)))
    except reader.ResultError as problem:
        raise ValueError(str(problem)) from None
