"""Strategies in Python: sound ones hold, faulty ones are refused, in conformance and in studies."""

import tempfile
import unittest

import numpy as np

import kbvh


class Boxes(kbvh.Strategy):
    """All pairs of boxes, by numpy."""

    id = "py_boxes"
    self_pairs = True

    def advance(self):
        self.boxes = [
            kbvh.primitive_bounds(body.offsets, body.indices, self.motion.positions(i))
            for i, body in enumerate(self.scene.bodies)
        ]
        self.tests = 0

    def candidates(self):
        found = [np.empty((0, 4), dtype=np.intp)]
        for a, b in self.scene.pairs:
            touch = np.all(
                (self.boxes[a][:, None, 0] <= self.boxes[b][None, :, 1])
                & (self.boxes[b][None, :, 0] <= self.boxes[a][:, None, 1]),
                axis=2,
            )
            self.tests += touch.size
            if a == b:
                corners = self.scene.bodies[a].indices.reshape(-1, 3)
                touch &= ~np.any(corners[:, None, :, None] == corners[None, :, None, :], axis=(2, 3))
                touch = np.triu(touch, 1)
            i, j = np.nonzero(touch)
            found.append(np.stack([np.full_like(i, a), i, np.full_like(j, b), j], axis=1))
        return np.concatenate(found)

    def counters(self):
        return {"box_tests": self.tests, "own_number": 7}


class Refitted(kbvh.Strategy):
    """A refitted tree, by numpy."""

    id = "py_refit"
    topology = {"width": 4, "leaf_size": 4}
    tightness = "tight"
    parameters = {"shrink": kbvh.Parameter(0, "how much boxes are shrunk: a fault", least=0, most=1)}

    def advance(self):
        self.bounds_of = []
        for i, (body, tree) in enumerate(zip(self.scene.bodies, self.scene.trees)):
            bounds = kbvh.refit(tree, kbvh.primitive_bounds(body.offsets, body.indices, self.motion.positions(i)))
            inset = float(self.params["shrink"]) * (bounds[:, 1] - bounds[:, 0])
            bounds[:, 0] += inset.astype(bounds.dtype)
            self.bounds_of.append(bounds)

    def candidates(self):
        found = []
        for a, b in self.scene.pairs:
            pairs = kbvh.overlapping(self.scene.trees[a], self.bounds_of[a], self.scene.trees[b], self.bounds_of[b])
            found.append(np.insert(np.insert(pairs, 1, b, axis=1), 0, a, axis=1))
        return np.concatenate(found)

    def bounds(self, body):
        return self.bounds_of[body]


def variant(name, base=Boxes, **members):
    """A registered class with other members."""
    return kbvh.register(type(name, (base,), {"id": name, "__doc__": "A variant.", **members}))


class Conformance(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        kbvh.register(Boxes)
        kbvh.register(Refitted)

    def test_sound_strategies_hold_on_every_small_scene(self):
        for strategy in (Boxes, Refitted):
            verdicts = kbvh.check(strategy)
            self.assertTrue(all(verdict.holds for verdict in verdicts), "\n".join(map(str, verdicts)))
            self.assertGreater(sum(verdict.pairs for verdict in verdicts), 500)
        left_out = [verdict for verdict in kbvh.check("py_refit") if verdict.left_out]
        self.assertEqual({verdict.scene for verdict in left_out}, {"tightening_knot-240"})
        audit = kbvh.check("py_refit")[0].audit
        self.assertGreater(audit["nodes"], 0)
        self.assertEqual((audit["invalid"], audit["not_tight"], audit["protrusion"]), (0, 0, 0.0))

    def test_a_forgotten_pair_is_found_and_named(self):
        variant("py_forgets", candidates=lambda self: Boxes.candidates(self)[::2])
        verdicts = kbvh.check("py_forgets", kbvh.small_scenes()[:2])
        self.assertFalse(any(verdict.holds for verdict in verdicts))
        first = verdicts[0]
        self.assertGreater(first.missed, 0)
        self.assertGreater(len(first.missed_pairs), 0)
        self.assertEqual(first.extra_pairs, [])
        a, i, b, j = first.missed_pairs[0]
        self.assertIn(f"({a}:{i}, {b}:{j})", str(first))
        self.assertIn("BROKEN", str(first))
        # It is the pair that brute force knows, at the frame that is named.
        world = kbvh.World(kbvh.small_scenes()[0], "brute_force", t=first.wrong_at)
        self.assertIn(first.missed_pairs[0], [tuple(pair) for pair in world.pairs().tolist()])

    def test_other_faults(self):
        soup = kbvh.small_scenes()[:1]
        cases = {
            "py_twice": ({"candidates": lambda self: np.repeat(Boxes.candidates(self), 2, axis=0)}, "more than once"),
            "py_late": ({"advance": lambda self: None, "reset": Boxes.advance}, "not among the candidates"),
            "py_beyond": ({"candidates": lambda self: [[0, 0, 1, 99]]}, "body 1 has 24 primitives; there is no primitive 99"),
            "py_shape": ({"candidates": lambda self: [[0, 0, 1]]}, r"no array \[pair\]\[4\]"),
            "py_floats": ({"candidates": lambda self: np.ones((2, 4))}, "no whole numbers"),
            "py_raises": ({"candidates": lambda self: 1 / 0}, "ZeroDivisionError"),
        }
        for id, (members, text) in cases.items():
            variant(id, **members)
            (verdict,) = kbvh.check(id, soup, precisions=["float32"])
            self.assertFalse(verdict.holds, id)
            self.assertRegex(verdict.why, text, id)

    def test_wrong_bounds_are_found_by_the_audit(self):
        (verdict,) = kbvh.check(Refitted, kbvh.small_scenes()[:1], {"shrink": 0.01}, precisions=["float64"])
        self.assertFalse(verdict.holds)
        self.assertGreater(verdict.audit["protrusion"], 0)
        self.assertRegex(verdict.why, "body 0|not among")

    def test_pairs_in_the_wrong_order_are_put_right(self):
        variant("py_swapped", candidates=lambda self: Boxes.candidates(self)[:, [2, 3, 0, 1]])
        (verdict,) = kbvh.check("py_swapped", kbvh.small_scenes()[:1], precisions=["float32"])
        self.assertTrue(verdict.holds, str(verdict))

    def test_curves_are_for_strategies_that_foresee_no_lines(self):
        thrown = [kbvh.scene("thrown_shards", triangles=60, keyframes=3)]
        (verdict,) = kbvh.check(Boxes, thrown, precisions=["float32"])
        self.assertTrue(verdict.holds and not verdict.left_out, str(verdict))
        variant("py_foresees_lines", foresight="next_keyframe")
        for id in ("py_foresees_lines", "auto"):
            (verdict,) = kbvh.check(id, thrown, precisions=["float32"])
            self.assertTrue(verdict.left_out, str(verdict))
            self.assertIn("foresees linear motion only", verdict.why)

    def test_foresight_is_what_was_declared(self):
        seen = []

        def advance(self):
            seen.append({name for name in ("displacement_bound", "lines_end", "keyframe") if hasattr(self.motion, name)})
            if hasattr(self.motion, "lines_end"):
                end = self.motion.lines_end(0)
                ahead = self.motion.positions_on_lines(0, min(end, self.motion.time + 0.1))
                assert ahead.shape == self.motion.positions(0).shape
            if hasattr(self.motion, "keyframe"):
                assert self.motion.keyframe(0, 1).shape == self.motion.positions(0).shape
            Boxes.advance(self)

        expected = [set(), {"displacement_bound"}, {"displacement_bound", "lines_end"}]
        expected.append(expected[-1] | {"keyframe"})
        for word, names in zip(("none", "step_bound", "next_keyframe", "whole_clip"), expected):
            seen.clear()
            id = f"py_sees_{word}"
            variant(id, advance=advance, foresight=word)
            (verdict,) = kbvh.check(id, kbvh.small_scenes()[:1], precisions=["float32"])
            self.assertTrue(verdict.holds, str(verdict))
            self.assertEqual(seen[0], names)
            self.assertEqual(kbvh.strategies().loc[id, "foresight"], word)

    def test_spans_contacts_and_plan_changes(self):
        changed = []
        variant(
            "py_all",
            spans=lambda self, t0, t1: ([[0, 0, 1, 0]], [[t0, t1]]),
            swept_candidates=lambda self, t0, t1, before: [[0, i, 1, j] for i in range(24) for j in range(24)],
            plans_changed=lambda self, ids: changed.append(ids.tolist()),
        )
        self.assertLessEqual({"spans", "contacts", "plan_changes"}, set(kbvh.strategies().loc["py_all", "abilities"]))
        soup = kbvh.small_scenes()[0]
        world = kbvh.World(soup, "py_all")
        self.assertEqual(world.spans(0.25).tolist(), [(0, 0, 1, 0, 0.0, 0.25)])
        world.change_plans(kbvh.PlanChange(0, 1, np.array([3]), np.zeros((1, 3))))
        self.assertEqual(changed, [[[1, 3]]])
        mine, native = (kbvh.World(soup, id, precision="float64").contacts(0.5) for id in ("py_all", "bottom_up"))
        self.assertGreater(len(native), 0)
        self.assertTrue(np.array_equal(np.sort(mine), np.sort(native)))

    def test_errors_and_interruptions_reach_the_caller(self):
        def fail(self):
            raise LookupError("lost")

        def interrupt(self):
            raise KeyboardInterrupt

        variant("py_fails", candidates=fail)
        with self.assertRaisesRegex(LookupError, "lost"):
            kbvh.World(kbvh.small_scenes()[0], "py_fails").pairs()
        variant("py_interrupted", candidates=interrupt)
        for call in (
            lambda: kbvh.World(kbvh.small_scenes()[0], "py_interrupted").pairs(),
            lambda: kbvh.check("py_interrupted"),
            lambda: kbvh.run({"scenes": ["waving_sheet"], "strategies": ["py_interrupted"]}),
        ):
            with self.assertRaises(KeyboardInterrupt):
                call()

    def test_a_world_at_work_takes_no_positions(self):
        worlds, said = [], []
        lies = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="f4")

        def advance(self):
            for world in worlds:
                try:
                    world.set_positions(1, kbvh.padded(lies + np.float32([0, 0, 9])))
                except RuntimeError as error:
                    said.append(str(error))
            Boxes.advance(self)

        variant("py_sets_positions", advance=advance)
        bodies = [kbvh.Body([[0, 1, 2]], lies, known=False, name=name) for name in ("a", "b")]
        worlds.append(kbvh.World(bodies, "py_sets_positions"))
        for step in range(1, 20):
            self.assertTrue(worlds[0].set_positions(1, kbvh.padded(lies + np.float32([0, 0, step]))))
            worlds[0].advance(step)
            np.full(10, 7, dtype="f4")  # would take the place of memory that was freed
            self.assertEqual(worlds[0].positions(1)[0, 2], step)
        self.assertEqual(len(said), 19)
        self.assertIn("at work", said[0])

    def test_what_cannot_be_registered(self):
        for members, text in [
            ({"id": "bottom_up"}, "is a strategy of kbvh"),
            ({"id": "My Idea"}, "a word of a to z"),
            ({"foresight": "all"}, "foresight"),
            ({"guarantee": "maybe"}, "not 'maybe'"),
            ({"topology": {"depth": 3}}, "not 'depth'"),
            ({"topology": {"width": 3}}, "width 3"),
            ({"candidates": kbvh.Strategy.candidates}, "has no method candidates"),
        ]:
            with self.assertRaisesRegex(kbvh.ConfigError, text):
                kbvh.register(type("X", (Boxes,), {"id": "py_x", **members}))
        with self.assertRaises(TypeError):
            kbvh.register(int)
        self.assertNotIn("py_x", kbvh.strategies().index)

    def test_a_class_takes_the_place_of_its_namesake(self):
        variant("py_again", candidates=lambda self: [])
        world = kbvh.World(kbvh.small_scenes()[1], "py_again")
        variant("py_again")
        world.advance(0.5)  # the old one still plays
        self.assertEqual(len(world.pairs()), 0)
        self.assertTrue(kbvh.check("py_again", kbvh.small_scenes()[1:2])[0].holds)
        self.assertEqual(list(kbvh.strategies().index).count("py_again"), 1)


class Studies(unittest.TestCase):
    def test_a_small_study_beside_native_strategies(self):
        kbvh.register(Boxes)
        variant("py_wrong", candidates=lambda self: Boxes.candidates(self)[::2])
        plan = {
            "scenes": [{"builtin": "waving_sheet", "triangles": 200, "keyframes": 3, "obstacle": 80}],
            "strategies": ["bottom_up", "py_boxes", "py_wrong"],
            "l": 4,
            "repetitions": 2,
        }
        self.assertEqual(kbvh.plan(plan)["strategy"].tolist(), ["bottom_up", "py_boxes", "py_wrong"])
        with tempfile.TemporaryDirectory() as folder:
            first = kbvh.run(plan, folder)
            self.assertEqual((first.measured, first.skipped, first.refused), (3, 0, 1))
            self.assertIn("py_boxes", str(first))
            runs = first.results.runs.set_index("id")
            self.assertEqual(runs.loc["py_boxes", "family"], "python")
            self.assertTrue(runs.loc["py_boxes", "title"].endswith("(Python)"))
            self.assertIn("Written in Python", runs.loc["py_boxes", "about"])
            self.assertEqual(runs.loc["py_boxes", "pairs"], runs.loc["bottom_up", "pairs"])
            self.assertEqual(runs.loc["py_boxes", "own_number_per_frame"] * runs.loc["py_boxes", "frames"], 7)
            self.assertEqual(first.results.refused["id"].tolist(), ["py_wrong"])
            self.assertIn("not among the candidates", first.results.refused["refused"].iloc[0])
            self.assertEqual(len(first.results.repetitions), 4)
            self.compare(first.results)
            again = kbvh.run(plan, folder)
            self.assertEqual((again.measured, again.skipped), (0, 3))
            # Other code is another contestant.
            variant("py_wrong", counters=lambda self: {"other": 1})
            other = kbvh.run(plan, folder)
            self.assertEqual((other.measured, other.skipped, other.refused), (1, 2, 0))

    def compare(self, results):
        """Ratios and profiles follow from the repetitions."""
        runs = results.runs.set_index("id")["run"]
        columns = ["update", "plan_changes", "traversal", "triangle_tests"]
        times = results.repetitions.assign(total=results.repetitions[columns].sum(axis=1)).groupby("run")["total"].apply(list)
        own, other = times[runs["py_boxes"]], times[runs["bottom_up"]]
        # Of two repetitions, the median of a frame is its mean, and so the ratio is that of the sums.
        quotients, ratio = [b / a for a, b in zip(own, other)], sum(other) / sum(own)
        found = results.ratios(measure="without_motion")
        row = found.loc[runs["py_boxes"]]
        # Frames are recorded with five digits.
        self.assertAlmostEqual(row["ratio"] / ratio, 1, places=3)
        for end, expected in (("low", min(quotients)), ("high", max(quotients))):
            self.assertAlmostEqual(row[end] / expected, 1, places=3)
        self.assertEqual((row["interval"], row["paired"], row["reference"]), (False, True, runs["bottom_up"]))
        self.assertEqual(found.loc[runs["bottom_up"], "ratio"], 1)
        self.assertEqual(len(found), 2)
        turned = results.ratios("py_boxes", "without_motion")
        self.assertAlmostEqual(turned.loc[runs["bottom_up"], "ratio"] * ratio, 1, places=3)
        self.assertEqual(len(results.ratios("lbvh")), 0)
        with self.assertRaisesRegex(ValueError, "measure is 'speed', but should be one of with_motion"):
            results.ratios(measure="speed")
        profiles = results.profiles(within=(1, 1e9))
        self.assertEqual(sorted(profiles.index), ["bottom_up", "py_boxes"])
        self.assertEqual(sorted(profiles["within 1"]), [0, 1])
        self.assertEqual(profiles["within 1e+09"].tolist(), [1, 1])
        self.assertEqual(profiles["factor"].iloc[0], 1)
        self.assertEqual(profiles["cells"].tolist(), [1, 1])

    def test_wrong_plans_and_results(self):
        with self.assertRaisesRegex(kbvh.InputError, "plan: .*scenez"):
            kbvh.run({"scenez": []})
        with self.assertRaisesRegex(kbvh.ConfigError, "nobody"):
            kbvh.run({"scenes": ["waving_sheet"], "strategies": ["nobody"]})
        with self.assertRaisesRegex(kbvh.InputError, "no_plan.json"):
            kbvh.plan("no_plan.json")
        with self.assertRaisesRegex(ValueError, "does not exist"):
            kbvh.results.read("no_folder")


if __name__ == "__main__":
    unittest.main()
