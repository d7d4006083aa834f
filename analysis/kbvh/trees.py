"""Trees over primitives, and what a strategy in Python needs to use them, on whole arrays at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Ids = npt.NDArray[np.uint32]


@dataclass
class Tree:
    """A tree without bounds. Node 0 is the root, and parents come before their children. The children of an inner node are
    first .. first + count; a leaf has primitives[first:first + count]."""

    first: Ids
    count: Ids
    leaf: npt.NDArray[np.bool_]
    parents: Ids
    primitives: Ids

    def __len__(self) -> int:
        return len(self.first)

    @cached_property
    def levels(self) -> list[npt.NDArray[np.intp]]:
        """The nodes of each depth, from the root downwards."""
        levels: list[npt.NDArray[np.intp]] = [np.zeros(1 if len(self) else 0, dtype=np.intp)]
        while len(levels[-1]):
            inner = levels[-1][~self.leaf[levels[-1]]]
            levels.append(_ranges(self.first[inner], self.count[inner]))
        return levels[:-1]


def _ranges(first: Array, count: Array) -> npt.NDArray[np.intp]:
    """Returns the numbers first[i] .. first[i] + count[i] - 1 of all i.

    >>> _ranges(np.array([5, 1]), np.array([2, 3])).tolist()
    [5, 6, 1, 2, 3]
    """
    count = count.astype(np.intp)
    begins = np.repeat(first.astype(np.intp) - (np.cumsum(count) - count), count)
    return begins + np.arange(count.sum(), dtype=np.intp)


def primitive_bounds(offsets: Array, indices: Array, positions: Array) -> Array:
    """Returns the boxes of primitives, [primitive][2][3]: lower and upper corners.

    >>> kbvh.primitive_bounds(np.array([0, 3]), np.array([0, 1, 2]), np.eye(3)).tolist()
    [[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]]
    """
    if len(offsets) < 2:
        return np.empty((0, 2, 3), dtype=positions.dtype)
    corners, begins = positions[indices], offsets[:-1].astype(np.intp)
    return np.stack([np.minimum.reduceat(corners, begins), np.maximum.reduceat(corners, begins)], axis=1)


def refit(tree: Tree, primitives: Array) -> Array:
    """Returns tight boxes of all nodes, [node][2][3], from those of the primitives, bottom up, a level at a time."""
    bounds = np.empty((len(tree), 2, 3), dtype=primitives.dtype)
    entries = primitives[tree.primitives]

    def union(nodes: npt.NDArray[np.intp], below: Array) -> None:
        count = tree.count[nodes].astype(np.intp)
        begins = np.cumsum(count) - count
        bounds[nodes, 0] = np.minimum.reduceat(below[:, 0], begins)
        bounds[nodes, 1] = np.maximum.reduceat(below[:, 1], begins)

    for level in reversed(tree.levels):
        leaves, inner = level[tree.leaf[level]], level[~tree.leaf[level]]
        if len(leaves):
            union(leaves, entries[_ranges(tree.first[leaves], tree.count[leaves])])
        if len(inner):
            union(inner, bounds[_ranges(tree.first[inner], tree.count[inner])])
    return bounds


def _overlap(a: Array, b: Array) -> npt.NDArray[np.bool_]:
    """Returns which boxes touch; boxes are closed."""
    return np.asarray(np.all((a[:, 0] <= b[:, 1]) & (b[:, 0] <= a[:, 1]), axis=1))


def overlapping(tree_a: Tree, bounds_a: Array, tree_b: Tree, bounds_b: Array) -> npt.NDArray[np.intp]:
    """Returns the pairs of primitives in overlapping leaves of two trees, [pair][2], found by descending in both trees a level
    at a time."""
    if not len(tree_a) or not len(tree_b):
        return np.empty((0, 2), dtype=np.intp)
    a = b = np.zeros(1, dtype=np.intp)
    found: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]] = []
    while len(a):
        touching = _overlap(bounds_a[a], bounds_b[b])
        a, b = a[touching], b[touching]
        ends = tree_a.leaf[a] & tree_b.leaf[b]
        found.append((a[ends], b[ends]))
        a, b = a[~ends], b[~ends]
        count_a = np.where(tree_a.leaf[a], 1, tree_a.count[a]).astype(np.intp)
        count_b = np.where(tree_b.leaf[b], 1, tree_b.count[b]).astype(np.intp)
        first_a, first_b = np.where(tree_a.leaf[a], a, tree_a.first[a]), np.where(tree_b.leaf[b], b, tree_b.first[b])
        total = count_a * count_b
        pair = np.repeat(np.arange(len(a)), total)
        place = _ranges(np.zeros(len(a), dtype=np.intp), total)
        a, b = (first_a[pair] + place // count_b[pair]).astype(np.intp), (first_b[pair] + place % count_b[pair]).astype(np.intp)
    leaf_a, leaf_b = (np.concatenate(nodes) for nodes in zip(*found))
    count_a, count_b = tree_a.count[leaf_a].astype(np.intp), tree_b.count[leaf_b].astype(np.intp)
    total = count_a * count_b
    pair = np.repeat(np.arange(len(leaf_a)), total)
    place = _ranges(np.zeros(len(leaf_a), dtype=np.intp), total)
    entry_a = tree_a.first[leaf_a][pair] + place // count_b[pair]
    entry_b = tree_b.first[leaf_b][pair] + place % count_b[pair]
    return np.stack([tree_a.primitives[entry_a], tree_b.primitives[entry_b]], axis=1).astype(np.intp)
