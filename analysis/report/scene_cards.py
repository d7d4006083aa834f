"""The report's facts about a scene: its bodies, its measurement, its motion, and a picture."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd

from figures import scene_pictures
from figures.canvas import Picture
from results import text


def bodies(rows: pd.DataFrame) -> list[dict[str, str]]:
    """Returns facts on the bodies of a scene, at its largest size."""
    largest = rows.loc[rows["primitives"].idxmax()]
    return [
        {
            "name": str(body.get("name", "?")),
            "primitives": text.count(body.get("primitives")),
            "vertices": text.count(body.get("vertices")),
            "keyframes": text.count(body.get("keyframes")),
            "motion": "moves" if body.get("moving") else "rests",
            "degenerate": text.count(body.get("degenerate") or 0),
        }
        for body in largest["bodies"]
        if isinstance(body, dict)
    ]


def card(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Returns facts on a scene as measured: at its largest size, and over its sizes."""
    largest = rows.loc[rows["primitives"].idxmax()]
    mine = rows[rows["primitives"] == largest["primitives"]]
    sampled = mine[mine["pairs"].notna() & (mine["verified_frames"] > 0)]
    origins = {"built_in": "built into kbvh", "files": "read from files", "shapes": "made by formula"}
    sizes = text.listing([text.size(value) for value in sorted(rows["moving"].unique())])
    frames = text.listing([text.count(value) for value in sorted(mine["frames"].dropna().unique())])
    facts = [
        ("From", origins.get(str(largest["origin"]), "")),
        ("Moving primitives", sizes),
        ("Interpolated frames, l", text.listing([f"{value:g}" for value in sorted(rows["l"].unique())])),
        ("Frames of a clip", frames),
        ("Scalars", text.listing(sorted(rows["scalar"].unique()))),
        ("Seeds", text.listing(sorted(seed for seed in rows["seed"].unique() if seed))),
    ]
    if len(sampled):
        pairs = sampled["pairs"] / sampled["verified_frames"]
        facts.append(("Pairs that meet", f"{text.significant(float(pairs.median()))} in a frame, on average"))
    if len(largest["changes"]):
        facts.append(("Changes at run time", largest["changes"]))
    return [(name, value) for name, value in facts if value]


def violence(folder: Path) -> list[tuple[str, str]]:
    """Describes the motion of the moving bodies of a scene, from its card."""
    facts = []
    for body in scene_pictures.card(folder)["bodies"]:
        if body["keyframes"] > 1:
            facts.append((
                f"How violent: {body['name']}",
                f"{100 * body['sides_changed_per_keyframe']:.2g} % of the sides of its {text.size(body['nodes'])} nodes have "
                f"another realising vertex at the next keyframe (at most {100 * body['sides_changed_at_most']:.2g} %); a vertex "
                f"moves by {body['mean_step_in_edges']:.2g} edges (at most {body['largest_step_in_edges']:.2g})",
            ))  # fmt: skip
    return facts


def view(folder: Path, figures_folder: Path, scene: str) -> Picture:
    """Writes the picture of the scene at a few keyframes."""
    # By the folder, whose name ends with the scene's hash: what was drawn of another scene of this name is not shown.
    slug = re.sub(r"[^a-z0-9]+", "-", folder.name.lower()).strip("-") or "scene"
    file = figures_folder / f"{slug}-scene.png"
    width, height = scene_pictures.write(folder, file)
    reading = (
        "Some keyframes from the first to the last, with z upwards; each body has its own colour. "
        f"Drawn from the meshes in scenes/{folder.name}, which other programs can also open."
    )
    return Picture(file.stem, f"Picture of the scene: {scene}", reading, "", width // 2, height // 2)
