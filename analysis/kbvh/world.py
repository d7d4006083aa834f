"""A scene and a strategy that keeps its bounds valid."""

from __future__ import annotations

import operator
import warnings
from dataclasses import dataclass
from typing import Any, Iterator, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _core
from .scenes import Body, PlanChange, Scene

Array = npt.NDArray[Any]
#: Parameters and topologies: words, or numbers that are written as words.
Words = Mapping[str, Union[str, int, float]]


def words(given: Optional[Words]) -> dict[str, str]:
    """Returns parameters as the texts that the library reads.

    >>> words({"margin": 0.5, "threads": 2.0})
    {'margin': '0.5', 'threads': '2'}
    """
    out = {}
    for key, value in (given or {}).items():
        if isinstance(value, (bool, np.bool_)):
            raise ValueError(f"{key}={value}: write the word that the strategy lists")
        whole = isinstance(value, (float, np.floating)) and float(value).is_integer() and abs(value) < 1e15
        out[key] = str(int(value)) if whole else str(value)
    return out


def _real(given: npt.ArrayLike, what: str) -> Array:
    """Returns an array of whole or real numbers. Raises ValueError for text, dates and complex numbers."""
    array = np.asarray(given)
    if array.size and array.dtype.kind not in "fiu":
        raise ValueError(f"{what} are no real numbers, but {array.dtype}")
    return array


def padded(positions: npt.ArrayLike, precision: str = "float32") -> Array:
    """Returns an array of the positions, [vertex][3], that a world of this precision reads without a copy: its memory has one
    more number at the end, as vector instructions need it.

    >>> import numpy as np
    >>> kbvh.padded(np.ones((4, 3))).base.shape
    (13,)
    """
    given = _real(positions, "positions")
    memory = np.zeros(given.size + 1, dtype=precision)
    out = memory[:-1].reshape(-1, 3)
    out[...] = given
    return out


def _number_of(body: Body, bodies: Sequence[Body]) -> int:
    """Returns the number of a body, over whose vertices another one is, among those that come before that one."""
    for i, one in enumerate(bodies):
        if one is body:
            return i
    raise ValueError(f"the body '{body.name}', over whose vertices it is, must come before it in the scene")


@dataclass
class Audit:
    """What an audit finds. `protrusion` is the largest distance of a vertex from a bound above it (0: all bounds are valid), in
    units of length; `looseness` the summed surface area over that of tight bounds, minus one. Stale nodes, which no query read,
    are counted and not examined."""

    nodes: int
    stale: int
    invalid: int
    not_tight: int
    protrusion: float
    looseness: float
    first_fault: str


@dataclass
class Hierarchy:
    """A body's hierarchy. `nodes` has the fields parent, first, count, leaf, stale, lower [3], upper [3], event_node (the number by
    which events name the node); node 0 is the root, the children of an inner node are nodes[first:first + count], and a leaf has
    primitives[first:first + count]."""

    nodes: Array
    primitives: npt.NDArray[np.uint32]


@dataclass
class Step:
    """An event that was performed: the event itself, the bounds that it changed, the certificates that it created."""

    event: Any
    touched: Array
    rescheduled: Array


class World:
    """Plays a scene with one strategy.

    `strategy` is an id (`kbvh.strategies()` lists them), `params` its parameters, `topology` overrides of its hierarchy (method,
    width, leaf_size), `t` the time of the start; by default that of the first keyframe. Input in the world's precision (float32
    or float64) and in C order is read where it lies; the world keeps its own copy of keyframes.

    `radius` makes all pairs those of boxes grown by half of it, so that two primitives at a distance of at most `radius` are
    always a pair (`Scene` says more); by default it is the scene's. Only strategies that take control nets play such a world. It
    finds no contacts, answers neither `hits` nor `within`, changes neither plans nor vertices (primitives come and go), and copies
    all positions that are set. Vertex v is two in `realisers` and in events: the corners 2 * v (lower) and 2 * v + 1 (upper) of its box.

    Raises ValueError or TypeError for wrong input (ConfigError for a strategy or parameter), RuntimeError for calls in the wrong
    order and for abilities that the strategy lacks; nothing has changed then. Ctrl-C ends a long call at its next frame.

    >>> sheet = kbvh.scene("waving_sheet", triangles=200, keyframes=3)
    >>> world = kbvh.World(sheet, "drift_boxes", precision="float64")
    >>> world.advance(world.frames(l=2)[1])
    >>> len(world.pairs()) == len(world.true_pairs())
    True
    """

    def __init__(
        self,
        scene: Union[Scene, Sequence[Body]],
        strategy: Optional[str] = None,
        params: Optional[Words] = None,
        *,
        precision: str = "float32",
        t: Optional[float] = None,
        topology: Optional[Words] = None,
        radius: Optional[float] = None,
    ) -> None:
        self.scene = scene if isinstance(scene, Scene) else Scene(list(scene))
        self._core = _core.World(precision)
        for i, body in enumerate(self.scene.bodies):
            times = None if not body.known else [0.0] if body.times is None else body.times
            try:
                if body.over is None:
                    self._core.add_body(
                        body.name, body.indices, body.offsets, body.shape, times, body.positions, body.bends, body.twists
                    )
                else:
                    over = _number_of(body.over, self.scene.bodies[:i])
                    self._core.add_body_over(over, body.name, body.indices, body.offsets, body.shape)
            except ValueError as reason:
                if f"'{body.name}'" in str(reason):
                    raise
                raise type(reason)(f"body '{body.name}': {reason}") from None
        if radius is None:
            radius = self.scene.radius
        if radius is not None:
            self._core.set_radius(radius)
        for a, b in self.scene.pairs_asked() or ():
            self._core.add_pair(a, b)
        if strategy is not None:
            self.start(strategy, params, t=t, topology=topology)

    def start(
        self,
        strategy: str,
        params: Optional[Words] = None,
        *,
        t: Optional[float] = None,
        topology: Optional[Words] = None,
    ) -> None:
        """Chooses the strategy, once, and starts at time t."""
        begin = float(self.frames()[0]) if t is None else t
        self._core.start(strategy, words(params), begin, words(topology))

    @property
    def precision(self) -> str:
        """float32 or float64."""
        return self._core.precision

    @property
    def time(self) -> float:
        """The current time, in seconds."""
        return self._core.time

    def frames(self, l: int = 1) -> npt.NDArray[np.float64]:
        """Returns the times of a clip: l frames for each interval between the keyframes of all bodies, and the last keyframe."""
        if operator.index(l) < 1:
            raise ValueError(f"{l} frames per keyframe interval, but at least 1 is needed")
        return np.asarray(self._core.frame_times(operator.index(l)))

    def play(self, l: int = 1) -> Iterator[float]:
        """Starts over and stops at each frame of the clip, so that questions can be asked there.

        >>> world = kbvh.World(kbvh.scene("waving_sheet", triangles=200, keyframes=3), "bottom_up")
        >>> len([len(world.pairs()) for t in world.play(l=2)])
        5
        """
        for i, t in enumerate(self.frames(l)):
            if i == 0:
                self.reset(t)
            else:
                self.advance(t)
            yield float(t)

    def reset(self, t: float) -> None:
        """Starts over at time t, with the original plans and geometry."""
        self._core.reset(t)

    def advance(self, t: float) -> None:
        """Moves scene and strategy to time t, which is not before the current one."""
        self._core.advance(t)

    def set_positions(self, body: int, positions: npt.ArrayLike, moved: Optional[npt.ArrayLike] = None) -> bool:
        """Sets the positions, [vertex][3], of a body with unknown motion, for the next `reset`, `advance` or `contacts`.

        An array of `padded`, or a flat one of 3 * vertices + 1 numbers, in the world's precision, is read where it lies: leave it
        unchanged until the next positions are set, and hand in another array for `contacts`. All others are copied. Returns
        whether the array is read where it lies.

        `moved` lists the only vertices whose positions may differ from those at the last frame: the strategy "dirty_refit" leaves
        out the others. Bounds are wrong if a vertex is missing in it.

        >>> v = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="f4")
        >>> bodies = [kbvh.Body([[0, 1, 2]], v, known=False), kbvh.Body([[0, 1, 2]], v + [0, 0, 1], known=False)]
        >>> world = kbvh.World(bodies, "dirty_refit")
        >>> v[2, 2] = 1
        >>> copied = not world.set_positions(0, v, moved=[2])
        >>> world.advance(1)
        >>> len(world.pairs())
        1
        """
        memory = getattr(positions, "base", None)
        if (
            isinstance(positions, np.ndarray)
            and isinstance(memory, np.ndarray)
            and memory.ndim == 1
            and memory.size == positions.size + 1
            and memory.dtype == positions.dtype
            and positions.flags.c_contiguous
            and memory.flags.c_contiguous
            and memory.ctypes.data == positions.ctypes.data
        ):
            positions = memory
        return self._core.set_positions(body, positions, moved)

    def change_plans(self, change: PlanChange) -> None:
        """Gives some vertices of a body new plans from the current time on; `change.time` is not read."""
        self._core.change_plans(change.body, change.vertices, change.velocities, change.times, change.positions)

    def change_geometry(
        self,
        *,
        vertices: Optional[Mapping[int, tuple[npt.ArrayLike, npt.ArrayLike]]] = None,
        primitives: Optional[Mapping[int, Sequence[npt.ArrayLike]]] = None,
        removed_primitives: Optional[Mapping[int, npt.ArrayLike]] = None,
        removed_vertices: Optional[Mapping[int, npt.ArrayLike]] = None,
    ) -> None:
        """Inserts and deletes at the current time, for each body: vertices as (positions, velocities), both [vertex][3];
        primitives as lists of vertices; ids. Inserted items get the next free ids; ids are never used again."""
        self._core.change_geometry(
            dict(vertices or {}), dict(primitives or {}), dict(removed_primitives or {}), dict(removed_vertices or {})
        )

    def pairs(self) -> Array:
        """Returns the pairs of primitives that intersect at the current time, under the strategy's guarantee: a structured array
        with body_a, primitive_a, body_b, primitive_b."""
        return self._core.pairs()

    def true_pairs(self) -> Array:
        """Returns the true pairs, sorted, found by testing all pairs of primitives: slow. Ask the strategy first."""
        return self._core.true_pairs()

    def changes(self) -> tuple[Array, Array]:
        """Returns the pairs that began and those that ceased to intersect since the last call, with the fields of `pairs`. The
        first call after the start or `reset` begins all pairs.

        >>> world = kbvh.World(kbvh.scene("waving_sheet", triangles=200, keyframes=3), "interval_join")
        >>> held = set()
        >>> for t in world.play(l=4):
        ...     begun, ended = world.changes()
        ...     held = (held - set(map(tuple, ended))) | set(map(tuple, begun))
        >>> held == set(map(tuple, world.pairs()))
        True
        """
        return self._core.changes()

    def spans(self, t: float) -> Array:
        """Advances to t and returns the pairs of the elapsed time, with the fields of `pairs`, begin and end (seconds)."""
        return self._core.spans(t)

    def contacts(self, t: float) -> Array:
        """Advances to t and returns the contacts on the way: kind (0: vertex and face, 1: two edges), body_a, feature_a, body_b,
        feature_b, begin and end (seconds; they enclose the time of impact). One call must not pass `next_knot`."""
        return self._core.contacts(t)

    def hits(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, lengths: npt.ArrayLike = np.inf, query: str = "closest"
    ) -> Array:
        """Answers rays at the current time: the points origin + s * direction, [ray][3] each, with 0 <= s <= length. Returns for each
        ray the body and primitive that it meets first (query "any": one that it meets) and s as parameter; 2**32 - 1 and infinity
        for a miss. Only polygons are met. Rays are rounded to the world's precision; a warning says so where that changes one.

        >>> world = kbvh.World([kbvh.Body([0, 1, 2], np.eye(3))], "bottom_up")
        >>> world.hits([[0, 0, 0], [5, 5, 5]], [[1, 1, 1], [1, 0, 0]]).tolist()
        [(0, 0, 0.3333333333333333), (4294967295, 4294967295, inf)]
        """
        if query not in ("closest", "any"):
            raise ValueError(f"a ray's query is closest or any, not '{query}'")
        starts = np.atleast_2d(_real(origins, "origins of rays"))
        rays = np.empty((len(starts), 7))
        try:
            rays[:, :3], rays[:, 3:6] = starts, _real(directions, "directions of rays")
            rays[:, 6] = _real(lengths, "lengths of rays")
        except ValueError as reason:
            if "real numbers" in str(reason):
                raise
            raise ValueError(f"{len(starts)} rays need origins and directions [ray][3], and lengths [ray]") from None
        if self.precision == "float32":
            with np.errstate(over="ignore"):
                rounded = rays.astype(np.float32)
            changed = int(np.count_nonzero(np.any((rounded != rays) & ~np.isnan(rays), axis=1)))
            if changed:
                whose = "ray of this call was" if changed == 1 else "rays of this call were"
                warnings.warn(f"{changed} {whose} rounded to float32, the precision of the world", stacklevel=2)
        return self._core.hits(rays, query == "any")

    def within(self, points: npt.ArrayLike, radius: npt.ArrayLike) -> Array:
        """Returns the primitives within a distance of points, [point][3], at the current time: a structured array with the fields
        point, body and primitive, sorted. The radius is one number or one for each point. Squared distances are compared exactly
        with the squared radius; polygons and points are met, control nets are not. Points and radii are rounded to the world's
        precision.

        >>> world = kbvh.World([kbvh.Body([0, 1, 2], np.eye(3))], "bottom_up")
        >>> world.within([[1, 1, 1], [2, 0, 0]], 1).tolist()
        [(1, 0, 0)]
        """
        centres = np.atleast_2d(_real(points, "points"))
        balls = np.empty((len(centres), 4))
        try:
            balls[:, :3], balls[:, 3] = centres, _real(radius, "radii")
        except ValueError as reason:
            if "real numbers" in str(reason):
                raise
            raise ValueError(f"{len(centres)} points are [point][3] and have one radius, or one each") from None
        return self._core.within(balls)

    def next_knot(self) -> float:
        """Returns the next time at which the plan of any vertex bends; infinite if none does."""
        return self._core.next_knot()

    def positions(self, body: int) -> Array:
        """Returns a copy of the positions of a body at the current time, [vertex][3], in the world's precision."""
        return self._core.positions(body)

    def positions_address(self, body: int) -> int:
        """Returns where the positions of a body lie, to see whether an array was copied."""
        return self._core.positions_address(body)

    def hierarchy(self, body: int) -> Optional[Hierarchy]:
        """Returns the hierarchy of a body; None if the strategy's hierarchy is not visible."""
        found = self._core.hierarchy(body)
        return None if found is None else Hierarchy(*found)

    def realisers(self, body: int) -> Optional[npt.NDArray[np.uint32]]:
        """Returns the vertex that realises each side of each node, [node][6], side 2 * axis + (0 lower, 1 upper), 2**32 - 1 for an
        inherited side; None unless the strategy works at events on a hierarchy that is visible."""
        return self._core.realisers(body)

    def watched_pairs(self) -> Array:
        """Returns the pairs of boxes that a separation list watches: body, node, other_body, other_node, overlapping, listed."""
        return self._core.watched_pairs()

    def audit(self, body: int) -> Optional[Audit]:
        """Audits the hierarchy of a body after a query; None if it is not visible."""
        found = self._core.audit(body)
        return None if found is None else Audit(**found)

    def counters(self) -> dict[str, int]:
        """Returns what was counted since the last `reset`; `kbvh.counters()` says what each counter means."""
        return self._core.counters()

    @property
    def has_events(self) -> bool:
        """Whether the strategy works at events that can be stepped one by one."""
        return self._core.has_events()

    def next_event_time(self) -> float:
        """Returns the time of the earliest event, in seconds; infinite if there is none."""
        return self._core.next_event_time()

    def scheduled_events(self) -> Array:
        """Returns all scheduled events in order of time: kind (0 bound, 1 boxes meet, 2 boxes separate, 3 review, 4 window),
        body, node, side, winner, loser, other_body, other_node, time and error (seconds), exact, and two linear pieces."""
        return self._core.scheduled_events()

    def step_event(self, until: float) -> Optional[Step]:
        """Performs the first event if it is due by time `until`; returns None if none is due. Steps, or `advance` to `until` or
        later, may follow."""
        found = self._core.step_event(until)
        return None if found is None else Step(found[0][0], found[1], found[2])

    def verify(
        self,
        strategy: str,
        params: Optional[Words] = None,
        *,
        frames: Optional[npt.ArrayLike] = None,
        topology: Optional[Words] = None,
    ) -> dict[str, Any]:
        """Plays the scene with a strategy, and compares pairs and bounds with the truth in each frame. This world keeps its own
        strategy and time. `kbvh.check` says the same in words."""
        return self._core.verify(strategy, self.frames() if frames is None else frames, words(params), words(topology))

