"""Scenes: from arrays, from files, by formula and built in."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _core

#: A path of a file.
PathLike = Union[str, "os.PathLike[str]"]


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


@dataclass
class Body:
    """A mesh and its motion.

    `positions` is [keyframe][vertex][3] with keyframes at `times` (seconds, increasing), between which vertices move on straight
    lines; or [vertex][3] for a body at rest, or for one whose motion is unknown (`known` is False): its positions are then set
    frame by frame. `indices` is [triangle][3], or a flat list of vertices that `offsets` cuts into primitives: primitive p has
    indices[offsets[p]:offsets[p + 1]]. A polygon of more than three corners is cut into triangles once, at its first positions,
    whatever its first corner; from then on it is the union of these triangles. Arrays are used as they are: nothing is copied
    before a world is made.

    With `bends` or `twists`, each [keyframe - 1][vertex][3], vertices move on curves instead of lines: with the share s of the
    way from one keyframe to the next, from 0 to 1, a coordinate is x0 (1 - s) + x1 s + s (1 - s) (bend + twist s). Strategies
    that foresee straight lines refuse such a body.

    `over` is another body whose vertices this one consists of, as the edges of a mesh do: it then has the positions, times and
    motion of that body, which comes before it in a scene. Primitives with a common vertex are no pair, also in two such bodies.
    `elements` makes such bodies.

    >>> import numpy as np
    >>> kbvh.Body([[0, 1, 2]], np.zeros((2, 3, 3)), times=[0, 1]).keyframes
    2
    >>> face = kbvh.Body([[0, 1, 2]], np.eye(3))
    >>> kbvh.Body([0, 1], offsets=[0, 2], over=face, name="edge").vertices
    3
    """

    indices: npt.ArrayLike
    positions: npt.ArrayLike = ()
    times: Optional[npt.ArrayLike] = None
    offsets: Optional[npt.ArrayLike] = None
    shape: str = "polygons"
    name: str = "body"
    known: bool = True
    #: Whether pairs within the body are requested, too.
    self_pairs: bool = False
    #: The curves between keyframes; None: all zero.
    bends: Optional[npt.ArrayLike] = None
    twists: Optional[npt.ArrayLike] = None
    #: The body whose vertices this one consists of; None: its own.
    over: Optional[Body] = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.over is not None:
            if not isinstance(self.over, Body):
                raise TypeError(f"body '{self.name}': over is a Body, not {type(self.over).__name__}")
            if np.size(self.positions) or self.times is not None or not self.known or self.bends is not None or self.twists is not None:
                raise ValueError(f"body '{self.name}': positions, times, curves and known are those of '{self.over.name}'")
            self.positions, self.times, self.known = self.over.positions, self.over.times, self.over.known
            self.bends, self.twists = self.over.bends, self.over.twists
        self.positions = np.asarray(self.positions)
        if self.positions.ndim not in (2, 3) or self.positions.shape[-1] != 3:
            raise ValueError(
                f"body '{self.name}': positions are [vertex][3] or [keyframe][vertex][3], not {list(self.positions.shape)}"
            )
        if self.times is None and self.positions.ndim == 3:
            raise ValueError(f"body '{self.name}': {_counted(self.positions.shape[0], 'keyframe')} without times")
        if self.times is not None and np.size(self.times) != self.keyframes:
            raise ValueError(f"body '{self.name}': {_counted(np.size(self.times), 'time')}, but positions at {_counted(self.keyframes, 'keyframe')}")
        if not self.known and self.positions.ndim == 3:
            raise ValueError(f"body '{self.name}': an unknown motion has no keyframes")
        for word, numbers in (("bends", self.bends), ("twists", self.twists)):
            if numbers is not None and np.shape(numbers) != (self.keyframes - 1, self.vertices, 3):
                raise ValueError(
                    f"body '{self.name}': {word} are [{self.keyframes - 1}][{self.vertices}][3], not {list(np.shape(numbers))}"
                )

    @property
    def keyframes(self) -> int:
        """The number of keyframes."""
        return 1 if np.ndim(self.positions) == 2 else int(np.shape(self.positions)[0])

    @property
    def vertices(self) -> int:
        """The number of vertices."""
        return int(np.shape(self.positions)[-2])

    @property
    def primitives(self) -> int:
        """The number of primitives."""
        return int(np.size(self.indices)) // 3 if self.offsets is None else int(np.size(self.offsets)) - 1


def elements(body: Body, which: str, name: Optional[str] = None, self_pairs: bool = False) -> Body:
    """Returns the "vertices", "edges" or "faces" of a body as a body over its vertices. Vertices and faces keep their numbers;
    edges are the sides of its polygons, each once, in the order of their larger and then of their smaller vertex.

    >>> import numpy as np
    >>> cloth = kbvh.Body([[0, 1, 2], [2, 1, 3]], np.zeros((4, 3)), name="cloth")
    >>> kbvh.elements(cloth, "edges").indices.reshape(-1, 2).tolist()
    [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    >>> world = kbvh.World([cloth, kbvh.elements(cloth, "vertices")], "bottom_up", radius=0.5)
    >>> sorted((int(pair["primitive_a"]), int(pair["primitive_b"])) for pair in world.pairs())
    [(0, 3), (1, 0)]
    """
    if which not in ("vertices", "edges", "faces"):
        raise ValueError(f"elements are vertices, edges or faces, not '{which}'")
    if which != "vertices" and body.shape != "polygons":
        raise ValueError(f"body '{body.name}' consists of {body.shape.replace('_', ' ')} and has no {which}")
    indices, offsets = body.indices, body.offsets
    if which == "vertices":
        indices, offsets = np.arange(body.vertices, dtype=np.uint32), np.arange(body.vertices + 1, dtype=np.uint32)
    if which == "edges":
        corners = np.ravel(indices).astype(np.int64)
        if offsets is None and len(corners) % 3:
            raise ValueError(f"body '{body.name}': {len(corners)} indices do not make triangles")
        begins: npt.NDArray[Any] = np.arange(0, len(corners) + 1, 3) if offsets is None else np.asarray(offsets, dtype=np.int64)
        following = np.arange(1, len(corners) + 1)
        following[begins[1:] - 1] = begins[:-1]
        sides = np.stack([corners, corners[following]], axis=1)
        sides = np.sort(sides[sides[:, 0] != sides[:, 1]], axis=1)
        larger_first = np.unique(sides[:, ::-1], axis=0)
        indices = larger_first[:, ::-1].astype(np.uint32).ravel()
        offsets = np.arange(0, 2 * len(larger_first) + 1, 2, dtype=np.uint32)
    return Body(indices, offsets=offsets, name=f"{body.name}-{which}" if name is None else name, self_pairs=self_pairs, over=body)


@dataclass
class PlanChange:
    """New plans of some vertices of a body: from their position at `time` on straight lines through `positions`
    ([vertex][knot][3]) at `times` ([knot], seconds), then with `velocities` ([vertex][3], units per second) for ever."""

    time: float
    body: int
    vertices: npt.NDArray[np.uint32]
    velocities: npt.NDArray[np.float64]
    times: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    positions: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0, 3)))


@dataclass
class Scene:
    """Bodies, and the pairs of bodies that are asked about: all pairs with a moving body, unless `pairs` lists them.

    With a `radius` all pairs are those of boxes grown by half of it: of two primitives at a distance of at most `radius` none is
    missing, as a broad phase has to find them. 0 asks for overlaps of boxes, None for exact intersections."""

    bodies: Sequence[Body]
    pairs: Optional[Sequence[tuple[int, int]]] = None
    name: str = "scene"
    notes: Sequence[str] = ()
    #: Whether plans change at run time (see `script`).
    changes: bool = False
    radius: Optional[float] = None
    _source: Optional[tuple[str, str]] = field(default=None, repr=False)

    @property
    def primitives(self) -> int:
        """The number of primitives of all bodies."""
        return sum(body.primitives for body in self.bodies)

    def pairs_asked(self) -> Optional[list[tuple[int, int]]]:
        """Returns the pairs of bodies for a world; None for the default."""
        own = [(i, i) for i, body in enumerate(self.bodies) if body.self_pairs]
        if self.pairs is not None:
            return [*self.pairs, *(pair for pair in own if pair not in self.pairs)]
        if not own:
            return None
        moving = [body.keyframes > 1 or not body.known for body in self.bodies]
        count = len(self.bodies)
        between = [(a, b) for a in range(count) for b in range(a + 1, count)]
        return ([pair for pair in between if moving[pair[0]] or moving[pair[1]]] or between) + own

    def script(self, precision: str = "float32", l: int = 1) -> tuple[npt.NDArray[np.float64], list[PlanChange]]:
        """Returns the frames of a described scene, l per interval between keyframes, and its changes of plans in order of time,
        each to be made after the query of the frame at its time.

        >>> frames, changes = kbvh.scene("reversing_spheres", triangles=80, keyframes=30).script()
        >>> len(frames), changes[0].velocities.shape[1]
        (30, 3)
        """
        if self._source is None:
            raise ValueError(f"'{self.name}' is made of arrays and has no script")
        if precision not in ("float32", "float64"):
            raise ValueError(f"a precision is float32 or float64, not '{precision}'")
        frames, changes = _core.make_scene(*self._source, precision, l)["played"]
        return frames, [PlanChange(t, body, ids, velocities, times, knots) for t, body, ids, times, knots, velocities in changes]


def scene(description: Union[str, Mapping[str, Any]], folder: PathLike = ".", **keys: Any) -> Scene:
    """Makes a scene from the description that a plan has (experiments/RESULTS.md): the name of a built-in scene with its keys
    (triangles, keyframes, seed, obstacle, order, self, radius), or bodies from files, by formula, and of elements of others.
    Relative files are relative to `folder`. Raises InputError.

    >>> kbvh.scene("tablecloth", triangles=200, keyframes=2).bodies[0].positions.shape
    (2, 121, 3)
    >>> [body.name for body in kbvh.scene({"bodies": [{"shape": "sphere", "triangles": 80}]}).bodies]
    ['icosphere-80']
    >>> mesh = {"shape": "sphere", "triangles": 80, "name": "ball"}
    >>> ball = kbvh.scene({"bodies": [mesh, {"elements": "edges", "of": "ball"}], "radius": 0.1})
    >>> ball.bodies[1].over is ball.bodies[0], ball.bodies[1].primitives, ball.radius
    (True, 120, 0.1)
    """
    if isinstance(description, str):
        description = {"builtin": description}
    source = (json.dumps({**description, **keys}, default=os.fspath), os.fspath(folder))
    made = _core.make_scene(*source, "", 0)
    bodies: list[Body] = []
    for body in made["bodies"]:
        over = body.pop("over", None)
        bodies.append(Body(**body, over=None if over is None else bodies[over]))
    return Scene(
        bodies, made["pairs"], made["name"], made["notes"], changes=made["changes"], radius=made["radius"], _source=source
    )


def load(file: PathLike, motion: Optional[PathLike] = None, **keys: Any) -> Body:
    """Reads a body from a file (.obj .ply .gltf .glb, or a folder of numbered frames), moved by a point cache (.pc2) if `motion`
    names one. `keys` are those of a plan's body: clip, fps, name, scale, rotate, translate, as, self, weld. Faces on the two
    sides of a seam use one vertex; weld=False lets each use its own, to move vertices by the numbers of the file. Warns of what
    the reader skipped or repaired. Raises InputError.
    """
    description = {"file": os.path.abspath(os.fspath(file)), **keys}
    if motion is not None:
        description["motion"] = os.path.abspath(os.fspath(motion))
    made = scene({"bodies": [description]})
    for note in made.notes:
        warnings.warn(note, stacklevel=2)
    return made.bodies[0]


def builtin_scenes() -> dict[str, str]:
    """Returns the names of the built-in scenes, with what they show.

    >>> "tablecloth" in kbvh.builtin_scenes()
    True
    """
    return _core.builtin_scenes()


def shapes() -> dict[str, str]:
    """Returns the names of the bodies that are made by formula, with their keys.

    >>> "sphere" in kbvh.shapes()
    True
    """
    return _core.shapes()
