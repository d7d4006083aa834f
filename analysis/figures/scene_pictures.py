"""Draws pictures of a built-in scene: a few keyframes side by side, flat shaded.

The meshes are those that `kbvh scene NAME --out FOLDER` writes (every body as OBJ, and PC2 if it moves).

    build/release/kbvh scene dress --triangles 8000 --out /tmp/dress
    /usr/bin/python3 analysis/scene_pictures.py /tmp/dress dress.png --keyframes 0 20 40 59
"""

from __future__ import annotations

import argparse
import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional

import matplotlib.image
import numpy as np

from results import files

PALETTE = ((0.62, 0.30, 0.28), (0.86, 0.72, 0.60), (0.45, 0.55, 0.68))  # bodies, in the order of their files
WIDEST = 1.7  # of a panel, in heights
LIGHT = np.array((-0.45, 0.5, 0.75)) / 1.007  # as the viewer sees it: from the upper left, in front


@dataclass
class Mesh:
    """A body: positions [keyframe, vertex, 3] and triangles [triangle, 3]."""

    name: str
    positions: np.ndarray
    triangles: np.ndarray


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Returns vertices [n, 3] and triangles [m, 3] of an OBJ file; polygons are cut into fans."""
    vertices, triangles = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            ids = [int(w.split("/")[0]) - 1 for w in words[1:]]
            triangles += [(ids[0], ids[i], ids[i + 1]) for i in range(1, len(ids) - 1)]
    return np.array(vertices), np.array(triangles, dtype=np.int64)


def read_pc2(path: Path) -> np.ndarray:
    """Returns all samples of a PC2 point cache, [sample, vertex, 3]."""
    data = path.read_bytes()
    _, _, vertices, _, _, samples = struct.unpack("<12siiffi", data[:32])
    return np.frombuffer(data, dtype="<f4", offset=32).reshape(samples, vertices, 3).astype(float)


def read_scene(folder: Path) -> list[Mesh]:
    """Reads every OBJ of the folder with its PC2, in the order of their names (the body's number comes first)."""
    meshes = []
    for path in sorted(folder.glob("*.obj")):
        vertices, triangles = read_obj(path)
        cache = path.with_suffix(".pc2")
        positions = read_pc2(cache) if cache.exists() else vertices[None]
        meshes.append(Mesh(path.stem, positions, triangles))
    return meshes


def camera(azimuth: float) -> np.ndarray:
    """Returns rows: right, up, towards the viewer; degrees from +x, seen slightly from above."""
    a, e = np.radians(azimuth), np.radians(8)
    towards = np.array((np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)))
    right = np.cross((0, 0, 1), towards)
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(towards, right), towards))


def draw(image: np.ndarray, depth: np.ndarray, points: np.ndarray, triangles: np.ndarray,
         colour: tuple[float, float, float], view: np.ndarray, scale: float, origin: np.ndarray) -> None:
    """Rasterises triangles into image [h, w, 3] and depth [h, w]; origin is the world point in the middle."""
    height, width = depth.shape
    seen = (points - origin) @ view.T
    pixels = np.stack((width / 2 + scale * seen[:, 0], height / 2 - scale * seen[:, 1], seen[:, 2]), axis=1)
    corners = pixels[triangles]
    normals = np.cross(points[triangles[:, 1]] - points[triangles[:, 0]],
                       points[triangles[:, 2]] - points[triangles[:, 0]])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(size > 0, size, 1)
    normals *= np.sign(normals @ view[2])[:, None]  # cloth has two sides
    shade = 0.3 + 0.7 * np.clip(normals @ (view.T @ LIGHT), 0, 1)
    low = np.floor(corners.min(axis=1)).astype(int)
    high = np.ceil(corners.max(axis=1)).astype(int)
    for t in range(len(triangles)):
        x0, y0 = max(low[t, 0], 0), max(low[t, 1], 0)
        x1, y1 = min(high[t, 0] + 1, width), min(high[t, 1] + 1, height)
        if x0 >= x1 or y0 >= y1:
            continue
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[t]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
        v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
        w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
        z = az + v * (bz - az) + w * (cz - az)
        window = depth[y0:y1, x0:x1]
        visible = (v >= 0) & (w >= 0) & (v + w <= 1) & (z > window)
        window[visible] = z[visible]
        image[y0:y1, x0:x1][visible] = np.array(colour) * shade[t]


def picture(meshes: list[Mesh], keyframes: list[int], azimuth: float, height: int) -> np.ndarray:
    """Draws the keyframes side by side, all at one scale and around one point, [height, width, 3]."""
    view = camera(azimuth)
    panels = []
    moments = [[m.positions[min(keyframe, len(m.positions) - 1)] for m in meshes] for keyframe in keyframes]
    seen = np.concatenate([points @ view.T for at in moments for points in at])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = 0.5 * (low + high) @ view
    spans = np.maximum(high - low, 1e-30)
    width = int(height * min(max(0.55, 1.05 * spans[0] / spans[1]), WIDEST))
    scale = 0.95 * min(height / spans[1], width / spans[0])
    for at in moments:
        image = np.ones((height, width, 3))
        depth = np.full((height, width), -np.inf)
        for i, (mesh, points) in enumerate(zip(meshes, at)):
            draw(image, depth, points, mesh.triangles, PALETTE[i % len(PALETTE)], view, scale, middle)
        panels.append(image)
    return np.concatenate(panels, axis=1)


class MeshError(Exception):
    """Reports unreadable meshes of a scene in one clause."""


@dataclass
class WrittenOut:
    """The folders of a study's scenes, and sentences about those with unreadable cards."""

    by_hash: dict[str, Path]
    by_name: dict[str, Path]  #: written before scenes had hashes
    notes: list[str]

    def of(self, rows: Any) -> Optional[Path]:
        """Returns the folder of the last of these runs whose scene was written; None if there is none."""
        for row in reversed(list(rows[["card", "scene_name"]].itertuples())):
            found = self.by_hash.get(row.card) if row.card else self.by_name.get(row.scene_name.replace("/", "-"))
            if found is not None:
                return found
        return None


def written_out(results: Path) -> WrittenOut:
    """Returns the scenes that `kbvh run --out RESULTS` has written."""
    found = WrittenOut({}, {}, [])
    for file in sorted((results / "scenes").glob("*/card.json")):
        try:
            scene_hash = card(file.parent).get("hash", "")
        except MeshError as problem:
            found.notes.append(f"A scene is shown without a picture: {problem}.")
            continue
        if scene_hash:
            found.by_hash[scene_hash] = file.parent
        else:
            found.by_name[file.parent.name] = file.parent
    return found


CARD_NUMBERS = ("keyframes", "nodes", "sides_changed_per_keyframe", "sides_changed_at_most", "mean_step_in_edges", "largest_step_in_edges")  # fmt: skip


def card(folder: Path) -> dict[str, Any]:
    """Returns the content of card.json. Raises MeshError."""
    file = folder / "card.json"
    try:
        found = files.read_json(file)
        bodies = [(body["name"], [float(body[name]) for name in CARD_NUMBERS]) for body in found["bodies"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as problem:
        raise MeshError(f"{file} cannot be read ({problem})") from None
    return {**found, "bodies": [{"name": name, **dict(zip(CARD_NUMBERS, numbers))} for name, numbers in bodies]}


def write(folder: Path, file: Path, height: int = 420) -> tuple[int, int]:
    """Draws all keyframes of a folder, unless the file is newer; returns width and height in pixels."""
    if not (file.exists() and file.stat().st_mtime > (folder / "card.json").stat().st_mtime):
        try:
            meshes = [mesh for mesh in read_scene(folder) if len(mesh.triangles)]
            keyframes = list(range(max((len(mesh.positions) for mesh in meshes), default=0)))
            image = picture(meshes, keyframes, 50.0, height) if keyframes else np.ones((height, height, 3))
        except (OSError, ValueError, IndexError, struct.error) as problem:
            raise MeshError(f"the meshes in {folder} cannot be read ({problem})") from None
        file.parent.mkdir(parents=True, exist_ok=True)
        drawn = io.BytesIO()
        matplotlib.image.imsave(drawn, np.clip(image, 0, 1), format="png")
        files.write_whole(file, drawn.getvalue())
    return int(matplotlib.image.imread(file).shape[1]), int(matplotlib.image.imread(file).shape[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder written by `kbvh scene NAME --out FOLDER`")
    parser.add_argument("out", type=Path, help="PNG file")
    parser.add_argument("--keyframes", type=int, nargs="+", default=[0, 15, 30, 45])
    parser.add_argument("--azimuth", type=float, default=50.0, help="direction of the viewer, degrees from +x")
    parser.add_argument("--height", type=int, default=700, help="pixels")
    options = parser.parse_args()
    meshes = read_scene(options.folder)
    if not meshes:
        raise SystemExit(f"{options.folder}: no OBJ files")
    matplotlib.image.imsave(options.out, np.clip(picture(meshes, options.keyframes, options.azimuth,
                                                         options.height), 0, 1))
