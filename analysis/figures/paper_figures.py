"""The paper's figures 18, 19, 21 and 22, panel by panel, from the study's data on their scenes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from claims.claim_points import Table
from figures.axes import KeyLines, fixed_log_axis, key, key_size, log_axis
from figures.canvas import Picture, picture
from figures.colours import FAMILIES, Look, looks as looks_of
from figures.figures import WIDTH
from results import text

AS_IN_PAPER = {"builder": {"width": 2, "leaf_size": 1}}
BOXTREE = {"strategy": "kinetic_boxtree", "params": {"rebuild": "never", "leaf_boxes": "inherited"}}
#: The members of a panel: name, and a term as in claims.json. The baselines come from claims.json.
KINETIC: list[tuple[str, dict[str, Any]]] = [
    ("kinetic AABB tree", {"strategy": "kinetic_aabb"}),
    ("kinetic BoxTree", BOXTREE),
]
LIST: list[tuple[str, dict[str, Any]]] = [("kinetic separation list", {"strategy": "kinetic_separation_list"})]
PEERS: list[tuple[str, dict[str, Any]]] = [
    ("FCL, bottom-up refit", {"strategy": "fcl_float_bottom_up"}),
    ("Bullet, BVH refit", {"strategy": "bullet_bvh"}),
]
#: Colours that differ: among all contestants of a report two of these structures may share one.
LOOKS: dict[str, Look] = looks_of((name, name, "kinetic") for name, _ in KINETIC + LIST)


@dataclass(frozen=True)
class Panel:
    """One diagram of the paper."""

    place: str  #: left, middle or right
    scene: str
    x: str  #: polygons or l
    quantities: tuple[str, ...]  #: the second is drawn dotted and open
    who: str  #: kinetic, all (with baselines and peers) or total (and the separation list)
    title: str


@dataclass(frozen=True)
class PaperFigure:
    """One figure of the paper."""

    number: str
    title: str
    panels: tuple[Panel, ...]
    reading: str


ON_SIZE = (
    "Both axes are logarithmic, so that a factor is the same distance everywhere and the refits, which the paper did not "
    "have, stay visible. "
)

FIGURES: tuple[PaperFigure, ...] = (
    PaperFigure(
        "18", "tablecloth",
        (
            Panel("left", "tablecloth", "polygons", ("events", "values"), "kinetic", "events and values per frame"),
            Panel("middle", "tablecloth", "polygons", ("values",), "refits", "values written per frame"),
            Panel("right", "tablecloth", "polygons", ("update",), "all", "update (ms per frame)"),
        ),
        ON_SIZE + "Compare left and middle with right: fewer written values (the paper's case) are faster only if an event "
        "does not cost more time than the values that it saves.",
    ),
    PaperFigure(
        "19", "reversing spheres, and dress",
        (
            Panel("left", "reversing_spheres", "polygons", ("update",), "all", "spheres: update (ms per frame)"),
            Panel("middle", "dress", "polygons", ("events", "values"), "kinetic", "dress: events and values"),
            Panel("right", "dress", "polygons", ("update",), "all", "dress: update (ms per frame)"),
        ),
        ON_SIZE + "Left, updates include the answers to changed flight plans; a kinetic line must lie below both refits "
        "for the paper's gain to hold today.",
    ),
    PaperFigure(
        "21", "shirt",
        (
            Panel("left", "shirt", "l", ("update",), "all", "update over l (ms per frame)"),
            Panel("middle", "shirt", "polygons", ("update",), "all", "update (ms per frame)"),
            Panel("right", "shirt", "polygons", ("total",), "total", "update and check (ms per frame)"),
        ),
        "Left, more frames between the same keyframes spread the same events more thinly, so kinetic lines fall and those of "
        "refits stay level; where they cross is the break-even point. Middle and right are for one l over sizes, both axes "
        "logarithmic.",
    ),
    PaperFigure(
        "22", "incremental collision detection",
        (
            Panel("left", "dress", "polygons", ("total",), "total", "dress: total (ms per frame)"),
            Panel("middle", "dress", "l", ("total",), "total", "dress: total over l (ms)"),
            Panel("right", "tablecloth", "polygons", ("total",), "total", "tablecloth: total (ms per frame)"),
        ),
        ON_SIZE + "The separation list never searches from the roots, so its line includes all its work for collisions; the "
        "others update and then search.",
    ),
)


def anchor(number: str) -> str:
    """Returns the fragment of a figure in the page."""
    return f"paper-{number}"


def drawn(
    table: Table, baselines: list[dict[str, Any]], looks: dict[str, Look], folder: Path
) -> list[tuple[PaperFigure, Optional[Picture], list[str]]]:
    """Returns every figure with its picture (None without any panel) and sentences on missing panels."""
    result = []
    for figure in FIGURES:
        panels: list[tuple[Panel, list[Line], str]] = []
        reasons: dict[str, list[str]] = {}
        for panel in figure.panels:
            lines, place = lines_of(table, panel, baselines, looks)
            if lines:
                panels.append((panel, lines, place))
            else:
                reasons.setdefault(why_not(table, panel), []).append(panel.place)
        missing = [f"Not drawn, {text.listing(places)}: {reason}." for reason, places in reasons.items()]
        title = f"Figure {figure.number} of the paper: {figure.title}"
        made = picture(folder, f"paper-{figure.number}", title, figure.reading, lambda: draw(panels)) if panels else None
        result.append((figure, made, missing))
    return result


def why_not(table: Table, panel: Panel) -> str:
    """Returns the data that a panel without lines lacks."""
    places = table.places(panel.scene)
    if not places:
        return f"there are no timed results of the scene {panel.scene}"
    if panel.x == "l":
        depths = text.listing([f"{l:g}" for l in sorted({l for _, l, _ in places})])
        return f"{panel.scene} was measured at l = {depths} only"
    return f"none of its strategies was measured on {panel.scene}"


@dataclass(frozen=True)
class Line:
    """One strategy's line for one quantity."""

    name: str
    look: Look
    quantity: str
    x: list[float]
    y: list[float]
    second: bool


def members(panel: Panel, baselines: list[dict[str, Any]], looks: dict[str, Look]) -> list[tuple[str, dict[str, Any]]]:
    """Returns names and terms of a panel's lines."""
    refits = [(one["short"], one) for one in baselines]
    if panel.who == "kinetic":
        return KINETIC
    if panel.who == "refits":
        return KINETIC + refits
    return KINETIC + (LIST if panel.who == "total" else []) + refits + PEERS


def lines_of(
    table: Table, panel: Panel, baselines: list[dict[str, Any]], looks: dict[str, Look]
) -> tuple[list[Line], str]:
    """Returns the lines of a panel, and their l or size; empty if there is nothing to show."""
    places = table.places(panel.scene)
    if not places:
        return [], ""
    if panel.x == "l":
        counts = {size: len({l for at, l, _ in places if at == size}) for size, _, _ in places}
        most = max(counts.values())
        if most < 2:
            return [], ""
        chosen = max(size for size, count in counts.items() if count == most)
        places = [one for one in places if one[0] == chosen]
        where = f"{text.size(chosen)} polygons"
    else:
        counts = {l: len({size for size, at, _ in places if at == l}) for _, l, _ in places}
        chosen = min(counts, key=lambda l: (-counts[l], abs(np.log(l / 10))))
        places = [one for one in places if one[1] == chosen]
        where = f"l = {chosen:g}"
    result = []
    for name, term in members(panel, baselines, looks):
        for number, quantity in enumerate(panel.quantities):
            counted = quantity in ("events", "values") and "strategy" in term and "id" not in term
            wanted = {**term, **AS_IN_PAPER} if counted else term
            x, y, last = [], [], None
            for size, l, rows in places:
                run = table.chosen(rows, wanted, quantity)
                known = table.values(run, quantity) if run is not None else []
                if len(known) and np.median(known) > 0:
                    x.append(l if panel.x == "l" else size)
                    y.append(float(np.median(known)))
                    last = table.row(run)
            if last is not None:
                own = LOOKS.get(name) or looks[last["contestant"]]
                look = Look(*FAMILIES["refit"], "-", True) if "baseline" in term or "family" in term else own
                look = replace(look, filled=True)  # open markers are for the second quantity here
                result.append(Line(name, look, quantity, x, y, number > 0))
    if panel.x == "l":
        result = [line for line in result if len(line.x) > 1]
    has_kinetic = any(line.name in {name for name, _ in KINETIC + LIST} for line in result)
    return (result if has_kinetic else []), where


def draw(panels: list[tuple[Panel, list[Line], str]]) -> Figure:
    """Draws panels side by side, and one key below them."""
    entries: dict[str, Look] = {}
    for _, lines, _ in panels:
        for line in lines:
            entries.setdefault(line.name, line.look)
    side, tall = key_size(list(entries))
    figure = Figure(figsize=(WIDTH, max(3.5, tall)), layout="constrained")
    grid = figure.add_gridspec(1, len(panels) + 1, width_ratios=[(WIDTH - side) / len(panels)] * len(panels) + [side])
    for place, (panel, lines, where) in enumerate(panels):
        draw_panel(figure.add_subplot(grid[0, place]), panel, lines, where)
    key(figure.add_subplot(grid[0, len(panels)]), list(entries.items()), KeyLines.shown)
    return figure


def draw_panel(axes: Axes, panel: Panel, lines: list[Line], where: str) -> None:
    """Draws one diagram: polygons or l on the x axis, both axes logarithmic."""
    fixed_log_axis(axes, "x", [x for line in lines for x in line.x], text.size if panel.x == "polygons" else text.tick)
    log_axis(axes, "y", [y for line in lines for y in line.y])
    for line in lines:
        style = (0, (1, 1.6)) if line.second else line.look.line
        axes.plot(line.x, line.y, linestyle=style, color=line.look.colour, marker=line.look.drawn,
                  markerfacecolor="white" if line.second else line.look.face, markersize=5.5, markeredgewidth=1.3)  # fmt: skip
    axes.set_title(f"{panel.place}: {panel.title}", fontsize=8.5)
    axes.set_xlabel(f"polygons ({where})" if panel.x == "polygons" else f"frames per keyframe, l ({where})")
    if len(panel.quantities) > 1:
        handles = [
            Line2D([], [], color="#444444", marker="o", markersize=5, label=panel.quantities[0]),
            Line2D([], [], color="#444444", marker="o", markerfacecolor="white", markersize=5,
                   linestyle=(0, (1, 1.6)), label=panel.quantities[1]),
        ]  # fmt: skip
        axes.legend(handles=handles, loc="lower right", frameon=False, fontsize=8)
