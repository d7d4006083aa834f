"""Reads what `kbvh loop --out FOLDER` writes: loop.jsonl, and the frames next to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from results import files

FILE_NAME = "loop.jsonl"
SCHEMA = "kbvh-loop-1"
#: Keys of a step, all numbers but the momentum.
NEEDED = (
    "step", "time_s", "iterates", "contacts", "smallest_gap_m", "penetrations", "detect_ms", "impact_ms", "rest_ms",
    "kinetic_j", "gravitational_j", "elastic_j", "barrier_j", "memory_bytes",
)  # fmt: skip


class LoopError(Exception):
    """Reports an unusable simulation in one sentence."""


@dataclass(frozen=True)
class Simulation:
    """A simulation: its description, and a row for each step."""

    folder: Path
    scene: str
    title: str
    triangles: int  #: of all bodies
    obstacle_faces: int  #: the first so many triangles belong to obstacles
    driven: bool  #: a script moves some of its vertices
    finder: str  #: what found the pairs: broad_phase, or the strategy with its parameters
    baseline: bool  #: a refit that others are compared with
    exact: bool  #: every pair is promised
    commit: str
    dirty: bool  #: of a program with local changes
    when: str
    cpu: str
    time_step: float  #: in s
    seed: int
    detection: str  #: the way of the broad phase, or the strategy that found the pairs
    steps: pd.DataFrame  #: NEEDED; momentum as x, y, z; the hash `state`; resident_bytes, NaN where it was not recorded
    frames: tuple[tuple[int, Path], ...]  #: step and OBJ file of each frame, in order

    @property
    def penetrations(self) -> int:
        """Returns the intersecting pairs of triangles, summed over steps."""
        return int(self.steps["penetrations"].sum())

    @property
    def of(self) -> tuple[str, int, int]:
        """Returns what it shares with simulations of the same motion whose pairs another finder found."""
        return self.scene, self.triangles, self.seed

    @property
    def memory_mb(self) -> tuple[float, float]:
        """Returns the largest memory of the program in the first and in the last tenth of the steps."""
        tenth = (len(self.steps) + 9) // 10
        first, last = (self.steps["resident_bytes"].iloc[part].max() / 1e6 for part in (slice(None, tenth), slice(-tenth, None)))
        return first, last


def find(folder: Path) -> list[Path]:
    """Returns the folders of simulations in a folder of results: itself, and all below it, in the order of their names."""
    return sorted(file.parent for file in folder.rglob(FILE_NAME) if file.is_file())


def load(folder: Path) -> Simulation:
    """Reads a simulation; one that was ended in the middle of a line is read to the line before. Raises LoopError."""
    file = folder / FILE_NAME
    try:
        text = file.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise LoopError(f"{file} cannot be read: {problem}.") from None
    lines = [line for line in text.split("\n")[:-1] if line]
    try:
        records = [files.parse_json(line) for line in lines]
        if not records or records[0].get("schema") != SCHEMA:
            raise LoopError(f"{file} does not begin with the schema {SCHEMA}.")
        return _simulation(folder, records[0], records[1:])
    except KeyError as problem:
        raise LoopError(f"{file} is not what `kbvh loop` writes: the field {problem.args[0]} is missing.") from None
    except (ValueError, TypeError, AttributeError, IndexError):
        raise LoopError(f"{file} is not what `kbvh loop` writes: a line or a field is of the wrong kind.") from None


def _simulation(folder: Path, header: dict[str, Any], records: list[dict[str, Any]]) -> Simulation:
    steps = pd.DataFrame({name: [float(record[name]) for record in records] for name in NEEDED})
    for place, axis in enumerate("xyz"):
        steps[axis] = [float(record["momentum_kg_m_s"][place]) for record in records]
    steps["state"] = [str(record["state"]) for record in records]
    steps["resident_bytes"] = [float(record.get("resident_bytes") or "nan") for record in records]
    mesh, options = header["mesh"], header["options"]
    strategy, way = options.get("strategy"), str(options["detection"])
    params = ", ".join(f"{key}={value}" for key, value in options.get("params", {}).items())
    finder = str(strategy) + (f" [{params}]" if params else "") if strategy else "broad_phase" + (f", {way}" if way != "refit" else "")
    return Simulation(
        folder=folder,
        scene=str(options["scene"]),
        title=str(header["title"]),
        triangles=int(mesh["faces"]),
        obstacle_faces=int(mesh.get("obstacle_faces", 0)),
        driven=int(mesh.get("driven_vertices", 0)) > 0,
        time_step=float(header["physics"]["time_step_s"]),
        seed=int(options["seed"]),
        detection=str(strategy or way),
        finder=finder,
        baseline=bool(header.get("baseline", False)),
        exact=bool(header.get("exact", True)),
        commit=str(header["commit"]),
        dirty=bool(header["dirty"]),
        when=str(header["when"]),
        cpu=str(header["machine"]["cpu"]),
        steps=steps,
        frames=tuple(sorted((int(path.stem.split("_")[1]), path) for path in (folder / "frames").glob("frame_*.obj"))),
    )
