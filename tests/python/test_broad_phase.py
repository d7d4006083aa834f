"""The broad phase from Python: candidates against all pairs, arrays as they lie, errors that name what is wrong."""

import unittest

import numpy as np

import kbvh

KINDS = ("vertex_vertex", "edge_vertex", "edge_edge", "face_vertex", "edge_face", "face_face")


def sheet(side, seed):
    """Returns a crumpled sheet: vertices, edges, faces."""
    random = np.random.default_rng(seed)
    at = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)
    v = np.column_stack([np.abs(np.remainder(at[:, 0] + side / 4, side / 2) - side / 4), at[:, 1], 0.05 * at[:, 0]])
    v = v + 0.2 * random.uniform(-1, 1, v.shape)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([corner, corner + 1, corner + side], 1),
                            np.stack([corner + 1, corner + side + 1, corner + side], 1)])  # fmt: skip
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    return v, edges, faces


def all_pairs(kind, v, edges, faces, radius, v1=None):
    """Returns candidates by definition, for coordinates whose sums with radius / 2 need no rounding to compare."""
    lists = {"vertex": np.arange(len(v))[:, None], "edge": edges, "face": faces}
    first, second = (lists[word] for word in kind.split("_"))
    both = v[None] if v1 is None else np.stack([v, v1])
    low, high = both.min(0) - radius / 2, both.max(0) + radius / 2
    boxes = [(low[ids].min(1), high[ids].max(1)) for ids in (first, second)]
    (low_a, high_a), (low_b, high_b) = boxes
    meet = np.all((low_a[:, None] <= high_b[None]) & (low_b[None] <= high_a[:, None]), axis=2)
    meet &= ~(first[:, None, :, None] == second[None, :, None, :]).any(axis=(2, 3))
    if first is second:
        meet &= np.triu(np.ones_like(meet), 1)
    return {(int(a), int(b)) for a, b in np.argwhere(meet)}


def pairs(found):
    return {(int(a), int(b)) for a, b in found}


class Candidates(unittest.TestCase):
    def test_are_those_of_all_pairs(self):
        v, edges, faces = sheet(10, 1)
        w = v + 0.3 * np.random.default_rng(2).uniform(-1, 1, v.shape)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        for kind in KINDS:
            self.assertEqual(pairs(broad.candidates(kind)), all_pairs(kind, v, edges, faces, 0.125), kind)
        broad.update(v, w)
        for kind in KINDS:
            found = broad.candidates(kind)
            self.assertEqual(len(found), len(pairs(found)))
            self.assertEqual(pairs(found), all_pairs(kind, v, edges, faces, 0.125, w), kind)
        broad.build(v, edges, faces, radius=0.125, v1=w)
        self.assertEqual(pairs(broad.candidates("edge_edge")), all_pairs("edge_edge", v, edges, faces, 0.125, w))

    def test_arrays_are_read_as_they_lie(self):
        v, edges, faces = sheet(10, 3)
        expected = all_pairs("edge_edge", v, edges, faces, 0.0)
        wide = np.zeros((len(v), 7))
        wide[:, 1:6:2] = v
        for array in (v, np.asfortranarray(v), wide[:, 1:6:2], v[::-1].copy()[::-1], v.tolist()):
            broad = kbvh.BroadPhase()
            broad.build(array, np.asfortranarray(edges), faces.astype(np.uint16))
            self.assertEqual(pairs(broad.candidates("edge_edge")), expected)
        single = kbvh.BroadPhase("float32")
        single.build(v.astype(np.float32), edges, faces)
        self.assertGreater(len(single.candidates("edge_edge")), 100)

    def test_moved_vertices_and_bounds(self):
        v, edges, faces = sheet(12, 4)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        broad.candidates("face_face")
        v[[5, 60]] += 0.25
        broad.update(v, moved=[5, 60])
        self.assertEqual(pairs(broad.candidates("face_face")), all_pairs("face_face", v, edges, faces, 0.125))
        broad.valid_for(0.25)
        before = broad.detections
        kept = pairs(broad.candidates("edge_edge"))
        broad.update(v + 0.125)
        self.assertLessEqual(all_pairs("edge_edge", v + 0.125, edges, faces, 0.125), kept)
        self.assertEqual(pairs(broad.candidates("edge_edge")), kept)
        self.assertEqual(broad.detections, before + 1)
        self.assertAlmostEqual(broad.left, 0.125)
        broad.update(v + 0.5)
        broad.candidates("edge_edge")
        self.assertEqual(broad.detections, before + 2)


class Filters(unittest.TestCase):
    def test_groups_pairs_and_functions(self):
        v, edges, faces = sheet(10, 6)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        every = all_pairs("edge_edge", v, edges, faces, 0.125)
        parity = np.arange(len(edges)) % 2
        broad.set_groups("edge", groups=1 << parity, masks=2 >> parity)
        odd = {pair for pair in every if sum(pair) % 2 == 1}
        self.assertEqual(pairs(broad.candidates("edge_edge")), odd)
        some = sorted(odd)[:5]
        broad.exclude("edge_edge", [(b, a) for a, b in some])
        self.assertEqual(pairs(broad.candidates("edge_edge")), odd - set(some))
        broad.exclude("edge_edge", [])
        broad.keep_only(lambda kind, found: (found[:, 0] > 40) & (kind == "edge_edge"))
        self.assertEqual(pairs(broad.candidates("edge_edge")), {pair for pair in odd if pair[0] > 40})
        broad.keep_only(None)
        broad.set_groups("edge", [], [])
        broad.set_vertex_groups(groups=np.ones(len(v), int), masks=np.full(len(v), 2))
        self.assertEqual(len(broad.candidates("face_face")), 0)
        broad.clear_filters()
        self.assertEqual(pairs(broad.candidates("edge_edge")), every)

    def test_rings_and_self_intersections(self):
        v, edges, faces = sheet(10, 6)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        connected = np.eye(len(v), dtype=bool)
        connected[edges[:, 0], edges[:, 1]] = connected[edges[:, 1], edges[:, 0]] = True
        broad.exclude_rings(1)
        for kind, elements in (("edge_edge", edges), ("face_face", faces)):
            expected = {(a, b) for a, b in all_pairs(kind, v, edges, faces, 0.125)
                        if not connected[np.ix_(elements[a], elements[b])].any()}  # fmt: skip
            self.assertEqual(pairs(broad.candidates(kind)), expected)
        broad.exclude_rings(0)
        touching = pairs(broad.self_intersections())
        self.assertGreater(len(touching), 0)
        self.assertEqual(touching, pairs(broad.within("face_face", 0.0)))
        broad.use_threads(1)
        with self.assertRaisesRegex(ValueError, "0 threads"):
            broad.use_threads(0)

    def test_functions_that_fail(self):
        v, edges, faces = sheet(10, 6)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        broad.keep_only(lambda kind, found: [1] / 0)
        with self.assertRaises(TypeError):
            broad.candidates("edge_edge")
        broad.keep_only(lambda kind, found: found)
        with self.assertRaisesRegex(ValueError, "truth values"):
            broad.candidates("edge_edge")
        broad.keep_only(lambda kind, found: np.ones(len(found) - 1, bool))
        with self.assertRaisesRegex(ValueError, "truth values"):
            broad.candidates("edge_edge")
        with self.assertRaisesRegex(ValueError, "99999"):
            broad.exclude("edge_edge", [[0, 99999]])
        broad.keep_only(None)
        self.assertEqual(pairs(broad.candidates("edge_edge")), all_pairs("edge_edge", v, edges, faces, 0.125))

    def test_functions_that_use_the_broad_phase_that_asks_them(self):
        v, edges, faces = sheet(10, 6)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        uses = [
            lambda: broad.candidates("edge_edge"),
            lambda: broad.keep_only(None),
            lambda: broad.update(v),
            lambda: broad.build(v, edges, faces),
            broad.clear_filters,
        ]
        for use in uses:
            broad.keep_only(lambda kind, found, use=use: use() or np.ones(len(found), bool))
            with self.assertRaisesRegex(RuntimeError, "the broad phase that asks the filter"):
                broad.candidates("edge_edge")
        # It goes on as before, and its numbers can be asked for.
        broad.keep_only(lambda kind, found: np.full(len(found), broad.detections > 0))
        self.assertEqual(pairs(broad.candidates("edge_edge")), all_pairs("edge_edge", v, edges, faces, 0.125))


class Edits(unittest.TestCase):
    def test_elements_and_changes(self):
        v, edges, faces = sheet(10, 7)
        broad = kbvh.BroadPhase()
        broad.build(v, edges, faces, radius=0.125)
        every = all_pairs("edge_edge", v, edges, faces, 0.125)
        begun, ended = broad.changes("edge_edge")
        self.assertEqual((pairs(begun), len(ended)), (every, 0))
        self.assertEqual(pairs(broad.changes("edge_edge", distance=0.125).begun), pairs(broad.within("edge_edge", 0.125)))
        gone = {int(begun[0, 0]), int(begun[-1, 1])}
        broad.remove("edge", sorted(gone))
        changes = broad.changes("edge_edge")
        self.assertEqual(pairs(changes.ended), {pair for pair in every if gone & set(pair)})
        self.assertEqual(len(changes.begun), 0)
        self.assertEqual(broad.insert(v[:1] + 0.25, edges=[[100, 5]]), (100, len(edges), len(faces)))
        w = np.concatenate([v, v[:1] + 0.25])
        broad.update(w)
        every = all_pairs("edge_edge", w, np.concatenate([edges, [[100, 5]]]), faces, 0.125)
        self.assertEqual(pairs(broad.candidates("edge_edge")), {pair for pair in every if not gone & set(pair)})
        self.assertEqual(broad.insert(faces=[[0, 1, 100]]), (101, len(edges) + 1, len(faces)))
        for wrong, call in (
            ("removed before", lambda: broad.remove("edge", sorted(gone))),
            ("vertex, an edge or a face", lambda: broad.remove("corner", [1])),
            ("names vertex 101 of 101", lambda: broad.insert(edges=[[0, 101]])),
        ):
            with self.assertRaisesRegex(ValueError, wrong):
                call()

    def test_earliest_impacts(self):
        v = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.25, 0.25, 8.0]])
        w = v * [1, 1, 0]
        broad = kbvh.BroadPhase()
        broad.build(v, [], [[0, 1, 2]], radius=2, v1=w)
        for separation in (0, 0.5, 2):
            impact = broad.earliest_impact(separation)
            self.assertEqual((impact.kind, impact.first, impact.second), ("face_vertex", 0, 3))
            self.assertTrue(impact.begin <= 1 - separation / 8 <= impact.end)
        broad.update(v, v - [0, 0, 1])
        self.assertIsNone(broad.earliest_impact(2))
        with self.assertRaisesRegex(ValueError, "separation from 0 to the radius 2"):
            broad.earliest_impact(3)
        broad.update(v)
        with self.assertRaisesRegex(ValueError, "without a motion"):
            broad.earliest_impact()


class Errors(unittest.TestCase):
    def test_name_what_is_wrong(self):
        v, edges, faces = sheet(4, 5)
        broad = kbvh.BroadPhase()
        for wrong, call in (
            ("before build", lambda: broad.candidates("edge_edge")),
            ("face 0 names vertex 99 of 16", lambda: broad.build(v, edges, [[0, 1, 99]])),
            ("shape .n, 2", lambda: broad.build(v, faces, faces)),
            ("shape .n, 3", lambda: broad.build(v[:, :2], edges, faces)),
            ("radius is -1", lambda: broad.build(v, edges, faces, radius=-1)),
            ("no real numbers", lambda: broad.build([["a"]], edges, faces)),
            ("float32 or float64", lambda: kbvh.BroadPhase("float16")),
        ):
            with self.assertRaisesRegex((ValueError, TypeError), wrong):
                call()
        broad.build(v, edges, faces, radius=0.5)
        bad = v.copy()
        bad[3, 1] = np.nan
        for wrong, call in (
            ("coordinate y of vertex 3 is nan", lambda: broad.update(bad)),
            ("V1: coordinate y of vertex 3", lambda: broad.update(v, bad)),
            ("15 rows for 16", lambda: broad.update(v[:15])),
            ("vertex 16 moved", lambda: broad.update(v, moved=[16])),
            ("not to a motion", lambda: broad.update(v, v, moved=[1])),
            ("from 0 to the radius 0.5", lambda: broad.within("edge_edge", 0.75)),
            ("edge_vertex", lambda: broad.candidates("vertex_edge")),
        ):
            with self.assertRaisesRegex(ValueError, wrong):
                call()
        self.assertEqual(pairs(broad.candidates("face_face")), all_pairs("face_face", v, edges, faces, 0.5))


if __name__ == "__main__":
    unittest.main()
