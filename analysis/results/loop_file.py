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
    time_step: float  #: in s
    seed: int
    detection: str  #: the way of the broad phase, or the strategy that found the pairs
    steps: pd.DataFrame  #: NEEDED; momentum as x, y, z; resident_bytes, NaN where it was not recorded
    frames: tuple[tuple[int, Path], ...]  #: step and OBJ file of each frame, in order

    @property
    def penetrations(self) -> int:
        """Returns the intersecting pairs of triangles, summed over steps."""
        return int(self.steps["penetrations"].sum())


def find(folder: Path) -> list[Path]:
    """Returns the folders of simulations in a folder of results: itself, and those in it and in its folder `loop`."""
    places = [folder, *sorted(folder.glob("*")), *sorted(folder.glob("loop/*"))]
    return [place for place in dict.fromkeys(places) if (place / FILE_NAME).is_file()]


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
    steps["resident_bytes"] = [float(record.get("resident_bytes") or "nan") for record in records]
    mesh, options = header["mesh"], header["options"]
    return Simulation(
        folder=folder,
        scene=str(options["scene"]),
        title=str(header["title"]),
        triangles=int(mesh["faces"]),
        obstacle_faces=int(mesh.get("obstacle_faces", 0)),
        driven=int(mesh.get("driven_vertices", 0)) > 0,
        time_step=float(header["physics"]["time_step_s"]),
        seed=int(options["seed"]),
        detection=str(options.get("strategy") or options["detection"]),
        steps=steps,
        frames=tuple(sorted((int(path.stem.split("_")[1]), path) for path in (folder / "frames").glob("frame_*.obj"))),
    )
