"""The content of each figure: functions from data to axes. Each returns None if there is nothing to show."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Optional

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator

from figures.axes import (
    WRAP,
    KeyLines,
    contestants_on_y,
    fixed_log_axis,
    keep_labels_apart,
    key,
    key_size,
    log_axis,
    mark,
    settle,
)
from figures.colours import PHASE_NAMES, PHASES, Look
from ratios.ratios import (
    best_refit_line,
    crossings,
    fastest_configurations,
    period_line,
    without_oracles,
)
from results.text import memory as bytes_of
from results.text import memory_tick, significant, size, tick

WIDTH = 10.5  #: of every figure, in inches
#: Bars longer than this many times the fastest are torn off, so that the others stay readable.
TORN = 12.0



def _refits(rows: pd.DataFrame) -> pd.Series:
    """Marks rows that refit every box in every frame: baselines, their family, and the refit of 2006."""
    return rows["baseline"] | rows["family"].isin(("refit", "period"))

Looks = dict[str, Look]


#: From this many contestants on, further configurations of a strategy get no name, or no row, of their own.
CROWD = 20


def _rows_figure(labels: Sequence[str], legend: float = 0.0) -> Figure:
    lines = max(len(textwrap.wrap(label, WRAP)) for label in labels)
    each = 0.27 if lines == 1 else 0.11 + 0.12 * lines
    return Figure(figsize=(WIDTH, 0.9 + legend + each * len(labels)), layout="constrained")


def thinned(rows: pd.DataFrame) -> pd.DataFrame:
    """Returns all rows, or the fastest configuration of each strategy if there are too many. Names that take more than two lines
    go without their settings then: no other configuration of the strategy is left.
    """
    if len(rows) <= CROWD:
        return rows
    chosen = fastest_configurations(rows)
    short = [
        label if len(textwrap.wrap(label, WRAP)) <= 2 else title for label, title in zip(chosen["label"], chosen["title"])
    ]
    return chosen.assign(label=short)


def cost_split(group: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws stacked bars of the time per frame by phase, fastest on top."""
    rows = thinned(group).sort_values("total_motion")
    if rows.empty or not rows["total_motion"].max() > 0:
        return None
    figure = _rows_figure(list(rows["label"]), 0.3)
    axes = figure.subplots()
    draw_cost_split(axes, rows, looks)
    return figure


def draw_cost_split(axes: Axes, rows: pd.DataFrame, looks: Looks) -> None:
    """Draws `rows` from top to bottom; bars that would dwarf the others are torn and keep their number."""
    contestants_on_y(axes, list(rows["label"]), [looks[c] for c in rows["contestant"]])
    totals = rows["total_motion"].to_numpy()
    limit = max(total for total in totals if total <= TORN * totals.min())
    torn = totals > limit
    if torn.any():
        limit *= 1.12
    left = np.zeros(len(rows))
    shown = [phase for phase in PHASES if rows[f"middle_{phase}"].max() > 0]
    sums = rows[[f"middle_{phase}" for phase in shown]].sum(axis=1).to_numpy()
    scale = np.divide(totals, sums, out=np.ones(len(rows)), where=sums > 0)  # a sum of medians is not the median of the sum
    for phase in shown:
        colour, hatch = PHASES[phase]
        ends = np.minimum(left + scale * rows[f"middle_{phase}"].to_numpy(), limit)
        axes.barh(range(len(rows)), ends - left, left=left, height=0.66, color=colour, hatch=hatch,
                  edgecolor="#33415C" if hatch else "white", linewidth=0.4)  # fmt: skip
        left = ends
    for row, total in enumerate(totals):
        end = limit if torn[row] else left[row]
        if torn[row]:
            step = limit * 0.006
            axes.plot([end - step, end + step, end - step, end + step], row + np.array([-0.4, -0.13, 0.13, 0.4]),
                      color="white", linewidth=3, zorder=4)  # fmt: skip
        axes.annotate(significant(total), (end, row), xytext=(7 if torn[row] else 4, 0), textcoords="offset points",
                      va="center", fontsize=8, weight="bold" if torn[row] else "normal", color="#222222")  # fmt: skip
    axes.set_xlim(0, limit * 1.09)
    axes.set_xlabel("time per frame (ms)")
    axes.grid(True, axis="x")
    patches = [
        Patch(facecolor=PHASES[p][0], hatch=PHASES[p][1], edgecolor="#33415C", linewidth=0.4, label=PHASE_NAMES[p])
        for p in shown
    ]
    axes.legend(handles=patches, loc="lower left", bbox_to_anchor=(0, 1.0), ncol=len(patches), frameon=False,
                borderaxespad=0.2, handlelength=1.6, columnspacing=1.6)  # fmt: skip


def _lines(
    rows: pd.DataFrame, looks: Looks, x: str, panels: Sequence[tuple[str, str]], x_label: str
) -> tuple[Figure, list[Axes]]:
    """Draws panels of lines over `x` with one key at the right."""
    last = rows.sort_values(x).groupby("contestant").tail(1).sort_values(panels[-1][0], ascending=False)
    entries = [(label, looks[c]) for label, c in zip(last["label"], last["contestant"])]
    side, tall = key_size([label for label, _ in entries])
    figure = Figure(figsize=(WIDTH, max(4.0, tall)), layout="constrained")
    grid = figure.add_gridspec(1, len(panels) + 1, width_ratios=[(WIDTH - side) / len(panels)] * len(panels) + [side])
    all_axes = []
    for place, (column, title) in enumerate(panels):
        axes = figure.add_subplot(grid[0, place])
        positive = rows[rows[column] > 0]
        fixed_log_axis(axes, "x", list(rows[x]), size if x == "moving" else (lambda value: f"{value:g}"))
        log_axis(axes, "y", list(positive[column]))
        for contestant, line in positive.sort_values(x).groupby("contestant"):
            look = looks[contestant]
            axes.plot(line[x], line[column], linestyle=look.line, color=look.colour, marker=look.drawn,
                      markerfacecolor=look.face, markersize=5.5, markeredgewidth=1.3)  # fmt: skip
        axes.set_title(title)
        axes.set_xlabel(x_label)
        all_axes.append(axes)
    key(figure.add_subplot(grid[0, len(panels)]), entries, KeyLines.shown)
    return figure, all_axes


def _time_panels(rows: pd.DataFrame) -> list[tuple[str, str]]:
    panels = [("updating", "update (ms per frame)"), ("total_motion", "total with motion (ms per frame)")]
    return [(column, title) for column, title in panels if (rows[column] > 0).any()]


def over_frames_per_keyframe(rows: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws update and total time against l; marks crossings with the best refit and with the refit of 2006."""
    panels = _time_panels(rows)
    if rows["l"].nunique() < 2 or not panels:
        return None
    figure, all_axes = _lines(rows, looks, "l", panels, "interpolated frames per keyframe, l")
    found: list[tuple[Axes, list[tuple[float, float]], list[str]]] = []
    for axes, (column, _) in zip(all_axes, panels):
        points: list[tuple[float, float]] = []
        baseline, period = rows["baseline"], rows["family"] == "period"
        for reference, colour, left_out in (
            (best_refit_line(rows, column, "l"), "#0072B2", baseline),
            (period_line(rows, column, "l"), "#7A7A7A", baseline | period),
        ):
            if reference is None:
                continue
            axes.plot(reference.index, reference, color=colour, alpha=0.22, linewidth=7, solid_capstyle="round", zorder=1)
            for _, line in rows[~left_out].groupby("contestant"):
                own = line.set_index("l")[column].sort_index()
                shared = own.index.intersection(reference.index)
                if (own.loc[shared] > 0).all():
                    x = np.asarray(shared, dtype=float)
                    level = reference.loc[shared].to_numpy()
                    points += [(c.x, c.y) for c in crossings(x, own.loc[shared].to_numpy(), level)]
        for point in points:
            axes.plot(*point, marker="o", markersize=12, markerfacecolor="none", color="#222222", markeredgewidth=1.1)
        found.append((axes, points, [f"l≈{x:.0f}" for x, _ in points]))
    settle(figure)
    for axes, points, labels in found:
        if points:
            keep_labels_apart(axes, points, labels)
    return figure


def over_size(rows: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws update and total time against the number of moving primitives, with a slope of n for comparison."""
    panels = _time_panels(rows)
    if rows["moving"].nunique() < 2 or not panels:
        return None
    figure, all_axes = _lines(rows, looks, "moving", panels, "moving primitives n")
    for axes in all_axes:
        _slope(axes)
    return figure


def _slope(axes: Axes) -> None:
    """Draws a thin line of slope n at the lower right, below all others; the panel grows to hold it."""
    (x0, x1), (_, y1) = axes.get_xlim(), axes.get_ylim()
    a, b = x0 * (x1 / x0) ** 0.6, x0 * (x1 / x0) ** 0.9
    lowest = min(
        float(np.interp(math.log(x), np.log(line.get_xdata()), np.log(line.get_ydata())))
        for line in axes.lines
        for x in (a, b)
    )
    high = math.exp(lowest) * (y1 / math.exp(lowest)) ** -0.05
    low = high * a / b
    axes.set_ylim(min(axes.get_ylim()[0], low * (y1 / low) ** -0.03), y1)
    axes.plot([a, b], [low, high], color="#999999", linewidth=0.9, zorder=1)
    axes.annotate("∝ n", (b, high), xytext=(3, 0), textcoords="offset points", fontsize=8, color="#777777",
                  va="center")  # fmt: skip


def counters(group: pd.DataFrame, over: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws events and written values per frame of event-driven strategies and refits.

    Lines over n if `over` has several sizes; else bars for `group`. None without events.
    """
    several = over["moving"].nunique() > 1
    rows = over if several else group
    rows = rows[(rows["certificates_failed_per_frame"] > 0) | _refits(rows)]
    wanted = [
        ("certificates_failed_per_frame", "events per frame"),
        ("values_written_per_frame", "bound values written per frame"),
    ]
    panels = [(column, title) for column, title in wanted if (rows[column] > 0).any()]
    if not (rows["certificates_failed_per_frame"] > 0).any():
        return None
    if several:
        figure, all_axes = _lines(rows, looks, "moving", panels, "moving primitives n")
        for axes in all_axes:
            _slope(axes)
        return figure
    rows = rows.sort_values(panels[-1][0], ascending=True)
    figure = _rows_figure(list(rows["label"]), 0.25)
    all_axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (column, title) in zip(all_axes, panels):
        draw_counter(axes, rows, looks, column)
        axes.set_title(title)
    contestants_on_y(all_axes[0], list(rows["label"]), [looks[c] for c in rows["contestant"]])
    for axes in all_axes[1:]:
        axes.tick_params(axis="y", length=0, labelleft=False)
    return figure


def draw_counter(axes: Axes, rows: pd.DataFrame, looks: Looks, column: str) -> None:
    """Draws a bar per contestant from zero, with its number; no bar for contestants without this counter."""
    for row, (value, contestant) in enumerate(zip(rows[column], rows["contestant"])):
        if not value > 0:
            continue
        look = looks[contestant]
        axes.barh([row], [value], height=0.6, color=look.colour if look.filled else "white", edgecolor=look.colour,
                  linewidth=1.2)  # fmt: skip
        axes.annotate(size(value) if value >= 10 else significant(value, 2), (value, row), xytext=(4, 0),
                      textcoords="offset points", va="center", fontsize=8)  # fmt: skip
    axes.set_xlim(0, rows[column].max() * 1.15)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: tick(value)))
    axes.grid(True, axis="x")


def latency(group: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws median, 99th percentile and worst frame of each contestant on a log scale."""
    rows = thinned(group[(group["p50"] > 0) & (group["worst"] > 0)]).sort_values("worst")
    if rows.empty:
        return None
    figure = _rows_figure(list(rows["label"]), 0.3)
    axes = figure.subplots()
    contestants_on_y(axes, list(rows["label"]), [looks[c] for c in rows["contestant"]])
    log_axis(axes, "x", [*rows["p50"], *rows["worst"]])
    for row, (p50, p99, worst, contestant) in enumerate(zip(rows["p50"], rows["p99"], rows["worst"], rows["contestant"])):
        colour = looks[contestant].colour
        axes.plot([p50, worst], [row, row], color=colour, linewidth=1.6, zorder=2)
        axes.plot([p50], [row], marker="o", markersize=6, color=colour, zorder=3)
        if math.isfinite(p99):
            axes.plot([p99], [row], marker="|", markersize=11, markeredgewidth=2, color=colour, zorder=3)
        axes.plot([worst], [row], marker="X", markersize=7, color=colour, markerfacecolor="white", zorder=3)
    handles = [
        Line2D([], [], marker=marker, linestyle="none", color="#444444", markerfacecolor=face, label=label,
               markeredgewidth=2 if marker == "|" else 1)
        for marker, face, label in (("o", "#444444", "median frame"), ("|", "#444444", "99 % of frames are faster"),
                                    ("X", "white", "worst frame"))
    ]  # fmt: skip
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1.0), ncol=3, frameon=False, borderaxespad=0.2)
    axes.set_xlabel("update and query of one frame (ms)")
    return figure


def memory(group: pd.DataFrame, looks: Looks) -> Optional[Figure]:
    """Draws total time against the bytes of a strategy; contestants are numbered by speed."""
    rows = thinned(group[(group["bytes"] > 0) & (group["total_motion"] > 0)])
    rows = without_oracles(rows).sort_values("total_motion").reset_index(drop=True) if len(rows) else rows
    if len(rows) < 2:
        return None
    names = [f"{number}  {label}: {bytes_of(held)}" for number, (label, held) in
             enumerate(zip(rows["label"], rows["bytes"]), 1)]  # fmt: skip
    side, tall = key_size(names)
    figure = Figure(figsize=(WIDTH, max(3.6, tall)), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=[WIDTH - side, side])
    axes = figure.add_subplot(grid[0, 0])
    log_axis(axes, "x", list(rows["bytes"]), memory_tick)
    log_axis(axes, "y", list(rows["total_motion"]))
    points = list(zip(rows["bytes"].astype(float), rows["total_motion"].astype(float)))
    for point, contestant in zip(points, rows["contestant"]):
        mark(axes, *point, looks[contestant])
    axes.set_xlabel("memory of the strategy's own structures")
    axes.set_ylabel("total time per frame (ms)")
    key(figure.add_subplot(grid[0, 1]), list(zip(names, (looks[c] for c in rows["contestant"]))), KeyLines.hidden)
    settle(figure)
    keep_labels_apart(axes, points, [str(number) for number in range(1, len(rows) + 1)])
    return figure
