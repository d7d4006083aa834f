"""Wrong input to a world and to a strategy in Python: each wrong value is a ValueError or TypeError with a sentence, nothing
crashes, and an interruption ends long work."""

import os
import signal
import subprocess
import sys
import unittest
import warnings

import numpy as np

import kbvh
from kbvh import _core
from scenes import TRIANGLE, falling, triangle_at


def body(positions, **keys):
    return lambda: kbvh.World([kbvh.Body(TRIANGLE, positions, **keys)])


def world(id="kinetic_aabb"):
    return kbvh.World(falling(), id)


def unknown():
    return kbvh.World([kbvh.Body(TRIANGLE, triangle_at(0), known=False)] * 2, "bottom_up")


def strategy(**members):
    kbvh.register(type("Doors", (kbvh.Strategy,), {"id": "py_doors", "__doc__": "Nothing.", "guarantee": "approximate", "candidates": lambda self: [], **members}))


def played(**members):
    strategy(**members)
    return kbvh.World(falling(), "py_doors")


class Values(unittest.TestCase):
    def refused(self, cases):
        for what, (error, text, call) in cases.items():
            with self.subTest(what):
                with self.assertRaisesRegex(error, text) as raised:
                    call()
                said = str(raised.exception)
                self.assertNotIn("incompatible function arguments", said)
                self.assertNotIn("Unable to cast", said)

    def test_arrays(self):
        eye = np.eye(3)
        pair = np.stack([eye, eye])
        self.refused({
            "complex": (ValueError, "'body', its positions: real numbers are needed, not complex128", body(eye * 1j)),
            "text": (ValueError, "real numbers are needed, not <U", body(eye.astype(str))),
            "dates": (ValueError, r"real numbers are needed, not datetime64\[s\]", body(eye.astype("datetime64[s]"))),
            "truths": (ValueError, "real numbers are needed, not bool", body(eye > 0)),
            "objects": (ValueError, "real numbers are needed, not object", body(eye.astype(object))),
            "times as dates": (ValueError, "its times: real numbers", body(pair, times=np.array([0, 1], "datetime64[s]"))),
            "times as text": (ValueError, "its times: real numbers", body(pair, times=["0", "1"])),
            "offsets from 1": (ValueError, "run from 0 to the number of indices, 3, not from 1 to 3", body(eye, offsets=[1, 3])),
            "offsets to 2": (ValueError, "not from 0 to 2", body(eye, offsets=[0, 2])),
            "offsets to 0": (ValueError, "not from 0 to 0", body(eye, offsets=[0])),
            "no offsets": (ValueError, "offsets begin with 0", body(eye, offsets=[])),
            "set: complex": (ValueError, "real numbers", lambda: unknown().set_positions(0, eye * 1j)),
            "set: a row": (ValueError, "points have 3 coordinates, not 9", lambda: unknown().set_positions(0, np.zeros((1, 9)))),
            "padded": (ValueError, "positions are no real numbers", lambda: kbvh.padded(eye.astype(str))),
            "verify": (ValueError, "frames: real numbers", lambda: world().verify("bottom_up", frames=["0"])),
        })  # fmt: skip
        for kind in ("f2", "f4", "f8", "g", "i1", "u8"):
            self.assertEqual(body(eye.astype(kind))().frames().tolist(), [0.0], kind)

    def test_ids_and_numbers(self):
        eye = np.eye(3)
        self.refused({
            "pair": (ValueError, "from 0 to 4294967295, not -1", lambda: kbvh.World(kbvh.Scene([kbvh.Body(TRIANGLE, eye)] * 2, pairs=[(-1, 0)]))),
            "half a body": (TypeError, "a whole number, not 0.5", lambda: kbvh.World(kbvh.Scene([kbvh.Body(TRIANGLE, eye)] * 2, pairs=[(0.5, 0)]))),
            "body -1": (ValueError, "not -1", lambda: world().positions(-1)),
            "body a": (TypeError, "a whole number, not str", lambda: world().positions("a")),
            "body 2**40": (ValueError, "not 1099511627776", lambda: world().hierarchy(2**40)),
            "frames": (ValueError, "not 1099511627776", lambda: world().frames(2**40)),
            "script": (ValueError, "not -1", lambda: kbvh.scene("reversing_spheres", triangles=80, keyframes=30).script(l=-1)),
            "time": (TypeError, "a real number, not NoneType", lambda: world().advance(None)),
            "time as text": (TypeError, "a real number, not str", lambda: world().step_event("1")),
            "time nan": (ValueError, "from t = 0 back to nan", lambda: world().advance(float("nan"))),
        })  # fmt: skip

    def test_changes(self):
        def edit(**what):
            return lambda: world().change_geometry(**what)

        def plan(vertices, velocities):
            return lambda: world().change_plans(kbvh.PlanChange(0, 1, vertices, velocities))

        three = np.zeros((3, 3))
        self.refused({
            "body -1": (ValueError, "a body is a whole number from 0 to 4294967295, not -1", edit(removed_primitives={-1: [0]})),
            "body a": (TypeError, "a body is a whole number, not str", edit(vertices={"a": (three, three)})),
            "id -1": (ValueError, "removed primitives: -1 cannot be an id", edit(removed_primitives={0: [-1]})),
            "id 2**64 - 1": (ValueError, "18446744073709551615 cannot be an id", edit(removed_vertices={0: np.array([2**64 - 1], "u8")})),
            "shape": (ValueError, "positions of new vertices: points have 3 coordinates, not 2", edit(vertices={0: (np.zeros((3, 2)),) * 2})),
            "counts": (ValueError, "3 positions and 2 velocities", edit(vertices={0: (three, three[:2])})),
            "no tuple": (TypeError, r"body 0 are a tuple \(positions, velocities\), not ndarray", edit(vertices={0: three})),
            "none": (TypeError, "not NoneType", edit(vertices={0: None})),
            "flat primitive": (ValueError, r"a list of vertices, \[primitive\]\[corner\], not 0", edit(primitives={0: [0, 1, 2]})),
            "deep primitive": (ValueError, "a list of vertices", edit(primitives={0: [[[0, 1, 2]]]})),
            "plan: id": (ValueError, "-1 cannot be an id", plan([-1], three[:1])),
            "plan: shape": (ValueError, "velocities of new plans: points have 3 coordinates, not 2", plan([0, 1], np.zeros((3, 2)))),
            "plan: dates": (ValueError, "real numbers", plan([0], three[:1].astype("datetime64[s]"))),
        })  # fmt: skip
        before = world()
        with self.assertRaises(ValueError):
            before.change_geometry(primitives={0: [[0, 1, 2]]}, removed_primitives={-1: [0]})
        self.assertEqual(len(before.hierarchy(0).primitives), 1)  # nothing has changed

    def test_rays(self):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.refused({"1e31": (ValueError, "ray 0: origin has .*e.30 on axis 0", lambda: world().hits([[1e31, 0, 0]], [[0, 0, 1]]))})
        self.refused({
            "complex": (ValueError, "origins of rays are no real numbers, but complex128", lambda: world().hits([[1j] * 3], [[0, 0, 1]])),
            "text": (ValueError, "origins of rays are no real numbers", lambda: world().hits([["1"] * 3], [[0, 0, 1]])),
            "dates": (ValueError, "lengths of rays", lambda: world().hits([[0] * 3], [[0, 0, 1]], np.array([1], "datetime64[s]"))),
            "nan": (ValueError, "ray 0: origin has nan", lambda: world().hits([[np.nan] * 3], [[0, 0, 1]])),
        })  # fmt: skip
        with self.assertWarnsRegex(UserWarning, "1 ray of this call was rounded to float32"):
            world().hits([[0.1, 0, 0], [0.5, 0, 0]], [[0, 0, 1]] * 2)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            world().hits([[0.5, 0, 0]], [[0, 0, 1]])
            kbvh.World(falling(), "kinetic_aabb", precision="float64").hits([[0.1, 0, 0]], [[0, 0, 1]])

    def test_what_strategies_return(self):
        def counted(value):
            return lambda: played(counters=lambda self: {"tests": value}).counters()

        def held(value):
            return lambda: played(bytes=lambda self: value).counters()

        def moved(ask, foresight="whole_clip"):
            return lambda: played(foresight=foresight, candidates=lambda self: ask(self.motion)).pairs()

        name = "'py_doors', counters: 'tests' is a whole number"
        self.refused({
            "counter -1": (ValueError, name + " from 0 to 18446744073709551615, not -1", counted(-1)),
            "counter 2**70": (ValueError, name + " from 0 to .*, not 1180591620717411303424", counted(2**70)),
            "counter 2.5": (TypeError, name + ", not 2.5", counted(2.5)),
            "counter None": (TypeError, name + ", not NoneType", counted(None)),
            "counter text": (TypeError, name + ", not str", counted("7")),
            "counters of a list": (TypeError, "returned no dictionary, but list", lambda: played(counters=lambda self: [1]).counters()),
            "a counter's name": (TypeError, "the name of a counter is a text, not 3", lambda: played(counters=lambda self: {3: 1}).counters()),
            "bytes -7": (ValueError, "'py_doors', bytes: the memory is a whole number from 0 to .*, not -7", held(-7)),
            "bytes 2.5": (TypeError, "the memory is a whole number, not 2.5", held(2.5)),
            "bytes None": (TypeError, "the memory is a whole number, not NoneType", held(None)),
            "motion: body": (ValueError, "not -1", moved(lambda motion: motion.positions(-1))),
            "motion: keyframe": (ValueError, "not -1", moved(lambda motion: motion.keyframe(0, -1))),
            "motion: time": (ValueError, "t = nan are not foreseen at t = 0$", moved(lambda motion: motion.positions_on_lines(0, float("nan")))),
            "pairs": (ValueError, "real|no whole numbers", lambda: played(candidates=lambda self: np.zeros((1, 4)) * 1j).pairs()),
            "pairs -1": (ValueError, "-1 cannot be an id", lambda: played(candidates=lambda self: [[0, 0, -1, 0]]).pairs()),
            "size": (ValueError, "its max_primitive_pairs is a whole number", lambda: strategy(max_primitive_pairs=-1)),
            "half a size": (TypeError, "its max_primitive_pairs is a whole number, not 2.5", lambda: strategy(max_primitive_pairs=2.5)),
            "primitives": (TypeError, "a list of words, not the text 'polygons'", lambda: strategy(primitives="polygons")),
            "topology": (TypeError, "a dictionary or None, not int", lambda: strategy(topology=3)),
        })  # fmt: skip
        world = played(counters=lambda self: {"own": np.int64(3), "most": 2**64 - 1, "yes": True}, bytes=lambda self: np.uint8(7))
        found = world.counters()
        self.assertEqual((found["own"], found["most"], found["yes"], found["bytes"]), (3, 2**64 - 1, 1, 7))

    def test_a_range_of_its_own_is_kept(self):
        table = kbvh.strategies()
        if "embree_refit" not in table.index:
            self.skipTest("built without Embree")
        most = table.loc["embree_refit", "max_coordinate"]
        self.assertEqual(most, 1.8e18)
        self.assertEqual(table.loc["bottom_up", "max_coordinate"], np.inf)
        with self.assertRaisesRegex(kbvh.ConfigError, r"takes coordinates up to 1.8e\+18, but vertex 0 of body 'far' is at x = 2305843009213693952"):
            kbvh.World([kbvh.Body(TRIANGLE, np.full((3, 3), 2.0**61), name="far")], "embree_refit")
        frames = kbvh.World([kbvh.Body(TRIANGLE, triangle_at(0), known=False)], "embree_refit")
        with self.assertRaisesRegex(ValueError, "but vertex 1 of body 0 is at z"):
            frames.set_positions(0, kbvh.padded([[0, 0, 0], [0, 0, 2e18], [0, 0, 0]]))
        with self.assertRaisesRegex(ValueError, "but the origin of ray 0 is at y"):
            frames.hits([[0, 2.0**62, 0]], [[0, 0, 1]])
        moves = kbvh.World(falling(), "embree_refit")
        with self.assertRaisesRegex(ValueError, "knot 0 of its new plan, is at x"):
            moves.change_plans(kbvh.PlanChange(0, 1, [0], [[0, 0, 0]], [1.0], [[[2.0**62, 0, 0]]]))
        moves.change_plans(kbvh.PlanChange(0, 1, [0], [[2.0**60, 0, 0]]))
        moves.advance(1.0)
        with self.assertRaisesRegex(ValueError, "'embree_refit' takes coordinates up to .*, but vertex 0 of body 1 is at x .* at t = 2 s"):
            moves.advance(2.0)


class Crashes(unittest.TestCase):
    """In processes of their own."""

    def run_python(self, code, **keys):
        lines = f"import numpy as np\nimport kbvh\nfrom kbvh import _core\n{code}\n"
        return subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True, **keys)

    def test_new_alone_has_no_object(self):
        for call in ("_core.World.__new__(_core.World).pairs()", "_core.World.__new__(_core.World).time",
                     "_core.World.__new__(_core.World).precision", "_core.World.__new__(_core.World).add_pair(0, 0)"):  # fmt: skip
            run = self.run_python(call)
            self.assertEqual(run.returncode, 1, f"{call}: {run.stderr}")
            self.assertIn("TypeError: World.__init__ was not called", run.stderr)
        run = self.run_python("_core.Motion.__new__(_core.Motion).time")
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertIn("TypeError: Motion.__init__ was not called", run.stderr)
        for call in ("_core.World.pairs(3)", "kbvh.World.__new__(kbvh.World).pairs()", "_core.World.__new__(_core.World)"):
            self.assertGreaterEqual(self.run_python(call).returncode, 0, call)

    def test_an_interruption_ends_long_work(self):
        scene = "kbvh.scene('waving_sheet', triangles=20000, obstacle=20000, keyframes=60)"
        works = {
            "true pairs": f"kbvh.World({scene}, 'bottom_up').true_pairs()",
            "verify": f"kbvh.World({scene}).verify('bottom_up', frames=np.linspace(0, 1, 100000))",
            "a study": "kbvh.run({'scenes': [{'builtin': 'waving_sheet', 'triangles': 20000, 'keyframes': 600}], 'l': 100, 'repetitions': 100})",
            "a simulation": "kbvh.scene('shirt', triangles=60000, keyframes=300)",
            "python": "[None for _ in iter(int, 1)]",
        }  # fmt: skip
        for what, work in works.items():
            with self.subTest(what):
                code = f"import kbvh, numpy as np\nprint('begun', flush=True)\ntry:\n    {work}\nexcept KeyboardInterrupt:\n    print('ended', flush=True)\nprint('after')"
                # A process that was started in the background ignores interruptions, and so would its children.
                with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True,
                                      preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
                                      env={**os.environ, "KBVH_CACHE": os.devnull}) as run:  # fmt: skip
                    self.assertEqual(run.stdout.readline(), "begun\n")
                    try:
                        run.wait(2)  # so that the work is under way
                        self.fail(f"{what} took less than two seconds: nothing was interrupted")
                    except subprocess.TimeoutExpired:
                        run.send_signal(signal.SIGINT)
                    try:
                        rest, _ = run.communicate(timeout=60)  # all of the work takes minutes
                    except subprocess.TimeoutExpired:
                        run.kill()
                        self.fail(f"{what} goes on after an interruption")
                    self.assertEqual((run.returncode, rest), (0, "ended\nafter\n"), what)


if __name__ == "__main__":
    unittest.main()
