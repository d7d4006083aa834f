"""Shared helpers of the figures: log axes with readable ticks, separated labels, key lists."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator
from matplotlib.transforms import Affine2D, ScaledTranslation, Transform, offset_copy

from figures.colours import Look
from results.text import tick as plain_tick

FormatTick = Callable[[float], str]


#: Characters after which names of contestants continue in a second line.
WRAP = 38


class KeyLines(Enum):
    """Whether contestants are drawn as lines, so that a key must show the line styles."""

    shown = "shown"
    hidden = "hidden"


def settle(figure: Figure) -> None:
    """Lays a figure out once, with rounded digits, because the solver's last digits vary between runs."""
    figure.draw_without_rendering()
    figure.set_layout_engine(None)  # not "none", with which savefig would draw everything twice
    for axes in figure.axes:
        axes.set_position([round(value, 4) for value in axes.get_position().bounds])


def log_axis(axes: Axes, which: str, values: Sequence[float], tick: FormatTick = plain_tick) -> None:
    """Sets a log axis over positive values with some margin, and ticks at 1, 2, 5 if it spans little."""
    low, high = min(values), max(values)
    room = max((high / low) ** 0.06, 1.15)
    low, high = low / room, high * room
    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    span = high / low
    if span < 4:
        step = 10.0 ** math.floor(math.log10((high - low) / 3))
        step *= next(m for m in (1, 2, 5, 10) if (high - low) / (step * m) <= 6)
        axis.set_major_locator(FixedLocator(list(np.arange(math.ceil(low / step), high / step + 1e-9) * step)))
    elif span < 300:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if span < 60 else (1, 3), numticks=30))
    else:
        axis.set_major_locator(LogLocator(numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: tick(float(f"{value:.6g}"))))
    axis.set_minor_formatter(NullFormatter())
    axis.set_minor_locator(NullLocator())
    axes.grid(True, axis=which)


def fixed_log_axis(axes: Axes, which: str, values: Sequence[float], tick: FormatTick) -> None:
    """Sets a log axis with ticks at the measured values, as far as they do not crowd."""
    places = sorted(set(values))
    kept: list[float] = []
    whole = math.log(places[-1] / places[0]) or 1.0
    for place in reversed(places):
        if not kept or math.log(kept[-1] / place) / whole > 0.07:
            kept.append(place)
    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    room = max((places[-1] / places[0]) ** 0.06, 1.05)
    (axes.set_xlim if which == "x" else axes.set_ylim)(places[0] / room, places[-1] * room)
    axis.set_major_locator(FixedLocator(kept))
    axis.set_major_formatter(FuncFormatter(lambda value, _: tick(value)))
    axis.set_minor_locator(NullLocator())
    axes.grid(True, axis=which)


def mark(axes: Axes, x: float, y: float, look: Look, size: float = 7.5, zorder: float = 3) -> None:
    """Draws one contestant's marker in data coordinates."""
    axes.plot([x], [y], marker=look.drawn, color=look.colour, markerfacecolor=look.face, markersize=size,
              markeredgewidth=1.5, linestyle="none", zorder=zorder, clip_on=False)  # fmt: skip


def contestants_on_y(axes: Axes, labels: Sequence[str], looks: Sequence[Optional[Look]]) -> None:
    """Draws a row per contestant from top to bottom, named at the left with its marker; without a look, a row is a heading."""
    axes.set_yticks(range(len(labels)))
    axes.set_yticklabels([textwrap.fill(label, WRAP) for label in labels], linespacing=0.95)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0, pad=19)
    beside = offset_copy(axes.get_yaxis_transform(), axes.figure, x=-11, y=0, units="points")
    for row, look in enumerate(looks):
        if look is None:
            continue
        axes.plot([0], [row], marker=look.drawn, color=look.colour, markerfacecolor=look.face, markersize=6.5,
                  markeredgewidth=1.4, linestyle="none", clip_on=False, transform=beside)  # fmt: skip


def key(axes: Axes, entries: Sequence[tuple[str, Look]], lines: KeyLines) -> None:
    """Draws a list of contestants in separate axes: marker, line style if they are drawn as lines, and name."""
    axes.set_axis_off()
    below = 0.0
    for label, look in entries:
        lines_of_label = textwrap.wrap(label, WRAP)
        below += 16
        at = offset_copy(axes.transAxes, axes.figure, x=0, y=8 - below, units="points")
        start = 36 if lines is KeyLines.shown else 8
        if lines is KeyLines.shown:
            left = offset_copy(at, axes.figure, x=2, units="points")
            axes.add_line(_segment(axes, left, look))
        middle = offset_copy(at, axes.figure, x=19 if lines is KeyLines.shown else 6, units="points")
        axes.plot([0], [1], marker=look.drawn, color=look.colour, markerfacecolor=look.face, markersize=6,
                  markeredgewidth=1.4, linestyle="none", clip_on=False, transform=middle)  # fmt: skip
        text_at = offset_copy(at, axes.figure, x=start + 8, units="points")
        axes.text(0, 1, lines_of_label[0], transform=text_at, va="center_baseline", fontsize=8.5, clip_on=False)
        for more in lines_of_label[1:]:
            below += 11
            next_line = offset_copy(axes.transAxes, axes.figure, x=start + 14, y=8 - below, units="points")
            axes.text(0, 1, more, transform=next_line, va="center_baseline", fontsize=8.5, clip_on=False)


def key_size(labels: Sequence[str]) -> tuple[float, float]:
    """Returns width and height in inches of a key of these names."""
    wrapped = [textwrap.wrap(label, WRAP) for label in labels]
    widest = max(len(line) for lines in wrapped for line in lines)
    return 0.8 + 0.074 * widest, 0.35 + sum(16 + 11 * (len(lines) - 1) for lines in wrapped) / 72


def _segment(axes: Axes, left: Transform, look: Look) -> Line2D:
    """Returns 34 points of a contestant's line, starting where `left` meets the top left of the axes."""
    line = Line2D([0, 34], [0, 0], color=look.colour, linestyle=look.line, linewidth=1.6, clip_on=False)
    inches = Affine2D().scale(1 / 72) + axes.figure.dpi_scale_trans
    line.set_transform(inches + ScaledTranslation(0, 1, left))
    return line


def keep_labels_apart(axes: Axes, points: Sequence[tuple[float, float]], labels: Sequence[str]) -> None:
    """Writes a short label next to each point, where it covers neither markers nor other labels.

    Call it once the axes' limits and place are final; a thin line leads to labels that had to move away.
    """
    at = axes.transData.transform(np.asarray(points, dtype=float))
    scale = axes.figure.dpi / 72
    taken = [(x - 5 * scale, y - 5 * scale, x + 5 * scale, y + 5 * scale) for x, y in at]
    for (x, y), label in sorted(zip(at.tolist(), labels), key=lambda item: item[0]):
        width, height = (2 + 5.2 * len(label)) * scale, 9 * scale
        best: tuple[float, float, float] | None = None
        for reach in (10, 15, 21, 28, 36, 46, 58):
            for angle in (0, 40, -40, 90, -90, 140, -140, 180, 20, -20, 65, -65):
                across, up = math.cos(math.radians(angle)), math.sin(math.radians(angle))
                cx = x + across * ((reach - 4) * scale + width / 2)
                cy = y + up * reach * scale
                box = (cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2)
                inside = axes.bbox.x0 < box[0] and axes.bbox.y0 < box[1] < box[3] < axes.bbox.y1
                if inside and not any(_overlap(box, other) for other in taken):
                    best = (cx, cy, reach)
                    break
            if best:
                break
        cx, cy, reach = best or (x + 6 * scale + width / 2, y, 10)
        taken.append((cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2))
        offset = ((cx - x) / scale, (cy - y) / scale)
        data = axes.transData.inverted().transform((x, y))
        lead = {"arrowstyle": "-", "color": "#888888", "linewidth": 0.6, "shrinkA": 4, "shrinkB": 4} if reach > 12 else None
        axes.annotate(label, data, xytext=offset, textcoords="offset points", ha="center", va="center",
                      fontsize=7.5, color="#222222", arrowprops=lead, zorder=6,
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8})  # fmt: skip


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
