"""The broad phase of a simulation: pairs of vertices, edges and faces of one mesh that are near each other."""

from __future__ import annotations

from typing import Any, Callable, NamedTuple, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _core

Array = npt.NDArray[Any]
Ids = Union[Sequence[int], Array]


class EarliestImpact(NamedTuple):
    """The first time of a motion at which two elements touch or are within a separation: it lies in [begin, end], as shares
    of the motion. `first` and `second` are rows of F and V, or of E and E, as the kind says."""

    begin: float
    end: float
    kind: str
    first: int
    second: int


class CandidateChanges(NamedTuple):
    """The pairs (n, 2) that began and those that ended, each in ascending order."""

    begun: npt.NDArray[np.uint32]
    ended: npt.NDArray[np.uint32]


class BroadPhase:
    """Candidates of one mesh: pairs of elements whose boxes overlap, each grown by radius / 2. Elements with a common vertex
    are no candidates, nor are pairs that a filter excludes. Kinds are vertex_vertex, edge_vertex, edge_edge, face_vertex, edge_face and face_face; a pair holds the
    rows of E, F or V in the order of the kind's name.

    Arrays of the object's precision are read where they lie, whatever their strides; others are converted.

    >>> import numpy as np
    >>> v = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0.3]])
    >>> broad = kbvh.BroadPhase()
    >>> broad.build(v, edges=[], faces=[[0, 1, 2]], radius=0.5)
    >>> broad.candidates("face_vertex")
    array([[0, 3]], dtype=uint32)
    >>> broad.within("face_vertex", 0.25)
    array([], shape=(0, 2), dtype=uint32)
    >>> v[3, 2] = 0.25
    >>> broad.update(v)
    >>> broad.within("face_vertex", 0.25)
    array([[0, 3]], dtype=uint32)
    """

    def __init__(self, precision: str = "float64") -> None:
        self._core = _core.BroadPhase(precision)
        self._precision = np.dtype(precision)

    def build(
        self,
        v: npt.ArrayLike,
        edges: npt.ArrayLike,
        faces: npt.ArrayLike,
        radius: float = 0.0,
        v1: Optional[npt.ArrayLike] = None,
    ) -> None:
        """Takes a mesh: positions (n, 3), edges (m, 2), faces (k, 3). With `v1`, vertices move straight from v to v1. The
        radius is the largest distance that `within` may be asked for. Filters and a bound of `valid_for` end. Raises ValueError for wrong shapes, indices and
        coordinates, which it names."""
        self._core.build(self._points(v), self._other(v1), edges, faces, radius)

    def update(
        self,
        v: npt.ArrayLike,
        v1: Optional[npt.ArrayLike] = None,
        moved: Optional[Ids] = None,
    ) -> None:
        """Takes other positions of the same mesh, or another motion from v to v1. With `moved`, only these rows of v are read,
        and all others have to be unchanged: the cost is in proportion to the elements that moved."""
        if moved is None:
            self._core.update(self._points(v), self._other(v1))
        elif v1 is None:
            self._core.update_moved(self._points(v), moved)
        else:
            raise ValueError("vertices that moved are told to positions, not to a motion from v to v1")

    def candidates(self, kind: str) -> npt.NDArray[np.uint32]:
        """Returns the candidates of one kind as pairs (n, 2), each once."""
        return self._core.candidates(kind)

    def within(self, kind: str, distance: float) -> npt.NDArray[np.uint32]:
        """Returns the pairs of elements whose distance is at most `distance`, in real arithmetic on the given numbers: no
        rounding decides. A motion is asked at its end. Raises ValueError for a distance beyond the radius."""
        return self._core.within(kind, distance)

    def valid_for(self, displacement: float) -> None:
        """From now on, candidates hold for all positions in which no coordinate differs by more than `displacement` from its
        value at the last detection. Updates within the bound cost a comparison; one beyond it starts the bound again.
        Candidates are then pairs that can become candidates within the bound. 0 ends this.

        >>> v = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.5], [1, 0, 0.5]])
        >>> broad = kbvh.BroadPhase()
        >>> broad.build(v, edges=[[0, 1], [2, 3]], faces=[], radius=0.1)
        >>> broad.valid_for(0.25)
        >>> for step in range(5):
        ...     broad.update(v + [0, 0.04 * step, 0])
        ...     pairs = broad.candidates("edge_edge")
        >>> len(pairs), broad.detections, round(broad.left, 6)
        (1, 1, 0.09)
        """
        self._core.valid_for(displacement)

    def changes(self, kind: str, distance: Optional[float] = None) -> CandidateChanges:
        """Returns which candidates of a kind began and which ended since the last call for this kind; at the first one since
        `build`, all begin. With a distance, compares the pairs within it instead of candidates."""
        return CandidateChanges(*self._core.changes(kind, distance))

    def earliest_impact(self, separation: float = 0.0) -> Optional[EarliestImpact]:
        """Returns the first time during the motion from v to v1 at which a vertex and a face, or two edges, are within the
        separation (0: touch), or None: the verdict is that of real arithmetic on the given numbers, and the time is enclosed
        to 2^-20 of the motion. Raises ValueError without a motion, and for a separation beyond the radius.

        >>> v = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.25, 0.25, 2]])
        >>> broad = kbvh.BroadPhase()
        >>> broad.build(v, edges=[], faces=[[0, 1, 2]], radius=0.5, v1=v * [1, 1, 0])
        >>> impact = broad.earliest_impact(separation=0.5)
        >>> impact.kind, impact.first, impact.second, impact.begin <= 0.75 <= impact.end
        ('face_vertex', 0, 3, True)
        """
        found = self._core.earliest_impact(separation)
        return None if found is None else EarliestImpact(*found)

    def insert(
        self, v: Optional[npt.ArrayLike] = None, edges: npt.ArrayLike = (), faces: npt.ArrayLike = ()
    ) -> tuple[int, int, int]:
        """Adds vertices at the positions v (n, 3), and edges and faces between vertices, the added ones included. Returns the
        ids of the first added vertex, edge and face: they follow the largest of their kind, and all other ids are
        unchanged. Positions have rows for added vertices from then on."""
        return self._core.insert(self._other(v), edges, faces)

    def remove(self, element: str, ids: Ids) -> None:
        """Removes elements ("vertex", "edge" or "face") by their ids, which are never used again before the next `build`. A
        removed vertex keeps its row of positions, and edges and faces that name it stay. Raises ValueError for an id that
        does not exist or was removed."""
        self._core.remove(element, ids)

    def set_groups(self, element: str, groups: Ids, masks: Ids) -> None:
        """Sets groups and masks, as bits, of all elements of a kind, in place of those set before. Two elements are a candidate
        only if each has a group in the mask of the other; searches skip subtrees without such elements. Empty lists admit all
        pairs again.

        >>> v = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.1], [1, 0, 0.1], [0, 0, 0.2], [1, 0, 0.2]])
        >>> broad = kbvh.BroadPhase()
        >>> broad.build(v, edges=[[0, 1], [2, 3], [4, 5]], faces=[], radius=0.5)
        >>> broad.set_groups("edge", groups=[1, 1, 2], masks=[2, 2, 3])
        >>> broad.candidates("edge_edge").tolist()
        [[0, 2], [1, 2]]
        """
        self._core.set_groups(element, groups, masks)

    def set_vertex_groups(self, groups: Ids, masks: Ids) -> None:
        """Sets groups and masks of vertices. Edges and faces get the union of their vertices' groups, and of their masks."""
        self._core.set_vertex_groups(groups, masks)

    def exclude(self, kind: str, pairs: npt.ArrayLike) -> None:
        """Excludes pairs (n, 2) of one kind, in place of those excluded before."""
        self._core.exclude(kind, np.asarray(pairs).reshape(-1, 2) if np.size(pairs) == 0 else pairs)

    def use_threads(self, threads: int) -> None:
        """Sets the number of threads that share searches, 1 at first. Answers and their order do not depend on it. Raises
        ValueError for more threads than this machine has."""
        self._core.use_threads(threads)

    def exclude_rings(self, rings: int) -> None:
        """Excludes pairs of elements, of all kinds, that at most `rings` edges connect: edges of E and sides of faces, as far as
        they are not removed. 0 ends this.

        >>> v = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [4, 0, 0], [5, 0, 0]]) * 0.1
        >>> broad = kbvh.BroadPhase()
        >>> broad.build(v, edges=[[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]], faces=[], radius=1)
        >>> broad.exclude_rings(1)
        >>> sorted(broad.candidates("edge_edge").tolist())
        [[0, 3], [0, 4], [1, 4]]
        """
        self._core.exclude_rings(rings)

    def self_intersections(self) -> npt.NDArray[np.uint32]:
        """Finds the pairs (n, 2) of faces, without a common vertex, that have a common point: exactly, as within("face_face", 0)
        does. Patches of the mesh that are proved not to touch themselves, by cones of their normals and projected contours, are
        left out: a smooth mesh has few others.

        >>> v = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, -1], [0.5, 0.5, 1], [3, 3, 1]])
        >>> broad = kbvh.BroadPhase()
        >>> broad.build(v, edges=[], faces=[[0, 1, 2], [3, 4, 5]], radius=0)
        >>> broad.self_intersections().tolist()
        [[0, 1]]
        """
        return self._core.self_intersections()

    def keep_only(self, choose: Optional[Callable[[str, npt.NDArray[np.uint32]], Any]]) -> None:
        """Lets a function choose among the pairs that no other filter excludes: choose(kind, pairs) gets many pairs (n, 2) at a
        time and returns an array of n truth values. It has to give the same answer whenever it is asked about a pair, and must
        not use this object: that raises RuntimeError. None ends this."""
        self._core.keep_only(choose)

    def clear_filters(self) -> None:
        """Ends all filters."""
        self._core.clear_filters()

    @property
    def left(self) -> float:
        """By how much every coordinate may still change before candidates are detected again; 0 without `valid_for`."""
        return self._core.left

    @property
    def detections(self) -> int:
        """The number of searches of all kinds since `build`."""
        return self._core.detections

    def _points(self, v: npt.ArrayLike) -> Array:
        array = np.asarray(v)
        if array.size and array.dtype.kind not in "fiu":
            raise ValueError(f"positions are no real numbers, but {array.dtype}")
        return np.asarray(array, dtype=self._precision)

    def _other(self, v1: Optional[npt.ArrayLike]) -> Optional[Array]:
        return None if v1 is None else self._points(v1)
