"""What strategies do, in a clause each: the pages explain with them what they recommend. From the headers of the strategies."""

from __future__ import annotations

from collections.abc import Iterable

#: By strategy; one that is not here is named only.
METHODS: dict[str, str] = {
    "auto": "chooses among other strategies by counts of the scene, and changes its choice while it runs",
    "bottom_up": "recomputes all boxes from the leaves up at every frame",
    "bd_tree": "computes boxes from the few coordinates of a reduced model, where a query visits them",
    "drift_boxes": "inflates old boxes by how far the vertices have moved since, and keeps a list of near pairs for several frames",
    "drift_boxes_bounded": "inflates old boxes by a bound on the vertices' steps, and keeps a list of near pairs for several frames",
    "drift_rebuild": "refits at every frame, and sorts the tree again when its queries have become expensive",
    "front": "refits at every frame, and starts each query from the pairs of nodes that overlapped in the last one",
    "hybrid": "refits the upper levels at every frame, and deeper boxes only where a query visits them",
    "inflated_lazy": "inflates boxes by a bound on the vertices' steps, and refits them when the inflation is used up",
    "interval_join": "finds the pairs that come near each other once a segment, with their times, and reads each frame's from that list",
    "interval_join_ahead": "computes the interval join of the next segment while the frames of this one pass",
    "kinetic_aabb": "updates a box only when another vertex comes to determine one of its sides",
    "kinetic_envelope": "finds once a segment when each side of a box changes its vertex, and updates only these",
    "leaf_slabs": "is a drop-in refit: boxes are recomputed at every frame, and pairs of leaves are also compared by a pair of parallel planes "
    "around each leaf before triangles are",
    "linear_bounds": "computes boxes at both ends of a segment, and queries interpolate between them",
    "morph_boxes": "blends the boxes of the keyframes by their weights",
}  # fmt: skip


def explained(titles: Iterable[tuple[str, str]]) -> str:
    """Returns a sentence for each of some strategies, given as (id, title), that METHODS knows; "" without any."""
    said = [f"{title[0].upper()}{title[1:]} {METHODS[id]}." for id, title in dict.fromkeys(titles) if id in METHODS]
    return " ".join(said)
