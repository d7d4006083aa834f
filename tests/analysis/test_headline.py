"""The headline tables: which rows they have, of which configuration, and what they say of it."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
import synthetic

from report import headline
from results import load, tuned
from results.load import ResultError


def line(id: str, scene: str, l: int, update: float, query: float, motion: float = 0.0, **strategy: Any) -> dict[str, Any]:
    """A result with three equal repetitions."""
    family = "refit" if id in ("bottom_up", "leaf_slabs", "hybrid") else "other"
    result = synthetic.record(dict(id=id, title=strategy.pop("title", id), family=family, query=1.0), "s", 2000, "float", l)
    result["scene"].update(name=scene, hash=scene)
    phases = {"motion": motion, "update": update, "traversal": query, "triangle_tests": 0.0, "plan_changes": 0.0}
    result["times"]["repetitions"] = [dict(phases) for _ in range(3)]
    result["strategy"].update(strategy, baseline=family == "refit")
    result["verified"].update(frames=11)
    return result


def lines() -> list[dict[str, Any]]:
    cloth = headline.CLOTH
    embree = dict(title="Embree, refit", version="Embree 1.2.3", instructions="avx512", remark="two geometries")
    return [
        line("bottom_up", cloth, 10, 1.0, 8.0, 1.0),
        line("hybrid", cloth, 10, 0.1, 12.0),  # its update alone would win
        line("auto", cloth, 10, 1.0, 4.0),
        line("embree_refit", cloth, 10, 7.0, 33.0, params={"geometry": "user"}, **embree),
        line("embree_refit", cloth, 10, 2.0, 60.0, params={"geometry": "triangles"}, **embree),
        line("kinetic_aabb", cloth, 10, 5.0, 15.0, params={"queue": "segment_heap"}, builder={"method": "median", "width": 8, "leaf_size": 16}),
        line("kinetic_aabb", cloth, 10, 50.0, 50.0, params={"queue": "avl"}, builder={"method": "median", "width": 2, "leaf_size": 1}),
        line("leaf_slabs", "new scene", 1, 2.0, 8.0),
        line("auto", "new scene", 1, 2.0, 18.0),
    ]  # fmt: skip


class TestHeadline(unittest.TestCase):
    def cases(self, records: list[dict[str, Any]]) -> list[headline.Case]:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
            return headline.cases(load.load(synthetic.write(Path(folder), records)))

    def rows(self, table: str) -> list[list[str]]:
        return [[cell.strip() for cell in row.strip("|").split("|")] for row in table.split("\n") if row.startswith("|")][2:]

    def test_rows_are_against_the_one_best_refit(self) -> None:
        rows = {row[0]: row[1:] for row in self.rows(headline.strategies(self.cases(lines()), headline.SHORT))}
        self.assertEqual(rows["best refit: bottom-up refit (`bottom_up`)"], ["1.00", "8.00", "1.00", "1"])
        self.assertEqual(rows["automatic choice (`auto`): may use the next keyframe †"], ["1.00", "4.00", "fetched", "2.00x"])
        self.assertEqual(rows["kinetic AABB tree as in 2006: needs the whole clip"][3], "0.10x")
        self.assertEqual(rows["kinetic AABB tree (`kinetic_aabb`): needs the whole clip"][3], "0.50x")

    def test_ranges_and_disturbances_are_shown(self) -> None:
        records = lines()
        records[2]["times"]["repetitions"][0]["update"] = 4.0
        records[2]["times"]["disturbed"] = "9 involuntary switches, 30 a second"
        table = headline.strategies(self.cases(records), headline.SHORT)
        row = next(row for row in self.rows(table) if row[0].startswith("automatic"))
        self.assertEqual(row[4], "2.00x ? [1.25–2.00]")
        self.assertIn("1 of 7 contestants was disturbed (?), for example: 9 involuntary switches, 30 a second.", table)
        self.assertIn("the machine was quiet.", headline.strategies(self.cases(lines()), headline.SHORT))

    def test_a_peer_updates_by_its_best_and_queries_by_the_other_and_says_so(self) -> None:
        table = headline.strategies(self.cases(lines()), headline.SHORT)
        row = next(row for row in self.rows(table) if row[0].startswith("Embree"))
        self.assertEqual(row, ["Embree, refit and `rtcCollide` ‡", "2.00", "33.0", "fetched", "0.25x"])
        self.assertIn("‡ Embree, refit, Embree 1.2.3: two geometries. With the update shown, a clip would be 0.29x.", table)

    def test_cases_mark_what_auto_was_tuned_on(self) -> None:
        table = headline.by_case(self.cases(lines()))
        known, new = self.rows(table)
        self.assertEqual(known[:6], [headline.CLOTH, "10", "`bottom_up`", "10.0", "10 %", "80 %"])
        self.assertEqual(known[6], "2.00x †")
        self.assertEqual(new[:3] + new[6:8], ["new scene", "1", "`leaf_slabs`", "0.50x", "–"])
        self.assertIn(headline.CLOTH, tuned.scenes())
        self.assertNotIn("sheet over box 10k", tuned.scenes())

    def test_says_how_many_frames_were_compared_and_what_was_found(self) -> None:
        self.assertIn("22 frames were compared with the oracle, each for every contestant (99 comparisons): no pair was missed",
                      headline.by_case(self.cases(lines())))  # fmt: skip
        wrong = lines()
        wrong[2]["verified"]["missed"] = 3
        self.assertIn("3 pairs were missed, 0 were extra", headline.by_case(self.cases(wrong)))

    def test_pages_are_changed_between_their_lines_only(self) -> None:
        all_cases = self.cases(lines())
        page = "before\n<!-- headline cases -->\nold\n<!-- /headline cases -->\nafter ü\n"
        new = headline.inserted(page, "P", all_cases)
        self.assertTrue(new.startswith("before\n<!-- headline cases -->\n| scene"))
        self.assertTrue(new.endswith("<!-- /headline cases -->\nafter ü\n"))
        self.assertEqual(headline.inserted(new, "P", all_cases), new)
        for wrong in ("nothing", page.replace("cases", "none"), page.replace("/headline", "headline"), page + page):
            with self.assertRaises(ResultError):
                headline.inserted(wrong, "P", all_cases)

    def test_other_results_are_refused(self) -> None:
        with self.assertRaisesRegex(ResultError, "not those of plan headline"):
            headline.strategies(self.cases(lines()[-2:]), headline.SHORT)

    def test_readme_and_guide_have_their_tables(self) -> None:
        root = Path(headline.__file__).resolve().parents[2]
        for page, names in (("README.md", ("short", "cases")), ("analysis/guides/results.md", ("whole", "cases"))):
            content = (root / page).read_text(encoding="utf-8")
            for name in names:
                self.assertEqual(content.count(f"<!-- headline {name} -->\n"), 1, page)
                self.assertEqual(content.count(f"<!-- /headline {name} -->\n"), 1, page)


if __name__ == "__main__":
    unittest.main()
