"""Claims: verdicts follow from results and from claims.json, and from nothing else."""

from __future__ import annotations

import copy
import json
import re
import unittest
from collections.abc import Callable
from pathlib import Path
from typing import Any, Optional

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic

from claims import claims
from figures import paper_figures
from results import load
import plan_cost
from report import report

Line = dict[str, Any]
Where = Callable[[Line], bool]

SIZES = {
    "tablecloth": (2000, 8000, 16000), "shirt": (32000, 163000, 326000), "dress": (65000, 290000, 580000),
    "reversing_spheres": (2000, 10000, 40000),
}  # fmt: skip
#: Strategy: family, builder, nanoseconds per polygon: update per frame, update per keyframe interval, query; motion;
#: events per 1000 polygons and interval, values per event (or per polygon and frame), looseness.
WORLD: dict[str, tuple[Any, ...]] = {
    "bottom_up": ("refit", (8, 16), 9.0, 0.0, 9.0, 1.0, 0, 11.0, 0.0),
    "bottom_up_period": ("period", (2, 1), 10.0, 0.0, 10.0, 1.0, 0, 12.0, 0.0),
    "rebuild": ("rebuild", (8, 16), 120.0, 0.0, 9.0, 1.0, 0, 12.0, 0.0),
    "kinetic_aabb": ("kinetic", (2, 1), 0.0, 0.5, 1.0, 0.0, 20, 2.5, 0.0),
    "kinetic_boxtree": ("kinetic", (2, 1), 0.0, 0.4, 20.0, 0.0, 6, 1.2, 3.0),
    "kinetic_separation_list": ("kinetic", (2, 1), 0.0, 1.0, 1.5, 0.0, 20, 2.5, 0.0),
}


def line(scene: str, size: int, l: int, strategy: str) -> Line:
    """A result of a world in which everything that the paper says of its experiments is true."""
    family, builder, each, interval, query, motion, events, values, loose = WORLD[strategy]
    result = synthetic.record(
        dict(id=strategy, title=strategy, family=family, builder=builder, query=1.0), scene, size + 400, "float", l, 3
    )
    ms = size * 1e-6
    result["key"] = f"{strategy} {scene} {size} {l}"
    result["verified"]["looseness"] = loose
    for sample in result["verified"]["over_time"]:
        sample["sah"] = 60.0 + (sample["t"] if loose else 0.0)
    phases = {"motion": motion * ms, "update": (each + interval / l) * ms, "traversal": query * ms,
              "triangle_tests": 0.0, "plan_changes": 0.0}  # fmt: skip
    result["times"]["repetitions"] = [dict(phases) for _ in range(3)]
    intervals = (result["scene"]["frames"] - 1) / l
    failed = events * size / 1000 * intervals
    result["counters"]["certificates_failed"] = failed
    result["counters"]["values_written"] = values * failed if events else values * size * result["scene"]["frames"]
    return result


def world() -> list[Line]:
    """Every scene, size, l and strategy."""
    return [
        line(scene, size, l, strategy)
        for scene, sizes in SIZES.items()
        for size in sizes
        for l in ((1,) if scene == "reversing_spheres" else (1, 10, 100))
        for strategy in WORLD
    ]


def of(strategy: str, scene: Optional[str] = None) -> Where:
    return lambda one: one["strategy"]["id"] == strategy and (scene is None or one["scene"]["name"].startswith(scene))


def times(where: Where, phase: str, factor: Callable[[Line], float]) -> Callable[[list[Line]], None]:
    """Multiplies a phase of the selected results."""

    def change(lines: list[Line]) -> None:
        for one in filter(where, lines):
            for repetition in one["times"]["repetitions"]:
                repetition[phase] *= factor(one)

    return change


def counts(where: Where, counter: str, factor: Callable[[Line], float]) -> Callable[[list[Line]], None]:
    def change(lines: list[Line]) -> None:
        for one in filter(where, lines):
            one["counters"][counter] *= factor(one)

    return change


def both(*changes: Callable[[list[Line]], None]) -> Callable[[list[Line]], None]:
    def change(lines: list[Line]) -> None:
        for one in changes:
            one(lines)

    return change


def l_of(one: Line) -> float:
    return float(one["scene"]["per_keyframe"])


#: For each claim, results that contradict it.
CONTRADICTIONS: dict[str, Callable[[list[Line]], None]] = {
    "E1": counts(of("kinetic_aabb", "tablecloth"), "values_written", lambda _: 1e4),
    "E2": counts(of("kinetic_boxtree", "tablecloth"), "certificates_failed", lambda _: 10),
    "E3": times(of("kinetic_aabb", "tablecloth"), "update", lambda _: 1e4),
    "E4": times(of("kinetic_boxtree", "tablecloth"), "traversal", lambda _: 1e-3),
    "E5": counts(of("kinetic_aabb", "shirt"), "certificates_failed", lambda one: one["scene"]["primitives"] / 1e4),
    "E6": times(of("kinetic_aabb", "reversing"), "update", lambda _: 1e3),
    "E7": counts(of("kinetic_aabb", "dress"), "values_written", lambda _: 3),
    "E8": times(of("kinetic_aabb", "dress"), "update", lambda _: 1e4),
    "E9": times(of("kinetic_aabb", "shirt"), "update", lambda one: l_of(one) ** 2),
    "E10": times(of("kinetic_aabb", "shirt"), "traversal", lambda _: 100),
    "E11": times(of("kinetic_separation_list", "dress"), "traversal", lambda _: 1e-3),
    "E12": times(of("kinetic_separation_list", "dress"), "traversal", l_of),
    "E13": times(of("kinetic_separation_list", "tablecloth"), "traversal", lambda _: 100),
    "E14": times(of("rebuild"), "update", lambda _: 0.01),
    "E15": both(times(of("bottom_up"), "update", lambda one: 1 / l_of(one)),
                times(of("bottom_up_period"), "update", lambda one: 1 / l_of(one))),
}  # fmt: skip


class ClaimsCase(shared.InFolder):
    def rows(self, lines: list[Line]) -> dict[str, claims.Row]:
        synthetic.write(self.folder, lines)
        return {row.id: row for row in claims.evaluate(load.load(self.folder), self.folder).rows}


class TestVerdicts(ClaimsCase):
    def test_all_hold_in_a_world_made_as_the_paper_has_it(self) -> None:
        found = {id: (row.verdict, row.why) for id, row in self.rows(world()).items() if id.startswith("E")}
        self.assertEqual(set(found), set(CONTRADICTIONS), "a new claim needs a line in CONTRADICTIONS: a change of results that contradicts it")
        for id, (verdict, why) in found.items():
            self.assertEqual(verdict, claims.HOLDS, f"{id}: {why}")

    def test_altered_results_flip_the_verdict_they_belong_to(self) -> None:
        for id, contradict in CONTRADICTIONS.items():
            with self.subTest(id):
                lines = world()
                contradict(lines)
                row = self.rows(lines)[id]
                self.assertEqual(row.verdict, claims.FAILS, row.why)
                self.assertIn("met nowhere", row.why)

    def test_a_boxtree_that_does_not_age_more_than_others_flips_the_claim(self) -> None:
        lines = world()
        for one in filter(of("kinetic_boxtree", "tablecloth"), lines):
            for sample in one["verified"]["over_time"]:
                sample["sah"] = 60.0 - sample["t"]
        row = self.rows(lines)["E4"]
        self.assertEqual(row.verdict, claims.FAILS, row.why)
        self.assertIn("Ageing", row.why)

    def test_against_one_baseline_only_is_a_condition(self) -> None:
        lines = world()
        times(of("bottom_up", "tablecloth"), "update", lambda _: 1e-3)(lines)
        times(of("bottom_up", "tablecloth"), "motion", lambda _: 1e-3)(lines)
        row = self.rows(lines)["E3"]
        self.assertEqual(row.verdict, claims.CONDITION, row.why)
        self.assertIn("against the 2006-style refit met everywhere", row.condition)
        self.assertNotIn("against the best refit", row.condition)
        self.assertNotEqual(row.ours["best:2006"], row.ours["best:best"])

    def test_the_condition_says_from_which_l_on(self) -> None:
        lines = world()
        times(lambda one: of("kinetic_aabb", "tablecloth")(one) and l_of(one) == 1, "update", lambda _: 1e4)(lines)
        row = self.rows(lines)["E3"]
        self.assertEqual(row.verdict, claims.CONDITION, row.why)
        self.assertIn("2006 against 2006 met from l = 10 on", row.condition)

    def with_another_tablecloth(self, change: Callable[[list[Line]], None] = lambda _: None) -> claims.Row:
        """E1 with a tablecloth from a file in addition to ours, on l = 1 and 10 only; `change` is done to that one's results."""
        lines = world()
        others = [copy.deepcopy(one) for one in lines if one["scene"]["name"].startswith("tablecloth-16") and l_of(one) < 100]
        for one in others:
            one["scene"].update(name="blender/tablecloth-16k", hash="b1e4de4", origin="files")
            one["key"] += " blender"
        change(others)
        return self.rows(lines + others)["E1"]

    def test_scenes_made_elsewhere_have_their_own_verdict(self) -> None:
        row = self.with_another_tablecloth()
        told = [(one.scenes, one.l, one.verdict) for one in row.apart]
        self.assertEqual(
            told, [(["tablecloth"], [1, 10], claims.HOLDS), (["blender/tablecloth-16k"], [1, 10], claims.HOLDS)]
        )
        self.assertEqual(row.differ, "")

    def test_where_scenes_differ_their_counts_are_told(self) -> None:
        row = self.with_another_tablecloth(counts(of("kinetic_aabb"), "values_written", lambda _: 1e4))
        self.assertEqual([one.verdict for one in row.apart], [claims.HOLDS, claims.FAILS])
        self.assertIn("blender/tablecloth-16k", row.differ)
        self.assertIn("at l = 10", row.differ)
        self.assertNotIn("l = 100", row.differ)

    def test_thresholds_are_those_of_the_data_file(self) -> None:
        synthetic.write(self.folder, world())
        said = claims.read_claims()
        for claim in said["claims"]:
            if claim["id"] == "E3":
                claim["checks"][0]["bound"] = 1e9
        file = self.folder / "other.json"
        file.write_text(json.dumps(said), encoding="utf-8")
        rows = {row.id: row for row in claims.evaluate(load.load(self.folder), self.folder, file).rows}
        self.assertEqual(rows["E3"].verdict, claims.FAILS)
        self.assertEqual(rows["E8"].verdict, claims.HOLDS)

    def test_the_best_refit_is_one_run_for_all_quantities(self) -> None:
        def with_lazy(query: float) -> list[Line]:
            """Adds a refit without updates whose query takes so many times as long as that of the other."""
            lines = world()
            for one in [copy.deepcopy(one) for one in filter(of("bottom_up"), lines)]:
                one["strategy"].update(id="hybrid", title="hybrid")
                for repetition in one["times"]["repetitions"]:
                    repetition.update(update=1e-12, motion=0.0, traversal=query * sum(repetition[name] for name in load.PHASES))
                lines.append(one)
            return lines

        self.assertEqual(self.rows(with_lazy(1.1))["E3"].verdict, claims.HOLDS, "it wins updates, but no clip")
        row = self.rows(with_lazy(0.01))["E3"]
        self.assertEqual(row.verdict, claims.CONDITION, "it wins the clip: its update is the other side")
        self.assertNotIn("against the best refit", row.condition)

    def test_commits_are_not_compared_with_one_another(self) -> None:
        lines = world()
        for one in lines:
            if l_of(one) == 10:
                one["commit"] = "fedcba9876543210"
        rows = self.rows(lines)
        self.assertEqual(rows["E3"].verdict, claims.HOLDS, "within each table all are of one commit")
        self.assertEqual(rows["E15"].verdict, claims.OPEN, "ten times an l is in another table, of another commit")

    def test_another_scalar_is_no_result(self) -> None:
        lines = world()
        for one in lines:
            one["scene"]["scalar"] = "double"
        self.assertEqual({row.verdict for row in self.rows(lines).values()}, {claims.OPEN})

    def test_disagreeing_repetitions_are_told(self) -> None:
        lines = world()
        for one in filter(of("kinetic_aabb", "tablecloth"), lines):
            one["times"]["repetitions"][0]["update"] *= 1e4
        row = self.rows(lines)["E3"]
        self.assertEqual(row.verdict, claims.HOLDS)
        self.assertIn("repetitions disagree", row.why)


class TestMissing(ClaimsCase):
    def open(self, lines: list[Line], ids: set[str], words: str) -> None:
        rows = self.rows(lines)
        found = {id for id, row in rows.items() if id.startswith("E") and row.verdict == claims.OPEN}
        self.assertEqual(found, ids, "a new claim that needs what this test leaves out belongs among the ids of this test")
        for id in ids:
            self.assertIn(words, " ".join(rows[id].missing), id)
            self.assertIn("Missing: ", rows[id].why)

    def test_nothing_of_the_paper_leaves_everything_open(self) -> None:
        lines = [synthetic.record(synthetic.CONTESTANTS[0], "elsewhere", 2000, "float", 10)]
        rows = self.rows(lines)
        self.assertEqual({row.verdict for row in rows.values()}, {claims.OPEN})
        for row in rows.values():
            self.assertTrue(row.missing, row.id)

    def test_a_scene(self) -> None:
        lines = [one for one in world() if not one["scene"]["name"].startswith("dress")]
        self.open(lines, {"E5", "E7", "E8", "E11", "E12", "E14"}, "results of the scene dress")

    def test_a_strategy(self) -> None:
        lines = [one for one in world() if not of("kinetic_separation_list")(one)]
        self.open(lines, {"E11", "E12", "E13"}, "kinetic_separation_list")

    def test_a_refused_strategy(self) -> None:
        lines = world()
        for one in filter(of("kinetic_separation_list"), lines):
            synthetic.refused(one, "", "frame 1: a pair is missing")
        self.open(lines, {"E11", "E12", "E13"}, "kinetic_separation_list")

    def test_a_baseline(self) -> None:
        lines = [one for one in world() if not of("bottom_up_period")(one)]
        self.open(lines, {f"E{n}" for n in (1, 3, 4, 6, 8, 10, 11, 13, 14, 15)}, "bottom_up_period")

    def test_sizes(self) -> None:
        lines = [one for one in world() if one["scene"]["primitives"] < 500000]
        self.open(lines, {"E5", "E7", "E8", "E11", "E14"}, "")
        self.assertIn("dress of 65k to 580k polygons (measured: 65k and 290k)", self.rows(lines)["E8"].missing)

    def test_frames_per_keyframe(self) -> None:
        lines = [one for one in world() if l_of(one) < 100]
        self.open(lines, {f"E{n}" for n in (3, 8, 9, 10, 11, 12, 13)}, "or more (measured: ")

    def test_clips_cut_at_different_places_are_not_compared(self) -> None:
        lines = world()
        for one in lines:
            if l_of(one) == 10:
                one["scene"]["frames"] = 150
        self.assertIn("of one clip", " ".join(self.rows(lines)["E15"].missing))

    def test_what_was_measured_so_far_is_told(self) -> None:
        lines = [one for one in world() if l_of(one) < 100]
        self.assertIn("Measured so far: Update time, bottom-up over kinetic AABB tree", self.rows(lines)["E3"].why)


class TestTheory(ClaimsCase):
    def theory(self, verdict: str) -> None:
        claim = {"id": "T7", "claim": "constant", "citation": "s.5", "bound": "0", "measured": "0 of 30", "verdict": verdict,
                 "condition": "if so", "why": "Counted.", "criteria": []}  # fmt: skip
        text = json.dumps({"schema": claims.THEORY_SCHEMA, "claims": [claim]})
        (self.folder / "theory.json").write_text(text, encoding="utf-8")

    def test_is_as_theory_json_judges(self) -> None:
        for verdict in (claims.HOLDS, claims.FAILS):
            self.theory(verdict)
            rows = self.rows(world())
            self.assertEqual((rows["T7"].verdict, rows["T7"].why), (verdict, "Counted."))
            self.assertEqual(rows["T8"].verdict, claims.OPEN)

    def test_another_schema_is_refused(self) -> None:
        (self.folder / "theory.json").write_text('{"schema": "other"}', encoding="utf-8")
        self.assertRaises(claims.ClaimError, self.rows, world())


class TestFiles(ClaimsCase):
    def test_every_point_names_records_of_the_results(self) -> None:
        lines = world()
        synthetic.write(self.folder, lines)
        self.assertEqual(claims.main([str(self.folder)]), 0)
        written = json.loads((self.folder / "claims.json").read_text(encoding="utf-8"))
        keys = {one["key"] for one in lines}
        for claim in written["claims"]:
            for check in claim["checks"]:
                for point in check["points"]:
                    self.assertTrue(point["keys"] and set(point["keys"]) <= keys)

    def test_claims_that_make_no_sense_are_one_sentence(self) -> None:
        synthetic.write(self.folder, world())
        said = claims.read_claims()
        said["claims"][0]["checks"][0]["measure"] = "magic"
        file = self.folder / "other.json"
        file.write_text(json.dumps(said), encoding="utf-8")
        self.assertEqual(claims.main([str(self.folder), "--claims", str(file)]), 2)

    def test_every_panel_of_a_claim_exists(self) -> None:
        panels = {f"{figure.number}-{panel.place}" for figure in paper_figures.FIGURES for panel in figure.panels}
        for claim in claims.read_claims()["claims"]:
            self.assertLessEqual(set(claim["figures"]), panels, claim["id"])


class TestPage(ClaimsCase):
    def page(self, lines: list[Line]) -> str:
        synthetic.write(self.folder, lines)
        self.assertEqual(report.main([str(self.folder), "--figures", "paper"]), 0)
        return (self.folder / "report.html").read_text(encoding="utf-8")

    def test_shows_verdicts_and_every_link_leads_somewhere(self) -> None:
        few = ("bottom_up", "bottom_up_period", "kinetic_aabb", "kinetic_boxtree")
        lines = [one for one in world() if l_of(one) < 100 and one["strategy"]["id"] in few]
        lines = [one for one in lines if not one["scene"]["name"].startswith("dress")]
        for one in filter(of("kinetic_aabb"), lines):
            one["scene"]["origin"] = "files" if one["scene"]["name"].startswith("shirt") else "built_in"
        page = self.page(lines)
        ids = set(re.findall(r'id="([^"]+)"', page))
        self.assertLessEqual(set(re.findall(r'href="#([^"]+)"', page)), ids)
        self.assertIn('<span class="source">here</span>', page)
        self.assertIn('<span class="source">reference run</span>', page, "what these results do not decide")
        self.assertIn('<span class="verdict holds">', page)
        own = page[page.index('id="scene-2"') : page.index('id="scene-3"')]
        self.assertIn("your own files", own, "the shirt is from files here")
        self.assertEqual(page.count('<span class="tag">your own files'), 1)
        for number in ("18", "19", "21", "22"):
            self.assertTrue((self.folder / "figures" / f"paper-{number}.png").exists())
            self.assertTrue((self.folder / "figures" / f"paper-{number}.pdf").exists())

    def test_panels_without_data_say_why(self) -> None:
        page = self.page([one for one in world() if one["scene"]["name"].startswith("tablecloth") and l_of(one) == 10])
        self.assertIn("Not drawn, left, middle and right: there are no timed results of the scene shirt", page)
        self.assertFalse((self.folder / "figures" / "paper-21.png").exists())


class TestPlan(unittest.TestCase):
    def test_no_piece_of_the_paper_is_estimated_too_long(self) -> None:
        file = Path(claims.FILE).parents[1] / "experiments" / "plans" / "paper.json"
        found = plan_cost.pieces(json.loads(file.read_text(encoding="utf-8")))
        self.assertGreater(len(found), 5)
        for name, minutes in found.items():
            self.assertTrue(0 < minutes <= plan_cost.LONGEST, f"{name}: {minutes:.0f} minutes")


if __name__ == "__main__":
    unittest.main()
