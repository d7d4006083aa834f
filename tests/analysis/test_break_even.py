"""Break-even points against values worked out by hand; nothing is said of l that were not measured."""

from __future__ import annotations

import unittest
from typing import Optional

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic
from test_claims import WORLD, Line, line

from claims import claims
from claims.claim_points import Table
from figures import break_even
from figures.break_even import AHEAD, BEHIND, CROSSES, MIXED
from report import report
from results import load

PERIOD, BEST = "2006-style refit", "best refit"


class TestPoints(unittest.TestCase):
    def found(self, depths: list[float], faster: list[float]) -> break_even.BreakEven:
        one = break_even.break_even(depths, faster)
        assert one is not None
        return one

    def test_lies_between_measured_l_on_logarithmic_axes(self) -> None:
        one = self.found([1, 10, 100], [0.02, 0.2, 2])
        self.assertEqual((one.kind, one.words), (CROSSES, "l ≈ 50"))
        self.assertAlmostEqual(one.l, 50.0)
        self.assertAlmostEqual(self.found([1, 4], [0.5, 2]).l, 2.0)

    def test_is_never_extrapolated(self) -> None:
        behind = self.found([1, 10], [0.09, 0.9])  # a line would cross at 11
        self.assertEqual((behind.kind, behind.l, behind.words), (BEHIND, 10, "beyond l = 10"))
        ahead = self.found([3, 10], [2, 7])
        self.assertEqual((ahead.kind, ahead.l, ahead.words), (AHEAD, 3, "every l from 3"))

    def test_one_l_decides_nothing(self) -> None:
        self.assertIsNone(break_even.break_even([10], [3]))
        self.assertIsNone(break_even.break_even([], []))

    def test_lines_that_cross_twice_are_told_as_they_are(self) -> None:
        again = self.found([1, 10, 100], [10, 0.1, 10])
        self.assertEqual(again.kind, CROSSES)
        self.assertRegex(again.words, r"slower from l ≈ 3\.2, faster from l ≈ 32")
        lost = self.found([1, 10, 100], [0.1, 10, 0.1])
        self.assertEqual((lost.kind, round(lost.l)), (MIXED, 32))

    def test_equal_is_not_faster(self) -> None:
        self.assertEqual(self.found([1, 10], [1, 1]).kind, BEHIND)
        self.assertEqual((self.found([1, 10], [1, 3]).kind, self.found([1, 10], [1, 3]).l), (CROSSES, 1))
        self.assertEqual(self.found([1, 10], [3, 1]).kind, MIXED)


class TestStudies(shared.InFolder):
    def lines(self, updates: dict[str, dict[int, float]], size: int = 16000) -> list[Line]:
        """Runs with given update times, and nothing else that takes time."""
        made = []
        for strategy, by_l in updates.items():
            for l, update in by_l.items():
                one = line("tablecloth", size, l, strategy if strategy in WORLD else "bottom_up")
                one["strategy"].update(id=strategy, title=strategy)
                for repetition in one["times"]["repetitions"]:
                    repetition.update(motion=0.0, update=update, traversal=0.0, triangle_tests=0.0)
                made.append(one)
        return made

    def places(self, lines: list[Line]) -> tuple[list[str], list[break_even.Place], list[str]]:
        synthetic.write(self.folder, lines)
        return break_even.places(Table(load.load(self.folder), "float"), claims.read_claims()["baselines"])

    def words(self, lines: list[Line], strategy: str, baseline: str, quantity: str = "update") -> Optional[str]:
        _, found, _ = self.places(lines)
        one = next(row.found[baseline] for row in found[0].rows if (row.label, row.quantity) == (strategy, quantity))
        return None if one is None else one.words

    def test_are_against_each_baseline(self) -> None:
        lines = self.lines({
            "bottom_up": {1: 1.0, 10: 1.0, 100: 1.0}, "bottom_up_period": {1: 20.0, 10: 20.0, 100: 20.0},
            "kinetic_aabb": {1: 200.0, 10: 20.0 * 10**0.5, 100: 20.0 / 10**0.5},
        })  # fmt: skip
        self.assertEqual(self.words(lines, "kinetic_aabb", PERIOD), "l ≈ 32")
        self.assertEqual(self.words(lines, "kinetic_aabb", BEST), "beyond l = 100")
        self.assertEqual(self.words(lines, "kinetic_aabb", "bottom_up"), "beyond l = 100")
        for one in lines:
            if one["strategy"]["id"] == "kinetic_aabb":
                for repetition in one["times"]["repetitions"]:
                    repetition["update"] /= 1e3
        self.assertEqual(self.words(lines, "kinetic_aabb", BEST), "every l from 1")

    def test_the_best_refit_is_that_of_each_table(self) -> None:
        lines = self.lines({"bottom_up": {1: 1.0, 10: 1.0}, "top_down": {1: 9.0, 10: 0.01}, "kinetic_aabb": {1: 4.0, 10: 0.25}})
        for one in lines:
            one["strategy"].update(baseline=one["strategy"]["id"] != "kinetic_aabb")
        self.assertEqual(self.words(lines, "kinetic_aabb", "bottom_up"), "l ≈ 3.2")
        self.assertEqual(self.words(lines, "kinetic_aabb", BEST), "beyond l = 10")

    def test_the_update_of_the_hybrid_refit_is_none(self) -> None:
        lines = self.lines({"bottom_up": {1: 1.0, 10: 1.0}, "hybrid": {1: 1.0, 10: 1.0}, "kinetic_aabb": {1: 4.0, 10: 0.25}})
        self.assertIsNone(self.words(lines, "kinetic_aabb", "hybrid"))
        self.assertEqual(self.words(lines, "kinetic_aabb", "hybrid", "total"), "l ≈ 3.2")

    def test_sizes_with_one_l_are_named_and_have_none(self) -> None:
        lines = self.lines({"bottom_up": {10: 1.0}, "kinetic_aabb": {10: 0.5}}, 2000)
        _, found, single = self.places(lines)
        self.assertEqual((found, single), ([], ["tablecloth 2.4k (l = 10)"]))

    def test_sizes_are_of_all_bodies(self) -> None:
        updates = {"bottom_up": {1: 1.0, 10: 1.0}, "kinetic_aabb": {1: 4.0, 10: 0.25}}
        lines = self.lines(updates)
        self.assertEqual([body["moving"] for body in lines[0]["scene"]["bodies"]], [True, False])
        self.assertEqual([place.size for place in self.places(lines)[1]], [16400], "16,000 triangles that move, and 400 at rest")
        for one in lines:  # another table under the cloth is another scene: nothing is interpolated between the two
            if one["scene"]["per_keyframe"] == 10:
                one["scene"].update(name="tablecloth-16000-900", primitives=16900)
                one["scene"]["bodies"][1]["primitives"] = 900
        self.assertEqual(self.places(lines)[1:], ([], ["tablecloth 16k (l = 1)", "tablecloth 17k (l = 10)"]))

    def test_page_has_the_figure(self) -> None:
        lines = self.lines({"bottom_up": {1: 1.0, 10: 1.0}, "bottom_up_period": {1: 1.0, 10: 1.0}, "kinetic_aabb": {1: 4.0, 10: 0.25}})
        synthetic.write(self.folder, lines)
        self.assertEqual(report.main([str(self.folder)]), 0)
        page = (self.folder / "report.html").read_text(encoding="utf-8")
        part = page[page.index('id="break-even"') :]
        part = part[: part.index("</details>")]
        self.assertIn("triangles of both bodies together", part)
        self.assertIn("largest measured l", part, "what lies beyond the measured l is said to be unknown")
        self.assertEqual(part.count("<figure>"), 1)
        self.assertTrue((self.folder / "figures" / "break-even.pdf").exists())


class TestNames(unittest.TestCase):
    def test_only_the_shortest_setting_that_differs_is_told(self) -> None:
        labels = ["kinetic AABB tree (leaf\u00a01, queue\u00a0avl)", "kinetic AABB tree (leaf\u00a016, queue\u00a0avl)", "kinetic BoxTree (leaf\u00a01)"]
        self.assertEqual(
            list(break_even.short_names(labels).values()), ["AABB tree (leaf 1)", "AABB tree (leaf 16)", "BoxTree"]
        )

    def test_names_that_would_be_equal_keep_all_settings(self) -> None:
        labels = ["kinetic X (a\u00a01, b\u00a01)", "kinetic X (a\u00a01, b\u00a02)", "kinetic X (a\u00a02, b\u00a01)", "kinetic X (a\u00a02, b\u00a02)"]
        self.assertEqual(len(set(break_even.short_names(labels).values())), 4)


if __name__ == "__main__":
    unittest.main()
