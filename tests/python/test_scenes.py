"""Scenes from files, by formula and built in are those that the program plays."""

import pathlib
import struct
import tempfile
import unittest

import numpy as np

import kbvh
from scenes import pairs


class Files(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.addCleanup(self.place.cleanup)
        self.folder = pathlib.Path(self.place.name)
        (self.folder / "quad.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
        rest = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="f4")
        self.frames = np.stack([rest + np.float32([0, 0, k]) for k in range(3)])
        head = b"POINTCACHE2\0" + struct.pack("<iiffi", 1, 4, 0.0, 1.0, 3)
        (self.folder / "quad.pc2").write_bytes(head + self.frames.tobytes())

    def test_a_mesh_and_its_point_cache(self):
        still = kbvh.load(self.folder / "quad.obj")
        self.assertEqual((still.keyframes, still.primitives, still.vertices), (1, 1, 4))
        self.assertEqual(np.asarray(still.indices).tolist(), [0, 1, 2, 3])
        moving = kbvh.load(self.folder / "quad.obj", self.folder / "quad.pc2", fps=10, name="quad", translate=[0, 0, 5])
        self.assertEqual(moving.name, "quad")
        self.assertTrue(np.allclose(moving.times, [0, 0.1, 0.2]))
        self.assertTrue(np.array_equal(moving.positions, self.frames + [0, 0, 5]))

    def test_a_described_scene_is_that_of_its_arrays(self):
        described = kbvh.scene(
            {"bodies": [{"file": "quad.obj", "motion": "quad.pc2", "translate": [0, 0, -1]}, {"shape": "sphere", "triangles": 80}]},
            folder=self.folder,
        )
        copied = kbvh.Scene(
            [kbvh.Body(b.indices, np.array(b.positions), times=b.times, offsets=b.offsets, name=b.name) for b in described.bodies]
        )
        seen = 0
        for precision in ("float32", "float64"):
            first, second = (kbvh.World(play, "bottom_up", precision=precision) for play in (described, copied))
            for t, again in zip(first.play(l=4), second.play(l=4)):
                self.assertEqual(t, again)
                self.assertEqual(pairs(first.pairs()), pairs(second.pairs()))
                seen += len(first.pairs())
        self.assertGreater(seen, 0)

    def test_seams_are_welded_and_readers_warn(self):
        (self.folder / "seam.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\nl 1 2\n"
        )
        with self.assertWarns(UserWarning) as caught:
            welded = kbvh.load(self.folder / "seam.obj")
        said = [str(one.message) for one in caught.warnings]
        self.assertTrue(any("welded 2 vertices" in note for note in said), said)
        self.assertTrue(any("skipped 1 polyline" in note for note in said), said)
        self.assertEqual(np.asarray(welded.indices).tolist(), [0, 1, 2, 1, 5, 2])
        self.assertEqual(welded.vertices, 6)
        with self.assertWarnsRegex(UserWarning, "not welded"):
            apart = kbvh.load(self.folder / "seam.obj", weld=False)
        self.assertEqual(np.asarray(apart.indices).tolist(), [0, 1, 2, 3, 5, 4])

    def test_wrong_files(self):
        (self.folder / "bad.obj").write_text("v 0 0 0\nf 1 2 9\n")
        with self.assertRaisesRegex(kbvh.InputError, "bad.obj"):
            kbvh.load(self.folder / "bad.obj")
        with self.assertRaisesRegex(kbvh.InputError, "no_such_key"):
            kbvh.load(self.folder / "quad.obj", no_such_key=1)
        with self.assertRaisesRegex(ValueError, "is made of arrays"):
            kbvh.Scene([kbvh.load(self.folder / "quad.obj")]).script()


class SameAsTheProgram(unittest.TestCase):
    def test_worlds_count_what_studies_record(self):
        self.assertGreater(self.least_pairs({"builtin": "waving_sheet", "triangles": 200, "keyframes": 3}), 0)

    def test_worlds_count_what_studies_record_on_curves(self):
        self.least_pairs({"builtin": "waving_sheet", "triangles": 200, "keyframes": 3, "curves": "smooth"})
        self.least_pairs({"builtin": "thrown_shards", "triangles": 200, "keyframes": 3})

    def least_pairs(self, description):
        """Compares a world with a study in both precisions; returns the smaller number of pairs."""
        sums = []
        for name, precision in (("float", "float32"), ("double", "float64")):
            with tempfile.TemporaryDirectory() as folder:
                plan = {"scenes": [description], "strategies": ["bottom_up"], "l": 3, "scalars": [name], "repetitions": 1}
                (run,) = kbvh.run(plan, folder).results.runs.to_dict("records")
            world = kbvh.World(kbvh.scene(description), "bottom_up", precision=precision)
            counts = [len(world.pairs()) for _ in world.play(l=3)]
            self.assertEqual((run["frames"], run["pairs"]), (len(counts), sum(counts)))
            counters = world.counters()
            for counter in ("values_written", "box_tests"):
                self.assertEqual(round(run[f"{counter}_per_frame"] * run["frames"]), counters[counter], counter)
            sums.append(sum(counts))
        return min(sums)

    def test_bodies_on_curves(self):
        made = kbvh.scene("thrown_cloth", triangles=200, keyframes=3)
        body = made.bodies[0]
        world = kbvh.World(made, "bottom_up", precision="float64")
        share = 0.25
        world.reset(body.times[0] + share * (body.times[1] - body.times[0]))
        chord = (1 - share) * body.positions[0] + share * body.positions[1]
        curve = chord + share * (1 - share) * (body.bends[0] + body.twists[0] * share)
        self.assertTrue(np.allclose(world.positions(0), curve, atol=1e-9))
        self.assertGreater(np.abs(curve - chord).max(), 0.1)
        self.assertIsNone(made.bodies[1].bends)
        lines = kbvh.scene("thrown_cloth", triangles=200, keyframes=3, curves="lines").bodies[0]
        self.assertIsNone(lines.bends)
        self.assertTrue(np.array_equal(lines.positions, body.positions))
        with self.assertRaisesRegex(kbvh.ConfigError, "foresees linear motion only"):
            kbvh.World(made, "auto")
        with self.assertRaisesRegex(ValueError, r"bends are \[1\]\[3\]\[3\], not \[2, 3, 3\]"):
            kbvh.Body([0, 1, 2], np.zeros((2, 3, 3)), times=[0, 1], bends=np.zeros((2, 3, 3)))

    def test_every_built_in_scene_can_be_made(self):
        for name in kbvh.builtin_scenes():
            if name in ("shirt", "dress"):  # a simulation of seconds
                continue
            made = kbvh.scene(name, triangles=400, keyframes=3)
            self.assertGreater(made.primitives, 0, name)
            self.assertTrue(any(body.keyframes > 1 for body in made.bodies) or made.changes, name)


if __name__ == "__main__":
    unittest.main()
