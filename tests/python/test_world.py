"""A world answers from Python what the library answers, reads arrays where they lie, and says what is wrong."""

import threading
import unittest

import numpy as np

import kbvh
from kbvh import _core
from scenes import TRIANGLE, falling, pairs, triangle_at


class Answers(unittest.TestCase):
    def test_every_strategy_with_a_guarantee_finds_the_true_pairs(self):
        table, tried = kbvh.strategies(), 0
        for play in kbvh.small_scenes():
            own = any(a == b for a, b in play.pairs_asked() or ())
            for id in table.index[table["guarantee"] != "approximate"]:
                if own and "self_pairs" not in table.loc[id, "abilities"]:
                    continue
                for precision in table.loc[id, "precisions"]:
                    world, seen = kbvh.World(play, id, precision=precision), 0
                    for _ in world.play(l=2):
                        answer = pairs(world.pairs())
                        self.assertEqual(answer, pairs(world.true_pairs()), f"{id} on {play.name}")
                        seen += len(answer)
                    self.assertGreater(seen, 0, play.name)
                    tried += 1
        self.assertGreater(tried, 200)

    def test_one_pair_where_a_triangle_falls_through_another(self):
        for id in ("bottom_up", "kinetic_aabb", "interval_join"):
            world = kbvh.World(falling(), id)
            self.assertEqual(len(world.pairs()), 0)
            world.advance(0.5)
            self.assertEqual(pairs(world.pairs()), [(0, 0, 1, 0)])
            self.assertEqual(world.pairs().dtype, _core.pair_type)
            world.advance(1.0)
            self.assertEqual(len(world.pairs()), 0)

    def test_spans_enclose_the_contact(self):
        world = kbvh.World(falling(), "kinetic_separation_list")
        found = world.spans(1.0)
        self.assertEqual(pairs(found), [(0, 0, 1, 0)])
        self.assertLessEqual(found["begin"][0], 0.25)
        self.assertGreaterEqual(found["end"][0], 0.75)

    def test_changes_add_up_to_the_pairs(self):
        for id in ("bottom_up", "interval_join", "kinetic_separation_list"):
            world, held, changed = kbvh.World(kbvh.small_scenes()[0], id), set(), 0
            for _ in world.play(l=5):
                begun, ended = (set(pairs(part)) for part in world.changes())
                self.assertTrue(ended <= held and not begun & held)
                changed += len(begun) + len(ended)
                held = held - ended | begun
                self.assertEqual(sorted(held), pairs(world.pairs()))
            self.assertGreater(changed, 20)

    def test_watched_pairs_and_realisers(self):
        world = kbvh.World(kbvh.small_scenes()[0], "kinetic_separation_list")
        watched = world.watched_pairs()
        self.assertGreater(len(watched), 3)
        self.assertEqual({0, 1}, set(watched["body"]) | set(watched["other_body"]))
        tree, realisers = world.hierarchy(0), world.realisers(0)
        self.assertEqual(realisers.shape, (len(tree.nodes), 6))
        root = world.positions(0)[realisers[0], np.arange(6) // 2]
        self.assertTrue(np.array_equal(root[0::2], tree.nodes["lower"][0]) and np.array_equal(root[1::2], tree.nodes["upper"][0]))
        self.assertIsNone(kbvh.World(falling(), "bottom_up").realisers(0))

    def test_rays(self):
        table = kbvh.strategies()
        body = kbvh.scene({"bodies": [{"shape": "sphere", "triangles": 80}]}).bodies[0]
        random = np.random.default_rng(2)
        towards = random.normal(size=(50, 3))
        origins = 3 * towards / np.linalg.norm(towards, axis=1, keepdims=True)
        first, tried = None, 0
        for id in table.index[table["abilities"].map(lambda words: "rays" in words)]:
            if table.loc[id, "guarantee"] != "exact":
                continue
            world = kbvh.World([body], id, precision="float64") if "float64" in table.loc[id, "precisions"] else None
            if world is None:
                continue
            hits = world.hits(origins, -origins)
            self.assertTrue(np.all((hits["body"] == 0) & (hits["parameter"] > 0) & (hits["parameter"] < 1)), id)
            self.assertTrue(np.all(world.hits(origins, origins, query="any")["body"] == 2**32 - 1), id)
            self.assertTrue(np.all(world.hits(origins, -origins, 1e-3)["body"] == 2**32 - 1), id)
            first = hits if first is None else first
            self.assertEqual(hits.tolist(), first.tolist(), id)
            tried += 1
        self.assertGreater(tried, 2)
        world = kbvh.World([body], "bottom_up")
        with self.assertRaisesRegex(ValueError, "need origins and directions"):
            world.hits(origins, origins[:7])
        with self.assertRaisesRegex(ValueError, "closest or any, not 'all'"):
            world.hits(origins, origins, query="all")

    def test_within(self):
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 3], [1, 0, 3], [0, 1, 3]], float)
        body = kbvh.Body([[0, 1, 2], [3, 4, 5]], corners)
        for precision in ("float32", "float64"):
            for id in ("bottom_up", "kinetic_aabb", "interval_join", "auto", "brute_force"):
                world = kbvh.World([body], id, precision=precision)
                found = world.within([[0.25, 0.25, 1], [0.25, 0.25, 1.5], [3, 4, 0]], [1, 1.5, 0.5])
                self.assertEqual(found.tolist(), [(0, 0, 0), (1, 0, 0), (1, 0, 1)], id)
                self.assertEqual(len(world.within([[0.25, 0.25, 1]], np.nextafter(np.float32(1), np.float32(0)))), 0, id)
        with self.assertRaisesRegex(ValueError, "radius -1"):
            world.within([[0, 0, 0]], -1)
        with self.assertRaisesRegex(ValueError, r"points are \[point\]\[3\]"):
            world.within([[0, 0, 0, 0]], 1)
        with self.assertRaisesRegex(ValueError, "radii are no real numbers"):
            world.within([[0, 0, 0]], "a")

    def test_contacts_between_keyframes(self):
        world = kbvh.World(falling(), "bottom_up")
        found = world.contacts(1.0)
        self.assertGreater(len(found), 0)
        self.assertTrue(np.all(found["begin"] <= found["end"]))
        self.assertTrue(set(found["kind"]) <= {0, 1})
        # The upright edge's upper end meets the plane of the falling triangle at z = 0.5.
        self.assertTrue(np.any((found["begin"] <= 0.25) & (found["end"] >= 0.25)))

    def test_positions_hierarchies_audits_and_counters(self):
        play = kbvh.scene("waving_sheet", triangles=200, keyframes=3)
        world = kbvh.World(play, "bottom_up", topology={"width": 2, "leaf_size": 1})
        world.advance(world.frames()[1])
        world.pairs()
        self.assertTrue(np.array_equal(world.positions(0), np.asarray(play.bodies[0].positions)[1].astype("f4")))
        tree = world.hierarchy(0)
        self.assertEqual(len(tree.nodes), 2 * play.bodies[0].primitives - 1)
        self.assertEqual(sorted(tree.primitives), list(range(play.bodies[0].primitives)))
        live = tree.nodes[~tree.nodes["stale"]]
        self.assertTrue(np.all(live["lower"] <= live["upper"]))
        audit = world.audit(0)
        self.assertEqual((audit.invalid, audit.protrusion, audit.first_fault), (0, 0.0, ""))
        self.assertEqual(audit.nodes + audit.stale if audit.nodes < len(tree.nodes) else audit.nodes, len(tree.nodes))
        self.assertGreater(world.counters()["box_tests"], 0)
        self.assertIsNone(kbvh.World(play, "brute_force").hierarchy(0))
        self.assertIsNone(kbvh.World(play, "brute_force").audit(0))

    def test_events_one_by_one_lead_where_advance_leads(self):
        play = kbvh.scene("waving_sheet", triangles=200, keyframes=3)
        stepped, plain = kbvh.World(play, "kinetic_aabb"), kbvh.World(play, "kinetic_aabb")
        self.assertTrue(stepped.has_events)
        end, steps = stepped.frames()[1], 0
        queue = stepped.scheduled_events()
        self.assertTrue(np.all(np.diff(queue["time"]) >= 0))
        self.assertEqual(queue["time"][0], stepped.next_event_time())
        while (step := stepped.step_event(end)) is not None:
            self.assertEqual(step.event["kind"], 0)
            self.assertEqual(step.touched["new_vertex"][0], step.event["loser"])
            steps += 1
        self.assertGreater(steps, 5)
        stepped.advance(end)
        plain.advance(end)
        self.assertTrue(np.array_equal(stepped.hierarchy(0).nodes, plain.hierarchy(0).nodes))
        self.assertFalse(kbvh.World(play, "bottom_up").has_events)

    def test_plans_and_geometry_change(self):
        world = kbvh.World(falling(to=1.0), "kinetic_aabb")
        world.advance(0.25)
        ids = np.arange(3)
        world.change_plans(kbvh.PlanChange(0, 1, ids, np.tile([0.0, 0, -2], (3, 1))))
        world.advance(0.75)
        self.assertTrue(np.allclose(world.positions(1)[:, 2], 0))
        self.assertEqual(len(world.pairs()), 1)
        world.change_geometry(removed_primitives={0: [0]})
        self.assertEqual(len(world.pairs()), 0)
        world.change_geometry(
            vertices={0: (world.positions(0) + [0.1, 0, 0], np.zeros((3, 3)))}, primitives={0: [[3, 4, 5]]}
        )
        self.assertEqual(pairs(world.pairs()), [(0, 1, 1, 0)])

    def test_scripted_scenes_play_their_changes(self):
        play = kbvh.scene("reversing_spheres", triangles=80, keyframes=30)
        self.assertTrue(play.changes)
        frames, changes = play.script("float64")
        self.assertGreater(len(changes), 0)
        world, next_change, seen = kbvh.World(play, "kinetic_envelope", precision="float64", t=frames[0]), 0, 0
        for t in frames:
            world.advance(t)
            answer = pairs(world.pairs())
            self.assertEqual(answer, pairs(world.true_pairs()))
            seen += len(answer)
            while next_change < len(changes) and changes[next_change].time == t:
                world.change_plans(changes[next_change])
                next_change += 1
        self.assertEqual(next_change, len(changes))
        self.assertGreater(seen, 0)


class Arrays(unittest.TestCase):
    def world(self, precision="float32"):
        bodies = [
            kbvh.Body(TRIANGLE, triangle_at(0, precision), known=False, name="a"),
            kbvh.Body(TRIANGLE, triangle_at(3, precision), known=False, name="b"),
        ]
        return kbvh.World(bodies, "bottom_up", precision=precision)

    def test_padded_positions_are_read_where_they_lie(self):
        for precision in ("float32", "float64"):
            world = self.world(precision)
            flat = np.concatenate([triangle_at(0.0, precision).ravel(), [0]]).astype(precision)
            for mine in (kbvh.padded(triangle_at(0.0), precision), flat):
                self.assertTrue(world.set_positions(1, mine))
                world.advance(world.time + 1)
                self.assertEqual(world.positions_address(1), mine.ctypes.data)
                self.assertEqual(len(world.pairs()), 1)

    def test_other_positions_are_copied_and_count_the_same(self):
        world = self.world()
        strided = np.zeros((3, 6), dtype="f4")[:, ::2]
        strided[...] = triangle_at(0)
        for mine in (triangle_at(0), triangle_at(0, "float64"), triangle_at(0).tolist(), strided, strided.astype(int)):
            self.assertFalse(world.set_positions(1, mine))
            world.advance(world.time + 1)
            if isinstance(mine, np.ndarray):
                self.assertNotEqual(world.positions_address(1), mine.ctypes.data)
            self.assertEqual(len(world.pairs()), 1)
        self.assertFalse(world.set_positions(1, kbvh.padded(triangle_at(0), "float64")))  # another precision

    def test_a_strategy_is_told_what_moved(self):
        n = 64
        x, y = np.meshgrid(np.arange(n), np.arange(n))
        flat = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1).astype("f4")
        corner = (y[:-1, :-1] * n + x[:-1, :-1]).ravel()
        faces = np.concatenate([np.stack([corner, corner + 1, corner + n], 1), np.stack([corner + n, corner + 1, corner + n + 1], 1)])
        lid = kbvh.Body(TRIANGLE, np.array([[0, 0, 1], [n, 0, 1], [0, n, 1]], dtype="f4"), known=False)
        found = {}
        for strategy in ("dirty_refit", "bottom_up"):
            sheet = flat.copy()
            world = kbvh.World([kbvh.Body(faces, flat, known=False), lid], strategy)
            for step, moved in enumerate(([30], [30, 200], np.array([31], dtype="u4"), [], None)):
                sheet[list(moved) if moved is not None else slice(None), 2] += 0.75
                world.set_positions(0, sheet, moved=moved)
                world.advance(step + 1)
                found.setdefault(step, []).append(sorted(map(tuple, world.pairs())))
                if strategy == "dirty_refit" and step < 4:
                    self.assertEqual(world.counters()["partial_refits"], step + 1)
        for step, pairs in found.items():
            self.assertEqual(pairs[0], pairs[1], step)
        self.assertGreater(len(found[1][0]), 0)
        self.assertGreater(len(found[4][0]), len(found[3][0]))
        with self.assertRaisesRegex(ValueError, "vertex 4096 moved, but body 'body' has 4096"):
            world.set_positions(0, sheet, moved=[4096])
        with self.assertRaisesRegex(ValueError, "the vertices that moved"):
            world.set_positions(0, sheet, moved=[0.5])

    def test_the_world_keeps_what_it_reads_alive(self):
        world = self.world()
        for step in range(50):
            world.set_positions(1, kbvh.padded(triangle_at(float(step))))
            np.full(10, 7, dtype="f4")  # would take the place of memory that was freed
            world.advance(step)
            self.assertEqual(world.positions(1)[0, 2], step)

    def test_answers_and_scenes_are_not_copied(self):
        made = _core.make_scene('{"builtin": "waving_sheet", "triangles": 200, "keyframes": 3}', ".", "", 0)
        body = kbvh.Body(**made["bodies"][0])
        self.assertIs(body.positions, made["bodies"][0]["positions"])
        self.assertFalse(body.positions.flags.owndata)  # the memory of the library
        self.assertEqual(kbvh.Body(**made["bodies"][0]).positions.ctypes.data, body.positions.ctypes.data)
        world = kbvh.World(falling(), "bottom_up", t=0.5)
        self.assertEqual(len(world.pairs()), 1)
        self.assertFalse(world.pairs().flags.owndata)

    def test_contacts_refuse_one_array_for_both_ends(self):
        world = self.world()
        mine = kbvh.padded(triangle_at(2.0))
        world.set_positions(1, mine)
        world.reset(0)
        mine[:, 2] = -1
        world.set_positions(1, mine)
        with self.assertRaisesRegex(ValueError, "the same array twice"):
            world.contacts(1)
        world.set_positions(1, kbvh.padded(mine))
        mine[:, 2] = 2
        self.assertGreater(len(world.contacts(1)), 0)

    def test_quads_points_and_64_bit_ids(self):
        square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
        quad = kbvh.Body(np.arange(4), square, offsets=[0, 4], name="quad")
        points = kbvh.Body(np.arange(1), np.array([[0.5, 0.5, 0.0]]), offsets=[0, 1], shape="points", name="points")
        self.assertEqual(len(kbvh.World([quad, points], "bottom_up").pairs()), 1)


class Errors(unittest.TestCase):
    def test_say_what_is_wrong_as_the_library_says_it(self):
        cases = [
            (kbvh.ConfigError, "there is no strategy 'nobody'; known are", lambda: kbvh.World(falling(), "nobody")),
            (kbvh.ConfigError, "'threads'", lambda: kbvh.World(falling(), "bottom_up", {"threads": "x"})),
            (kbvh.ConfigError, "width 3", lambda: kbvh.World(falling(), "bottom_up", topology={"width": 3})),
            (ValueError, "the keys method, width and leaf_size, not 'depth'", lambda: kbvh.World(falling(), "bottom_up", topology={"depth": 3})),
            (ValueError, "not 'float16'", lambda: kbvh.World(falling(), precision="float16")),
            (ValueError, "not 'cubes'", lambda: kbvh.World([kbvh.Body(TRIANGLE, triangle_at(0), shape="cubes")])),
            (ValueError, "no array of numbers, but str", lambda: kbvh.World(falling(), "bottom_up").set_positions(0, "here")),
            (ValueError, "there is no body 7 among 2", lambda: kbvh.World(falling(), "bottom_up").set_positions(7, triangle_at(0))),
            (RuntimeError, "the motion of body 'falls' is known", lambda: kbvh.World(falling(), "bottom_up").set_positions(1, triangle_at(0))),
            (RuntimeError, "has not started: call start first", lambda: kbvh.World(falling()).pairs()),
            (RuntimeError, "does not declare spans", lambda: kbvh.World(falling(), "bottom_up").spans(1)),
            (RuntimeError, "does not declare events", lambda: kbvh.World(falling(), "bottom_up").step_event(1)),
            (ValueError, "back to -1", lambda: kbvh.World(falling(), "bottom_up").advance(-1)),
            (ValueError, "-3 cannot be an id", lambda: kbvh.World([kbvh.Body([0, 1, -3], triangle_at(0))])),
            (ValueError, "no whole numbers, but float64", lambda: kbvh.World([kbvh.Body([0.0, 1.0, 2.0], triangle_at(0))])),
            (ValueError, "vertex 7|7", lambda: kbvh.World([kbvh.Body([0, 1, 7], triangle_at(0))])),
            (ValueError, r"not \[3, 2\]", lambda: kbvh.Body(TRIANGLE, np.zeros((3, 2)))),
            (ValueError, "2 keyframes without times", lambda: kbvh.Body(TRIANGLE, np.zeros((2, 3, 3)))),
            (ValueError, "1 time, but positions at 2 keyframes", lambda: kbvh.Body(TRIANGLE, np.zeros((2, 3, 3)), times=[0])),
            (ValueError, "2 times, but positions at 1 keyframe", lambda: kbvh.Body(TRIANGLE, np.zeros((6, 3)), times=[0, 1])),
            (ValueError, "^body 'mine': .*nan", lambda: kbvh.World([kbvh.Body(TRIANGLE, triangle_at(np.nan), name="mine")])),
            (ValueError, "^body 'late': .*must increase", lambda: kbvh.World([kbvh.Body(TRIANGLE, np.zeros((2, 3, 3)), times=[1, 0], name="late")])),
            (ValueError, "0 frames per keyframe", lambda: kbvh.World(falling()).frames(0)),
            (ValueError, "-1 frames per keyframe", lambda: list(kbvh.World(falling(), "bottom_up").play(l=-1))),
            (TypeError, "float", lambda: kbvh.World(falling()).frames(1.5)),
            (ValueError, "frame 1 cannot be at t = 0", lambda: kbvh.World(falling()).verify("bottom_up", frames=[1, 0])),
            (kbvh.InputError, "nowhere.obj", lambda: kbvh.load("nowhere.obj")),
            (kbvh.InputError, "no_scene", lambda: kbvh.scene("no_scene")),
            (kbvh.InputError, "trianglez", lambda: kbvh.scene("tablecloth", trianglez=7)),
        ]  # fmt: skip
        for kind, text, call in cases:
            with self.assertRaisesRegex(kind, text, msg=text) as caught:
                call()
            self.assertIs(type(caught.exception), kind, text)
        self.assertTrue(issubclass(kbvh.ConfigError, kbvh.KbvhError) and issubclass(kbvh.KbvhError, ValueError))

    def test_nothing_changes_on_an_error(self):
        world = kbvh.World(falling(), "bottom_up")
        world.advance(0.5)
        with self.assertRaises(ValueError):
            world.advance(0.25)
        with self.assertRaises(kbvh.ConfigError):
            kbvh.World(falling()).start("bottom_up", {"margin": 1})
        self.assertEqual(world.time, 0.5)
        self.assertEqual(len(world.pairs()), 1)

    def test_other_threads_run_meanwhile_and_one_world_serves_one(self):
        world = kbvh.World(kbvh.scene("tablecloth", triangles=2000, keyframes=2), "bottom_up")
        begun, outcome = threading.Event(), []

        def work():
            begun.set()
            outcome.append(len(world.true_pairs()))

        thread = threading.Thread(target=work)
        thread.start()
        begun.wait()
        refused = 0
        while thread.is_alive():
            try:
                world.true_pairs()
            except RuntimeError as error:
                self.assertIn("at work", str(error))
                refused += 1
                break
        thread.join()
        self.assertEqual(refused, 1)
        self.assertEqual(len(outcome), 1)


if __name__ == "__main__":
    unittest.main()
