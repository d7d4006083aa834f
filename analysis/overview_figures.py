"""The overview of a study for print: performance profiles, and the fastest contestant of every table against the best refit.

explorer.html shows the same with filters.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Optional

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

import ratios
import tables
import text
from axes import KeyLines, contestants_on_y, key, key_size, log_axis, mark
from canvas import Picture, picture
from colours import Look
from load import Study
from profiles import Profile, profiles

WIDTH = 10.5  #: of every figure, in inches
#: Factors up to which a profile is drawn; the first that holds this share of all factors is taken.
ENDS, SHARE = (2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0), 0.85
#: Profiles that print can tell apart, beside those of the baselines. Up to EXTRA more are drawn rather than left out.
MOST, EXTRA = 12, 4


def pictures(study: Study, glance: Sequence[tables.Glance], all_looks: dict[str, Look], folder: Path) -> list[Picture]:
    """Returns the figures of the overview that there are data for."""
    found = profiles(study)
    first = study.runs.sort_values(["id", "contestant"]).drop_duplicates("id").set_index("id")
    looks = {id: all_looks[contestant] for id, contestant in first["contestant"].items()}
    titles = dict(first["title"])
    cells = found[0].cells if found else 0
    shown, left_out = selection(found, set(study.runs.loc[study.runs["baseline"], "id"]))
    made = [
        picture(
            folder, "profiles", "How often is who within a factor of the best?",
            f"Each line counts the tables in which a strategy was measured, of {text.plural(cells, 'table')} with two strategies or more. A line at "
            "60 % above 1.25 is a strategy that in 60 % of its tables takes at most 1.25 times as long as the fastest, motion evaluation "
            "included. Of several settings of a strategy the fastest counts; in brackets: its tables." + left_out_says(left_out, titles),
            lambda: profile(shown, looks, titles) if cells else None,
        ),
        picture(
            folder, "glance", "The fastest contestant of another kind against the best refit of each table",
            "To the right of 1 it is faster than the best refit. The line is the 95 % interval of the ratio, by a bootstrap over the "
            "repetitions; total time with motion evaluation, verified contestants only.",
            lambda: against_refit(study, glance, all_looks),
        ),
    ]  # fmt: skip
    return [one for one in made if one is not None]


def selection(found: Sequence[Profile], baselines: set[str]) -> tuple[list[Profile], list[Profile]]:
    """Splits profiles, which come best first, into those that are drawn and those that are left out."""
    if len(found) <= MOST + EXTRA:
        return list(found), []
    drawn = [place < MOST or one.id in baselines for place, one in enumerate(found)]
    return [one for one, yes in zip(found, drawn) if yes], [one for one, yes in zip(found, drawn) if not yes]


def left_out_says(left_out: Sequence[Profile], titles: dict[str, str]) -> str:
    """Returns a sentence on the profiles that are not drawn."""
    if not left_out:
        return ""
    names = "; ".join(titles[one.id] for one in left_out)
    return (
        f" Drawn are the {MOST} strategies with the largest mean of (fastest time / own time), and the baselines. Left out, from the "
        f"better to the worse: {names}. The explorer draws all of them."
    )


def profile(found: Sequence[Profile], looks: dict[str, Look], titles: dict[str, str]) -> Figure:
    """Draws the share of tables within a factor of the best, the best strategies first in the key."""
    factors = pd.Series([factor for one in found for factor in one.factors])
    end = next((end for end in ENDS if end >= factors.quantile(SHARE)), ENDS[-1])
    names = [f"{titles[one.id]} ({len(one.factors)})" for one in found]
    side, tall = key_size(names)
    figure = Figure(figsize=(WIDTH, max(4.2, tall)), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=[WIDTH - side, side])
    axes = figure.add_subplot(grid[0, 0])
    for place, one in reversed(list(enumerate(found))):
        look = looks[one.id]
        x = [1.0, *(factor for factor in one.factors if 1 < factor <= end), end]
        y = [one.within(factor) for factor in x]
        axes.plot(x, y, drawstyle="steps-post", color=look.colour, linestyle=look.line, linewidth=1.8 if place < 8 else 1.0, zorder=3 if place < 8 else 2)
        for third in range(3):
            at = end ** ((third + (place * 7 % len(found)) / len(found)) / 3)
            if one.within(at) > 0:
                mark(axes, at, one.within(at), look, 6 if place < 8 else 4.5, zorder=4)
    axes.set_xscale("log")
    axes.set_xlim(1, end)
    axes.set_ylim(0, 1.02)
    axes.xaxis.set_major_locator(FixedLocator([value for value in ((1, 1.25, 1.5) if end <= 10 else (1,)) + (2, 3, 5, 10, 20, 50, 100) if value <= end]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}x"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value * 100:.0f}\u2009%"))
    axes.grid(True)
    axes.set_xlabel("within this factor of the fastest")
    axes.set_ylabel("share of tables")
    key(figure.add_subplot(grid[0, 1]), [(name, looks[one.id]) for name, one in zip(names, found)], KeyLines.shown)
    return figure


def against_refit(study: Study, glance: Sequence[tables.Glance], looks: dict[str, Look]) -> Optional[Figure]:
    """Draws a row a table: the ratio of the fastest other contestant to the best refit, with its interval or range
    (dotted if the machine was disturbed)."""
    rows = []
    for line in glance:
        if line.exact_run is None:
            continue
        found = ratios.ratio(study, line.exact_run, line.refit_run, "with_motion")
        if found is None:
            continue
        rows.append((line, found, (found.low, found.high)))
    if not rows:
        return None
    scalars = {line.scalar for line, *_ in rows}
    names = [
        f"{line.scene}, {line.primitives}, " + (f"{line.scalar}, " if len(scalars) > 1 else "") + f"l = {line.l}" for line, *_ in rows
    ]
    figure = Figure(figsize=(WIDTH, 1.0 + 0.2 * len(rows)), layout="constrained")
    axes = figure.subplots()
    contestants_on_y(axes, names, [looks[line.exact_contestant] for line, *_ in rows])
    axes.set_yticklabels(names)  # in one line: rows are narrow
    log_axis(axes, "x", [1.0, *(value for _, found, ends in rows for value in (found.middle, *ends))])
    axes.axvline(1, color="#333333", linewidth=1)
    right = axes.get_yaxis_transform()
    for place, (line, found, (low, high)) in enumerate(rows):
        look = looks[line.exact_contestant]
        style = ":" if found.disturbed else "-"
        axes.plot([low, high], [place, place], color=look.colour, linewidth=1.6, linestyle=style, zorder=2)
        mark(axes, found.middle, place, look, 6)
        name = line.exact.split(" (")[0]
        axes.text(1.01, place, f"{text.factor(found.middle)}{'?' if found.disturbed else ''}  {name}", transform=right, va="center", fontsize=7.5, color="#333333")
    axes.set_xlabel("times as fast as the best refit")
    return figure
