"""Finds the l from which on a strategy is faster than a baseline: per scene and size, between measured l only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from claims.claim_points import Table, quotient
from figures.axes import contestants_on_y, fixed_log_axis, settle
from figures.colours import FAMILIES, Look
from figures.figures import WIDTH
from ratios import ratios
from results import text

QUANTITIES = ("update", "total", "total with motion")
FAMILY = "kinetic"  #: the family whose break-even points are drawn, and listed first
NEVER = ("period", "oracle", "limit")  #: families whose points are not drawn
#: Quantities for which these baselines do not count: the query of the hybrid refit does a part of its update.
NOT_ALONE = {"update": ["hybrid"], "update with motion": ["hybrid"], "query": ["hybrid"]}
DRAWN = (("update", "update"), ("total with motion", "update, query and motion"))
AHEAD, BEHIND, CROSSES, MIXED = "ahead", "behind", "crosses", "mixed"


@dataclass(frozen=True)
class BreakEven:
    """One strategy against one baseline, over the l at which both were measured."""

    kind: str  #: ahead or behind at every measured l, crosses (ahead from l on), or mixed (not ahead at the largest l)
    l: float  #: where it crosses the last time; the smallest measured l if ahead, the largest if behind
    measured: tuple[float, ...]
    words: str


@dataclass(frozen=True)
class Row:
    """One strategy and quantity on one scene and size."""

    contestant: str
    label: str
    family: str
    quantity: str
    found: dict[str, Optional[BreakEven]]  #: by baseline


@dataclass(frozen=True)
class Place:
    """All strategies on one scene and size."""

    scene: str
    size: float  #: primitives of all bodies, those at rest included, as everywhere in a report but in the paper's claims
    depths: list[float]
    rows: list[Row]

    def known(self, names: Sequence[str]) -> list[str]:
        """Returns the baselines that were measured here."""
        return [name for name in names if any(row.found.get(name) for row in self.rows)]


def break_even(depths: Sequence[float], faster: Sequence[float]) -> Optional[BreakEven]:
    """Finds the break-even point of a ratio (above 1 is faster) measured at some l; None with fewer than two of them.

    Between two measured l the ratio is a straight line on logarithmic axes; it is never extrapolated.
    """
    if len(depths) < 2:
        return None
    first, last = depths[0], depths[-1]
    measured = tuple(float(l) for l in depths)
    ahead = [ratio > 1 for ratio in faster]
    if all(ahead):
        return BreakEven(AHEAD, first, measured, f"every l from {first:g}")
    if not any(ahead):
        return BreakEven(BEHIND, last, measured, f"beyond l = {last:g}")
    found = ratios.crossings(np.asarray(depths, dtype=float), 1 / np.asarray(faster, dtype=float), np.ones(len(depths)))
    told = ", ".join(f"{'faster' if one.faster else 'slower'} from l ≈ {_short(one.x)}" for one in found)
    if ahead[-1]:
        at = found[-1].x if found else max(l for l, won in zip(depths, ahead) if not won)
        return BreakEven(CROSSES, at, measured, told if len(found) > 1 else f"l ≈ {_short(at)}")
    return BreakEven(MIXED, found[-1].x if found else last, measured, told or f"as fast at l = {last:g}")


def _short(l: float) -> str:
    return text.tick(float(f"{l:.2g}"))


def baselines_of(table: Table, declared: Sequence[dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    """Returns names and terms: those of claims.json, then each strategy that declares itself a baseline."""
    named = [(one["short"], one) for one in declared]
    rows = table.rows[table.rows["baseline"] & (table.rows["guarantee"] != "approximate")]
    singles = sorted({(str(row.id), str(row.title)) for row in rows[["id", "title"]].itertuples()})
    return named + [
        (title, {"strategy": identity, "baseline": True, "params": {"threads": "1"}, "not_for": NOT_ALONE}) for identity, title in singles
    ]


def places(table: Table, declared: Sequence[dict[str, Any]]) -> tuple[list[str], list[Place], list[str]]:
    """Returns the names of the baselines, every scene and size (of all bodies together) with at least two l, and the names of those with one l."""
    baselines = baselines_of(table, declared)
    found, single = [], []
    for scene in dict.fromkeys(table.rows["scene"]):
        listed = [(float(rows[0]["primitives"]), l, rows) for _, l, rows in table.places(scene)]
        for size in sorted({size for size, _, _ in listed}):
            at = [(l, rows) for one, l, rows in listed if one == size]
            if len(at) < 2:
                single.append(f"{scene} {text.size(size)} (l = {at[0][0]:g})")
                continue
            rows = [
                row
                for contestant, label, family in contestants(at)
                for quantity in QUANTITIES
                if (row := _row(table, at, (contestant, label, family), quantity, baselines)) is not None
            ]
            if rows:
                found.append(Place(scene, size, [l for l, _ in at], rows))
    return [name for name, _ in baselines], found, single


def contestants(at: Sequence[tuple[float, list[dict[str, Any]]]]) -> list[tuple[str, str, str]]:
    """Returns contestants that are no baselines, with labels and families, kinetic ones first."""
    known = {
        (str(row["contestant"]), str(row["label"]), str(row["family"]))
        for _, rows in at
        for row in rows
        if not row["baseline"] and row["family"] not in NEVER and row["guarantee"] != "approximate"
    }
    return sorted(known, key=lambda one: (one[2] != FAMILY, one[1]))


def _row(
    table: Table, at: Sequence[tuple[float, list[dict[str, Any]]]], who: tuple[str, str, str], quantity: str,
    baselines: Sequence[tuple[str, dict[str, Any]]],
) -> Optional[Row]:  # fmt: skip
    found = {}
    for name, term in baselines:
        depths, faster = [], []
        for l, rows in at:
            own = next((int(row["run"]) for row in rows if row["contestant"] == who[0]), None)
            other = table.chosen(rows, term, quantity)
            value = quotient(table, other, own, quantity) if own is not None and other is not None else None
            if value is not None and value.middle > 0:
                depths.append(l)
                faster.append(value.middle)
        found[name] = break_even(depths, faster)
    return Row(*who, quantity, found) if any(found.values()) else None


def figure(found: Sequence[Place], names: Sequence[str], looks: dict[str, Look]) -> Optional[Figure]:
    """Draws break-even points against the two baselines of claims.json, updates left and totals right."""
    listed = [(place, row) for place in found for row in place.rows if (row.family, row.quantity) == (FAMILY, DRAWN[0][0])]
    if not listed:
        return None
    names_of = short_names([row.label for _, row in listed])
    labels: list[str] = []  # from top to bottom: each scene and size, and under it its strategies
    heads: list[int] = []
    at: dict[tuple[str, float, str], int] = {}
    for number, (place, row) in enumerate(listed):
        if number == 0 or listed[number - 1][0] is not place:
            heads.append(len(labels))
            labels.append(f"{place.scene} {text.size(place.size)}")
        at[place.scene, place.size, row.contestant] = len(labels)
        labels.append(names_of[row.label])
    rows_high, key_high = 0.9 + 0.21 * len(labels), 0.55
    made = Figure(figsize=(WIDTH, rows_high + key_high), layout="constrained")
    grid = made.add_gridspec(2, len(DRAWN), height_ratios=[rows_high, key_high])
    panels = [made.add_subplot(grid[0, column]) for column in range(len(DRAWN))]
    colours = [FAMILIES["period"][0], FAMILIES["refit"][0]]
    depths = sorted({l for place in found for l in place.depths})
    for axes, (quantity, title) in zip(panels, DRAWN):
        fixed_log_axis(axes, "x", depths, text.tick)
        axes.set_xlim(depths[0] / 1.45, depths[-1] * 1.45)
        axes.set_title(title)
        axes.set_xlabel("frames per keyframe, l")
        for place, row in listed:
            same = next((one for one in place.rows if (one.contestant, one.quantity) == (row.contestant, quantity)), None)
            for step, (name, colour) in enumerate(zip(names[:2], colours)):
                one = same.found.get(name) if same is not None else None
                if one is not None:
                    _draw(axes, one, at[place.scene, place.size, row.contestant] + (step - 0.5) * 0.34, colour)
    rows_of = {number: row for (_, row), number in zip(listed, at.values())}
    contestants_on_y(
        panels[0], labels,
        [replace(looks[rows_of[i].contestant], filled=True) if i in rows_of else None for i in range(len(labels))],
    )  # fmt: skip
    for head in heads:
        panels[0].get_yticklabels()[head].set_fontweight("bold")
    for axes in panels[1:]:
        axes.set_ylim(panels[0].get_ylim())
        axes.set_yticks([])
    for axes in panels:
        for head in heads[1:]:
            axes.axhline(head - 0.5, color="#888888", linewidth=0.6)
    below = made.add_subplot(grid[1, :])
    below.set_axis_off()
    below.legend(handles=_key(names, colours), loc="center", ncols=3, frameon=False, fontsize=8)
    settle(made)
    return made


def short_names(labels: Sequence[str]) -> dict[str, str]:
    """Returns names for a narrow margin: a title without "kinetic", and of several settings of one strategy only the shortest that
    no other has, unless that leaves two names equal.
    """
    settings: dict[str, dict[str, list[str]]] = {}
    for label in labels:
        title, _, told = label.replace("\u00a0", " ").partition(" (")
        settings.setdefault(title.removeprefix("kinetic "), {})[label] = told.rstrip(")").split(", ") if told else []
    names = {}
    for title, variants in settings.items():
        for label, own in variants.items():
            others = {one for other, told in variants.items() if other != label for one in told}
            only = [one for one in own if one not in others] or own
            names[label] = title if len(variants) == 1 or not own else f"{title} ({min(only, key=len)})"
    if len(set(names.values())) < len(names):
        return {label: label.replace("\u00a0", " ").removeprefix("kinetic ") for label in names}
    return names


def _draw(axes: Axes, one: BreakEven, y: float, colour: str) -> None:
    """Draws a bar from the break-even point to the largest measured l, or an open arrow at that l without one."""
    low, high = one.measured[0], one.measured[-1]
    axes.plot([low, high], [y, y], color="#DDDDDD", linewidth=1, zorder=1)
    if one.kind == BEHIND:
        axes.plot([high], [y], marker=">", color=colour, markerfacecolor="white", markersize=5, linestyle="none", zorder=3)
        return
    if one.kind == MIXED:
        axes.plot([one.l], [y], marker="x", color=colour, markersize=5, linestyle="none", zorder=3)
        return
    axes.plot([one.l, high], [y, y], color=colour, linewidth=2.4, solid_capstyle="butt", zorder=2)
    axes.plot([one.l], [y], marker="<" if one.kind == AHEAD else "o", color=colour, markersize=5, linestyle="none", zorder=3)


def _key(names: Sequence[str], colours: Sequence[str]) -> list[Line2D]:
    made = [Line2D([], [], color=colour, linewidth=2.4, label=f"faster than the {name}") for name, colour in zip(names, colours)]
    for marker, filled, label in (
        ("o", True, "break-even"), ("<", True, "faster at every l measured"), (">", False, "not up to the largest l measured"),
        ("x", True, "slower again"),
    ):  # fmt: skip
        face = "#444444" if filled else "white"
        made.append(Line2D([], [], color="#444444", marker=marker, markerfacecolor=face, markersize=5, linestyle="none", label=label))
    return made
