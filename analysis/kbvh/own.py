"""Strategies that are written in Python: the way to try an idea in ten minutes.

A strategy answers which pairs of primitives may intersect, frame by frame. kbvh tests its candidates exactly, compares it
with the truth (`kbvh.check`) and lets it take part in studies (`kbvh.run`) with the others. It is slow: every time includes
the interpreter, so compare ideas by their counters, not by their milliseconds.
"""

from __future__ import annotations

import hashlib
import inspect
from dataclasses import dataclass
from typing import Any, Mapping, Optional, Sequence, Type, TypeVar, Union

import numpy as np
import numpy.typing as npt

from . import _core
from .trees import Array, Tree


@dataclass
class Parameter:
    """A parameter of a strategy: a number from `least` to `most` (`whole`: only whole ones), or one of the words in `allowed`."""

    default: Union[str, int, float]
    meaning: str
    allowed: Sequence[str] = ()
    least: float = 0
    most: float = float("inf")
    whole: bool = False


@dataclass
class BodyView:
    """A body without its motion: primitive p has the vertices indices[offsets[p]:offsets[p + 1]]."""

    offsets: npt.NDArray[np.uint32]
    indices: npt.NDArray[np.uint32]
    vertices: int
    moving: bool
    shape: str

    @property
    def primitives(self) -> int:
        """The number of primitives."""
        return len(self.offsets) - 1


@dataclass
class SceneView:
    """What a strategy knows of its scene: bodies, the pairs of bodies that are asked about, the precision of positions (float32
    or float64), and, if it asks for them by `topology`, a tree per body."""

    bodies: list[BodyView]
    pairs: list[tuple[int, int]]
    trees: list[Tree]
    precision: str


class Motion:
    """The motion as a strategy without foresight sees it. Arrays are copies."""

    def __init__(self, core: Any) -> None:
        self._core = core

    @property
    def time(self) -> float:
        """The current time, in seconds."""
        return self._core.time

    def positions(self, body: int) -> Array:
        """Returns the positions of a body at the current frame, [vertex][3]."""
        return self._core.positions(body)


class SteppedMotion(Motion):
    """With foresight step_bound."""

    def displacement_bound(self, body: int, t0: float, t1: float) -> float:
        """Returns an upper bound of every vertex's displacement between two times, in units of length."""
        return self._core.displacement_bound(body, t0, t1)


class SegmentMotion(SteppedMotion):
    """With foresight next_keyframe."""

    def lines_begin(self, body: int) -> float:
        """Returns the time from which every vertex of the body is on its current line."""
        return self._core.lines_begin(body)

    def lines_end(self, body: int) -> float:
        """Returns the time until which every vertex of the body stays on its current line; infinite for ever."""
        return self._core.lines_end(body)

    def positions_on_lines(self, body: int, t: float) -> Array:
        """Returns the positions, [vertex][3], at a time from `lines_begin` to `lines_end`."""
        return self._core.positions_on_lines(body, t)


class ClipMotion(SegmentMotion):
    """With foresight whole_clip."""

    def keyframe_times(self, body: int) -> npt.NDArray[np.float64]:
        """Returns the times of a body's keyframes, in seconds."""
        return self._core.keyframe_times(body)

    def keyframe(self, body: int, k: int) -> Array:
        """Returns the positions at keyframe k, [vertex][3]."""
        return self._core.keyframe(body, k)


_MOTIONS: dict[str, Type[Motion]] = {
    "none": Motion,
    "step_bound": SteppedMotion,
    "next_keyframe": SegmentMotion,
    "whole_clip": ClipMotion,
}


class Strategy:
    """The base of strategies in Python.

    Override `candidates`, and whatever else the idea needs. `self.scene` is the SceneView, `self.params` the parameters as text,
    `self.motion` the motion as far as `foresight` shows it. The first lines of the class's docstring say in lists and reports
    what the strategy is.
    """

    id: str = ""
    title: str = ""
    citation: str = "a strategy in Python"
    #: exact: candidates contain all true pairs; approximate: no promise.
    guarantee: str = "exact"
    #: tight, conservative or none: of what `bounds` returns.
    tightness: str = "none"
    #: none, step_bound, next_keyframe or whole_clip: what `self.motion` shows of the future.
    foresight: str = "none"
    #: Wishes for the trees in `self.scene.trees` (method, width, leaf_size; {} for the usual ones); None: no trees.
    topology: Optional[Mapping[str, Any]] = None
    #: Whether it answers pairs within a body (without those of primitives that share a vertex).
    self_pairs: bool = False
    primitives: Sequence[str] = ("polygons", "points", "control_nets")
    parameters: Mapping[str, Parameter] = {}
    #: The largest scene in studies, in pairs of primitives of two bodies; 0: any.
    max_primitive_pairs: int = 0

    def __init__(self, scene: SceneView, params: dict[str, str], motion: Any) -> None:
        self.scene = scene
        self.params = params
        self.motion = motion
        self.prepare()

    def prepare(self) -> None:
        """Makes what is needed before the first frame. There are no positions yet."""

    def reset(self) -> None:
        """Starts over at the current time. By default the same as `advance`."""
        self.advance()

    def advance(self) -> None:
        """Brings bounds to the current time."""

    def candidates(self) -> Any:
        """Returns the pairs that may intersect at the current time, [pair][4]: body, primitive, body, primitive; each once."""
        raise NotImplementedError(f"{type(self).__name__} has no candidates")

    def bounds(self, body: int) -> Optional[npt.ArrayLike]:
        """Returns the boxes of the nodes of `self.scene.trees[body]`, [node][2][3], for audits; None: they are not shown."""
        return None

    def spans(self, t0: float, t1: float) -> tuple[npt.ArrayLike, npt.ArrayLike]:
        """Returns pairs, [pair][4], and their spans of time, [pair][2], that enclose every contact from t0 to t1. The motion
        stands at t1."""
        raise NotImplementedError

    def swept_candidates(self, t0: float, t1: float, before: list[Array]) -> Any:
        """Returns the pairs, [pair][4], that may touch while every vertex moves on a straight line from `before` ([body], then
        [vertex][3]) to the current position."""
        raise NotImplementedError

    def plans_changed(self, changed: npt.NDArray[np.uint32]) -> None:
        """Takes note of vertices, [change][2]: body, vertex, whose plans changed at the current time."""
        raise NotImplementedError

    def counters(self) -> dict[str, int]:
        """Returns what was counted since the last `reset`, by names of kbvh's counters or by own ones: whole numbers from 0 to
        2**64 - 1."""
        return {}

    def bytes(self) -> int:
        """Returns the memory of the strategy's own structures, in bytes."""
        return 0


S = TypeVar("S", bound=Type[Strategy])


def _overrides(cls: Type[Strategy], method: str) -> bool:
    return getattr(cls, method) is not getattr(Strategy, method)


def _source(cls: Type[Strategy]) -> str:
    """Returns a hash of the source of the class and its bases: results of other code are other results."""
    digest = hashlib.sha256()
    for base in cls.__mro__[: cls.__mro__.index(Strategy)]:
        try:
            text = inspect.getsource(base)
        except (OSError, TypeError):  # a class that was made in a session
            code = [value.__code__ for value in vars(base).values() if inspect.isfunction(value)]
            text = repr([(one.co_name, one.co_code, one.co_names, str(one.co_consts)) for one in code])
        digest.update(text.encode())
    return digest.hexdigest()[:12]


def _about(cls: Type[Strategy]) -> str:
    own = cls.__doc__ if cls.__doc__ != Strategy.__doc__ else None
    text = " ".join(inspect.cleandoc(own or "").split("\n\n")[0].split())
    return f"{text + ' ' if text else ''}Written in Python: its times include the interpreter."


def register(cls: S) -> S:
    """Registers a strategy in this process, under its id: `kbvh.strategies`, worlds, `kbvh.check` and studies know it then. A
    class registered later with the same id takes its place. Usable as a decorator. Raises ConfigError.

    >>> @kbvh.register
    ... class Everything(kbvh.Strategy):
    ...     '''All pairs of primitives.'''
    ...     id = "everything"
    ...     def candidates(self):
    ...         return [(a, i, b, j) for a, b in self.scene.pairs
    ...                 for i in range(self.scene.bodies[a].primitives) for j in range(self.scene.bodies[b].primitives)]
    """
    if not (isinstance(cls, type) and issubclass(cls, Strategy)):
        raise TypeError(f"{cls!r} is no class derived from kbvh.Strategy")
    if not _overrides(cls, "candidates"):
        raise _core.ConfigError(f"strategy '{cls.id}' has no method candidates")
    if isinstance(cls.primitives, str):
        raise TypeError(f"strategy '{cls.id}': its primitives are a list of words, not the text '{cls.primitives}'")
    if cls.topology is not None and not isinstance(cls.topology, Mapping):
        raise TypeError(f"strategy '{cls.id}': its topology is a dictionary or None, not {type(cls.topology).__name__}")
    if cls.foresight not in _MOTIONS:
        raise _core.ConfigError(f"strategy '{cls.id}': its foresight is one of {', '.join(_MOTIONS)}, not '{cls.foresight}'")
    abilities = [
        word
        for word, has in {
            "spans": _overrides(cls, "spans"),
            "contacts": _overrides(cls, "swept_candidates"),
            "plan_changes": _overrides(cls, "plans_changed"),
            "self_pairs": cls.self_pairs,
        }.items()
        if has
    ]
    parameters = [
        {
            "name": name,
            "default": str(one.default),
            "meaning": one.meaning,
            "allowed": list(one.allowed),
            "least": float(one.least),
            "most": float(one.most),
            "whole": one.whole,
        }
        for name, one in cls.parameters.items()
    ]
    description = {
        "id": cls.id,
        "title": f"{cls.title or cls.id.replace('_', ' ')} (Python)",
        "citation": cls.citation,
        "tightness": cls.tightness,
        "guarantee": cls.guarantee,
        "foresight": cls.foresight,
        "primitives": list(cls.primitives),
        "topology": None if cls.topology is None else {key: str(value) for key, value in cls.topology.items()},
        "parameters": parameters,
        "abilities": abilities,
        "max_primitive_pairs": cls.max_primitive_pairs,
    }
    if "source" in cls.parameters:
        raise _core.ConfigError(f"strategy '{cls.id}': the parameter source is reserved")
    source = _source(cls)
    meaning = "a hash of its source, so that results of other code are other results"
    own = {"name": "source", "default": source, "meaning": meaning, "allowed": [source], "least": 0.0, "most": 0.0, "whole": False}
    description["parameters"] = [*parameters, own]
    view = _MOTIONS[cls.foresight]

    def make(scene: dict[str, Any], params: dict[str, str], motion: Any) -> Strategy:
        bodies = [BodyView(**body) for body in scene["bodies"]]
        trees = [Tree(**tree) for tree in scene["trees"]]
        return cls(SceneView(bodies, scene["pairs"], trees, scene["precision"]), params, view(motion))

    _core.register_strategy(description, _about(cls), make)
    return cls
