"""Studies: plans and their results."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Mapping, Optional, Union

import pandas as pd

from . import _core, results
from .scenes import PathLike


@dataclass
class Run:
    """The outcome of a plan: configurations that were measured, were in the folder already, were not timed because a guarantee
    was broken, or are unfinished for lack of memory; the tables as text; and the results, if a folder was given."""

    measured: int
    skipped: int
    refused: int
    unfinished: int
    tables: str
    results: Optional[results.Results] = None

    def __str__(self) -> str:
        return self.tables


def _read(given: Union[PathLike, Mapping[str, Any]]) -> tuple[str, str, str]:
    """Returns the text of a plan, its place in messages, and the folder of its files."""
    if isinstance(given, Mapping):
        return json.dumps(given, default=os.fspath), "plan", "."
    file = Path(given)
    try:
        text = file.read_text(encoding="utf-8")
        json.loads(text)
    except (OSError, ValueError) as problem:
        raise _core.InputError(f"{file}: {problem}") from None
    return text, str(file), str(file.parent)


def plan(given: Union[PathLike, Mapping[str, Any]]) -> pd.DataFrame:
    """Returns what a plan would measure, one row per study, scene and contestant, without running it. `given` is a plan
    (experiments/RESULTS.md) or its file. Raises InputError and ConfigError.

    >>> frame = kbvh.plan({"scenes": ["tablecloth"], "strategies": ["bottom_up", "lbvh"], "l": [1, 10]})
    >>> frame[["scene", "strategy", "l"]].values.tolist()
    [['tablecloth', 'bottom_up', 1], ['tablecloth', 'bottom_up', 10], ['tablecloth', 'lbvh', 1], ['tablecloth', 'lbvh', 10]]
    """
    rows = []
    for study in json.loads(_core.expand_plan(*_read(given)))["studies"]:
        for scene in study["scenes"]:
            for contestant in study["contestants"]:
                for scalar in study["scalars"]:
                    for l in study["l"]:
                        rows.append(
                            {
                                "study": study["study"],
                                "scene": scene["name"] or scene["builtin"] or "bodies",
                                "triangles": scene["triangles"],
                                "keyframes": scene["keyframes"],
                                "seed": scene["seed"],
                                "scalar": scalar,
                                "l": l,
                                "strategy": contestant["id"],
                                "label": contestant["label"],
                                "params": contestant["params"],
                                "repetitions": study["repetitions"],
                            }
                        )
    return pd.DataFrame(rows)


def run(given: Union[PathLike, Mapping[str, Any]], out: Optional[PathLike] = None) -> Run:
    """Runs a plan: verifies each contestant, then times those whose guarantee holds. With `out`, results are added to
    `out`/results.jsonl, as `kbvh run` does; configurations that are there already are not measured again. Strategies in Python
    take part by their ids; their times include the interpreter. Raises InputError and ConfigError.
    """
    found = _core.run(*_read(given), "" if out is None else os.fspath(out))
    return Run(**found, results=None if out is None else results.read(out))
