"""The answers of the report in full: whose verdict a claim has, what the sentences say, and where the bars of the chart are."""

from __future__ import annotations

import json
import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
import synthetic
from synthetic import line
from test_advice import other

from advice import advice, cells_file, kept_costs, summary
from claims import claims
from figures import time_error, time_error_file, time_error_panels
from results.load import Study, load


def row(id: str, verdict: str) -> claims.Row:
    return claims.Row(id, f"Claim {id}", "", "", {"": "1"}, verdict, "", "", brief=f"{id} here.")


class TestPaper(unittest.TestCase):
    def setUp(self) -> None:
        temporary = tempfile.TemporaryDirectory(prefix="kbvh-analysis-")
        self.addCleanup(temporary.cleanup)
        self.reference, self.folder = Path(temporary.name) / "reference", Path(temporary.name) / "results"
        for folder in (self.reference, self.folder):
            folder.mkdir()
        known = {"E1": claims.HOLDS, "E2": claims.FAILS, "E3": claims.CONDITION, "E4": claims.OPEN}
        corners = [{"id": "a:b", "name": "a against b"}]
        self.write([{"id": id, "verdict": verdict, "brief": f"{id} there.", "corners": corners, "ours": {"a:b": "2 to 3, 4 (with motion)"}}
                    for id, verdict in known.items()])  # fmt: skip
        first = {"machine": {"cpu": "Some CPU"}, "when": "2026-01-02T03:04:05Z", "commit": "0123456789"}
        (self.reference / "results.jsonl").write_text(json.dumps(first) + "\n")

    def write(self, rows: list[dict[str, Any]]) -> None:
        (self.reference / "claims.json").write_text(json.dumps({"schema": "kbvh-claims-1", "claims": rows}))

    def paper(self, *rows: claims.Row, folder: str = "folder") -> summary.Paper:
        return summary.paper(claims.Claims(list(rows), []), getattr(self, folder), self.reference)

    def test_this_study_decides_where_it_can_and_else_the_reference_run(self) -> None:
        found = self.paper(row("E1", claims.OPEN), row("E2", claims.HOLDS), row("E3", claims.OPEN), row("E4", claims.OPEN))
        self.assertEqual([(one.verdict, one.source) for one in found.verdicts],
                         [(claims.HOLDS, summary.BY_REFERENCE), (claims.HOLDS, summary.HERE),
                          (claims.CONDITION, summary.BY_REFERENCE), (claims.OPEN, "")])  # fmt: skip
        self.assertEqual([one.brief for one in found.verdicts[:2]], ["E1 there.", "E2 here."])
        self.assertEqual([one.row.id for one in found.verdicts if one.differs], ["E2"])
        self.assertEqual(found.tally, [(claims.HOLDS, 1, 1), (claims.CONDITION, 0, 1), (claims.FAILS, 0, 0), (claims.OPEN, 1, 0)])
        says = " ".join(summary.parts_on_the_paper(found))
        for words in ("Of its 4 claims 2 hold, 1 hold with a condition, 0 do not hold and 1 are open", "1 decided by this study and 2 by the "
                      "reference run that comes with the project (Some CPU, 2026-01-02, commit 01234567)", "judges E2 otherwise",
                      "The claim “Claim E3” (E3) holds with a condition, by the reference run."):  # fmt: skip
            self.assertIn(words, says)

    def test_claims_stand_in_the_order_of_their_numbers(self) -> None:
        ids = ["T2", "T10", "T1", "C1", "E10", "E3", "E1", "X1", ""]
        verdicts = (claims.FAILS, claims.HOLDS, claims.CONDITION)
        found = self.paper(*(row(id, verdicts[i % 3]) for i, id in enumerate(ids)))
        self.assertEqual([one.row.id for one in found.verdicts], ["E1", "E3", "E10", "T1", "T2", "T10", "C1", "", "X1"])

    def test_the_main_claim_is_answered_before_its_verdict(self) -> None:
        known = {"2006:2006": ("0.037 to 3.35, 1 (with motion)", "met nowhere"), "best:2006": ("1.04 to 40.1", "met from l = 3 on"),
                 "best:best": ("0.0081 to 0.66", "met at 2 of 3 points (cloth 2k, l = 1; …)")}  # fmt: skip
        corners = [{"id": id, "name": id, "rule": rule} for id, (_, rule) in known.items()]
        self.write([{"id": "E3", "verdict": claims.CONDITION, "brief": "", "corners": corners, "ours": {id: span for id, (span, _) in known.items()}}])
        self.assertEqual(
            summary.parts_on_the_paper(self.paper(row("E3", claims.OPEN)))[0],
            "Is updating a kinetic AABB tree faster than a bottom-up refit? Against a refit as in 2006: yes if tuned here (1.04 to 40.1 times as fast), "
            "not always if built as in 2006 (0.037 to 3.35 times as fast). Against today's best refit: no (0.0081 to 0.66 times as fast). The claim “Claim E3” (E3) "
            "holds with a condition, by the reference run. Where its factor is met: tuned here against the refit of 2006, from 3 frames a keyframe on; built as in "
            "2006 against the refit of 2006, nowhere; tuned here against today's best refit, at 2 of 3 points.",
        )

    def test_other_kinetic_trees_are_named_where_they_beat_the_best_refit(self) -> None:
        for span, rule, says in (
            ("0.026 to 3.61, 0.081 to 9.78 (with motion)", "met nowhere without motion evaluation, met from l = 100 on with motion evaluation",
             "if the time counts that it takes to evaluate positions: not always (0.081 to 9.78 times as fast; the claimed factor is met from 100 frames a keyframe on)."),
            ("0.5 to 0.6, 1.5 to 1\u202f234 (with motion)", "met nowhere", "if the time counts that it takes to evaluate positions: yes (1.5 to 1\u202f234 times as fast)."),
            ("0.5 to 0.6, 0.7 to 0.9 (with motion)", "met nowhere", ""),
        ):  # fmt: skip
            corners = [{"id": "best:best", "name": "x", "rule": ""}, {"id": "any:best", "name": "y", "rule": rule}]
            self.write([{"id": "E3", "verdict": claims.CONDITION, "brief": "", "corners": corners, "ours": {"best:best": "0.1 to 0.2", "any:best": span}}])
            main = summary.parts_on_the_paper(self.paper(row("E3", claims.OPEN)))[0]
            if says:
                self.assertIn(says, main)
            else:
                self.assertNotIn("Kinetic trees of other kinds", main)

    def test_the_reference_run_does_not_stand_in_for_itself(self) -> None:
        found = self.paper(row("E1", claims.OPEN), folder="reference")
        self.assertEqual([(one.verdict, one.source) for one in found.verdicts], [(claims.OPEN, "")])
        self.assertEqual(found.reference, "")

    def test_without_a_reference_run_only_this_study_speaks(self) -> None:
        (self.reference / "claims.json").unlink()
        self.assertIn("decide none", " ".join(summary.parts_on_the_paper(self.paper(row("E1", claims.OPEN)))))
        says = " ".join(summary.parts_on_the_paper(self.paper(row("E1", claims.HOLDS))))
        self.assertIn("1 decided by this study.", says)
        self.assertNotIn("reference", says)

    def test_the_reference_run_that_comes_with_the_project_decides_all(self) -> None:
        every = [row(one["id"], claims.OPEN) for one in json.loads((summary.REFERENCE / "claims.json").read_text())["claims"]]
        found = summary.paper(claims.Claims(every, []), self.folder)
        self.assertEqual({one.source for one in found.verdicts}, {summary.BY_REFERENCE})


class TestSentences(unittest.TestCase):
    def study(self, lines: list[dict[str, Any]]) -> Study:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            return load(synthetic.write(Path(name), lines))

    def said(self, lines: list[dict[str, Any]]) -> dict[str, str]:
        study = self.study(lines)
        known = summary.Paper([], "")
        found = summary.sentences(study, advice.situations(advice.cells(study)), time_error_panels.shown(time_error.places(study)), known)
        return {one.subject: one.says for one in found}

    def test_what_to_take_follows_the_rule(self) -> None:
        said = self.said([line("refit", 2.0), other("join", 1.0, foresight="next_keyframe")])
        self.assertEqual(
            "With 10 frames a keyframe and more, take refit where nothing is known: the best refit in the only scene, at 2.00 ms a frame (4k triangles); "
            "join if the next keyframe is known: 2.00 times as fast as the refit (in 1 scene), at 1.00 ms a frame (4k triangles) (surely faster: not beyond doubt, in the only scene there is no interval).",
            said["What to take"].split(" This study")[0],
        )
        self.assertIn("This study has at most 4k triangles, both bodies together.", said["What to take"])
        self.assertIn("Pairs within a body (self-collision) and rays were not asked for", said["Self-collision, rays"])
        self.assertIn("answers wrongly", said["Time against error"])

    def test_the_answer_of_each_subject_comes_first(self) -> None:
        study = self.study([line("refit", 2.0), other("join", 1.0, foresight="next_keyframe")])
        found = {one.subject: one for one in summary.sentences(study, advice.situations(advice.cells(study)), [], summary.Paper([], ""))}
        take = found["What to take"]
        self.assertTrue(take.parts[0].startswith("With 10 frames a keyframe and more, take refit"))
        self.assertTrue(take.parts[1].startswith("This study has at most"))
        for one in found.values():
            self.assertTrue(one.parts and one.place, one.subject)

    def test_what_a_study_did_not_ask_is_answered_by_measurements_that_come_with_the_project(self) -> None:
        lines = [line("refit", 2.0), other("join", 1.0, foresight="next_keyframe")]
        kept = json.loads(json.dumps(lines))
        for one in kept:
            one["scene"].update(rays="coherent:64")
        wrong = line("stale", 1.0, guarantee="approximate")
        wrong["verified"].update(pairs=1000, missed=5)
        situations = advice.situations(advice.cells(self.study(lines)))
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            folder = Path(name)
            self.assertEqual(summary.on_others(situations, folder), "Pairs within a body (self-collision) and rays were not asked for in this study.")
            (folder / "cells.json").write_text(cells_file.content(cells_file.of_study(self.study(kept))), encoding="utf-8")
            says = summary.on_others(situations, folder)
            self.assertRegex(says, r"not asked for in this study\. By measurements that come with the project \(.*2026-.*\): With 10 frames .* and rays, take refit where")
            self.assertNotIn("come with", summary.on_others(advice.situations([*advice.cells(self.study(kept)), *self.within()]), folder))
            self.assertNotIn("come with", summary.on_errors([], folder))
            (folder / "errors.json").write_text(time_error_file.content(time_error.places(self.study([*lines, wrong]))), encoding="utf-8")
            self.assertRegex(summary.on_errors([], folder), r"come with the project: If nothing of the future .* Measured .*commit ")

    def test_sizes_that_a_study_lacks_are_told_from_the_cells_that_come_with_the_project(self) -> None:
        def sized(primitives: int) -> list[dict[str, Any]]:
            lines = [line("refit", 2.0), other("join", 1.0, foresight="next_keyframe")]
            for one in lines:
                one["scene"].update(primitives=primitives)
            return lines

        own = advice.situations(advice.cells(self.study(sized(4000))))
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            folder = Path(name)
            self.assertEqual(
                summary.on_larger(own, folder),
                ["This study has at most 4k triangles, both bodies together. 10k to 100k and 100k and more were not measured."],
            )
            (folder / "cells.json").write_text(cells_file.content(cells_file.of_study(self.study(sized(20000)))), encoding="utf-8")
            (says,) = summary.on_larger(own, folder)
            self.assertRegex(says, r"project \(.*\), 10k to 100k triangles: With 10 frames a keyframe and more: refit, 2\.00 ms a frame \(20k triangles\); "
                             r"join if the next keyframe is known, 1\.00 ms a frame \(20k triangles\); 2\.00 times as fast as the refit .*; surely faster: .*\. 100k and more was not measured\.")  # fmt: skip
            self.assertEqual(summary.on_larger(advice.situations(advice.cells(self.study(sized(200000)))), folder), [])

    def test_the_scenes_that_lose_between_the_fewest_and_the_most_frames_are_told(self) -> None:
        kept = []
        for l, join in ((1, 4.0), (7, 2.5), (10, 1.0)):
            for scene in ("cloth", "ball"):
                kept += [line("refit", 2.0, scene), other("join", join if scene == "ball" else 0.5, scene, foresight="next_keyframe")]
                for one in kept[-2:]:
                    one["scene"].update(primitives=20000, per_keyframe=l)
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            (Path(name) / "cells.json").write_text(cells_file.content(cells_file.of_study(self.study(kept))), encoding="utf-8")
            (says,) = summary.on_larger(advice.situations(advice.cells(self.study([line("refit", 2.0), other("join", 1.0)]))), Path(name))
        self.assertIn(". With 2 to 9 frames a keyframe join is slower than the best refit on ball, 20k, l = 7: 0.80. 100k and more", says)

    def test_cells_that_come_with_the_project_are_told_line_by_line(self) -> None:
        lines = []
        for scene, refit, join in (("ball", 3.0, 2.0), ("cloth", 2.0, 1.0)):
            lines += [line("refit", refit, scene), other("join", join, scene, foresight="next_keyframe")]
        lines[-1]["times"]["disturbed"] = "9 involuntary switches"
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            folder = Path(name)
            self.assertEqual(kept_costs.kept_lines(folder), [])
            (folder / "cells.json").write_text(cells_file.content(cells_file.of_study(self.study(lines))), encoding="utf-8")
            ball, cloth = sorted(kept_costs.kept_lines(folder), key=lambda one: one.scene)
        self.assertEqual((ball.scene, ball.asks, ball.primitives, ball.l), ("ball", "", "4k", "10"))
        self.assertEqual((ball.refit.title, ball.refit.ms, ball.refit.ratio), ("refit", "3.00", "the best refit"))
        nothing, keyframe, clip = ball.advised
        assert keyframe is not None
        self.assertEqual((nothing, clip), (None, None), "the best refit, and what less knowledge takes, stand once")
        self.assertEqual((keyframe.title, keyframe.ms), ("join", "2.00"))
        self.assertTrue(keyframe.ratio.startswith("1.50"), keyframe.ratio)
        assert cloth.advised[1] is not None
        self.assertTrue(cloth.advised[1].ratio.startswith("2.00?"), "doubtful")
        self.assertTrue(ball.counts and cloth.counts)

    def test_a_cell_that_two_plans_measured_has_two_lines_of_which_one_counts(self) -> None:
        more = cells_file.of_study(self.study([line("refit", 3.0), other("join", 1.0), other("tree", 2.0)]))
        few = cells_file.of_study(self.study([line("refit", 2.0), other("join", 1.0)]))
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            (Path(name) / "cells.json").write_text(cells_file.content(cells_file.Cells([*more.measured, *few.measured], [*more.cells, *few.cells])), encoding="utf-8")
            found = kept_costs.kept_lines(Path(name))
        self.assertEqual([(one.refit.ms, one.counts) for one in found], [("3.00", True), ("2.00", False)])

    def test_self_collision_with_positions_only_is_said_to_be_unmeasured(self) -> None:
        found = advice.situations(self.within())
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            folder = Path(name)
            says = summary.on_others(found, folder)
            self.assertIn("Pairs within a body with positions only (a keyframe at every frame), and above 4k triangles, were not measured in this study.", says)
            self.assertIn("Refit uses no keyframes: take it with positions only, too; its time there is not known.", says)
            self.assertNotIn("Nearest", says)
            (folder / "cells.json").write_text(cells_file.content(cells_file.Cells([["p", "2026-01-02", "abc", "cpu"]], list(self.within()))), encoding="utf-8")
            self.assertRegex(summary.on_others(found, folder), r"Nearest, by measurements that come with the project \(cpu, 2026-01-02; alone, 4k, l = 10\): 10 frames a keyframe and more: refit, 2\.00 ms")

    def within(self) -> list[advice.MeasuredCell]:
        lines = [line("refit", 2.0, "alone"), other("join", 1.0, "alone", foresight="next_keyframe")]
        for one in lines:
            one["scene"]["bodies"][0]["self"] = True
        return advice.cells(self.study(lines))

    def test_disturbed_runs_are_counted_and_old_ones_unknown(self) -> None:
        lines = [synthetic.add_frames(line(f"refit_{i}", 1.0)) for i in range(4)]
        self.assertIn("quiet: none of 4", self.said(lines)["This run"])
        lines[2]["times"]["disturbed"] = "9 involuntary switches"
        self.assertIn("1 of 4 timed contestants are doubtful", self.said(lines)["This run"])
        self.assertIn("9 involuntary switches", self.said(lines)["This run"])
        self.assertIn("is unknown", self.said([line("refit", 1.0)])["This run"])

    def test_the_table_of_scenes_says_what_it_costs_by_what_is_known(self) -> None:
        study = self.study([line("refit", 2.0), line("slower", 4.0), other("join", 1.0, foresight="next_keyframe")])
        (one,) = summary.lines(study, advice.cells(study))
        nothing, keyframe, clip = one.by_knowledge
        self.assertEqual((nothing.title, nothing.ms, nothing.ratio), ("refit", "2.00", "the best refit"))
        self.assertEqual((keyframe.title, keyframe.ms, keyframe.ratio.split(" ")[0]), ("join", "1.00", "2.00"))
        self.assertIsNone(clip, "knowing more gains nothing")


class TestChart(unittest.TestCase):
    def test_places_are_on_one_logarithmic_axis(self) -> None:
        def best(id: str, low: float, speed: float, high: float) -> advice.Advice:
            return advice.Advice(id, id, False, speed, low, high, 3, 3, "", 0)

        a, b = best("a", 1.0, 2.0, 4.0), best("b", 2.0, 4.0, 8.0)
        known = list(advice.FORESIGHT)
        found = summary.chart([advice.Situation("x", "y", 3, [(known[0], a), (known[1], b), (known[2], b)])])
        ((_, bars),) = found.groups
        self.assertEqual([bar.best.id for bar in bars], ["a", "b"], "what more knowledge does not change has no line")
        ticks = {label: place for place, label in found.ticks}
        self.assertEqual((bars[0].low, bars[0].at), (ticks["1"], ticks["2"]))
        self.assertAlmostEqual(bars[1].high - bars[1].at, ticks["2"] - ticks["1"], places=1)
        self.assertTrue(all(0 <= place <= 100 for bar in bars for place in (bar.low, bar.at, bar.high)))


if __name__ == "__main__":
    unittest.main()
