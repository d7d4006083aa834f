"""Vertices, edges and faces as bodies over one vertex set, and radii, from arrays and from descriptions: candidates against all
pairs of boxes, positions of vertices, and errors that say what is wrong."""

import unittest

import numpy as np

import kbvh
from test_broad_phase import all_pairs, sheet

SHEET = {
    "bodies": [
        {"shape": "waving_sheet", "triangles": 98, "keyframes": 3, "name": "cloth"},
        {"elements": "vertices", "of": "cloth", "name": "corners"},
        "elements=edges,of=cloth",
    ],
    "pairs": [["corners", "cloth"], ["cloth-edges", "cloth-edges"]],
}


def rows(body):
    """The primitives of a body whose primitives have one number of vertices, [primitive][corner]."""
    corners = 3 if body.offsets is None else int(np.diff(np.asarray(body.offsets, dtype=int))[0])
    return np.asarray(body.indices, dtype=int).reshape(-1, corners)


def found(world):
    """The pairs of a world of faces, vertices and edges: faces with vertices, and edges with edges."""
    pairs = [tuple(int(n) for n in pair) for pair in world.pairs()[["body_a", "primitive_a", "body_b", "primitive_b"]].tolist()]
    assert len(set(pairs)) == len(pairs) and {(a, b) for a, _, b, _ in pairs} <= {(0, 1), (2, 2)}
    return {(i, j) for a, i, b, j in pairs if b == 1}, {(i, j) for a, i, b, j in pairs if b == 2}


def elements_of(v, faces):
    """A mesh at rest whose positions are set frame by frame, with its vertices and edges, and two kinds of candidates."""
    cloth = kbvh.Body(faces, v, known=False, name="cloth")
    bodies = [cloth, kbvh.elements(cloth, "vertices"), kbvh.elements(cloth, "edges")]
    return kbvh.Scene(bodies, pairs=[(0, 1), (2, 2)])


class Elements(unittest.TestCase):
    def test_are_bodies_over_the_vertices_of_another(self):
        v, edges, faces = sheet(6, 1)
        play = elements_of(v, faces)
        cloth, corners, sides = play.bodies
        self.assertIs(sides.over, cloth)
        self.assertIs(sides.positions, cloth.positions)
        self.assertEqual((sides.vertices, sides.keyframes, sides.known, sides.name), (36, 1, False, "cloth-edges"))
        self.assertEqual(rows(corners).tolist(), np.arange(36)[:, None].tolist())
        self.assertEqual({tuple(edge) for edge in rows(sides).tolist()}, {tuple(edge) for edge in edges.tolist()})
        self.assertEqual(rows(kbvh.elements(cloth, "faces", name="again")).tolist(), faces.tolist())
        # Polygons, in the order of their larger and then of their smaller vertex.
        house = kbvh.Body([0, 1, 2, 3, 2, 1, 4], np.zeros((5, 3)), offsets=[0, 4, 7])
        self.assertEqual(rows(kbvh.elements(house, "edges")).tolist(), [[0, 1], [1, 2], [0, 3], [2, 3], [1, 4], [2, 4]])

    def test_a_description_names_what_python_names(self):
        described = kbvh.scene(SHEET, radius=0.1)
        cloth = described.bodies[0]
        self.assertEqual((described.radius, described.pairs), (0.1, [(0, 1), (2, 2)]))
        for body, which in zip(described.bodies[1:], ("vertices", "edges")):
            made = kbvh.elements(cloth, which)
            self.assertIs(body.over, cloth)
            self.assertEqual(np.asarray(body.indices).tolist(), np.asarray(made.indices).tolist(), which)
            self.assertEqual(np.asarray(body.offsets).tolist(), np.asarray(made.offsets).tolist(), which)
        self.assertIsNone(kbvh.scene(SHEET).radius)
        self.assertEqual(kbvh.scene("waving_sheet", triangles=50, keyframes=2, radius=0).radius, 0)


class Candidates(unittest.TestCase):
    def test_of_a_description(self):
        for radius in (0, 0.03, 0.2):
            for id in ("bottom_up", "interval_join", "brute_force"):
                world, seen = kbvh.World(kbvh.scene(SHEET, radius=radius), id, precision="float64"), 0
                faces, edges = rows(world.scene.bodies[0]), rows(world.scene.bodies[2])
                for t in world.play(l=2):
                    v, answer = world.positions(1), found(world)
                    self.assertEqual(v.shape, (world.scene.bodies[0].vertices, 3))
                    for kind, pairs in zip(("face_vertex", "edge_edge"), answer):
                        # Boxes of vertices that move are larger by a few roundings.
                        less, more = (all_pairs(kind, v, edges, faces, r) for r in (max(radius - 1e-9, 0), radius + 1e-9))
                        self.assertLessEqual(less, pairs, f"{id}, {kind}, t = {t}")
                        self.assertLessEqual(pairs, more, f"{id}, {kind}, t = {t}")
                        seen += len(pairs)
                self.assertGreater(seen, 0)
            for verdict in kbvh.check("bottom_up", [kbvh.scene(SHEET, radius=radius)], l=2):
                self.assertTrue(verdict.holds and not verdict.left_out, str(verdict))

    def test_of_positions_set_frame_by_frame(self):
        radius = 0.125
        v, _, faces = sheet(10, 1)
        for id in ("bottom_up", "dirty_refit", "lbvh"):
            play = elements_of(v, faces)
            world, broad = kbvh.World(play, id, precision="float64", radius=radius), kbvh.BroadPhase()
            edges = rows(play.bodies[2])
            broad.build(v, edges, faces, radius=radius)
            for frame in range(4):
                w = sheet(10, 1 + frame)[0]
                if frame > 0:
                    given = kbvh.padded(w, "float64")
                    self.assertFalse(world.set_positions(frame % 3, given), "boxes are copies")
                    given[:] = 0
                    world.advance(frame)
                    broad.update(w)
                self.assertTrue(np.array_equal(world.positions(2), w))
                for kind, pairs in zip(("face_vertex", "edge_edge"), found(world)):
                    self.assertEqual(pairs, all_pairs(kind, w, edges, faces, radius), f"{id}, {kind}")
                    self.assertEqual(pairs, {tuple(int(n) for n in pair) for pair in broad.candidates(kind)}, f"{id}, {kind}")
                    self.assertGreater(len(pairs), 10)

    def test_of_vertices_that_moved(self):
        v, _, faces = sheet(10, 1)
        # A tree of many nodes: where most of them hold vertices that moved, all are refitted.
        many = {"width": 2, "leaf_size": 1}
        world = kbvh.World(elements_of(v, faces), "dirty_refit", precision="float64", radius=0.125, topology=many)
        w = v.copy()
        w[[7, 50]] = sheet(10, 2)[0][[7, 50]]
        world.set_positions(0, w, moved=[7, 50])
        world.advance(1)
        self.assertEqual(found(world)[0], all_pairs("face_vertex", w, rows(world.scene.bodies[2]), faces, 0.125))
        self.assertEqual(world.audit(2).protrusion, 0)
        world.set_positions(0, v + [0, 0, 5], moved=[7])
        world.advance(2)
        world.pairs()
        self.assertGreater(world.audit(2).protrusion, 0)

    def test_of_edges_that_come_and_go(self):
        v, _, faces = sheet(10, 1)
        world = kbvh.World(elements_of(v, faces), "bottom_up", precision="float64", radius=0.125)
        edges = rows(world.scene.bodies[2])
        gone, added = {0, 5, 17}, [[0, 99], [12, 40]]
        before = found(world)
        world.change_geometry(primitives={2: added}, removed_primitives={2: sorted(gone)})
        all_edges = all_pairs("edge_edge", v, np.vstack([edges, added]), faces, 0.125)
        expected = {pair for pair in all_edges if not gone & set(pair)}
        self.assertTrue(any(pair[1] >= len(edges) for pair in expected))
        self.assertEqual(found(world), (before[0], expected))
        with self.assertRaisesRegex(ValueError, "a new primitive of body 2 refers to vertex 100, but there are 100"):
            world.change_geometry(primitives={2: [[0, 100]]})

    def test_of_exact_intersections_without_a_radius(self):
        # An edge through a face of the same vertex set; a second edge has a vertex of the face.
        v = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.2, 0.2, 1]], dtype="f4")
        face = kbvh.Body([0, 1, 2], v, name="face")
        edges = kbvh.Body([3, 4, 0, 4], offsets=[0, 2, 4], over=face, name="edges")
        world = kbvh.World([face, edges], "bottom_up")
        self.assertEqual(world.pairs()[["primitive_a", "primitive_b"]].tolist(), [(0, 0)])
        self.assertEqual(len(world.true_pairs()), 1)


class Wrong(unittest.TestCase):
    def test_bodies(self):
        body = kbvh.Body([[0, 1, 2]], np.eye(3), name="face")
        edge = kbvh.Body([0, 1], offsets=[0, 2], over=body, name="edge")
        for error, text, call in (
            (TypeError, "body 'edge': over is a Body, not int", lambda: kbvh.Body([0, 1], offsets=[0, 2], over=0, name="edge")),
            (ValueError, "positions, times, curves and known are those of 'face'", lambda: kbvh.Body([0, 1, 2], np.eye(3), over=body)),
            (ValueError, "positions, times, curves and known are those of 'face'", lambda: kbvh.Body([0, 1, 2], over=body, known=False)),
            (ValueError, r"positions are \[vertex\]\[3\]", lambda: kbvh.Body([0, 1, 2])),
            (ValueError, "body 'edge': the body 'face', over whose vertices it is, must come before it", lambda: kbvh.World([edge, body])),
            (ValueError, "body 'edge': the body 'face', over whose vertices it is, must come before it", lambda: kbvh.World([edge])),
            (ValueError, "refers to vertex 3", lambda: kbvh.World([body, kbvh.Body([0, 3], offsets=[0, 2], over=body)])),
            (ValueError, "vertices, edges or faces, not 'corners'", lambda: kbvh.elements(body, "corners")),
            (ValueError, "consists of points and has no edges", lambda: kbvh.elements(kbvh.Body([0], np.eye(3), offsets=[0, 1], shape="points"), "edges")),
            (ValueError, "2 indices do not make triangles", lambda: kbvh.elements(kbvh.Body([0, 1], np.eye(3)), "edges")),
        ):  # fmt: skip
            with self.assertRaisesRegex(error, text):
                call()

    def test_descriptions(self):
        cloth = {"shape": "waving_sheet", "triangles": 8, "name": "cloth"}
        for text, description in (
            ("there is no body 'clot'", {"bodies": [cloth, {"elements": "edges", "of": "clot"}]}),
            ("has no mesh, only the faces of 'a'", {"bodies": [{"elements": "edges", "of": "b", "name": "a"}, {"elements": "faces", "of": "a", "name": "b"}]}),
            ("must not be negative", {"builtin": "waving_sheet", "radius": -1}),
            ("it changes plans at run time", {"builtin": "reversing_spheres", "radius": 1}),
        ):  # fmt: skip
            with self.assertRaisesRegex(kbvh.InputError, text):
                kbvh.scene(description)

    def test_radii(self):
        body = kbvh.Body([[0, 1, 2]], np.eye(3), name="face")
        for radius in (-1, float("nan"), float("inf"), 1e31):
            with self.assertRaisesRegex(ValueError, "the radius is .*, not a number from 0 to 1e.30 in float"):
                kbvh.World([body, body], radius=radius)
        with self.assertRaisesRegex(TypeError, "a real number, not str"):
            kbvh.World([body, body], radius="1")
        table = kbvh.strategies()
        for id in table.index[table["primitives"].map(lambda words: "control_nets" not in words)]:
            with self.assertRaisesRegex(kbvh.ConfigError, f"'{id}' takes no radius"):
                kbvh.World([body, body], id, radius=1)
        world = kbvh.World([body, body], "bottom_up", radius=1)
        self.assertEqual(len(world.pairs()), 1)
        zero = np.zeros((1, 3))
        for call in (
            lambda: world.hits([[0, 0, 0]], [[1, 1, 1]]),
            lambda: world.within([[0, 0, 0]], 1),
            lambda: world.contacts(1),
            lambda: world.change_plans(kbvh.PlanChange(0, 0, [0], zero)),
            lambda: world.change_geometry(vertices={0: (zero, zero)}),
        ):
            with self.assertRaisesRegex(RuntimeError, "a world with a radius consists of boxes"):
                call()


if __name__ == "__main__":
    unittest.main()
