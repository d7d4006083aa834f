"""Time against error: which points, curves and fronts are found, what is said, and what is drawn."""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)

from report import report
import synthetic
from figures import time_error
from results.load import Study, load
from synthetic import line

WRONG = dict(guarantee="approximate", tightness="none")


def wrong(identity: str, total: float, missed: int, extra: int = 0, pairs: int = 1000, **params: Any) -> dict[str, Any]:
    made = line(identity, total, params={name: str(value) for name, value in params.items()}, **WRONG)
    made["strategy"]["family"] = "approximate"
    made["strategy"]["label"] = f"{identity} [{' '.join(f'{name}={value}' for name, value in params.items())}]"
    made["verified"].update(pairs=pairs, missed=missed, extra=extra, first_missed=7 if missed else None, missed_depth_in_edges=0.25 if missed else 0.0)
    return made


def exact(identity: str, total: float, foresight: str = "none") -> dict[str, Any]:
    made = line(identity, total)
    made["strategy"].update(foresight=foresight, label=identity)
    made["verified"].update(pairs=1000, missed=0, extra=0, first_missed=None)
    return made


class TestTimeError(unittest.TestCase):
    def study(self, lines: list[dict[str, Any]]) -> Study:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            return load(synthetic.write(Path(name), lines))

    def place(self, lines: list[dict[str, Any]]) -> time_error.Place:
        (place,) = time_error.places(self.study(lines))
        return place

    def test_shares_are_of_the_true_and_of_the_reported_pairs(self) -> None:
        place = self.place([exact("refit", 2.0), wrong("stale", 1.0, missed=200, extra=200, pairs=1000)])
        stale = place.points[0]
        self.assertEqual((stale.id, stale.missed, stale.false, stale.depth, stale.first), ("stale", 0.2, 0.2, 0.25, 7))
        self.assertEqual(place.points[1].first, None)

    def test_tables_without_an_error_are_no_places(self) -> None:
        self.assertEqual(time_error.places(self.study([exact("refit", 2.0), exact("tree", 1.0)])), [])
        self.assertEqual(time_error.places(self.study([exact("refit", 2.0), wrong("lucky", 1.0, missed=0)])), [])

    def test_older_records_have_no_depth_and_no_first_miss(self) -> None:
        lines = [exact("refit", 2.0), wrong("stale", 1.0, missed=5)]
        for one in lines:
            for name in ("first_missed", "missed_depth_in_edges"):
                one["verified"].pop(name, None)
        (shown,) = time_error.shown(self.study(lines))
        self.assertEqual([row["first"] for row in shown.all_rows], ["–", "never"])
        self.assertEqual([row["depth"] for row in shown.all_rows], ["–", "0"])

    def test_a_curve_connects_what_differs_in_one_number(self) -> None:
        lines = [exact("refit", 2.0)]
        lines += [wrong("stale", 1.0 + every / 8, 100 - every, refit_every=every, margin=0, query="boxes") for every in (8, 2, 4)]
        lines += [wrong("stale", 1.5, 3, refit_every=4, margin=0.5, query="boxes"), wrong("stale", 1.2, 9, refit_every=2, margin=0, query="slabs")]
        place = self.place(lines)
        found = {(curve.dial, tuple(one.settings[curve.dial] for one in curve.points)) for curve in place.curves}
        self.assertEqual(found, {("refit_every", ("2", "4", "8")), ("margin", ("0", "0.5"))})

    def test_nobody_dominates_the_front(self) -> None:
        lines = [exact("refit", 2.0), exact("slow", 3.0), wrong("a", 1.0, 500), wrong("b", 1.5, 100), wrong("c", 1.6, 100), wrong("d", 2.5, 1, extra=1)]
        place = self.place(lines)
        self.assertEqual([one.id for one in place.fronts["missed"]], ["a", "b", "refit"])
        self.assertEqual([one.id for one in place.fronts["false"]], ["a"])
        self.assertEqual([(one.id, one.mark) for one in place.named], [("a", "1"), ("b", "2"), ("refit", "3")])
        for column, front in place.fronts.items():
            for one in front:
                better = [other for other in place.points if other.time < one.time and getattr(other, column) <= getattr(one, column)]
                self.assertEqual(better, [], one.id)

    def test_the_sentence_compares_the_fastest_of_each(self) -> None:
        lines = [exact("refit", 2.0), exact("slow", 3.0), wrong("bad", 0.5, 11), wrong("good", 1.0, 9), wrong("better", 1.25, 0)]
        study = self.study(lines)
        (place,) = time_error.places(study)
        (says,) = time_error.sentences(study, place)
        self.assertIn("exact is 2.00 times as slow as the fastest that misses less than 1\u00a0%", says)
        self.assertIn("one, refit, takes 2.00", says)
        self.assertIn("missed 0.90\u00a0%", says)
        self.assertNotIn("buys no time", says)

    def test_where_an_error_buys_nothing_it_says_so(self) -> None:
        study = self.study([exact("refit", 1.0), wrong("good", 1.5, 1), wrong("bad", 0.5, 500)])
        (place,) = time_error.places(study)
        self.assertIn("an error buys no time", time_error.sentences(study, place)[0])
        study = self.study([exact("refit", 1.0), wrong("bad", 0.5, 500)])
        (place,) = time_error.places(study)
        self.assertIn("no approximate contestant missed less than 1\u00a0%", time_error.sentences(study, place)[0])

    def test_knowledge_of_the_future_is_compared_with_its_like(self) -> None:
        lines = [exact("refit", 2.0), exact("clip", 0.8, foresight="whole_clip"), wrong("good", 1.0, 1)]
        study = self.study(lines)
        (place,) = time_error.places(study)
        without, known = time_error.sentences(study, place)
        self.assertTrue(without.startswith("Without knowledge") and "2.00 times" in without, without)
        self.assertTrue(known.startswith("With any knowledge") and "1.25 times as fast" in known, known)

    def test_places_of_marks_follow_time_and_share(self) -> None:
        scale = time_error.Scale([1.0, 10.0], [0.0, 0.001, 0.1])
        self.assertLess(scale.x(1.0), scale.x(10.0))
        self.assertAlmostEqual(scale.x(10**0.5), (scale.x(1.0) + scale.x(10.0)) / 2)
        self.assertAlmostEqual(scale.y(0.001) - scale.y(0.01), scale.y(0.01) - scale.y(0.1))
        self.assertGreater(scale.y(0.0), scale.y(0.001) + time_error.STRIP / 2, "zero is apart")

    def test_the_panels_draw_every_contestant_slow_ones_at_the_edge(self) -> None:
        lines = [exact("refit", 2.0), wrong("a", 1.0, 500), wrong("b", 1.5, 100, extra=4), wrong("slow", 40.0, 3)]
        (shown,) = time_error.shown(self.study(lines))
        self.assertEqual(shown.slow, 1)
        for panel in shown.panels:
            places = [float(x) for x in re.findall(r'class="mark"[^>]*translate\(([\d.]+)', panel)]
            self.assertEqual(len(places), 3)
            self.assertEqual([x for x in places if x >= time_error.WIDTH - time_error.RIGHT], [time_error.WIDTH - time_error.RIGHT])
            self.assertEqual(len(re.findall('class="exact"', panel)), 1)
            self.assertIn('class="beat"', panel)
            for number in re.findall(r'\b(?:x|y|x1|x2|y1|y2|cx|cy)="([^"]*)"', panel):
                self.assertTrue(-1 <= float(number) <= max(time_error.WIDTH, time_error.HEIGHT), number)
        self.assertEqual(re.findall('class="number"[^>]*>([^<]*)<', shown.panels[0]), ["1", "2", "3"])
        self.assertEqual(len(shown.all_rows), 4)

    def test_no_line_and_no_mark_crosses_the_name_of_a_vertical_line(self) -> None:
        lines = [exact("join", 1.5, foresight="next_keyframe"), exact("refit", 1.6), exact("slow", 9.0), wrong("a", 1.52, 1000), wrong("b", 1.55, 900)]
        (shown,) = time_error.shown(self.study(lines))
        for panel in shown.panels:
            names = re.findall(r'<text class="tick" x="([\d.]+)" y="([\d.]+)">(fastest exact|no foresight)<', panel)
            self.assertEqual(len(names), 2)
            marks = re.findall(r'translate\(([\d.]+) ([\d.]+)', panel)
            falls = re.findall(r'<line class="(?:beat|grid|lead)[^"]*" x1="([\d.]+)" x2="[\d.]+" y1="([\d.]+)"', panel)
            falls += re.findall(r'class="front" d="M([\d.]+) ([\d.]+)', panel)
            self.assertGreaterEqual(len(marks), 2)
            self.assertGreaterEqual(len(falls), 3)
            for x, y, name in names:
                left, right, foot = float(x), float(x) + time_error.FONT * len(name), float(y)
                for at, top in [*falls, *((x, str(float(y) - 4)) for x, y in marks)]:
                    self.assertFalse(left < float(at) < right and float(top) < foot, f"{name}: {at}, {top}")

    def test_it_follows_the_answers_where_there_is_an_error(self) -> None:
        for lines, there in (([exact("refit", 2.0), wrong("a", 1.0, 5)], True), ([exact("refit", 2.0), exact("tree", 1.0)], False)):
            with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name, contextlib.redirect_stdout(io.StringIO()):
                folder = synthetic.write(Path(name), lines)
                self.assertEqual(report.main([str(folder), "--figures", "none"]), 0)
                page = (folder / "report.html").read_text(encoding="utf-8")
            found = re.findall(r'<section id="([^"]*)"', page)
            self.assertEqual(found, ["answers", "errors"] if there else ["answers"])
            self.assertEqual('href="#errors"' in page, there)

    def test_names_are_escaped(self) -> None:
        bad = wrong("a", 1.0, 5)
        bad["strategy"]["title"] = "<b>&"
        (shown,) = time_error.shown(self.study([exact("refit", 2.0), bad]))
        self.assertNotIn("<b>", "".join(shown.panels))


if __name__ == "__main__":
    unittest.main()
