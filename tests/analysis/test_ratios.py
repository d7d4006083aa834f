"""Ratios, break-even points and Pareto fronts against values worked out by hand."""

from __future__ import annotations

import json
import math
import shutil
import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
import synthetic

from results import clip_times, load
import numpy as np
import pandas as pd
from ratios import ratios
from report import tables

#: The first resamples of five repetitions.
PINNED: list[list[int]] = [[2, 3, 4, 2, 2], [3, 4, 2, 1, 3], [2, 3, 2, 2, 2]]


def line(strategy: str, family: str, motion: list[float], update: list[float], **other: Any) -> dict[str, Any]:
    """A result with given motion and update times per repetition, and nothing else that takes time."""
    result = synthetic.record(dict(id=strategy, title=strategy, family=family, query=1.0), "s", 2000, "float", 10)
    result["times"]["repetitions"] = [
        {"motion": m, "update": u, "traversal": 0.0, "triangle_tests": 0.0, "plan_changes": 0.0}
        for m, u in zip(motion, update)
    ]
    result.update({name: value for name, value in other.items() if name != "guarantee"})
    result["strategy"]["guarantee"] = other.get("guarantee", "exact")
    return result


def ratios_of(lines: list[dict[str, Any]], scope: str) -> dict[str, ratios.Ratio]:
    with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
        study = load.load(synthetic.write(Path(folder), lines))
    ids = study.runs.set_index("run")["id"]
    return {ids[run]: one for run, one in ratios.ratios(study, scope).items()}


class TestRatios(unittest.TestCase):
    def test_few_repetitions_have_a_range(self) -> None:
        lines = [line("a", "refit", [1, 1, 1], [3, 5, 7]), line("k", "kinetic", [1, 1, 1], [1, 1, 3])]
        with_motion = ratios_of(lines, "with_motion")["k"]
        self.assertTrue(with_motion.paired)
        self.assertFalse(with_motion.is_interval)
        # 6 / 2 of the medians; (4/2, 6/2, 8/4) and (3/1, 5/1, 7/3) of repetitions
        self.assertEqual((with_motion.middle, with_motion.low, with_motion.high), (3.0, 2.0, 3.0))
        without = ratios_of(lines, "without_motion")["k"]
        self.assertEqual((without.middle, without.low, without.high), (5.0, 7 / 3, 5.0))

    def test_best_refit_is_the_reference_and_has_ratio_one(self) -> None:
        lines = [line("slow", "refit", [0, 0], [9, 9]), line("fast", "refit", [0, 0], [3, 3]), line("r", "rebuild", [0, 0], [6, 6])]
        found = ratios_of(lines, "with_motion")
        self.assertEqual({name: one.middle for name, one in found.items()}, {"slow": 1 / 3, "fast": 1.0, "r": 0.5})

    def test_the_reference_is_one_for_all_phases(self) -> None:
        # Positions count: one baseline fetches them in its update, the other one has them evaluated.
        fetching, plain = line("fetching", "refit", [0], [4]), line("plain", "refit", [3], [2])
        self.assertEqual(ratios_of([fetching, plain], "with_motion")["fetching"].middle, 1.0)
        self.assertEqual(ratios_of([fetching, plain], "without_motion")["plain"].middle, 2.0)
        self.assertEqual(ratios_of([fetching, plain], "update")["plain"].middle, 2.0)

    def test_a_lazy_refit_does_not_win_the_update_alone(self) -> None:
        lazy, plain = line("lazy", "refit", [0], [1]), line("plain", "refit", [0], [4])
        lazy["times"]["repetitions"][0]["traversal"] = 9.0
        found = ratios_of([lazy, plain, line("k", "kinetic", [0], [2])], "update")
        self.assertEqual({name: one.middle for name, one in found.items()}, {"lazy": 4.0, "plain": 1.0, "k": 2.0})

    def test_the_line_of_the_best_refit_is_of_one_run_at_each_x(self) -> None:
        rows = pd.DataFrame({
            "run": [0, 1, 2, 3], "baseline": [True] * 4, "guarantee": ["exact"] * 4, "l": [1, 1, 10, 10],
            "updating": [1.0, 4.0, 2.0, 3.0], "total_motion": [9.0, 5.0, 6.0, 7.0],
        })  # fmt: skip
        found = ratios.best_refit_line(rows, "updating", "l")
        self.assertEqual(dict(found), {1: 4.0, 10: 2.0})

    def test_other_libraries_and_approximate_refits_are_no_reference(self) -> None:
        lines = [line("f", "fcl", [0], [1]), line("sloppy", "refit", [0], [1], guarantee="approximate"), line("a", "refit", [0], [2])]
        self.assertEqual(ratios_of(lines, "with_motion")["f"].middle, 2.0)

    def test_only_declared_baselines_are_a_reference(self) -> None:
        fast, slow = line("mine", "refit", [0], [1]), line("bottom_up", "refit", [0], [4])
        fast["strategy"]["baseline"], slow["strategy"]["baseline"] = False, True
        found = ratios_of([fast, slow], "with_motion")
        self.assertEqual({name: one.middle for name, one in found.items()}, {"mine": 4.0, "bottom_up": 1.0})
        other = line("new", "mine", [0], [2])
        other["strategy"]["baseline"] = True
        self.assertEqual(ratios_of([fast, slow, other], "with_motion")["mine"].middle, 2.0)

    def test_records_without_the_field_go_by_the_family(self) -> None:
        old, new = line("old", "refit", [0], [3]), line("k", "kinetic", [0], [1])
        self.assertNotIn("baseline", old["strategy"])
        self.assertEqual(ratios_of([old, new], "with_motion")["k"].middle, 3.0)

    def test_unequal_repetitions_or_sessions_are_not_paired(self) -> None:
        uneven = [line("a", "refit", [0, 0, 0], [2, 4, 6]), line("k", "kinetic", [0, 0], [1, 2])]
        found = ratios_of(uneven, "with_motion")["k"]
        self.assertFalse(found.paired)
        self.assertEqual((found.middle, found.low, found.high), (4 / 1.5, 1.0, 6.0))
        apart = [line("a", "refit", [0, 0], [2, 4]), line("k", "kinetic", [0, 0], [1, 2], run="session 2")]
        self.assertFalse(ratios_of(apart, "with_motion")["k"].paired)

    def test_never_across_commits_or_machines(self) -> None:
        for change in ({"commit": "another"}, {"dirty": True}, {"machine": dict(synthetic.MACHINE, cpu="another")}):
            lines = [line("a", "refit", [0], [2]), line("k", "kinetic", [0], [1], **change)]
            self.assertNotIn("k", ratios_of(lines, "with_motion"))

    def test_plan_changes_count_as_update(self) -> None:
        lines = [line("a", "refit", [0], [4]), line("k", "kinetic", [0], [1])]
        lines[1]["times"]["repetitions"][0]["plan_changes"] = 1.0
        self.assertEqual(ratios_of(lines, "update")["k"].middle, 2.0)


class TestOneDenominator(unittest.TestCase):
    def test_is_that_of_the_program_on_the_same_file(self) -> None:
        # tests/program/results_test.cpp and test_explore.py read the same two files.
        results = Path(__file__).resolve().parents[1] / "support" / "results"
        expected = {float(l): id for l, id in json.loads((results / "denominators.json").read_text()).items()}
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
            shutil.copy(results / "denominators.jsonl", Path(folder) / "results.jsonl")
            study = load.load(Path(folder))
        ids = study.runs.set_index("run")["id"]
        found = {}
        for _, group in study.timed.groupby("group"):
            best = ratios.best_refit(study, group)
            found[float(group["l"].iloc[0])] = None if best is None else ids[best]
        self.assertEqual(found, expected)

    def test_ratios_are_those_of_the_program_on_the_same_file(self) -> None:
        # tests/program/table_test.cpp reads the same two files. The program computes; this holds the analysis to it.
        results = Path(__file__).resolve().parents[1] / "support" / "results"
        expected = json.loads((results / "ratios.json").read_text())
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
            shutil.copy(results / "ratios.jsonl", Path(folder) / "results.jsonl")
            study = load.load(Path(folder))
        ids = study.runs.set_index("run")["id"]
        refit = ratios.best_refit(study, study.runs)
        self.assertIsNotNone(refit)
        scopes = {"total": "without_motion", "total_with_motion": "with_motion", "upkeep": "update", "query": "query"}
        self.assertEqual(set(ids), set(expected))
        for run, id in ids.items():
            for phase, scope in scopes.items():
                with self.subTest(id, phase=phase):
                    one, wanted = ratios.ratio(study, int(run), refit, scope), expected[id][phase]
                    found = None if one is None else [one.middle, one.low, one.high]
                    if found is None or wanted is None:
                        self.assertEqual(found, wanted)
                        continue
                    np.testing.assert_allclose(found, wanted[:3] if len(wanted) > 1 else wanted * 3, rtol=1e-9)
                    self.assertEqual(one.is_interval, len(wanted) > 1 and wanted[3])


def clip(strategy: str, family: str, frames: list[list[float]], **times: Any) -> dict[str, Any]:
    """A result of schema 2 with these totals, [repetition][frame], update and query alike, and 1 ms of motion."""
    result = synthetic.record(dict(id=strategy, title=strategy, family=family, query=1.0), "s", 2000, "float", 10)
    result["schema"] = 2
    steady = times.pop("steady_from", None)

    def phases(part: list[float]) -> dict[str, float]:
        half = sum(part) / len(part) / 2
        return {"motion": 1.0, "update": half, "traversal": half, "triangle_tests": 0.0, "plan_changes": 0.0, "geometry_changes": 0.0}

    result["times"].update(
        repetitions=[
            {**phases(one), "totals": one, "motions": [1.0] * len(one), **({} if steady is None else {"steady": phases(one[steady:])})}
            for one in frames
        ],
        frames=len(frames[0]), by="frames", steady_from=steady, disturbed="", build_ms=0.0,
    )  # fmt: skip
    result["times"].update(times)
    return result


class TestFrames(unittest.TestCase):
    #: Frame 1 of the second repetition, frame 2 of the third, and all of the last were disturbed.
    DISTURBED = [[8, 2, 4, 2], [8, 90, 4, 2], [8, 2, 70, 2], [8, 2, 4, 2], [80, 20, 40, 20]]

    def load(self, *lines: dict[str, Any]) -> load.Study:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
            return load.load(synthetic.write(Path(folder), list(lines)))

    def test_a_disturbed_frame_does_not_count(self) -> None:
        study = self.load(clip("a", "refit", self.DISTURBED, steady_from=2), clip("b", "kinetic", self.DISTURBED, by="clips"))
        by_frames, by_clips = (study.runs.iloc[i] for i in (0, 1))
        self.assertEqual((by_frames["total"], by_frames["updating"], by_frames["query"], by_frames["motion"]), (4.0, 2.0, 2.0, 1.0))
        self.assertEqual((by_frames["total_motion"], by_frames["steady"]), (5.0, 3.0))
        self.assertEqual(by_clips["total"], 82 / 4)
        self.assertTrue(math.isnan(by_clips["steady"]))

    def test_one_side_by_clips_makes_both(self) -> None:
        refit, own = clip("a", "refit", self.DISTURBED), clip("k", "kinetic", [[2, 2, 2, 2]] * 5)
        self.assertEqual(ratios.ratios(self.load(refit, own), "without_motion")[1].middle, 2.0)
        own["times"]["by"] = "clips"
        found = ratios.ratios(self.load(refit, own), "without_motion")[1]
        self.assertEqual((found.middle, found.is_interval), (82 / 8, True))

    def test_five_repetitions_have_an_interval(self) -> None:
        def times(repetitions: int, first: float) -> list[list[float]]:
            return [[first if r == 0 else 4.0] for r in range(repetitions)]

        for repetitions, ends in ((2, (0.5, 1.0)), (4, (0.5, 1.0)), (9, (1.0, 1.0))):
            study = self.load(clip("a", "refit", times(repetitions, 4)), clip("k", "kinetic", times(repetitions, 8)))
            found = ratios.ratios(study, "without_motion")[1]
            self.assertEqual(found.is_interval, repetitions >= 5)
            self.assertEqual((found.low, found.high), ends, repetitions)

    def test_the_first_draws(self) -> None:
        # Pinned in tests/program/results_test.cpp and in the explorer's test, too.
        raw = self.load(clip("a", "refit", [[2.0 ** r] for r in range(5)])).raw[0]
        found = clip_times.replicates(raw, "total")[:3]
        self.assertEqual(found.tolist(), [float(np.median([2.0 ** r for r in draw])) for draw in PINNED])

    def test_a_beginning_is_paid_for_from_a_frame_on(self) -> None:
        own, refit = clip("k", "kinetic", [[10, 1, 1, 1, 7, 1, 1, 1, 1]]), clip("a", "refit", [[4] * 9])
        study = self.load(refit, own)
        refit_times, times = study.raw[0], study.raw[1]
        self.assertEqual(clip_times.paid_from(times, 0, refit_times, 0), 2)
        self.assertEqual(clip_times.paid_from(times, 1, refit_times, 0), 5)
        self.assertIsNone(clip_times.paid_from(times, 100, refit_times, 0))

    def test_records_of_both_schemas_are_never_compared(self) -> None:
        old = line("a", "refit", [0], [1])
        study = self.load(old, clip("k", "kinetic", [[2, 2]] * 5), clip("a", "refit", [[4, 4]] * 5))
        self.assertEqual(old["schema"], 1)
        found = ratios.ratios(study, "without_motion")
        self.assertEqual(found[1].middle, 2.0)
        self.assertEqual(found[0].middle, 1.0, "alone in its group")
        self.assertTrue(any("1 of 3 results are of schema 1" in note for note in study.notes), study.notes)
        with self.assertRaisesRegex(load.ResultError, "schema 3 is not known"):
            self.load(dict(old, schema=3))

    def test_repetitions_that_differ_are_disturbed_though_no_processor_was_missed(self) -> None:
        steady, other = clip("a", "refit", [[4]] * 5), clip("k", "kinetic", [[2], [2], [2.4], [3], [3]])
        study = self.load(steady, other)
        self.assertEqual([study.raw[run].disturbed for run in (0, 1)], ["", "its repetitions differ by a factor of 1.33"])
        self.assertEqual(list(study.runs["disturbed"]), ["", "its repetitions differ by a factor of 1.33"])
        # One slow repetition of five is none of their quartiles; four repetitions have none.
        study = self.load(clip("a", "refit", [[4]] * 4 + [[9]]), clip("k", "kinetic", [[2], [2], [9], [9]]))
        self.assertEqual(list(study.runs["disturbed"]), ["", ""])

    def test_a_disturbed_machine_is_seen_at_the_ratio(self) -> None:
        study = self.load(clip("a", "refit", [[4]] * 5), clip("k", "kinetic", [[2]] * 5, disturbed="90 involuntary switches"))
        found = ratios.ratios(study, "without_motion")
        self.assertEqual((found[0].disturbed, found[1].disturbed), (False, True))
        shown = tables.groups(study, tables.Ratios(study))[0]
        self.assertEqual([row.ratio_without_motion.disturbed for row in shown.rows], [True, False])
        self.assertTrue(any("Disturbed (?)" in note and "90 involuntary switches" in note for note in shown.notes), shown.notes)


class TestPareto(unittest.TestCase):
    def test_front(self) -> None:
        points = [(0.0, 5.0), (1.0, 3.0), (1.0, 4.0), (2.0, 3.0), (3.0, 1.0), (4.0, 2.0)]
        self.assertEqual(ratios.pareto_front(points), [0, 1, 4])

    def test_one_point_dominates(self) -> None:
        self.assertEqual(ratios.pareto_front([(1, 1), (0, 0), (2, 0)]), [1])

    def test_equal_points_and_unknown_values(self) -> None:
        self.assertEqual(ratios.pareto_front([(math.nan, 0), (1, 1), (1, 1), (0, math.inf)]), [1])
        self.assertEqual(ratios.pareto_front([]), [])

    def test_agrees_with_the_definition_on_random_points(self) -> None:
        rng = np.random.default_rng(1)
        for _ in range(50):
            points = [tuple(map(float, p)) for p in rng.integers(0, 8, size=(20, 2))]
            front = {points[i] for i in ratios.pareto_front(points)}
            defined = {p for p in points if not any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)}
            self.assertEqual(front, defined)


class TestBreakEven(unittest.TestCase):
    def test_crossing_on_log_log_lines(self) -> None:
        x = np.array([1.0, 10.0, 100.0])
        found = ratios.crossings(x, 10.0 / x, np.array([0.5, 0.5, 0.5]))
        self.assertEqual(len(found), 1)
        self.assertAlmostEqual(found[0].x, 20.0)
        self.assertAlmostEqual(found[0].y, 0.5)
        self.assertTrue(found[0].faster)

    def test_crossing_at_a_measured_point(self) -> None:
        x = np.array([1.0, 10.0, 100.0])
        found = ratios.crossings(x, np.array([4.0, 2.0, 1.0]), np.array([2.0, 2.0, 2.0]))
        self.assertEqual([(round(c.x, 6), c.faster) for c in found], [(10.0, True)])


if __name__ == "__main__":
    unittest.main()
