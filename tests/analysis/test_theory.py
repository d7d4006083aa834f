"""Figures of `kbvh theory`: what they show, and what they refuse."""

from __future__ import annotations

import contextlib
import io
import json
import unittest
from typing import Any, Optional

import paths  # noqa: F401  (finds the modules under test)
import shared

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import theory_figures


def count(scene: str, n: int, events: int) -> dict[str, Any]:
    return {
        "scene": scene, "triangles": 2 * n, "vertices": n, "nodes": 4 * n - 1, "depth": 10, "segments": 29,
        "events": events, "values": 2 * events, "silent_events": 0, "breakpoint_bound": 1e9, "queue_peak": 4 * n,
        "most_of_node": 6, "bytes": 1000 * n, "sum_visited": 2 * events, "max_visited": 10, "sum_steps": 20 * events,
        "max_steps": 100, "sum_operations": 5 * events, "max_operations": 15, "sum_certificates": 5 * events,
        "max_certificates": 20, "max_vertex_certificates": 100, "mean_vertex_certificates": 50.5,
        "max_leaves_of_vertex": 6, "updates": 200, "sum_update_certificates": 16000, "max_update_certificates": 120,
        "max_update_steps": 90, "update_share": 0.4, "queue_steps_bound": 200.0,
    }  # fmt: skip


def measured() -> dict[str, Any]:
    sizes = [100, 200, 400, 800, 1600, 3200]
    frames = [
        {"scene": "cloth", "triangles": 500, "l": l, "frames": 29 * l, "events": 300, "values": 700,
         "bottom_up_values": 6000 * 29 * l}
        for l in (1, 10, 100)
    ]  # fmt: skip
    fit = {
        "scene": "cloth", "triangles": [2 * n for n in sizes], "vertices": sizes, "events": [9 * n for n in sizes],
        "exponent": 0.9, "low": 0.85, "high": 0.95, "constant": 1.1, "worst": 0.2,
        "residuals": [0.2, 0.1, 0.0, -0.05, -0.1, -0.2],
    }  # fmt: skip
    return {
        "schema": theory_figures.SCHEMA,
        "counts": [count("cloth", n, 9 * n) for n in sizes]
        + [count("sphere", n, 0) for n in sizes]
        + [count("dance", 1234, 999)],
        "frames": frames,
        "fits": [fit],
    }


def panel(figure: Optional[Figure], beginning: str) -> Axes:
    """The axes whose title begins so."""
    assert figure is not None
    titles = [axes.get_title(loc="left") or axes.get_title() for axes in figure.axes]
    return next(axes for axes, title in zip(figure.axes, titles) if title.startswith(beginning))


class TheoryCase(shared.InFolder):
    def write(self, value: Any) -> None:
        text = value if isinstance(value, str) else json.dumps(value)
        (self.folder / "theory.json").write_text(text, encoding="utf-8")

    def load(self, value: Any) -> theory_figures.Theory:
        self.write(value)
        return theory_figures.load(self.folder / "theory.json")


class TestFigures(TheoryCase):
    def test_all_are_written_as_png_and_pdf(self) -> None:
        self.write(measured())
        self.assertEqual(theory_figures.main([str(self.folder)]), 0)
        for name, *_ in theory_figures.FIGURES:
            for kind in ("png", "pdf"):
                self.assertGreater((self.folder / "figures" / f"{name}.{kind}").stat().st_size, 1000, name)

    def test_scenes_without_events_or_with_one_size_are_not_drawn_over_n(self) -> None:
        theory = self.load(measured())
        self.assertEqual(set(theory_figures.growing(theory.counts)["scene"]), {"cloth"})
        figure = theory_figures.events_over_n(theory)
        events = panel(figure, "events")
        drawn = [line for line in events.lines if line.get_marker() not in ("", "None", None)]
        self.assertEqual(len(drawn), 1)
        self.assertEqual(list(drawn[0].get_ydata()), [900, 1800, 3600, 7200, 14400, 28800])

    def test_residuals_are_percent_and_name_their_exponent(self) -> None:
        figure = theory_figures.events_over_n(self.load(measured()))
        residuals = panel(figure, "off")
        values = [list(line.get_ydata()) for line in residuals.lines if line.get_marker() not in ("", "None", None)]
        self.assertEqual([round(value, 9) for value in values[0]], [20, 10, 0, -5, -10, -20])
        self.assertIn("exponent 0.90 (0.85 to 0.95)", residuals.texts[0].get_text())

    def test_without_fits_there_is_one_panel(self) -> None:
        value = measured()
        value["fits"] = []
        figure = theory_figures.events_over_n(self.load(value))
        self.assertRaises(StopIteration, panel, figure, "off")

    def test_means_are_sums_over_events(self) -> None:
        figure = theory_figures.steps_per_event(self.load(measured()))
        comparisons = panel(figure, "comparisons")
        heights = {round(float(line.get_ydata()[0]), 9) for line in comparisons.lines if len(line.get_ydata())}
        self.assertEqual(heights, {20.0, 100.0, 200.0})

    def test_nothing_measured_draws_nothing(self) -> None:
        empty = {"schema": theory_figures.SCHEMA, "counts": [], "frames": [], "fits": []}
        self.assertEqual(theory_figures.draw_all(self.load(empty), self.folder / "figures"), [])

    def test_one_rate_is_no_line(self) -> None:
        value = measured()
        value["frames"] = value["frames"][:1]
        self.assertIsNone(theory_figures.events_over_l(self.load(value)))


class TestWrongInput(TheoryCase):
    def test_is_code_two_and_one_sentence(self) -> None:
        for wrong in (None, "{", {"schema": "other"}, []):
            if wrong is not None:
                self.write(wrong)
            err = io.StringIO()
            with contextlib.redirect_stderr(err):
                self.assertEqual(theory_figures.main([str(self.folder)]), 2)
            self.assertEqual(len(err.getvalue().splitlines()), 1)


if __name__ == "__main__":
    unittest.main()
