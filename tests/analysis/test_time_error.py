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
from figures import time_error, time_error_file, time_error_panels
from results.load import ResultError, Study, load
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
        (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
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
                better = [other for other in place.points if other.time < one.time and time_error.MEASURES[column].of(other) <= time_error.MEASURES[column].of(one)]
                self.assertEqual(better, [], one.id)

    def test_the_sentence_compares_the_fastest_of_each(self) -> None:
        lines = [exact("refit", 2.0), exact("slow", 3.0), wrong("bad", 0.5, 11), wrong("good", 1.0, 9), wrong("better", 1.25, 0)]
        study = self.study(lines)
        (place,) = time_error.places(study)
        (says,) = time_error.sentences(study, place)
        self.assertRegex(says, r"^If nothing of the future is known, on one scene \(.*, 10 frames a keyframe\): missing up to 1\u00a0% of the pairs makes a frame 2\.00 times as fast")
        self.assertIn("good takes 1.00\u00a0ms a frame and missed 0.90\u00a0%", says)
        self.assertTrue(says.endswith("; the fastest exact one, refit, takes 2.00\u00a0ms a frame."), says)
        self.assertNotIn("gains nothing", says)

    def test_where_an_error_buys_nothing_it_says_so(self) -> None:
        study = self.study([exact("refit", 1.0), wrong("good", 1.5, 1), wrong("bad", 0.5, 500)])
        (place,) = time_error.places(study)
        self.assertRegex(time_error.sentences(study, place)[0], r"missing up to 1\u00a0% of the pairs gains nothing: the fastest exact one, refit, takes 1\.00\u00a0ms a frame and is 1\.50 times as fast")
        study = self.study([exact("refit", 1.0), wrong("bad", 0.5, 500)])
        (place,) = time_error.places(study)
        self.assertIn("no approximate contestant missed less than 1\u00a0%", time_error.sentences(study, place)[0])

    def test_a_gain_within_the_noise_may_be_none(self) -> None:
        def rounds(one: dict[str, Any], updates: list[float]) -> dict[str, Any]:
            one["times"]["repetitions"] = [{**one["times"]["repetitions"][0], "update": update} for update in updates]
            return one

        high, low = [2.0, 2.04, 2.0], [1.98, 2.06, 1.94]  # ratios 1.01, 0.99 and 1.03
        study = self.study([rounds(exact("refit", 2.0), high), rounds(wrong("good", 2.0, 1), low)])
        (place,) = time_error.places(study)
        self.assertIn("makes a frame 1.01 times as fast (0.99 to 1.03), which may be no gain: good takes", time_error.sentences(study, place)[0])
        self.assertIn("makes a frame 1.01 times as fast (0.99 to 1.03, which may be no gain) if nothing is known: ", time_error.brief(place))
        study = self.study([rounds(exact("refit", 2.0), low), rounds(wrong("good", 2.0, 1), high)])
        (place,) = time_error.places(study)
        self.assertRegex(time_error.sentences(study, place)[0], r"gains nothing: .* is 1\.01 times as fast \(0\.99 to 1\.03; this run does not tell them apart\) as")
        self.assertIn("makes no difference that is sure if nothing is known: ", time_error.brief(place))

    def test_knowledge_of_the_future_is_compared_with_its_like(self) -> None:
        lines = [exact("refit", 2.0), exact("clip", 0.8, foresight="whole_clip"), wrong("good", 1.0, 1)]
        study = self.study(lines)
        (place,) = time_error.places(study)
        without, known = time_error.sentences(study, place)
        self.assertTrue(without.startswith("If nothing") and "makes a frame 2.00 times as fast" in without, without)
        self.assertTrue(known.startswith("Whatever is known") and "gains nothing" in known and "1.25 times as fast" in known, known)

    def test_places_of_marks_follow_time_and_share(self) -> None:
        scale = time_error_panels.Scale([1.0, 10.0], [0.0, 0.001, 0.1])
        self.assertLess(scale.x(1.0), scale.x(10.0))
        self.assertAlmostEqual(scale.x(10**0.5), (scale.x(1.0) + scale.x(10.0)) / 2)
        self.assertAlmostEqual(scale.y(0.001) - scale.y(0.01), scale.y(0.01) - scale.y(0.1))
        self.assertGreater(scale.y(0.0), scale.y(0.001) + time_error_panels.STRIP / 2, "zero is apart")

    def test_the_panels_draw_every_contestant_slow_ones_at_the_edge(self) -> None:
        lines = [exact("refit", 2.0), wrong("a", 1.0, 500), wrong("b", 1.5, 100, extra=4), wrong("slow", 40.0, 3)]
        (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
        self.assertEqual(shown.slow, 1)
        for panel in (one.drawn for one in shown.panels):
            places = [float(x) for x in re.findall(r'class="mark"[^>]*translate\(([\d.]+)', panel)]
            self.assertEqual(len(places), 3)
            self.assertEqual([x for x in places if x >= time_error_panels.WIDTH - time_error_panels.RIGHT], [time_error_panels.WIDTH - time_error_panels.RIGHT])
            self.assertEqual(len(re.findall('class="exact"', panel)), 1)
            self.assertIn('class="beat"', panel)
            for number in re.findall(r'\b(?:x|y|x1|x2|y1|y2|cx|cy)="([^"]*)"', panel):
                self.assertTrue(-1 <= float(number) <= max(time_error_panels.WIDTH, time_error_panels.HEIGHT), number)
        self.assertEqual(re.findall('class="number"[^>]*>([^<]*)<', shown.panels[0].drawn), ["1", "2", "3"])
        self.assertEqual(len(shown.all_rows), 4)

    def test_no_line_and_no_mark_crosses_the_name_of_a_vertical_line(self) -> None:
        lines = [exact("join", 1.5, foresight="next_keyframe"), exact("refit", 1.6), exact("slow", 9.0), wrong("a", 1.52, 1000), wrong("b", 1.55, 900)]
        (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
        for panel in (one.drawn for one in shown.panels):
            names = re.findall(r'<text class="tick" x="([\d.]+)" y="([\d.]+)">(fastest exact|no foresight)<', panel)
            self.assertEqual(len(names), 2)
            marks = re.findall(r'translate\(([\d.]+) ([\d.]+)', panel)
            falls = re.findall(r'<line class="(?:beat|grid|lead)[^"]*" x1="([\d.]+)" x2="[\d.]+" y1="([\d.]+)"', panel)
            falls += re.findall(r'class="front" d="M([\d.]+) ([\d.]+)', panel)
            self.assertGreaterEqual(len(marks), 2)
            self.assertGreaterEqual(len(falls), 3)
            for x, y, name in names:
                left, right, foot = float(x), float(x) + time_error_panels.NAME * len(name), float(y)
                for at, top in [*falls, *((x, str(float(y) - 4)) for x, y in marks)]:
                    self.assertFalse(left < float(at) < right and float(top) < foot, f"{name}: {at}, {top}")

    def test_labels_cover_neither_marks_nor_each_other(self) -> None:
        # Dials that begin with the same value at nearly the same place: "300 300" was read as one number.
        for crowd in (1.0, 1.02, 1.3):
            lines = [exact("refit", 2.0), exact("other", 2.02), exact("third", 2.04)]
            for i, box_tests in enumerate((300, 1000, 3000, 10000)):
                lines += [wrong(f"budget{k}", (1 + i / 8) * crowd**k, 900 - 200 * i - k, box_tests=box_tests) for k in range(6)]
            (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
            self.assertEqual([one.name for one in shown.panels + shown.more], ["missed", "false", "depth", "first"])
            for panel in shown.panels + shown.more:
                labels = [(kind, float(x), float(y) - 4, word) for kind, x, y, word in
                          re.findall(r'<text class="(number|value)"[^>]* x="([\d.]+)" y="([\d.]+)">([^<]*)<', panel.drawn)]  # fmt: skip
                marks = [(float(x), float(y)) for x, y in re.findall(r'class="mark"[^>]*translate\(([\d.]+) ([\d.]+)', panel.drawn)]
                if panel.name == "missed":
                    self.assertGreater(len([one for one in labels if one[0] == "value"]), 1)
                for i, (kind, x, y, word) in enumerate(labels):
                    half = 3.1 * len(word)  # of a digit 6.2 wide, measured in Chromium at the largest of both sizes
                    for at, up in marks:
                        self.assertFalse(abs(x - at) < half + 3 and abs(y - up) < 7, f"{crowd} {panel.name}: {word} covers a mark")
                    for other, at, up, said in labels[:i]:
                        gap = abs(x - at) - half - 3.1 * len(said)
                        self.assertFalse(gap < 3 and abs(y - up) < 9, f"{crowd} {panel.name}: {word} and {said} are {gap:.1f} apart")

    def test_a_strategy_with_several_dials_names_the_one_that_a_value_is_of(self) -> None:
        lines = [exact("refit", 2.0)]
        lines += [wrong("stale", 1.0 + every / 8, 100 * every, refit_every=every, margin=0) for every in (2, 4, 8)]
        lines += [wrong("stale", 1.9, 20, refit_every=2, margin=0.5), wrong("other", 1.1, 950, box_tests=300), wrong("other", 1.6, 850, box_tests=900)]
        (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
        said = {word.replace("\u00a0", " ") for word in re.findall('class="value"[^>]*>([^<]*)<', shown.panels[0].drawn)}
        self.assertTrue({"every 8", "300"} <= said <= {"every 2", "every 8", "margin 0", "margin 0.5", "300", "900"}, said)

    def test_curves_are_drawn_where_there_is_an_error(self) -> None:
        lines = [exact("refit", 2.0), *(wrong("stale", total, missed, refit_every=every) for every, total, missed in ((2, 1.6, 0), (3, 1.5, 0), (8, 1.2, 100)))]
        (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
        drawn = {panel.name: re.findall(r'class="dial"[^>]* d="([^"]*)"', panel.drawn) for panel in shown.panels}
        self.assertEqual([way.count("M") for way in drawn["missed"]], [1], "from 3 to 8, and not along the strip from 2 to 3")
        self.assertEqual(drawn["false"], [])
        marks = dict(re.findall(r'translate\(([\d.]+) ([\d.]+)', shown.panels[0].drawn))
        (begin, end) = re.findall(r"([\d.]+) ([\d.]+)", drawn["missed"][0])
        self.assertEqual([marks[x] for x, _ in (begin, end)], [y for _, y in (begin, end)], "from mark to mark")

    def test_contestants_without_an_error_stand_side_by_side_or_above_each_other(self) -> None:
        crowd = [exact(f"tree_{i}", 2.0 + i / 40) for i in range(24)]
        for lines in ([*crowd, wrong("a", 1.0, 500), wrong("b", 9.0, 1)], [exact("refit", 2.0), wrong("a", 1.0, 500)]):
            (shown,) = time_error_panels.shown(time_error.places(self.study(lines)))
            panel = shown.panels[0].drawn
            bottom = time_error_panels.HEIGHT - time_error_panels.BOTTOM
            (top,) = re.findall(r'<rect class="strip" x="\d+" y="([\d.]+)"', panel)
            marks = [(float(x), float(y)) for x, y in re.findall(r'<circle class="exact"[^>]* cx="([\d.]+)" cy="([\d.]+)"', panel)]
            self.assertEqual(len(marks), len(lines) - (len(lines) > 2) - 1)
            for i, (x, y) in enumerate(marks):
                self.assertTrue(float(top) + 4 < y < bottom - 4, "in the strip")
                for at, up in marks[:i]:
                    self.assertGreater(max(abs(x - at), abs(y - up)), time_error_panels.ROW - 0.2)
            others = [float(y) for y in re.findall(r'class="mark"[^>]*translate\([\d.]+ ([\d.]+)', panel)]
            self.assertTrue(others and max(others) < float(top), "all others above the strip")
            self.assertEqual(re.findall(r">\((\d+)\)<", panel), ["24"] if len(lines) > 2 else [])

    def test_every_panel_says_what_it_shows(self) -> None:
        lines = [exact("join", 0.8, foresight="next_keyframe"), exact("refit", 2.0), wrong("a", 1.0, 500, extra=10), wrong("b", 1.5, 5), wrong("c", 3.0, 0)]
        (place,) = time_error.places(self.study(lines))
        says = {name: time_error.finding(place, name) for name in time_error.MEASURES}
        self.assertRegex(says["missed"], r"^2 of 3 approximate contestants are faster than refit, .*they miss 0\.50\s% \(b\) to 50\s% \(a\)\.$")
        self.assertRegex(says["false"], r"^1 of 3 approximate contestants reports false pairs, at most 2\.0\s% of what they report \(a\); the other 2 report none\.$")
        self.assertRegex(says["depth"], r"less than 1\s% of the pairs miss none deeper than 0\.25 edge lengths \(b\); the deepest .* 0\.25")
        self.assertRegex(says["first"], r"^2 of the 2 that miss a pair begin within ten frames .*\(frame 8 of \d+\); the last to begin is .*, at frame 8\.$")
        place = self.place([exact("refit", 0.5), wrong("a", 1.0, 500)])
        self.assertIn("None of 1 approximate contestant is faster than refit", time_error.finding(place, "missed"))
        self.assertIn("reports a false pair", time_error.finding(place, "false"))

    def test_the_file_has_all_that_is_drawn(self) -> None:
        lines = [exact("refit", 2.0), exact("clip", 0.8, foresight="whole_clip")]
        lines += [wrong("stale", 1.0 + every / 8, 100 - every, extra=every, refit_every=every) for every in (8, 2, 4)]
        places = time_error.places(self.study(lines))
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            file = Path(name) / time_error_file.FILE
            file.write_text(time_error_file.content(places), encoding="utf-8")
            again = time_error_file.read(file)
            for own, other in zip(time_error_panels.shown(places), time_error_panels.shown(again)):
                self.assertEqual((own.place.title, own.place.measured, own.sentences), (other.place.title, other.place.measured, other.sentences))
                self.assertEqual((own.panels, own.more, own.legend, own.all_rows), (other.panels, other.more, other.legend, other.all_rows))
            self.assertIn("Measured ", again[0].measured)
            for text, why in (("{}", "schema"), (file.read_text().replace('"missed"', '"mist"'), "fields"), (file.read_text().replace('"title"', '"name"', 1), "title")):
                file.write_text(text, encoding="utf-8")
                self.assertRaisesRegex(ResultError, why, time_error_file.read, file)

    def test_the_command_says_what_the_figures_show(self) -> None:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name, contextlib.redirect_stdout(io.StringIO()) as out:
            folder = synthetic.write(Path(name), [exact("refit", 2.0), wrong("a", 1.0, 5)])
            self.assertEqual(time_error_file.main([str(folder), "--write", str(folder / "errors.json")]), 0)
            self.assertEqual(len(time_error_file.read(folder / "errors.json")), 1)
            self.assertIn("1 of 1 approximate contestant is faster", out.getvalue().replace("\u00a0", " "))
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name, contextlib.redirect_stderr(io.StringIO()) as out:
            self.assertEqual(time_error_file.main([str(synthetic.write(Path(name), [exact("refit", 2.0), exact("tree", 1.0)]))]), 2)
            self.assertIn("wrongly", out.getvalue())

    def test_the_short_sentence_has_both_times_and_the_doubt(self) -> None:
        study = self.study([exact("refit", 2.0), exact("slow", 3.0), wrong("bad", 0.5, 11), wrong("good", 1.0, 9, dial=3)])
        (place,) = time_error.places(study)
        self.assertEqual(
            time_error.brief(place),
            "Missing up to 1\u00a0% of the pairs makes a frame 2.00 times as fast if nothing is known: 1.00 ms by good, 2.00 ms exactly by refit (cloth, 4k triangles).",
        )
        place.sentences[0] = place.sentences[0].replace("times as fast", f"times as fast (0.90 to 2.20; {time_error.DISTURBED}), {time_error.NO_GAIN}", 1)
        self.assertIn("makes a frame 2.00 times as fast (0.90 to 2.20, which may be no gain) if nothing is known: 1.00 ms", time_error.brief(place))
        self.assertTrue(time_error.brief(place).endswith("(cloth, 4k triangles, a doubtful run)."))
        for lines, said in (
            ([exact("refit", 1.0), wrong("good", 1.5, 1)], "gains nothing if nothing is known: 1.50 ms by good, 1.00 ms exactly by refit"),
            ([exact("refit", 1.0), wrong("bad", 0.5, 500)], "No approximate contestant missed less than 1\u00a0% of the pairs if nothing is known; the exact refit takes 1.00 ms"),
            ([exact("clip", 2.0, foresight="whole_clip"), wrong("good", 1.0, 1)], "makes a frame 2.00 times as fast: 1.00 ms by good, 2.00 ms exactly by clip"),
        ):  # fmt: skip
            self.assertIn(said, time_error.brief(self.place(lines)))

    def test_it_is_the_first_part_below_the_answers_where_there_is_an_error(self) -> None:
        for lines, there in (([exact("refit", 2.0), wrong("a", 1.0, 5)], True), ([exact("refit", 2.0), exact("tree", 1.0)], False)):
            with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name, contextlib.redirect_stdout(io.StringIO()):
                folder = synthetic.write(Path(name), lines)
                self.assertEqual(report.main([str(folder), "--figures", "none"]), 0)
                page = (folder / "report.html").read_text(encoding="utf-8")
            self.assertEqual(re.findall(r'<section id="([^"]*)"', page), ["answers"])
            parts = re.findall(r'<details class="part" id="([^"]*)"', page)
            self.assertEqual(parts[:2], ["errors", "full"] if there else ["full", "glance"])
            self.assertEqual('href="#errors"' in page, there)

    def test_names_are_escaped(self) -> None:
        bad = wrong("a", 1.0, 5)
        bad["strategy"]["title"] = "<b>&"
        (shown,) = time_error_panels.shown(time_error.places(self.study([exact("refit", 2.0), bad])))
        self.assertNotIn("<b>", "".join(one.drawn for one in shown.panels))


if __name__ == "__main__":
    unittest.main()
