"""The broad phase of a simulation: pairs of vertices, edges and faces of one mesh that are near each other."""

from __future__ import annotations

from typing import Any, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _core

Array = npt.NDArray[Any]


class BroadPhase:
    """Candidates of one mesh: pairs of elements whose boxes overlap, each grown by radius / 2. Elements with a common vertex
    are no candidates. Kinds are vertex_vertex, edge_vertex, edge_edge, face_vertex, edge_face and face_face; a pair holds the
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
        radius is the largest distance that `within` may be asked for. Raises ValueError for wrong shapes, indices and
        coordinates, which it names."""
        self._core.build(self._points(v), self._other(v1), edges, faces, radius)

    def update(
        self,
        v: npt.ArrayLike,
        v1: Optional[npt.ArrayLike] = None,
        moved: Optional[Union[Sequence[int], Array]] = None,
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
