"""Checks whether a strategy keeps its promises."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Optional, Sequence, Type, Union

import numpy as np

from . import _core
from .own import Strategy
from .scenes import Body, Scene, scene
from .world import Words, World


#: The largest scenes that are compared with brute force, too, in pairs of primitives.
_BRUTE_FORCE = 1_000_000


def _soups(seed: int) -> Scene:
    """Two soups of triangles whose vertices drift at random."""
    random = np.random.default_rng(seed)
    bodies = []
    for name in ("a", "b"):
        centres = random.uniform(0, 1, (24, 1, 3))
        first = (centres + random.normal(0, 0.12, (24, 3, 3))).reshape(-1, 3)
        positions = np.stack([first + k * random.normal(0, 0.2, first.shape) for k in range(3)])
        bodies.append(Body(np.arange(72), positions, times=[0.0, 0.5, 1.0], name=name))
    return Scene(bodies, name="soups")


def _ties() -> Scene:
    """Two combs of triangles on whole numbers, which touch in points, edges and planes at many frames."""
    base = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0]], dtype=float)
    rows = np.concatenate([base + [x, y, 0] for x in range(0, 6, 2) for y in range(0, 6, 2)])
    moved = np.stack([rows + [0, 0, 2], rows, rows - [1, 1, 2]])
    ids = np.arange(len(rows))
    return Scene([Body(ids, rows, name="rest"), Body(ids, moved, times=[0.0, 1.0, 2.0], name="passes")], name="ties")


def small_scenes() -> list[Scene]:
    """Returns the scenes on which `check` plays a strategy, small enough for brute force.

    >>> [one.name for one in kbvh.small_scenes()]
    ['soups', 'ties', 'waving_sheet-200-80', 'running_figures-400', 'tightening_knot-240']
    """
    return [
        _soups(1),
        _ties(),
        scene("waving_sheet", triangles=200, keyframes=3, obstacle=80),
        scene("running_figures", triangles=400, keyframes=3),
        scene("tightening_knot", triangles=240, keyframes=3),
    ]


@dataclass
class Verdict:
    """What a strategy did on one scene, in one precision. Counts are sums over frames; `missed_pairs` and `extra_pairs` are those
    of the first wrong frame, at `wrong_at` (seconds)."""

    strategy: str
    scene: str
    precision: str
    holds: bool
    why: str
    frames: int = 0
    pairs: int = 0
    missed_candidates: int = 0
    missed: int = 0
    extra: int = 0
    repeated: int = 0
    audit: Optional[dict[str, Any]] = None
    wrong_at: Optional[float] = None
    missed_pairs: list[tuple[int, int, int, int]] = field(default_factory=list)
    extra_pairs: list[tuple[int, int, int, int]] = field(default_factory=list)
    left_out: bool = False

    def __str__(self) -> str:
        name = f"{self.strategy} on {self.scene}, {self.precision}"
        if self.left_out:
            return f"{name}: left out, {self.why}"
        counts = f"{self.frames} frames, {self.pairs} pairs, {self.missed} missed, {self.extra} extra"
        if self.holds:
            return f"{name}: holds ({counts})"
        lists = [
            f"{word} at t = {self.wrong_at:g}: {', '.join(f'({a}:{i}, {b}:{j})' for a, i, b, j in pairs[:5])}"
            + (f" and {len(pairs) - 5} more" if len(pairs) > 5 else "")
            for word, pairs in (("missed", self.missed_pairs), ("extra", self.extra_pairs))
            if pairs
        ]
        return "\n  ".join([f"{name}: BROKEN, {self.why} ({counts})", *lists])


def _compare(verdict: Verdict, play: Scene, params: Optional[Words], topology: Optional[Words], l: int) -> None:
    """Plays until the first frame whose pairs differ from those of brute force, and lists them."""
    world = World(play, verdict.strategy, params, precision=verdict.precision, topology=topology)
    for t in world.play(l):
        answer: set[tuple[int, int, int, int]] = {tuple(pair) for pair in world.pairs().tolist()}
        truth: set[tuple[int, int, int, int]] = {tuple(pair) for pair in world.true_pairs().tolist()}
        if answer != truth:
            verdict.wrong_at = t
            verdict.missed_pairs, verdict.extra_pairs = sorted(truth - answer), sorted(answer - truth)
            return


def _unsuitable(strategy: dict[str, Any], play: Scene, precision: str) -> str:
    """Returns why a strategy does not take part in a scene; empty if it does."""
    if precision not in strategy["precisions"]:
        return f"it does not exist in {precision}"
    if any(a == b for a, b in play.pairs_asked() or ()) and "self_pairs" not in strategy["abilities"]:
        return "it does not answer pairs within a body"
    bent = any(np.any(numbers) for body in play.bodies for numbers in (body.bends, body.twists) if numbers is not None)
    if bent and "curves" not in strategy["abilities"]:
        return "it foresees linear motion only, and vertices move on curves"
    if play.radius is not None:
        return "" if "control_nets" in strategy["primitives"] else "it does not take a radius"
    others = [body.shape for body in play.bodies if body.shape not in strategy["primitives"]]
    return f"it does not take {others[0]}" if others else ""


def check(
    strategy: Union[str, Type[Strategy]],
    scenes: Optional[Sequence[Scene]] = None,
    params: Optional[Words] = None,
    *,
    topology: Optional[Words] = None,
    precisions: Sequence[str] = ("float32", "float64"),
    l: int = 5,
) -> list[Verdict]:
    """Compares a strategy with the truth, at l frames per keyframe interval: its pairs with those of the judge and, on small
    scenes, of brute force; its bounds, if it shows them, with the vertices below them. By default on `small_scenes`. An error
    raised by a strategy in Python counts as a broken guarantee; wrong parameters raise ConfigError.

    >>> for verdict in kbvh.check("bottom_up", kbvh.small_scenes()[:2], precisions=["float32"]): print(verdict)
    bottom_up on soups, float32: holds (11 frames, 284 pairs, 0 missed, 0 extra)
    bottom_up on ties, float32: holds (11 frames, 41 pairs, 0 missed, 0 extra)
    """
    id = strategy if isinstance(strategy, str) else strategy.id
    listed = {row["id"]: row for row in _core.list_strategies()}
    verdicts = []
    for play in small_scenes() if scenes is None else scenes:
        for precision in precisions:
            verdict = Verdict(id, play.name, precision, False, "")
            verdicts.append(verdict)
            world = World(play, precision=precision)
            if id in listed and (why := _unsuitable(listed[id], play, precision)):
                verdict.left_out, verdict.holds, verdict.why = True, True, why
                continue
            try:
                found = world.verify(id, params, frames=world.frames(l), topology=topology)
            except _core.ConfigError:
                raise
            except Exception as error:  # of the strategy: any
                if listed.get(id, {}).get("family") != "python":
                    raise
                verdict.why = f"{type(error).__name__}: {error}"
                continue
            verdict.holds, verdict.why = found["holds"], found["first_violation"]
            for name in ("frames", "pairs", "missed_candidates", "missed", "extra", "repeated", "audit"):
                setattr(verdict, name, found[name])
            small = play.primitives**2 <= _BRUTE_FORCE and listed[id]["guarantee"] != "approximate"
            if small or not verdict.holds:
                _compare(verdict, play, params, topology, l)
            if verdict.holds and verdict.wrong_at is not None:
                verdict.holds, verdict.why = False, f"brute force finds other pairs at t = {verdict.wrong_at:g}"
    return verdicts
