"""The five sentences at the top of the report, and the words of its small chart."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
from synthetic import line
from test_advice import other, study
from test_summary import row

from advice import advice, cells_file, summary, top
from claims import claims

FRAMES = list(advice.FRAMES)


def best(id: str, speed: float, **changes: Any) -> advice.Advice:
    return advice.Advice(id, id, id == "refit", speed, speed, speed, 3, 3, "", 3 if id == "refit" else 0, **changes)


def situation(frames: str, *ids: advice.Advice, asks: str = advice.PAIRS) -> advice.Situation:
    """A situation with this advice, from the least knowledge to the most."""
    return advice.Situation(asks, frames, 3, list(zip(advice.FORESIGHT, ids)), (2000, 16000))


class TestTaking(unittest.TestCase):
    def test_neighbouring_numbers_of_frames_are_one(self) -> None:
        for names, said in (
            (FRAMES[:1], "with positions only"), (FRAMES[1:2], "with 2 to 9 frames a keyframe"), (FRAMES[1:], "from 2 frames a keyframe on"),
            (FRAMES[2:], "from 10 frames a keyframe on"), (FRAMES[:2], "with 1 to 9 frames a keyframe"),
            ([FRAMES[0], FRAMES[2]], "with positions only and from 10 frames a keyframe on"), (FRAMES, "with any number of frames a keyframe"),
        ):  # fmt: skip
            self.assertEqual(top.frames_words(names), said)

    def test_what_to_take_is_said_by_what_is_known_with_the_cells_that_lose(self) -> None:
        refit = best("refit", 1.0)
        group = [
            situation(FRAMES[0], refit, refit, refit),
            situation(FRAMES[1], refit, best("join", 1.68, slower=1), best("join", 1.68, slower=1)),
            situation(FRAMES[2], refit, best("join", 1.97), best("tree", 2.5, unsure=1)),
        ]
        self.assertEqual(
            top.on_taking(group),
            "Two bodies: refit; if the next keyframe is known, join from 2 frames a keyframe on (1.68 to 1.97 times as fast as the best refit, slower in 1 of 6 cells); "
            "if the whole clip is known, tree from 10 frames a keyframe on (2.50 times as fast, not beyond doubt). Measured with 2k to 16k triangles.",
        )
        self.assertTrue(top.on_taking(group[2:]).startswith("Two bodies, from 10 frames a keyframe on: refit; if the next keyframe is known, join (1.97 times as fast as"))

    def test_the_first_sentence_is_about_what_the_study_asks(self) -> None:
        changes, rays, pairs = (situation(FRAMES[2], best("refit", 1.0), asks=asks) for asks in ("changes of pairs", advice.RAYS, advice.PAIRS))
        self.assertEqual(top.main_question([changes, rays, pairs]), advice.PAIRS)
        self.assertEqual(top.main_question([rays, changes]), "changes of pairs")
        self.assertEqual(top.main_question([rays]), "")
        self.assertEqual(top.shown([rays, changes]), [rays, changes])
        self.assertEqual(top.shown([rays, changes, pairs]), [rays, pairs], "others are in the folded chart")
        self.assertTrue(top.on_taking([changes]).startswith("Changes of pairs, from 10"))

    def test_what_a_study_does_not_ask_is_told_by_the_project_or_said_to_be_absent(self) -> None:
        rays = [line("refit", 2.0, "r"), other("join", 1.0, "r", foresight="next_keyframe")]
        for one in rays:
            one["scene"].update(rays="coherent:64")
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            folder = Path(name)
            self.assertEqual(top.on_others([], folder), "Not measured: within a body and rays.")
            (folder / "cells.json").write_text(cells_file.content(cells_file.of_study(study(rays))), encoding="utf-8")
            told = "Rays, 10 frames a keyframe and more: refit; if the next keyframe is known, join (2.00 times as fast, not beyond doubt)."
            self.assertEqual(top.on_others([], folder), f"By the project's own runs: {told} Not measured: within a body.")
            own = situation(FRAMES[0], best("refit", 1.0), asks=advice.RAYS)
            self.assertEqual(top.on_others([own], folder), "Rays, positions only: refit. Not measured: within a body.", "this study comes first")


class TestPaper(unittest.TestCase):
    def verdict(self, verdict: str, **spans: str) -> summary.Verdict:
        ids = {id.replace("_", ":").removeprefix("as"): span for id, span in spans.items()}
        corners = [{"id": id, "name": id, "rule": ""} for id in ids]
        return summary.Verdict(row("E3", claims.OPEN), verdict, "", corners, ids)

    def test_the_main_claim_is_three_numbers(self) -> None:
        one = self.verdict(claims.CONDITION, best_2006="1.04 to 40.1, 1 (with motion)", as2006_2006="0.1 to 3", best_best="0.0081 to 0.66")
        self.assertEqual(
            top.on_the_main_claim(one),
            "Updating a kinetic AABB tree as of 2006 is not always faster than a refit as of 2006 (0.1 to 3 times); "
            "tuned here it is faster than that refit (1.04 to 40.1), not faster than today's best (0.0081 to 0.66).",
        )
        self.assertIn("as of 2006 is not always faster than a refit as of 2006 (0.1 to 3 times).", top.on_the_main_claim(self.verdict(claims.FAILS, as2006_2006="0.1 to 3")))
        same = self.verdict(claims.FAILS, best_2006="0.19 to 15.9", best_best="0.028 to 2.31")
        self.assertIn("tuned here is not always faster than a refit as of 2006 (0.19 to 15.9 times) and than today's best (0.028 to 2.31 times).", top.on_the_main_claim(same))
        self.assertEqual(top.on_the_main_claim(self.verdict(claims.FAILS)), "")

    def test_the_tally_says_who_decides(self) -> None:
        here = summary.Verdict(row("E1", claims.HOLDS), "")
        said = top.on_the_paper(summary.Paper([here, self.verdict(claims.CONDITION), summary.Verdict(row("E2", claims.OPEN), "")], ""))
        self.assertEqual(said, "Of its 3 claims 1 hold, 1 hold with a condition, 0 do not and 1 are open (1 decided here, 1 by the reference run).")
        self.assertIn("decide none", top.on_the_paper(summary.Paper([summary.Verdict(row("E2", claims.OPEN), "")], "")))


class TestWords(unittest.TestCase):
    def test_the_chart_has_short_words(self) -> None:
        self.assertEqual([top.known_words(known) for known in advice.FORESIGHT], ["nothing known", "next keyframe known", "whole clip known"])
        self.assertEqual([top.frames_label(frames) for frames in FRAMES], ["positions only", *FRAMES[1:]])
        self.assertEqual(top.costs(best("join", 2.0, times=(0.0229, 0.454))), "0.0229 to 0.454")
        self.assertEqual(top.costs(best("join", 2.0, times=(2.25, 2.25))), "2.25")


if __name__ == "__main__":
    unittest.main()
