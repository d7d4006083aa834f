"""The simulations below a folder, with the finders of their pairs side by side, as a Markdown table.

usage: loop_table.py FOLDER [--write analysis/guides/simulator.md]
Of one scene, a row for each finder; of several, a row for each scene. A page has the tables of several folders, between
`<!-- simulations of NAME -->` and `<!-- /simulations of NAME -->`, where NAME is the name of the folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Optional

import pandas as pd

from results import files, loop_file, text
from results.files import ResultError
from results.loop_file import LoopError, Simulation

FINDER_HEAD = (
    "pairs found by", "steps", "detection, ms", "worst", "over the best refit", "all but detection, ms", "worst step, ms", "memory, MB",
    "penetrations", "states",
)  # fmt: skip
SCENE_HEAD = (
    "scene", "triangles", "finders", "steps of each, at least", "steps in all", "penetrations", "other states", "best refit, ms",
    "fastest other", "worst step, ms", "memory grew by, MB",
)  # fmt: skip


class Scene:
    """Simulations of one motion, one for each finder of pairs."""

    def __init__(self, simulations: list[Simulation]) -> None:
        self.simulations = sorted(simulations, key=lambda one: (not one.finder.startswith("broad_phase"), one.finder))
        self.common = min(len(one.steps) for one in simulations)
        #: With which states are compared: those of the first exact finder.
        self.reference = next((one for one in self.simulations if one.exact), self.simulations[0])

    def steps(self, one: Simulation) -> pd.DataFrame:
        """Returns the steps that all made."""
        return one.steps.iloc[: self.common]

    def detection(self, one: Simulation) -> float:
        """Returns the time of detection in all steps that all made, in ms."""
        return float(self.steps(one)["detect_ms"].sum())

    def best(self, baseline: bool) -> Optional[Simulation]:
        """Returns the refit, or the other exact finder, whose detection took least."""
        return min((one for one in self.simulations if one.baseline == baseline and one.exact), key=self.detection, default=None)

    def over_refit(self, one: Simulation) -> Optional[float]:
        """Returns the detection of the best refit over that of a simulation; None without a refit."""
        refit, time = self.best(baseline=True), self.detection(one)
        return self.detection(refit) / time if refit and time > 0 else None

    def difference(self, one: Simulation) -> Optional[int]:
        """Returns the first step that a simulation and the reference made, and after which their states differ."""
        for step, (mine, other) in enumerate(zip(one.steps["state"], self.reference.steps["state"]), 1):
            if mine != other:
                return step
        return None

    def finder_row(self, one: Simulation) -> tuple[str, ...]:
        """Returns the cells of FINDER_HEAD."""
        steps, differs = self.steps(one), self.difference(one)
        states = f"differ at {text.count(differs)}" if differs else text.MISSING if one is self.reference else "equal"
        return (
            one.finder, text.count(len(one.steps)), text.milliseconds(steps["detect_ms"].median()), text.milliseconds(steps["detect_ms"].max()),
            times(self.over_refit(one)), text.milliseconds((steps["impact_ms"] + steps["rest_ms"]).median()),
            text.milliseconds(_whole(steps).max()), ", ".join(text.significant(megabytes) for megabytes in one.memory_mb),
            text.count(one.penetrations), states,
        )  # fmt: skip

    def scene_row(self) -> tuple[str, ...]:
        """Returns the cells of SCENE_HEAD."""
        all_of, refit, other = self.simulations, self.best(baseline=True), self.best(baseline=False)
        grown = max(last - first for first, last in (one.memory_mb for one in all_of))
        return (
            all_of[0].scene, text.size(all_of[0].triangles), text.count(len(all_of)), text.count(self.common),
            text.count(sum(len(one.steps) for one in all_of)), text.count(sum(one.penetrations for one in all_of)),
            text.count(sum(self.difference(one) is not None for one in all_of)),
            f"{refit.finder} {text.milliseconds(self.steps(refit)['detect_ms'].median())}" if refit else text.MISSING,
            f"{other.finder} {times(self.over_refit(other))}" if other else text.MISSING,
            text.milliseconds(max(_whole(one.steps).max() for one in all_of)), text.significant(grown, 2),
        )  # fmt: skip


def _whole(steps: pd.DataFrame) -> pd.Series:
    return steps["detect_ms"] + steps["impact_ms"] + steps["rest_ms"]


def times(value: Optional[float]) -> str:
    """Formats a ratio as 1.25x."""
    return text.MISSING if value is None else f"{text.factor(value)}x"


def load_scenes(folder: Path) -> list[Scene]:
    """Reads all simulations below a folder that made a step. Raises LoopError, also if there are none."""
    motions: dict[tuple[str, int, int], list[Simulation]] = {}
    for place in loop_file.find(folder):
        one = loop_file.load(place)
        if len(one.steps):
            motions.setdefault(one.of, []).append(one)
    if not motions:
        raise LoopError(f"{folder} has no simulations: `kbvh loop --plan PLAN --out {folder}` makes them.")
    return [Scene(simulations) for simulations in motions.values()]


def facts(scenes: list[Scene]) -> str:
    """States time, program and machine in one sentence."""
    all_of = [one for scene in scenes for one in scene.simulations]

    def of(values: Iterable[str]) -> str:
        return text.listing(sorted(set(values)))

    commits = of(one.commit[:8] + (" with local changes" if one.dirty else "") for one in all_of)
    return f"Measured: {of(one.when[:10] for one in all_of)}, commit {commits}, {of(one.cpu for one in all_of)}, one thread."


def markdown(scenes: list[Scene]) -> str:
    """Returns the table, and what its numbers mean."""
    if len(scenes) == 1:
        scene = scenes[0]
        head, rows = FINDER_HEAD, [scene.finder_row(one) for one in scene.simulations]
        meaning = (
            f"Scene {scene.reference.scene} with {text.size(scene.reference.triangles)} triangles. Times a step, of the first "
            f"{text.plural(scene.common, 'step')}, which all made: medians, and the worst step, which may be the first, where trees are built; the ratio is that of "
            "detection in all these steps. Memory: of the program, the most in the first and in the last tenth of a row's steps. States "
            f"after every step are compared with those of {scene.reference.finder}."
        )
    else:
        head, rows = SCENE_HEAD, [scene.scene_row() for scene in scenes]
        meaning = (
            "Detection a step, median, and its ratio to the best refit, of the steps that all finders of a scene made. Other states: "
            "simulations whose states after some step differ from those of the first exact finder. Memory: of the program, the largest growth of a "
            "simulation from the first to the last tenth of its steps."
        )
    lines = [_line(head), "|" + "---|" * len(head), *(_line(row) for row in rows), "", f"{facts(scenes)} {meaning}"]
    return "\n".join(lines) + "\n"


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def markers(folder: Path) -> tuple[str, str]:
    """Returns the lines of a page between which the table of a folder stands."""
    name = folder.resolve().name
    return f"<!-- simulations of {name} -->", f"<!-- /simulations of {name} -->"


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(
        prog="loop_table.py",
        description="Prints the simulations below a folder as a Markdown table: of one scene a row for each finder, of several a row for each.",
        epilog="example: loop_table.py results/live/small --write analysis/guides/simulator.md",
    )
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="written by kbvh loop --out, or a folder of such folders")
    parser.add_argument("--write", metavar="PAGE", type=Path, help="insert the table between the folder's markers in this page")
    options = parser.parse_args(arguments)

    def work() -> int:
        table = markdown(load_scenes(options.folder))
        if options.write is None:
            print(table, end="")
        else:
            page = options.write.read_text(encoding="utf-8")
            files.write_whole(options.write, files.inserted(page, *markers(options.folder), table, str(options.write)))
        return 0

    return files.run_command("loop_table.py", (LoopError, ResultError), work)
