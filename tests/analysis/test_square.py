"""The square: each corner of a claim is judged by its own runs, and what was not measured is said."""

from __future__ import annotations

import copy
import json
import re
import unittest
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, Callable

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic
from test_claims import Line, Where, both, l_of, line, of, times

from claims import claim_pictures, claim_words, claims
from results import load
import plan_cost
from report import report

STRUCTURES = ("kinetic_aabb", "kinetic_boxtree", "kinetic_separation_list")
QUARTERS = ("2006:2006", "best:2006", "best:best", "any:2006", "any:best")


def named(strategy: str, queue: str = "") -> Where:
    """The runs of a strategy, of one queue if it is named."""
    return lambda one: one["strategy"]["id"] == strategy and (not queue or one["strategy"]["params"].get("queue") == queue)


def copied(lines: list[Line], strategy: str, identity: str, **strategy_fields: Any) -> list[Line]:
    """The runs of a strategy as those of another one, or of another configuration."""
    made = [copy.deepcopy(one) for one in filter(of(strategy), lines)]
    for one in made:
        one["strategy"].update(id=identity, **strategy_fields)
        one["key"] += f" {identity} {strategy_fields}"
    return made


def world(scene: str, sizes: tuple[int, ...], depths: tuple[int, ...] = (1, 10, 100)) -> list[Line]:
    """One scene as the paper has it, with everything that the corners ask for."""
    strategies = ("bottom_up", "bottom_up_period", "rebuild", *STRUCTURES)
    lines = [line(scene, size, l, strategy) for size in sizes for l in depths for strategy in strategies]
    for one in lines:
        if one["strategy"]["id"] in STRUCTURES:
            one["strategy"]["params"] = {"queue": "segment_heap"}
    for structure in STRUCTURES:
        lines += copied(lines[: len(sizes) * len(depths) * len(strategies)], structure, structure, params={"queue": "avl"})
    lines += copied([one for one in lines if not named("kinetic_aabb", "avl")(one)], "kinetic_aabb", "kinetic_envelope", params={})
    old_tree = {"method": "median", "width": 2, "leaf_size": 1}
    return lines + copied(lines, "rebuild", "rebuild", params={"method": "median"}, builder=old_tree)


def tablecloth() -> list[Line]:
    return world("tablecloth", (2000, 16000))


class Case(shared.InFolder):
    def row(self, id: str, lines: list[Line], *changes: Callable[[list[Line]], None]) -> claims.Row:
        for change in changes:
            change(lines)
        synthetic.write(self.folder, lines)
        found = claims.evaluate(load.load(self.folder), self.folder)
        return next(row for row in found.rows if row.id == id)

    def corners(self, row: claims.Row) -> dict[str, str]:
        return {one.id: one.verdict for one in row.corners}


SLOW = lambda _: 1e4  # noqa: E731
PAPERS = [times(named("kinetic_aabb", queue), "update", SLOW) for queue in ("avl", "segment_heap")]
REALISERS = times(named("kinetic_envelope"), "update", SLOW)
BOXES = times(named("kinetic_boxtree"), "update", SLOW)
BEST_REFIT = both(times(named("bottom_up"), "update", lambda _: 1e-5), times(named("bottom_up"), "motion", lambda _: 1e-5))


class TestCorners(Case):
    def test_all_five_hold_in_a_world_as_the_paper_has_it(self) -> None:
        row = self.row("E3", tablecloth())
        self.assertEqual(self.corners(row), dict.fromkeys(QUARTERS, claims.HOLDS))
        self.assertEqual((row.verdict, row.unmeasured), (claims.HOLDS, []))

    def test_each_flips_by_its_own_runs(self) -> None:
        for name, changes, refuted in (
            ("the queue of 2006", [PAPERS[0]], {"2006:2006"}),
            ("the paper's structure", PAPERS, {"2006:2006", "best:2006", "best:best"}),
            ("the best queue only", [PAPERS[1]], set()),  # the other one is the best then
            ("all kinetic trees", [*PAPERS, REALISERS, BOXES], set(QUARTERS)),
            ("the best refit", [BEST_REFIT], {"best:best", "any:best"}),
        ):
            with self.subTest(name):
                row = self.row("E3", tablecloth(), *changes)
                failed = {corner for corner, verdict in self.corners(row).items() if verdict == claims.FAILS}
                self.assertEqual(failed, refuted)
                self.assertEqual(row.verdict == claims.HOLDS, not refuted)
                self.assertEqual(row.verdict == claims.FAILS, refuted == set(QUARTERS))

    def test_the_verdict_names_the_corner_and_the_l(self) -> None:
        slow_first = times(lambda one: named("kinetic_aabb", "avl")(one) and l_of(one) < 100, "update", SLOW)
        row = self.row("E3", tablecloth(), slow_first, BEST_REFIT)
        self.assertEqual(row.verdict, claims.CONDITION)
        self.assertIn("2006 against 2006 met from l = 100 on", row.condition)
        self.assertIn("2006 against 2006 met from l = 100 on", row.brief)
        self.assertNotIn("against the best refit met", row.condition)

    def test_the_fastest_configuration_is_the_best(self) -> None:
        row = self.row("E3", tablecloth(), PAPERS[1])
        self.assertEqual(row.as_in_2006, ["the paper's structure at its best"])
        self.assertEqual(self.row("E3", tablecloth(), PAPERS[0]).as_in_2006, [])

    def test_the_separation_list_is_no_kinetic_tree(self) -> None:
        row = self.row("E3", tablecloth(), *PAPERS, REALISERS, BOXES, times(named("kinetic_separation_list"), "update", lambda _: 1e-3))
        self.assertEqual(row.verdict, claims.FAILS)

    def test_any_kinetic_structure_counts_in_totals(self) -> None:
        lists = times(named("kinetic_separation_list"), "traversal", SLOW)
        row = self.row("E13", tablecloth(), lists)
        found = self.corners(row)
        self.assertEqual([found[one] for one in QUARTERS], [claims.FAILS] * 3 + [claims.HOLDS] * 2)
        self.assertEqual(row.verdict, claims.CONDITION)


class TestMissingCorners(Case):
    def test_without_other_kinetic_trees_the_corner_is_said_to_be_missing(self) -> None:
        row = self.row("E3", [one for one in tablecloth() if not named("kinetic_envelope")(one)])
        self.assertEqual(row.verdict, claims.HOLDS)
        self.assertEqual(self.corners(row)["any:best"], claim_words.NOT_MEASURED)
        self.assertEqual(row.unmeasured, ["the best kinetic tree of any kind"])

    def test_a_corner_that_reaches_less_far_says_so(self) -> None:
        row = self.row("E3", [one for one in tablecloth() if not (named("kinetic_envelope")(one) and l_of(one) == 100)])
        self.assertEqual(row.unmeasured, ["the best kinetic tree of any kind (tablecloth at l = 30 or more (measured: 1 and 10))"])

    def test_without_the_structure_of_2006_nothing_is_decided(self) -> None:
        row = self.row("E3", [one for one in tablecloth() if not named("kinetic_aabb", "avl")(one)])
        self.assertEqual(row.verdict, claims.OPEN)
        self.assertIn("kinetic_aabb (width 2, leaf size 1, queue avl)", " ".join(row.missing))

    def test_an_l_is_compared_with_the_same_contestant_at_another(self) -> None:
        lines = [one for one in world("shirt", (32000,)) + tablecloth() if not (named("kinetic_envelope")(one) and l_of(one) > 10)]
        for one in filter(named("kinetic_envelope"), lines):
            times(lambda _: True, "update", lambda _: 1e-3)([one])
        points = [p for looked in self.row("E15", lines).looked for p in looked.points if p.corner == "any"]
        self.assertTrue(points)
        for point in points:
            self.assertAlmostEqual(point.value.middle, 1.0)
            self.assertEqual(point.l, 10)


class TestRebuilds(Case):
    def row_of(self, *changes: Callable[[list[Line]], None]) -> claims.Row:
        lines = tablecloth() + world("shirt", (32000, 326000), (10,)) + world("dress", (65000, 580000), (10,))
        lines += world("reversing_spheres", (2000, 40000), (1,))
        return self.row("E14", lines, *changes)

    def test_the_best_rebuild_counts(self) -> None:
        self.assertEqual(self.row_of().verdict, claims.HOLDS)

        def faster(lines: list[Line]) -> None:
            made = copied(lines, "rebuild", "rebuild", params={"method": "morton"}, builder={"method": "median", "width": 8, "leaf_size": 16})
            times(lambda _: True, "update", lambda _: 0.01)(made)
            lines += made

        row = self.row_of(faster)
        self.assertEqual(row.verdict, claims.CONDITION, row.why)
        self.assertIn("a rebuild of the 2006-style tree against the 2006-style refit met everywhere", row.condition)
        self.assertNotIn("the best rebuild against", row.condition)


class TestClips(Case):
    def test_a_rebuild_that_is_not_paid_per_frame_flips_the_claim(self) -> None:
        lines = tablecloth() + world("shirt", (32000,))
        self.assertEqual(self.row("E15", copy.deepcopy(lines)).verdict, claims.HOLDS)
        row = self.row("E15", copy.deepcopy(lines), times(named("rebuild"), "update", lambda one: 1 / l_of(one)))
        self.assertEqual(row.verdict, claims.FAILS)
        without = self.row("E15", [one for one in lines if not named("rebuild")(one)])
        self.assertEqual((without.verdict, without.unmeasured), (claims.HOLDS, ["the best rebuild"]))


class TestPlans(unittest.TestCase):
    def plan(self, name: str) -> dict[str, Any]:
        file = Path(claims.FILE).parents[1] / "experiments" / "plans" / name
        return json.loads(file.read_text(encoding="utf-8"))

    def test_have_the_contestants_of_2006(self) -> None:
        wanted = [corner["denominator"] for square in claims.read_claims()["squares"].values() for corner in square
                  if "params" in corner.get("denominator", {})]  # fmt: skip
        self.assertEqual({term["strategy"] for term in wanted}, set(STRUCTURES))
        for name, studies in (("default.json", 1), ("full.json", 2), ("paper.json", 9)):
            for term in wanted:
                with self.subTest(name, term=term):
                    listed = [
                        study for study in self.plan(name)["studies"]
                        for one in study.get("strategies", [])
                        if isinstance(one, dict) and one["id"] == term["strategy"]
                        and one.get("params", {}).get("queue") == "avl"
                        and all(term["params"].get(key, value) == value for key, value in one["params"].items())
                    ]  # fmt: skip
                    self.assertGreaterEqual(len(listed), studies)

    def test_the_default_study_stays_short(self) -> None:
        self.assertLess(sum(plan_cost.pieces(self.plan("default.json")).values()), 4)


class Articles(HTMLParser):
    """The visible part of each claim (its summary), and the part that folds out."""

    def __init__(self) -> None:
        super().__init__()
        self.found: dict[str, dict[str, list[str]]] = {}
        self.id = ""
        self.depth = 0  #: of details within the claim's own
        self.in_sight = False

    def handle_starttag(self, tag: str, attributes: list[tuple[str, Any]]) -> None:
        said = dict(attributes)
        if tag == "details" and said.get("class") == "claim":
            self.id, self.depth = said["id"], 0
            self.found[self.id] = {"shown": [], "folded": [], "pictures": [], "open": ["open"] if "open" in said else []}
            return
        if not self.id:
            return
        if tag == "details":
            self.depth += 1
        if tag == "summary":
            self.in_sight = self.depth == 0
        if tag == "svg":
            self.found[self.id]["pictures"].append(f"{said.get('role')}: {said.get('aria-label')}")
        self.found[self.id]["shown" if self.in_sight else "folded"].append(f"<{tag}>")

    def handle_endtag(self, tag: str) -> None:
        if tag == "summary":
            self.in_sight = False
        if tag == "details" and self.id:
            self.depth -= 1
            if self.depth < 0:
                self.id = ""

    def handle_data(self, data: str) -> None:
        if self.id and data.strip():
            self.found[self.id]["shown" if self.in_sight else "folded"].append(data.strip())


class TestPage(Case):
    def articles(self, lines: list[Line]) -> dict[str, dict[str, list[str]]]:
        synthetic.write(self.folder, lines)
        self.assertEqual(report.main([str(self.folder), "--figures", "none"]), 0)
        page = (self.folder / "report.html").read_text(encoding="utf-8")
        parser = Articles()
        parser.feed(page)
        return parser.found

    def test_a_claim_is_a_line_with_a_picture_that_folds_out(self) -> None:
        lines = tablecloth()
        PAPERS[0](lines)
        found = self.articles(lines)
        e3 = found["claim-E3"]
        shown, folded = " ".join(e3["shown"]), " ".join(e3["folded"])
        self.assertIn(claims.CONDITION, shown)
        self.assertIn("here", e3["shown"], "whose verdict it is")
        self.assertEqual(e3["open"], [])
        self.assertIn("the best kinetic tree of any kind", folded)
        self.assertEqual(len(e3["pictures"]), 1)
        label = e3["pictures"][0]
        self.assertTrue(label.startswith("img: Logarithmic axis. Claimed at least 5"))
        self.assertIn("2006 vs 2006: 0.0020 to 0.22, met nowhere", label)
        for short in ("its best vs 2006", "its best vs best refit", "any kinetic vs 2006", "any kinetic vs best refit"):
            self.assertRegex(label, rf"{short}: [^;]*met everywhere")

    def test_a_corner_that_was_not_measured_is_said_in_line_and_picture(self) -> None:
        found = self.articles([one for one in tablecloth() if not named("kinetic_envelope")(one)])["claim-E3"]
        self.assertIn("Not measured here: the best kinetic tree of any kind.", " ".join(found["folded"]))
        self.assertIn("any kinetic vs 2006: not measured here", found["pictures"][0])
        self.assertEqual(sum(one == "not measured here" for one in found["folded"]), 4, "in two rows of the picture and of the list")

    def test_why_is_two_sentences(self) -> None:
        synthetic.write(self.folder, tablecloth())
        for row in claims.evaluate(load.load(self.folder), self.folder).rows:
            self.assertTrue(row.brief, row.id)
            self.assertLessEqual(len(re.findall(r"\.(?:\s|$)", row.brief)), 2, row.brief)

    def test_claims_without_a_number_have_no_picture(self) -> None:
        counted = {"what": "changes of a clip, tablecloth, 512 polygons", "bound": 10.0, "measured": 4.0, "met": True,
                   "relation": "<=", "role": "always", "tolerance": 0.0}  # fmt: skip
        picture = claim_pictures.of_theory([counted, {**counted, "what": "changes of a clip, dress, 800 polygons", "measured": 20.0, "met": False}])
        self.assertIn('aria-label="Measured over bound, logarithmic axis. Claimed ≤ the bound. changes of a clip: 0.40 to 2.00, met at 1 of 2."', picture)
        self.assertEqual(claim_pictures.of_theory([{**counted, "relation": "==", "bound": 0.0, "measured": 0.0}]), "")
        self.assertEqual(claim_pictures.of_theory([]), "")

    def test_colours_are_the_page_s_own(self) -> None:
        picture = claim_pictures.of_theory([{"what": "x", "bound": 1.0, "measured": 2.0, "met": False, "relation": "<=", "tolerance": 0.0}])
        self.assertNotRegex(picture, r"#[0-9a-fA-F]{3}|fill=|stroke=")
        style = (Path(report.TEMPLATES) / "style.css").read_text(encoding="utf-8")
        light, dark = (set(re.findall(r"--[a-z-]+(?=:)", part)) for part in style.split("prefers-color-scheme: dark", 1))
        self.assertEqual(light, dark, "every colour has one for dark pages")


class TestPictures(unittest.TestCase):
    def test_values_lie_where_their_logarithm_says(self) -> None:
        axis = claim_pictures.Axis([0.1, 10.0], False)
        self.assertAlmostEqual(axis.at(1.0), (axis.at(0.1) + axis.at(10.0)) / 2)
        self.assertLess(axis.at(0.1), axis.at(0.2))
        self.assertEqual(axis.ticks, [0.1, 1, 10])

    def test_ticks_are_few_and_round(self) -> None:
        for low, high in ((0.88, 1.3), (0.0004, 70), (1, 2), (6, 1500), (0.9, 1.01), (1e-9, 1e9)):
            found = claim_pictures.ticks(low, high)
            self.assertTrue(1 <= len(found) <= 6, (low, high, found))
            self.assertTrue(all(low <= one <= high for one in found))

    def test_the_zone_is_where_a_check_is_met(self) -> None:
        for relation, bound, room, zone in ((">=", 5, 0.2, (4, float("inf"))), ("<=", 2, 0.5, (0, 3)), ("within a factor of", 2, 0, (0.5, 2))):
            self.assertEqual(claim_pictures.Block("", relation, bound, room, "").zone(), zone)


if __name__ == "__main__":
    unittest.main()
