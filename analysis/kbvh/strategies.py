"""The strategies, their parameters and their counters."""

from __future__ import annotations

from typing import Any

import pandas as pd

from . import _core


def strategies() -> pd.DataFrame:
    """Returns one row per strategy, with its id as the index: title, family, language, guarantee, tightness, foresight, abilities,
    parameters (name to default), about (what it is and when it wins) and more.

    >>> table = kbvh.strategies()
    >>> table.loc["bottom_up", "guarantee"]
    'exact'
    >>> table.loc["bottom_up", "language"]
    'C++'
    """
    rows = _core.list_strategies()
    for row in rows:
        row["language"] = "python" if row["family"] == "python" else "C++"
        row["parameters"] = {one["name"]: one["default"] for one in row["parameters"]}
    return pd.DataFrame(rows).set_index("id")


def describe(strategy: str) -> dict[str, Any]:
    """Returns everything about one strategy; `parameters` is a frame with name, default, meaning and what is allowed.

    >>> kbvh.describe("drift_boxes")["parameters"].columns[:3].tolist()
    ['name', 'default', 'meaning']
    """
    rows = {row["id"]: row for row in _core.list_strategies()}
    if strategy not in rows:
        raise _core.ConfigError(f"there is no strategy '{strategy}'; known are {', '.join(rows)}")
    columns = ["name", "default", "meaning", "admissible", "allowed", "least", "most", "whole"]
    return {**rows[strategy], "parameters": pd.DataFrame(rows[strategy]["parameters"], columns=columns)}


def counters() -> dict[str, str]:
    """Returns the counters that all strategies share, with what each counts.

    >>> "box_tests" in kbvh.counters()
    True
    """
    return _core.counter_meanings()
