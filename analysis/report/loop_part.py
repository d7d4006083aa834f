"""The report's part on simulations in the loop: a line for each, a film strip, and what happened over time."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Optional

from figures import loop_figures
from figures.canvas import Picture, picture
from results import loop_file, text
from results.loop_file import LoopError, Simulation

#: Simulations whose pictures are in the page; those of others lie next to it.
MOST_EMBEDDED = 6

HEAD = (
    "scene", "triangles", "detection", "steps", "penetrations", "smallest gap, mm", "most contacts", "iterates a step", "detection, ms",
    "impacts, ms", "rest, ms", "worst step, ms", "memory, MB",
)  # fmt: skip


@dataclass
class Pictures:
    """The pictures of one simulation."""

    title: str
    film: Optional[Picture]
    steps: Optional[Picture]


@dataclass
class LoopPart:
    """What the page shows of all simulations of a folder."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    broken: list[int]  #: places of rows with penetrations
    pictures: list[Pictures]


def loop_part(folder: Path, which: str, notes: list[str]) -> Optional[LoopPart]:
    """Returns the part of a folder of results, or None without simulations. What cannot be read becomes a note."""
    simulations = []
    for place in loop_file.find(folder):
        try:
            one = loop_file.load(place)
            if len(one.steps):
                simulations.append(one)
        except LoopError as problem:
            notes.append(f"A simulation is left out: {problem}")
    if not simulations:
        return None
    made = []
    for number, one in enumerate(pictured(simulations)):
        if which != "none":
            try:
                made.append(_pictures(one, folder, number))
            except LoopError as problem:
                notes.append(f"A simulation has no film strip: {problem}")
    broken = [place for place, one in enumerate(simulations) if one.penetrations > 0]
    return LoopPart(HEAD, [_row(one) for one in simulations], broken, made)


def pictured(simulations: list[Simulation]) -> list[Simulation]:
    """Returns one simulation of each motion, the first that has frames, if any: finders that lose no pair draw the same pictures."""
    chosen: dict[tuple[str, int, int], Simulation] = {}
    for one in simulations:
        if one.of not in chosen or (one.frames and not chosen[one.of].frames):
            chosen[one.of] = one
    return list(chosen.values())


def _row(one: Simulation) -> tuple[str, ...]:
    steps = one.steps
    times = steps["detect_ms"] + steps["impact_ms"] + steps["rest_ms"]
    return (
        one.scene, text.size(one.triangles), one.detection, text.count(steps["step"].max()), text.count(one.penetrations),
        text.significant(1e3 * steps["smallest_gap_m"].min(), 2), text.count(steps["contacts"].max()),
        text.significant(steps["iterates"].mean(), 2), text.milliseconds(steps["detect_ms"].mean()),
        text.milliseconds(steps["impact_ms"].mean()), text.milliseconds(steps["rest_ms"].mean()), text.milliseconds(times.max()),
        ", ".join(text.significant(megabytes) for megabytes in one.memory_mb),
    )  # fmt: skip


def _pictures(one: Simulation, folder: Path, number: int) -> Pictures:
    slug = re.sub(r"[^a-z0-9]+", "-", one.scene.lower()).strip("-") or "scene"
    title = f"{one.scene}, {text.size(one.triangles)} triangles"
    embedded = number < MOST_EMBEDDED
    film = picture(
        folder / "figures", f"loop-{number + 1}-{slug}-film", f"{one.title[0].upper()}{one.title[1:]}", loop_figures.FILM_READING,
        lambda: loop_figures.film(one), embedded,
    )  # fmt: skip
    steps = picture(
        folder / "figures", f"loop-{number + 1}-{slug}-steps", "Energy, momentum, gaps, contacts, times and memory",
        loop_figures.STEPS_READING, lambda: loop_figures.over_time(one), embedded,
    )  # fmt: skip
    return Pictures(title, film, steps)
