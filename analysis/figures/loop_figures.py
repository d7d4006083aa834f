"""Draws a simulation of `kbvh loop`: a film strip of its frames, and its energies, momentum, gaps and times over time.

usage: loop_pictures.py FOLDER [--out DIR] [--frames N] [--azimuth DEGREES]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from figures import canvas, scene_pictures
from results import files
from results.loop_file import LoopError, Simulation, load
from results.text import count, significant, tick

WIDTH = 10.5  #: of every figure, in inches
OBSTACLE = (0.66, 0.65, 0.62)
BODIES = (
    (0.45, 0.55, 0.68), (0.80, 0.47, 0.36), (0.58, 0.66, 0.42), (0.86, 0.72, 0.50), (0.60, 0.46, 0.62), (0.42, 0.64, 0.64),
)  # fmt: skip
#: Lines, from dark to light, so that they differ in grey, too.
BLUE, RED, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#999999"


def components(triangles: np.ndarray, vertices: int) -> np.ndarray:
    """Returns a number for each triangle [n]: that of its connected body, counted from 0 in the order of first vertices."""
    label = np.arange(vertices)
    while True:
        lowest = label[triangles].min(axis=1)
        lower = label.copy()
        np.minimum.at(lower, triangles.ravel(), np.repeat(lowest, 3))
        lower = lower[lower]
        if (lower == label).all():
            break
        label = lower
    return np.unique(label[triangles[:, 0]], return_inverse=True)[1] if len(triangles) else np.zeros(0, dtype=int)


def chosen(frames: int, wanted: int) -> list[int]:
    """Returns the places of at most `wanted` frames at equal distances, the first and the last one included."""
    return sorted({int(place) for place in np.linspace(0, frames - 1, min(frames, wanted)).round()})


def film(simulation: Simulation, frames: int = 6, azimuth: float = 50.0) -> Optional[Figure]:
    """Draws frames side by side, all at one scale; None without frames. The view follows a figure that walks. Raises LoopError."""
    if not simulation.frames:
        return None
    shown = [simulation.frames[place] for place in chosen(len(simulation.frames), frames)]
    try:
        meshes = [scene_pictures.read_obj(path) for _, path in shown]
        triangles = meshes[0][1]
        points = [vertices for vertices, _ in meshes]
        if any(vertices.shape != points[0].shape for vertices in points) or triangles.max() >= len(points[0]):
            raise ValueError("they have different meshes")
    except (OSError, ValueError, IndexError) as problem:
        raise LoopError(f"the frames in {simulation.folder / 'frames'} cannot be read ({problem}).") from None
    panels = _panels(simulation, points, triangles, scene_pictures.camera(azimuth))
    tall = panels[0].shape[0] / panels[0].shape[1] * WIDTH / len(panels)
    figure = Figure(figsize=(WIDTH, tall + 0.3), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.01, h_pad=0.01, wspace=0, hspace=0)
    for place, (panel, (step, _)) in enumerate(zip(panels, shown)):
        axes = figure.add_subplot(1, len(panels), place + 1)
        axes.imshow(panel, interpolation="antialiased")
        axes.set_axis_off()
        axes.set_title(f"{significant(step * simulation.time_step)} s", loc="center", fontweight="normal", fontsize=8.5)
    return figure


def _panels(simulation: Simulation, points: list[np.ndarray], triangles: np.ndarray, view: np.ndarray) -> list[np.ndarray]:
    """Rasterises all frames, [height, width, 3] each."""
    obstacles, bodies = triangles[: simulation.obstacle_faces], triangles[simulation.obstacle_faces :]
    number = components(bodies, len(points[0]))
    colour = np.array([BODIES[one % len(BODIES)] for one in range(int(number.max(initial=-1)) + 1)])
    looked_at = _looked_at(simulation, points[0], obstacles, bodies)
    boxes = [(seen.min(axis=0), seen.max(axis=0)) for seen in (at[looked_at] @ view.T for at in points)]
    follows = simulation.driven and simulation.obstacle_faces > 0
    if not follows:
        low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
        boxes = [(low, high)] * len(boxes)
    spans = np.max([high - low for low, high in boxes], axis=0)
    width = 440
    height = int(width * min(max(spans[1] / spans[0], 0.55), 1.7))
    scale = 0.94 * min(width / spans[0], height / spans[1])
    images = []
    for at, (low, high) in zip(points, boxes):
        image, depth = np.ones((height, width, 3)), np.full((height, width), -np.inf)
        middle = 0.5 * (low + high) @ view
        scene_pictures.draw(image, depth, at, obstacles, OBSTACLE, view, scale, middle)
        for one in range(len(colour)):
            scene_pictures.draw(image, depth, at, bodies[number == one], tuple(colour[one]), view, scale, middle)
        images.append(np.clip(image, 0, 1))
    return images


def _looked_at(simulation: Simulation, at: np.ndarray, obstacles: np.ndarray, bodies: np.ndarray) -> np.ndarray:
    """Returns the vertices that have to be in the picture: those of all bodies, and of obstacles unless they are a floor that is
    much larger."""
    soft = np.unique(bodies)
    hard = np.unique(obstacles)
    if not len(hard) or not len(soft):
        return np.concatenate((hard, soft))
    sizes = [float(np.ptp(at[ids], axis=0).max()) for ids in (hard, soft)]
    return np.concatenate((hard, soft)) if simulation.driven or sizes[0] < 1.5 * sizes[1] else soft


def _line(axes: Axes, x: Sequence[float], y: Sequence[float], colour: str, label: str = "", **more: object) -> None:
    axes.plot(x, y, color=colour, label=label, linewidth=1.1, **more)


def _panel(figure: Figure, place: int, title: str, log: bool = False) -> Axes:
    axes = figure.add_subplot(2, 3, place)
    axes.set_title(title)
    axes.grid(True)
    if log:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: tick(float(f"{value:.6g}"))))
    if place > 3:
        axes.set_xlabel("simulated time, s")
    return axes


def _key(axes: Axes) -> None:
    """Draws the key above the lines: the axis grows by its height."""
    key = axes.legend(loc="upper right", frameon=False, fontsize=7.5, handlelength=1.4, labelspacing=0.25, borderaxespad=0.2)
    low, high = axes.get_ylim()
    share = 0.1 * len(key.get_texts())
    axes.set_ylim(low, high * (high / low) ** share if axes.get_yscale() == "log" else high + share * (high - low))


def over_time(simulation: Simulation) -> Optional[Figure]:
    """Draws energy, momentum, smallest gap and penetrations, contacts, times and memory of each step; None without steps."""
    steps = simulation.steps
    if steps.empty:
        return None
    x = steps["time_s"]
    figure = Figure(figsize=(WIDTH, 4.7), layout="constrained")

    axes = _panel(figure, 1, "energy, J")
    height = steps["gravitational_j"] - steps["gravitational_j"].min()
    total = steps["kinetic_j"] + height + steps["elastic_j"] + steps["barrier_j"]
    _line(axes, x, total, "#222222", "sum")
    _line(axes, x, height, BLUE, "of height, over its least")
    _line(axes, x, steps["kinetic_j"], RED, "of motion")
    _line(axes, x, steps["elastic_j"], GREEN, "elastic")
    _line(axes, x, steps["barrier_j"], GREY, "of contact")
    _key(axes)

    axes = _panel(figure, 2, "momentum of free vertices, kg m/s")
    for axis, colour in (("x", BLUE), ("y", RED), ("z", "#222222")):
        _line(axes, x, steps[axis], colour, axis)
    _key(axes)

    found = simulation.penetrations
    axes = _panel(figure, 3, f"smallest gap, mm; {count(found)} penetrations", log=True)
    _line(axes, x, 1e3 * steps["smallest_gap_m"].clip(lower=1e-12), BLUE)
    through = steps[steps["penetrations"] > 0]
    if len(through):
        _line(axes, through["time_s"], 1e3 * through["smallest_gap_m"].clip(lower=1e-12), RED, "a step with penetrations",
              linestyle="none", marker="x", markersize=5)  # fmt: skip
        _key(axes)

    axes = _panel(figure, 4, "contacts")
    _line(axes, x, steps["contacts"], BLUE)

    axes = _panel(figure, 5, "ms a step", log=True)
    for name, colour, label in (("rest_ms", GREY, "the rest of the step"), ("impact_ms", GREEN, "impacts"), ("detect_ms", BLUE, "detection")):
        _line(axes, x, steps[name].clip(lower=1e-4), colour, label)
    _key(axes)

    axes = _panel(figure, 6, "memory, MB")
    if steps["resident_bytes"].notna().any():
        _line(axes, x, steps["resident_bytes"] / 1e6, GREY, "program")
    _line(axes, x, steps["memory_bytes"] / 1e6, BLUE, "broad phase and solver")
    axes.set_ylim(bottom=0)
    _key(axes)
    return figure


FILM_READING = (
    "The states of a simulation side by side, from left to right, at the simulated times above them. Obstacles are grey; each soft body "
    "has its own colour."
)
STEPS_READING = (
    "All over simulated time. Implicit Euler takes energy away; scripts and gravity add some. The smallest gap is the smallest distance of "
    "two surfaces without their thickness, or the barrier's reach where none are near; it never reaches 0, and a cross marks a step after which triangles "
    "intersected."
)


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(
        prog="loop_pictures.py",
        description="Draws FOLDER/frames as DIR/film.png, and FOLDER/loop.jsonl as DIR/steps.png.",
        epilog="example: kbvh loop --scene walker --frames 10 --out results/walker; loop_pictures.py results/walker",
    )
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="folder written by kbvh loop --out FOLDER --frames N")
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to write (FOLDER)")
    parser.add_argument("--frames", type=int, default=6, help="of the film strip (6)")
    parser.add_argument("--azimuth", type=float, default=50.0, help="direction of the viewer, degrees from +x (50)")
    options = parser.parse_args(arguments)

    def work() -> int:
        simulation = load(options.folder)
        out = options.out or options.folder
        out.mkdir(parents=True, exist_ok=True)
        if not simulation.frames:
            print(f"{options.folder} has no frames to draw: kbvh loop writes them with --frames")
        for name, draw in (("film", lambda: film(simulation, options.frames, options.azimuth)), ("steps", lambda: over_time(simulation))):
            drawn = canvas.small_png(draw)
            if drawn:
                files.write_whole(out / f"{name}.png", drawn)
                print(out / f"{name}.png")
        return 0

    return files.run_command("loop_pictures.py", (LoopError,), work)
