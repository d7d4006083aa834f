"""Makes the tables that a claim folds out: every point behind it, as finished texts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import text
from claim_pictures import SIGNS, grouped
from claim_points import Looked, Point
from claim_words import details, kinds, motion, wanted


@dataclass(frozen=True)
class Cell:
    """A value with its range over repetitions."""

    value: str
    range: str
    met: bool
    close: bool  #: the repetitions disagree on `met`


@dataclass(frozen=True)
class Table:
    """One check: a row for each place, a column for each corner and quantity."""

    title: str
    wanted: str
    columns: list[str]
    rows: list[tuple[str, list[Cell | None]]]
    configurations: list[tuple[str, str]]  #: corner and its configurations
    missing: list[str]


@dataclass(frozen=True)
class Criterion:
    """Criteria of the theory that differ in the clip only."""

    what: str
    clips: int
    measured: str
    bound: str
    role: str
    met: str
    holds: bool


def tables(looked: Sequence[Looked]) -> list[Table]:
    """Returns a table for each of a claim's checks."""
    return [_table(one) for one in looked]


def _table(one: Looked) -> Table:
    columns: list[str] = []
    who: dict[str, list[str]] = {}
    cells: dict[tuple[str, float, float], dict[str, Cell]] = {}
    for corner, quantity, points in kinds(one):
        name = ", ".join(part for part in (corner.short, motion(one, quantity).replace(" evaluation", "")) if part)
        name = name or (quantity if len(one.check["quantities"]) > 1 else "value")
        columns.append(name)
        who.setdefault(corner.short, []).extend(point.of for point in points)
        for point in points:
            cells.setdefault((point.scene, point.size, point.l), {})[name] = _cell(point)
    rows: list[tuple[str, list[Cell | None]]] = [
        (f"{scene} {text.size(size)}, l = {l:g}", [found.get(name) for name in columns])
        for (scene, size, l), found in sorted(cells.items(), key=lambda item: (item[0][0], item[0][1], item[0][2]))
    ]
    configurations = [(short, "; ".join(dict.fromkeys(listed))) for short, listed in who.items()]
    what = one.check["what"]
    return Table(what[:1].upper() + what[1:], wanted(one.check), columns, rows, configurations, details(one))


def _cell(point: Point) -> Cell:
    value = point.value
    spread = "" if value.low == value.high else f"({text.factor(value.low)}–{text.factor(value.high)})"
    return Cell(text.factor(value.middle), spread, point.met, point.close)


def criteria(listed: Sequence[dict[str, Any]]) -> list[Criterion]:
    """Returns the criteria of a claim of the theory, one line for those that differ in the clip only."""
    result = []
    for what, same in grouped(listed).items():
        met = sum(bool(one["met"]) for one in same)
        result.append(
            Criterion(
                what, len(same), _range([one["measured"] for one in same]),
                f"{SIGNS.get(same[0]['relation'], '=')} {_range([one['bound'] for one in same])}"
                + (f", give or take {text.percent(same[0]['tolerance'])}" if same[0].get("tolerance") else ""),
                str(same[0]["role"]), f"{met} of {len(same)}", met == len(same),
            )
        )  # fmt: skip
    return result


def _range(values: list[float]) -> str:
    low, high = text.significant(min(values)), text.significant(max(values))
    return low if low == high else f"{low} to {high}"
