"""The parts of the report on single scenes: cards, and figures of a scene's groups."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional

import pandas as pd

from figures import figures, scene_pictures, tree_figures
from figures.canvas import Picture, picture
from figures.colours import Look
from ratios import ratios
from report import scene_cards, tables
from results import text
from results.load import Study


@dataclass
class Section:
    """The part of the report on one scene."""

    title: str
    anchor: str
    bodies: list[dict[str, str]]
    card: list[tuple[str, str]]
    view: Optional[Picture]  #: of the scene itself
    own: bool  #: from files that the user brought
    sizes: str  #: of the smaller versions of the scene
    groups: list[tables.Group]
    pictures: list[Picture] = field(default_factory=list)  #: files next to the page


def sections(
    study: Study, groups: list[tables.Group], all_looks: dict[str, Look], folder: Path, which: str
) -> list[Section]:
    """Returns the parts on the scenes of a study, in the order of its groups; draws the figures that are wanted."""
    ordered = pd.concat(study.groups())
    of_group = dict(zip(ordered["group"].unique(), groups))
    written = scene_pictures.written_out(folder.parent)
    of_scenes = which in ("main", "all")
    study.notes += written.notes
    result = []
    for number, (scene, rows) in enumerate(ordered.groupby("scene", sort=False)):
        mine = [of_group[group] for group in rows["group"].unique()]
        smaller = sorted(rows["primitives"].unique())[:-1]
        sizes = text.listing([text.size(value) for value in smaller])
        own = bool((rows["origin"] == "files").any())
        card, view = scene_cards.card(rows), None
        if (shown := written.of(rows.sort_values("primitives"))) is not None:
            card += scene_cards.violence(shown)
            try:
                view = scene_cards.view(shown, folder, str(scene)) if of_scenes else None
            except scene_pictures.MeshError as problem:
                study.notes.append(f"{scene} has no picture: {problem}.")
        section = Section(str(scene), f"scene-{number + 1}", scene_cards.bodies(rows), card, view, own, sizes, mine)
        timed = rows[rows["refused"] == ""]
        slug = re.sub(r"[^a-z0-9]+", "-", str(scene).lower()).strip("-") or f"scene-{number + 1}"
        if len(timed) and of_scenes:
            head = headline(timed)
            section.pictures += _group_pictures(timed[timed["group"] == head], timed, all_looks, folder, slug)
            if which == "all":
                for other in timed["group"].unique():
                    if other != head:
                        name = f"{slug}-{of_group[other].anchor}"
                        section.pictures += _group_pictures(
                            timed[timed["group"] == other], timed[:0], all_looks, folder, name
                        )
            section.pictures += _trends(timed, head, all_looks, folder, slug)
        result.append(section)
    return result


def headline(timed: pd.DataFrame) -> str:
    """Returns the group for single-group figures: the largest, in float if available, at the middle l."""
    rows = timed[timed["primitives"] == timed["primitives"].max()]
    if (rows["scalar"] == "float").any():
        rows = rows[rows["scalar"] == "float"]
    depths = sorted(rows["l"].unique())
    rows = rows[rows["l"] == depths[len(depths) // 2]]
    return str(rows["group"].iloc[0])


def _place(row: pd.Series) -> str:
    return f"{row['scene']}, {text.size(row['primitives'])} primitives, {row['scalar']}, l = {row['l']:g}"


def _group_pictures(
    group: pd.DataFrame, timed: pd.DataFrame, all_looks: dict[str, Look], folder: Path, slug: str
) -> list[Picture]:
    """Draws cost split, counters and latency of one group."""
    first = group.iloc[0]
    place = _place(first)
    sizes = ratios.fastest_configurations(
        timed[(timed["scalar"] == first["scalar"]) & (timed["l"] == first["l"]) & (timed["machine"] == first["machine"])]
        .drop_duplicates(["contestant", "primitives"], keep="last")
    ) if len(timed) else timed  # fmt: skip
    fastest_only = " Of each strategy only the fastest configuration is drawn." if len(group) > figures.CROWD else ""
    several = len(sizes) and sizes["moving"].nunique() > 1
    counted = f"{first['scene']}, {first['scalar']}, l = {first['l']:g}" if several else place
    made = [
        picture(
            folder, f"{slug}-cost", f"Where the time goes: {place}",
            "Each bar is the mean time of one frame, split into its phases; shorter is better, and the fastest is on "
            "top. A bar with a white zigzag at its end exceeds the picture: its number gives the length."
            + fastest_only,
            lambda: figures.cost_split(group, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-counters", f"Machine-independent work: {counted}",
            "An event-driven strategy writes a bound only when an event changes it, while a refit writes all of them in every "
            "frame. This is the work that it saves. Its price is the events, each of which costs more time than writing a value.",
            lambda: figures.counters(group, sizes, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-depth", f"Where in the tree events happen: {place}",
            "Each mark counts the events per frame that begin at nodes of one depth. A line that rises to the right means that "
            "most events are near the leaves, where an event changes few boxes above it and is therefore cheap."
            + fastest_only,
            lambda: tree_figures.events_by_depth(group, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-quality", f"Does the tree age? {place}",
            "A level line is a tree that suits the last frame of the clip as well as its first; a rising line is a structure "
            "that the motion has degraded. The cost is what the surface-area heuristic expects of a random query, divided by the "
            "same for a tree that is built with this heuristic at that time. A line that starts above 1 is a tree with fuller leaves, "
            "or one that was split at medians." + fastest_only,
            lambda: tree_figures.over_time(group, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-pace", f"Does the query slow down? {place}",
            "Mean times of equal parts of the clip. A line rises where an aging tree costs time, or where there is more to find."
            + fastest_only,
            lambda: tree_figures.times_over_time(group, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-latency", f"Distribution of frame times: {place}",
            "The dot is the median frame, the bar the 99th percentile, the cross the worst frame; motion "
            "evaluation is not included. A long line means that work is concentrated in a few frames, which is visible as a "
            "stutter even if the mean is good."
            + fastest_only,
            lambda: figures.latency(group, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-memory", f"Memory: {place}",
            "The memory of a strategy's own structures after the clip, without the shared meshes and their motion. Further "
            "left is smaller, further down is faster; a strategy to the right of another is worth its memory only if it lies below."
            + fastest_only,
            lambda: figures.memory(group, all_looks), embedded=False,
        ),
    ]  # fmt: skip
    return [one for one in made if one is not None]


def _left_out(rows: pd.DataFrame) -> str:
    oracles = sorted(set(rows["label"]) - set(ratios.without_oracles(rows)["label"]))
    return f" Only the table has {text.listing(oracles)}, which would compress the others." if oracles else ""


def _trends(
    timed: pd.DataFrame, head: str, all_looks: dict[str, Look], folder: Path, slug: str
) -> list[Picture]:
    """Draws lines over l and over n: at the size with most l and at the l with most sizes, or else those of the headline
    group.
    """
    first = timed[timed["group"] == head].iloc[0]
    same = timed[(timed["scalar"] == first["scalar"]) & (timed["machine"] == first["machine"])]
    same = same.drop_duplicates(["contestant", "primitives", "l"], keep="last")
    left_out = _left_out(same)
    same = ratios.without_oracles(same)
    primitives = _most(same, "primitives", "l", float(first["primitives"]))
    depth = _most(same, "l", "primitives", float(first["l"]))
    depths = ratios.fastest_configurations(same[same["primitives"] == primitives])
    sizes = ratios.fastest_configurations(same[same["l"] == depth])
    where = f"{first['scene']}, {first['scalar']}"
    made = [
        picture(
            folder, f"{slug}-l", f"Frames per keyframe: {where}, {text.size(primitives)} primitives",
            "The number of events depends on the keyframes only, so event-driven strategies gain as more frames are "
            "interpolated between two of them, while a refit (broad bands: blue is the best, grey the one of 2006) pays for every "
            "frame. A ring marks a break-even point with one of them; beyond it the falling line wins."
            + left_out,
            lambda: figures.over_frames_per_keyframe(depths, all_looks), embedded=False,
        ),
        picture(
            folder, f"{slug}-n", f"Size: {where}, l = {depth:g}",
            "Both axes are logarithmic, so a cost proportional to n is a straight line with the slope of the thin grey line. A "
            "steeper line grows faster than the scene; parallel lines differ by a constant factor at every size."
            + left_out,
            lambda: figures.over_size(sizes, all_looks), embedded=False,
        ),
    ]  # fmt: skip
    return [one for one in made if one is not None]


def _most(rows: pd.DataFrame, column: str, counted: str, usual: float) -> float:
    """Returns the value of a column at which most values of another were measured: the usual one if it has as many, else the
    largest.
    """
    numbers = rows.groupby(column)[counted].nunique()
    best = numbers[numbers == numbers.max()].index
    return usual if usual in best else float(best.max())
