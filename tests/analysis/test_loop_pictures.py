"""Pictures of simulations: what is read, what a film strip and plots show, and the report's part on them."""

from __future__ import annotations

import contextlib
import io
import json
import unittest
from pathlib import Path
from typing import Any, Optional

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic

import numpy as np
from figures import loop_figures
from matplotlib.axes import Axes
from report import loop_part, report
from results import loop_file


def header(scene: str = "sphere", driven: int = 0, seed: int = 1) -> dict[str, Any]:
    return {
        "schema": loop_file.SCHEMA,
        "options": {"scene": scene, "triangles": 3, "seed": seed, "detection": "refit"},
        "commit": "0123456789abcdef", "dirty": False, "machine": {"cpu": "a processor"}, "when": "2026-01-31T12:00:00Z",
        "title": "a cloth falls onto a floor",
        "mesh": {"vertices": 10, "faces": 3, "obstacle_faces": 1, "driven_vertices": driven},
        "physics": {"time_step_s": 0.01},
    }  # fmt: skip


def step(number: int, penetrations: int = 0) -> dict[str, Any]:
    return {
        "step": number, "time_s": 0.01 * number, "iterates": 4, "contacts": 10 * number, "smallest_gap_m": 1e-3 / number,
        "penetrations": penetrations, "detect_ms": 1.0, "impact_ms": 0.5, "rest_ms": 2.0 + number, "kinetic_j": 1.0,
        "gravitational_j": -float(number), "elastic_j": 0.5, "barrier_j": 0.25, "memory_bytes": 1e6,
        "resident_bytes": 2e7 + number, "momentum_kg_m_s": [1.0, 2.0, -3.0], "state": f"{number:016x}",
    }  # fmt: skip


#: A floor, and two triangles above it that share no vertex.
FLOOR = [(-0.7, -0.7, 0), (0.7, -0.7, 0), (0, 0.7, 0)]
FIRST = [(-0.5, 0, 0.5), (0, 0, 0.5), (-0.25, 0, 1)]
SECOND = [(0.1, 0, 0.5), (0.6, 0, 0.5), (0.35, 0, 1)]


class LoopCase(shared.InFolder):
    def write(self, place: str, steps: list[dict[str, Any]], frames: int = 3, head: Optional[dict[str, Any]] = None, tail: str = "") -> Path:
        folder = self.folder / place
        (folder / "frames").mkdir(parents=True)
        lines = [json.dumps(line) + "\n" for line in [head or header(), *steps]]
        (folder / "loop.jsonl").write_text("".join(lines) + tail, encoding="utf-8")
        for frame in range(frames):
            points = FLOOR + [(x, y, z - 0.1 * frame) for x, y, z in FIRST] + SECOND
            text = [f"v {x} {y} {z}" for x, y, z in points] + ["f 1 2 3", "f 4 5 6", "f 7 8 9"]
            (folder / "frames" / f"frame_{10 * frame:06d}.obj").write_text("\n".join(text) + "\n", encoding="utf-8")
        return folder


class TestReading(LoopCase):
    def test_steps_and_frames(self) -> None:
        one = loop_file.load(self.write("a", [step(1), step(2, 3)]))
        self.assertEqual((one.scene, one.triangles, one.obstacle_faces, one.driven), ("sphere", 3, 1, False))
        self.assertEqual(list(one.steps["contacts"]), [10, 20])
        self.assertEqual(list(one.steps["z"]), [-3, -3])
        self.assertEqual(one.penetrations, 3)
        self.assertEqual([number for number, _ in one.frames], [0, 10, 20])

    def test_the_strategy_that_found_the_pairs_is_named(self) -> None:
        head = header()
        self.assertEqual(loop_file.load(self.write("a", [step(1)], head=head)).detection, "refit")
        head["options"] |= {"strategy": None}
        self.assertEqual(loop_file.load(self.write("b", [step(1)], head=head)).detection, "refit")
        head["options"] |= {"detection": "strategy", "strategy": "leaf_slabs", "params": {}}
        one = loop_file.load(self.write("c", [step(1)], head=head))
        self.assertEqual((one.detection, one.finder, one.baseline, one.exact), ("leaf_slabs", "leaf_slabs", False, True))
        head["options"] |= {"params": {"leaf": "4", "width": "8"}}
        head |= {"baseline": True, "exact": False}
        one = loop_file.load(self.write("d", [step(1)], head=head))
        self.assertEqual((one.finder, one.baseline, one.exact), ("leaf_slabs [leaf=4, width=8]", True, False))

    def test_a_line_that_breaks_off_is_left_out(self) -> None:
        one = loop_file.load(self.write("a", [step(1)], tail='{"step": 2, "time'))
        self.assertEqual(len(one.steps), 1)

    def test_memory_may_be_missing(self) -> None:
        older = {name: value for name, value in step(1).items() if name != "resident_bytes"}
        one = loop_file.load(self.write("a", [older]))
        self.assertTrue(one.steps["resident_bytes"].isna().all())
        self.assertIsNotNone(loop_figures.over_time(one))

    def test_what_is_none_is_refused_in_one_sentence(self) -> None:
        lacking = {name: value for name, value in step(1).items() if name != "contacts"}
        cases = {
            "schema": self.write("a", [], head={"schema": "other"}),
            "contacts": self.write("b", [lacking]),
            "wrong kind": self.write("c", [{**step(1), "momentum_kg_m_s": "x"}]),
            "cannot be read": self.folder / "nothing",
        }
        for word, folder in cases.items():
            with self.assertRaisesRegex(loop_file.LoopError, word):
                loop_file.load(folder)

    def test_simulations_are_found_wherever_they_lie(self) -> None:
        for place in ("", "sheets", "loop/sphere", "live/small/sphere/bottom_up"):
            self.write(place, [step(1)])
        (self.folder / "other" / "loop.jsonl").mkdir(parents=True)
        found = [str(place.relative_to(self.folder)) for place in loop_file.find(self.folder)]
        self.assertEqual(found, [".", "live/small/sphere/bottom_up", "loop/sphere", "sheets"])


class TestFigures(LoopCase):
    def test_bodies_are_connected_triangles(self) -> None:
        triangles = np.array([(5, 6, 7), (0, 1, 2), (7, 8, 9), (2, 3, 4)])
        self.assertEqual(loop_figures.components(triangles, 11).tolist(), [1, 0, 1, 0])
        # A chain, along which numbers have to travel.
        chain = np.array([(n, n + 1, n + 1) for n in range(99, -1, -1)])
        self.assertEqual(set(loop_figures.components(chain, 101).tolist()), {0})

    def test_chosen_frames_begin_and_end_with_the_clip(self) -> None:
        self.assertEqual(loop_figures.chosen(101, 6), [0, 20, 40, 60, 80, 100])
        self.assertEqual(loop_figures.chosen(2, 6), [0, 1])
        self.assertEqual(loop_figures.chosen(1, 6), [0])

    def test_a_film_shows_each_frame_with_each_body_in_its_colour(self) -> None:
        one = loop_file.load(self.write("a", [step(1)]))
        figure = loop_figures.film(one, 3, azimuth=-90)
        assert figure is not None
        self.assertEqual([axes.get_title() for axes in figure.axes], ["0 s", "0.100 s", "0.200 s"])
        images = [np.asarray(axes.images[0].get_array()) for axes in figure.axes]
        colours = (loop_figures.OBSTACLE, *loop_figures.BODIES[:2])

        def middles(image: np.ndarray) -> list[float]:
            """The mean height of each colour, from the top."""
            found = []
            for colour in colours:
                hue = image / image.max(axis=2, keepdims=True)
                mine = (np.abs(hue - np.array(colour) / max(colour)).max(axis=2) < 1e-6) & (image.min(axis=2) < 0.999)
                self.assertGreater(mine.sum(), 50, colour)
                found.append(float(np.nonzero(mine)[0].mean()))
            return found

        first, last = middles(images[0]), middles(images[2])
        self.assertGreater(last[1], first[1] + 5, "the first body has fallen")
        self.assertAlmostEqual(last[2], first[2], delta=0.5, msg="the second one rests")
        self.assertGreater(first[0], first[2], "the floor is below")

    def test_the_view_follows_a_driven_figure(self) -> None:
        # The same frames, carried away by 50 m from one to the next.
        folder = self.write("a", [step(1)], head=header("walker", driven=3))
        for number, file in enumerate(sorted((folder / "frames").iterdir())):
            lines = [line.split() for line in file.read_text().splitlines()]
            moved = [f"v {float(w[1]) + 50 * number} {w[2]} {w[3]}" if w[0] == "v" else " ".join(w) for w in lines]
            file.write_text("\n".join(moved) + "\n")
        figure = loop_figures.film(loop_file.load(folder), 3)
        assert figure is not None
        for axes in figure.axes:
            self.assertGreater((np.asarray(axes.images[0].get_array()).min(axis=2) < 0.99).mean(), 0.05)

    def test_without_frames_there_is_no_film(self) -> None:
        self.assertIsNone(loop_figures.film(loop_file.load(self.write("a", [step(1)], frames=0))))

    def test_frames_of_different_meshes_are_refused(self) -> None:
        folder = self.write("a", [step(1)])
        (folder / "frames" / "frame_000010.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        with self.assertRaisesRegex(loop_file.LoopError, "different meshes"):
            loop_figures.film(loop_file.load(folder))

    def test_plots_show_what_was_recorded(self) -> None:
        one = loop_file.load(self.write("a", [step(1), step(2, 4), step(3)]))
        figure = loop_figures.over_time(one)
        assert figure is not None
        
        def title(axes: Axes) -> str:
            return axes.get_title(loc="left") or axes.get_title()

        panels = {title(axes).split(",")[0]: axes for axes in figure.axes}
        energy = {line.get_label(): list(line.get_ydata()) for line in panels["energy"].lines}
        self.assertEqual(energy["of height, over its least"], [2, 1, 0])
        self.assertEqual(energy["sum"], [3.75, 2.75, 1.75])
        self.assertEqual([list(line.get_ydata())[0] for line in panels["momentum of free vertices"].lines], [1, 2, -3])
        gap = panels["smallest gap"]
        self.assertIn("4 penetrations", title(gap))
        np.testing.assert_allclose(gap.lines[0].get_ydata(), [1, 0.5, 1 / 3])
        self.assertEqual(list(gap.lines[1].get_xdata()), [0.02], "a cross at the step with penetrations")
        self.assertEqual([list(line.get_ydata()) for line in panels["ms a step"].lines][0], [3, 4, 5])

    def test_the_command_writes_small_pictures(self) -> None:
        folder = self.write("a", [step(1), step(2)])
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            self.assertEqual(loop_figures.main([str(folder), "--out", str(self.folder / "drawn"), "--frames", "2"]), 0)
        for name in ("film.png", "steps.png"):
            self.assertIn(name, out.getvalue())
            self.assertTrue(0 < (self.folder / "drawn" / name).stat().st_size < 100_000)
        err = io.StringIO()
        with contextlib.redirect_stderr(err):
            self.assertEqual(loop_figures.main([str(self.folder / "nothing")]), 2)
        self.assertEqual(err.getvalue().count("\n"), 1)


class TestReport(LoopCase):
    def page(self, figures: str = "paper") -> tuple[str, str]:
        wanted = [c for c in synthetic.CONTESTANTS if c["id"] == "bottom_up"]
        synthetic.write(self.folder, [synthetic.record(c, "tablecloth", 2000, "float", 1) for c in wanted])
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            self.assertEqual(report.main([str(self.folder), "--figures", figures]), 0, err.getvalue())
        return (self.folder / "report.html").read_text(encoding="utf-8"), err.getvalue()

    def test_without_simulations_there_is_no_part(self) -> None:
        self.assertNotIn("Simulations in the loop", self.page()[0])

    def test_each_has_a_line_and_folded_pictures(self) -> None:
        self.write("loop/sphere", [step(1), step(2)])
        self.write("loop/cloths", [step(1, 7)], head=header("cloths"), frames=0)
        page, _ = self.page()
        part = page[page.index('id="loop"') :]
        part = part[: part.index('id="made"')]
        self.assertIn("<td>sphere</td>", part)
        self.assertEqual(part.count('class="n wrong"'), 1)
        self.assertIn('<td class="n wrong">7</td>', part)
        self.assertEqual(part.count("<img"), 3, "two pictures, and one of the simulation without frames")
        self.assertEqual(part.count("<details>"), 2)
        self.assertLess(len(part), 300_000)
        self.assertTrue((self.folder / "figures" / "loop-2-sphere-film.png").exists())

    def test_without_figures_there_is_the_table(self) -> None:
        self.write("loop/sphere", [step(1)])
        page, _ = self.page("none")
        self.assertIn("<td>sphere</td>", page)
        self.assertNotIn("<summary>sphere", page)

    def test_of_one_motion_one_simulation_is_drawn(self) -> None:
        self.write("live/broad_phase", [step(1)], frames=0)
        self.write("live/lbvh", [step(1)])
        self.write("live/other", [step(1)], head=header(seed=2), frames=0)
        part = loop_part.loop_part(self.folder, "paper", [])
        assert part is not None
        self.assertEqual(len(part.rows), 3)
        self.assertEqual([one.film is not None for one in part.pictures], [True, False])

    def test_what_cannot_be_read_is_a_note(self) -> None:
        self.write("loop/sphere", [step(1)], head={"schema": "other"})
        page, err = self.page()
        self.assertNotIn('id="loop"', page)
        self.assertIn("A simulation is left out", err)

    def test_pictures_of_many_simulations_lie_next_to_the_page(self) -> None:
        for number in range(loop_part.MOST_EMBEDDED + 1):
            self.write(f"loop/{number}", [step(1)], head=header(seed=number), frames=0)
        part = loop_part.loop_part(self.folder, "paper", [])
        assert part is not None
        uris = [one.steps.uri for one in part.pictures if one.steps]
        self.assertEqual([uri == "" for uri in uris], [False] * loop_part.MOST_EMBEDDED + [True])


if __name__ == "__main__":
    unittest.main()
