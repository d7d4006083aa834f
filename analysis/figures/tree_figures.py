"""The inner state of the trees: their quality over a clip, and the places of their events."""

from __future__ import annotations

from typing import Optional

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from figures.axes import KeyLines, key, key_size, log_axis
from figures.figures import CROWD, WIDTH, Looks, thinned
from ratios.ratios import without_oracles
from results.text import percent_tick, tick

#: Curves that never differ by more than this share are drawn as one.
SAME = 0.005


def over_time(group: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws the SAH cost over that of a tree built at the same time, and looseness if available, along the clip.

    Contestants whose two curves agree share one line, named after the first and the number of the others.
    """
    rows = without_oracles(thinned(group[group["over_time"].map(len) > 1]))
    if rows.empty:
        return None
    shared: list[tuple[pd.Series, pd.DataFrame, int]] = []
    for _, row in rows.iterrows():
        curve = pd.DataFrame(row["over_time"])
        curve["quality"] = curve["sah"] / curve["sah_rebuilt"]
        for place, (first, other, more) in enumerate(shared):
            if _agree(curve, other):
                shared[place] = (first, other, more + 1)
                break
        else:
            shared.append((row, curve, 0))
    shared.sort(key=lambda entry: -float(entry[1]["quality"].iloc[-1]))
    loose = any((curve["looseness"] > 0).any() for _, curve, _ in shared)
    entries = [
        (f"{row['label']} and {more} more alike" if more else str(row["label"]), looks[row["contestant"]])
        for row, _, more in shared
    ]
    side, tall = key_size([label for label, _ in entries])
    across = 2 if loose else 1
    figure = Figure(figsize=(WIDTH, max(3.8, tall)), layout="constrained")
    grid = figure.add_gridspec(1, across + 1, width_ratios=[(WIDTH - side) / across] * across + [side])
    axes = figure.add_subplot(grid[0, 0])
    log_axis(axes, "y", [1.0, *(value for _, curve, _ in shared for value in curve["quality"])])
    axes.axhline(1.0, color="#999999", linewidth=0.9, zorder=1)
    axes.set_title("SAH cost, over a tree built at that time")
    _lines(axes, shared, looks, "quality")
    if loose:
        axes = figure.add_subplot(grid[0, 1])
        axes.set_yscale("symlog", linthresh=1e-4, linscale=0.5)
        highest = max(float(curve["looseness"].max()) for _, curve, _ in shared)
        axes.set_ylim(-3e-5, max(highest * 2, 1e-3))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: percent_tick(value)))
        axes.grid(True, axis="y")
        axes.set_title("looseness of the boxes")
        _lines(axes, shared, looks, "looseness")
    key(figure.add_subplot(grid[0, across]), entries, KeyLines.shown)
    return figure


def times_over_time(group: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws the query time, and update and query together, of equal parts of the clip."""
    rows = without_oracles(thinned(group[group["times_over_time"].map(len) > 1]))
    if rows.empty:
        return None
    drawn = []
    for _, row in rows.iterrows():
        curve = pd.DataFrame(row["times_over_time"])
        curve["total"] = curve["update"] + curve["query"]
        drawn.append((row, curve.rename(columns={"begin": "t"}), 0))
    drawn.sort(key=lambda entry: -float(entry[1]["query"].iloc[-1]))
    entries = [(str(row["label"]), looks[row["contestant"]]) for row, _, _ in drawn]
    side, tall = key_size([label for label, _ in entries])
    figure = Figure(figsize=(WIDTH, max(3.8, tall)), layout="constrained")
    grid = figure.add_gridspec(1, 3, width_ratios=[(WIDTH - side) / 2] * 2 + [side])
    for place, (column, title) in enumerate((("query", "query, ms"), ("total", "update and query, ms"))):
        values = [value for _, curve, _ in drawn for value in curve[column] if value > 0]
        if not values:
            return None
        axes = figure.add_subplot(grid[0, place])
        log_axis(axes, "y", values)
        axes.set_title(title)
        _lines(axes, drawn, looks, column)
        axes.set_xlabel("part of the clip")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f} %"))
    key(figure.add_subplot(grid[0, 2]), entries, KeyLines.shown)
    return figure


def _agree(a: pd.DataFrame, b: pd.DataFrame) -> bool:
    if len(a) != len(b):
        return False
    return bool(
        ((a["quality"] - b["quality"]).abs() <= SAME * b["quality"]).all()
        and ((a["looseness"] - b["looseness"]).abs() <= SAME * b["looseness"]).all()
    )


def _lines(axes: Axes, shared: list[tuple[pd.Series, pd.DataFrame, int]], looks: Looks, column: str) -> None:
    for row, curve, _ in shared:
        look = looks[row["contestant"]]
        axes.plot(curve["t"], curve[column], linestyle=look.line, color=look.colour, marker=look.drawn,
                  markerfacecolor=look.face, markersize=4.5, markeredgewidth=1.1, clip_on=False)  # fmt: skip
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: tick(value)))
    axes.set_xlabel("time of the clip")


def events_by_depth(group: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws events of bounds per frame, by the depth of their node."""
    rows = thinned(group[group["events_at_depth"].map(len) > 0])
    if rows.empty or len(rows) > CROWD:
        return None
    rows = rows.assign(events=rows["events_at_depth"].map(sum)).sort_values("events", ascending=False)
    entries = [(str(label), looks[c]) for label, c in zip(rows["label"], rows["contestant"])]
    side, tall = key_size([label for label, _ in entries])
    figure = Figure(figsize=(WIDTH, max(3.6, tall)), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=[WIDTH - side, side])
    axes = figure.add_subplot(grid[0, 0])
    log_axis(axes, "y", [n / row.frames for row in rows.itertuples() for n in row.events_at_depth if n > 0])
    for row in rows.itertuples():
        look = looks[row.contestant]
        counted = [(depth, n / row.frames) for depth, n in enumerate(row.events_at_depth) if n > 0]
        axes.plot(*zip(*counted), linestyle=look.line, color=look.colour, marker=look.drawn, markerfacecolor=look.face,
                  markersize=5.5, markeredgewidth=1.3)  # fmt: skip
    axes.xaxis.set_major_locator(MaxNLocator(12, integer=True))
    axes.set_xlabel("depth of the node (0: root)")
    axes.set_ylabel("events per frame")
    key(figure.add_subplot(grid[0, 1]), entries, KeyLines.shown)
    return figure
