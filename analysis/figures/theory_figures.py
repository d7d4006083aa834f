"""Draws the measurements of `kbvh theory`: FOLDER/theory.json becomes figures in FOLDER/figures/.

usage: theory_figures.py FOLDER
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Optional

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from figures.axes import KeyLines, fixed_log_axis, key, key_size, log_axis
from figures.canvas import Picture, picture
from figures.colours import Look, looks
from results import files
from results.load import read_json
from results.text import size, tick

SCHEMA = "kbvh-theory-1"
WIDTH = 10.5  #: of every figure, in inches
BOUND = "#999999"  #: colour of bounds and fits


class TheoryError(Exception):
    """Reports an unusable theory.json."""


@dataclass(frozen=True)
class Theory:
    """The measurements of one theory.json."""

    counts: pd.DataFrame  #: a row per scene and size
    frames: pd.DataFrame  #: a row per scene and l
    fits: pd.DataFrame  #: a row per scene that was fitted
    looks: dict[str, Look]  #: of scenes


def load(file: Path) -> Theory:
    """Reads theory.json. Raises TheoryError if it is missing or of another schema."""
    found = read_json(file, SCHEMA, TheoryError)
    try:
        counts = pd.DataFrame(found["counts"])
        frames = pd.DataFrame(found["frames"])
        scenes = sorted({*counts.get("scene", []), *frames.get("scene", [])})
        return Theory(counts, frames, pd.DataFrame(found["fits"]), looks((scene, scene, scene) for scene in scenes))
    except (KeyError, TypeError, ValueError) as problem:
        raise TheoryError(f"{file}: a field is missing or of the wrong kind: {problem}.") from None


def growing(counts: pd.DataFrame) -> pd.DataFrame:
    """Returns the scenes that were measured at several sizes, with events at each."""
    if counts.empty:
        return counts
    by_scene = counts.groupby("scene")
    several = (by_scene["vertices"].transform("nunique") > 1) & (by_scene["events"].transform("min") > 0)
    return counts[several].sort_values(["scene", "vertices"])


def _keyed(scenes: Sequence[str], theory: Theory, panels: int, height: float) -> tuple[Figure, list[Axes]]:
    """Lays out panels side by side and a key of scenes at the right."""
    side, tall = key_size(scenes)
    figure = Figure(figsize=(WIDTH, max(height, tall)), layout="constrained")
    grid = figure.add_gridspec(1, panels + 1, width_ratios=[(WIDTH - side) / panels] * panels + [side])
    key(figure.add_subplot(grid[0, panels]), [(scene, theory.looks[scene]) for scene in scenes], KeyLines.shown)
    return figure, [figure.add_subplot(grid[0, place]) for place in range(panels)]


def _line(axes: Axes, x: Sequence[float], y: Sequence[float], look: Look, filled: Optional[bool] = None) -> None:
    face = look.colour if (look.filled if filled is None else filled) else "#FFFFFF"
    axes.plot(x, y, linestyle=look.line, color=look.colour, marker=look.drawn, markerfacecolor=face, markersize=5.5,
              markeredgewidth=1.3, zorder=3)  # fmt: skip


def n_log_n(n: np.ndarray) -> np.ndarray:
    """Returns n log2 n."""
    return n * np.log2(n)


def events_over_n(theory: Theory) -> Optional[Figure]:
    """Draws events of a clip against vertices with the fit c n log n, and the residuals of the fits below each other."""
    rows = growing(theory.counts)
    if rows.empty:
        return None
    scenes = list(rows["scene"].unique())
    fitted = theory.fits[theory.fits["scene"].isin(scenes)] if not theory.fits.empty else theory.fits
    figure, all_axes = _keyed(scenes, theory, 2 if len(fitted) else 1, 4.2)
    draw_events(all_axes[0], rows, fitted, theory.looks)
    if len(fitted):
        draw_residuals(all_axes[1], fitted, theory.looks)
    return figure


def draw_events(axes: Axes, rows: pd.DataFrame, fits: pd.DataFrame, scene_looks: dict[str, Look]) -> None:
    """Draws points joined by lines; the fits are wide and grey behind them."""
    fixed_log_axis(axes, "x", list(rows["vertices"]), size)
    log_axis(axes, "y", list(rows["events"]))
    for _, fit in fits.iterrows():
        n = np.asarray(fit["vertices"], dtype=float)
        axes.plot(n, fit["constant"] * n_log_n(n), color="#DDDDDD", linewidth=6, solid_capstyle="round", zorder=1)
    for scene, line in rows.groupby("scene"):
        _line(axes, line["vertices"], line["events"], scene_looks[str(scene)])
    axes.set_title("events of a clip (wide grey: c n log n)" if len(fits) else "events of a clip")
    axes.set_xlabel("vertices n")


def draw_residuals(axes: Axes, fits: pd.DataFrame, scene_looks: dict[str, Look]) -> None:
    """Draws the deviation of events from c n log n, in percent; the exponent of each scene next to its last point."""
    every = [float(n) for numbers in fits["vertices"] for n in numbers]
    fixed_log_axis(axes, "x", every, size)
    widest = 1.0
    for _, fit in fits.iterrows():
        percent = 100 * np.asarray(fit["residuals"], dtype=float)
        widest = max(widest, float(np.abs(percent).max()))
        _line(axes, fit["vertices"], percent, scene_looks[fit["scene"]])
    axes.axhline(0, color=BOUND, linewidth=0.9, zorder=1)
    axes.set_ylim(-(1.3 + 0.16 * len(fits)) * widest, 1.25 * widest)  # with room for the exponents
    axes.grid(True, axis="y")
    text = "\n".join(
        f"{fit['scene']}: exponent {fit['exponent']:.2f} ({fit['low']:.2f} to {fit['high']:.2f})" for _, fit in fits.iterrows()
    )
    axes.text(0.98, 0.02, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5, color="#333333",
              bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5}, zorder=5)  # fmt: skip
    axes.set_title("off c n log n (%)")
    axes.set_xlabel("vertices n")


def events_over_l(theory: Theory) -> Optional[Figure]:
    """Draws changes of the kinetic tree and values of bottom-up against the frames of each keyframe interval."""
    rows = theory.frames
    if rows.empty or rows["l"].nunique() < 2:
        return None
    rows = rows[(rows["events"] > 0) & (rows.groupby("scene")["l"].transform("nunique") > 1)].sort_values("l")
    if rows.empty:
        return None
    figure, (axes,) = _keyed(list(rows["scene"].unique()), theory, 1, 4.2)
    draw_values_over_l(axes, rows, theory.looks)
    return figure


def draw_values_over_l(axes: Axes, rows: pd.DataFrame, scene_looks: dict[str, Look]) -> None:
    """Draws, filled, the values that the kinetic tree changes in a clip; open and dotted, the values that bottom-up writes.
    """
    fixed_log_axis(axes, "x", list(rows["l"]), lambda value: f"{value:g}")
    log_axis(axes, "y", [*rows["values"], *rows["bottom_up_values"]])
    for scene, line in rows.groupby("scene"):
        look = scene_looks[str(scene)]
        _line(axes, line["l"], line["values"], look, filled=True)
        axes.plot(line["l"], line["bottom_up_values"], linestyle=(0, (1, 1.6)), color=look.colour, marker=look.drawn,
                  markerfacecolor="white", markersize=5, markeredgewidth=1.1, linewidth=1.1, zorder=2)  # fmt: skip
    axes.set_title("bound values written in a clip")
    axes.set_xlabel("interpolated frames per keyframe, l")
    handles = [
        Line2D([], [], color="#444444", marker="o", markersize=5.5, label="kinetic AABB tree"),
        Line2D([], [], color="#444444", marker="o", markerfacecolor="white", markersize=5, linestyle=(0, (1, 1.6)),
               linewidth=1.1, label="bottom-up refit"),
    ]  # fmt: skip
    axes.legend(handles=handles, loc="upper left", frameon=False)


def certificates_per_vertex(theory: Theory) -> Optional[Figure]:
    """Draws the mean and maximum number of certificates of a vertex, and the cost of changing one plan, against n."""
    rows = theory.counts
    if rows.empty:
        return None
    rows = rows[rows.groupby("scene")["vertices"].transform("nunique") > 1].sort_values(["scene", "vertices"])
    if rows.empty:
        return None
    figure, (left, right) = _keyed(list(rows["scene"].unique()), theory, 2, 4.0)
    means = rows["sum_update_certificates"] / rows["updates"].clip(lower=1)
    draw_mean_and_most(left, rows, rows["mean_vertex_certificates"], rows["max_vertex_certificates"], theory.looks)
    left.set_title("certificates of a vertex")
    draw_mean_and_most(right, rows, means, rows["max_update_certificates"], theory.looks)
    right.set_title("candidates looked at by one plan change")
    return figure


def draw_mean_and_most(
    axes: Axes, rows: pd.DataFrame, mean: pd.Series, most: pd.Series, scene_looks: dict[str, Look]
) -> None:
    """Draws means filled, maxima open, over a logarithmic n: O(log m) is at most a straight line."""
    fixed_log_axis(axes, "x", list(rows["vertices"]), size)
    for scene, line in rows.groupby("scene"):
        look = scene_looks[str(scene)]
        _line(axes, line["vertices"], mean[line.index], look, filled=True)
        axes.plot(line["vertices"], most[line.index], linestyle=(0, (1, 1.6)), color=look.colour, marker=look.drawn,
                  markerfacecolor="white", markersize=5.5, markeredgewidth=1.2, linewidth=1.1, zorder=2)  # fmt: skip
    axes.set_ylim(0, float(most.max()) * 1.2)
    axes.grid(True, axis="y")
    axes.set_xlabel("vertices n")
    handles = [
        Line2D([], [], color="#444444", marker="o", markersize=5.5, label="mean"),
        Line2D([], [], color="#444444", marker="o", markerfacecolor="white", markersize=5.5, linestyle=(0, (1, 1.6)),
               label="most"),
    ]  # fmt: skip
    axes.legend(handles=handles, loc="upper left", ncol=2, frameon=False)


def steps_per_event(theory: Theory) -> Optional[Figure]:
    """Draws comparisons in the queue and nodes visited per event against polygons, with the bounds."""
    rows = growing(theory.counts)
    if rows.empty:
        return None
    figure, (left, right) = _keyed(list(rows["scene"].unique()), theory, 2, 4.0)
    draw_steps(left, rows, rows["sum_steps"] / rows["events"], rows["max_steps"], rows["queue_steps_bound"],
               theory.looks)  # fmt: skip
    left.set_title("comparisons in the queue per event")
    draw_steps(right, rows, rows["sum_visited"] / rows["events"], rows["max_visited"], rows["depth"], theory.looks)
    right.set_title("nodes visited per event")
    return figure


def draw_steps(
    axes: Axes, rows: pd.DataFrame, mean: pd.Series, most: pd.Series, bound: pd.Series, scene_looks: dict[str, Look]
) -> None:
    """Draws means and maxima over a logarithmic m, both axes logarithmic; the bounds are grey lines."""
    fixed_log_axis(axes, "x", list(rows["triangles"]), size)
    log_axis(axes, "y", [value for value in (*mean, *most, *bound) if value > 0], tick)
    for scene, line in rows.groupby("scene"):
        look = scene_looks[str(scene)]
        axes.plot(line["triangles"], bound[line.index], color=BOUND, linewidth=1.2, zorder=1)
        _line(axes, line["triangles"], mean[line.index], look, filled=True)
        axes.plot(line["triangles"], most[line.index], linestyle=(0, (1, 1.6)), color=look.colour, marker=look.drawn,
                  markerfacecolor="white", markersize=5.5, markeredgewidth=1.2, linewidth=1.1, zorder=2)  # fmt: skip
    axes.set_xlabel("polygons m")
    handles = [
        Line2D([], [], color="#444444", marker="o", markersize=5.5, label="mean"),
        Line2D([], [], color="#444444", marker="o", markerfacecolor="white", markersize=5.5, linestyle=(0, (1, 1.6)),
               label="most"),
        Line2D([], [], color=BOUND, linewidth=1.2, label="bound"),
    ]  # fmt: skip
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1.07), ncol=3, frameon=False, borderaxespad=0)


FIGURES = (
    (
        "theory-events-n", "Events of a clip and n log n", events_over_n,
        "Left, points that follow the wide grey line grow as n log n; both axes are logarithmic. Right, a scene whose line "
        "rises grows faster than that, one whose line falls grows more slowly.",
        ("T6",),
    ),
    (
        "theory-events-l", "Values written and frames per keyframe", events_over_l,
        "The kinetic tree's lines are level, because its events depend on the keyframes, not on the frames between them. "
        "The refit writes every bound in every frame, so its dotted lines rise as l does.",
        ("T7",),
    ),
    (
        "theory-certificates", "Certificates per vertex", certificates_per_vertex,
        "The axis of n is logarithmic, so O(log n) is at most a straight line. Filled marks are means, open ones the vertex "
        "with the most.",
        ("T4",),
    ),
    (
        "theory-steps", "Cost of an event", steps_per_event,
        "Filled marks are means over events, open ones the dearest event, grey lines the bounds. As long as open marks stay "
        "below the grey lines, an event costs what the theory allows.",
        ("T3",),
    ),
)  # fmt: skip


def pictures(theory: Theory, folder: Path) -> list[Picture]:
    """Writes every figure that has content, as PNG and PDF."""
    made = [
        picture(folder, name, title, reading, lambda draw=draw: draw(theory)) for name, title, draw, reading, _ in FIGURES
    ]
    return [one for one in made if one is not None]


def draw_all(theory: Theory, folder: Path) -> list[str]:
    """Writes every figure that has content; returns their names."""
    return [one.name for one in pictures(theory, folder)]


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="theory_figures.py", description="Draws FOLDER/theory.json.")
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="folder with theory.json")
    options = parser.parse_args(arguments)

    def work() -> int:
        draw_all(load(options.folder / "theory.json"), options.folder / "figures")
        return 0

    return files.run_command("theory_figures.py", (TheoryError,), work)
