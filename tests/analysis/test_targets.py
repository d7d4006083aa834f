"""Targets: the Markdown table, the page it is written into, and the section of the report."""

from __future__ import annotations

import contextlib
import copy
import io
import json
import unittest
from pathlib import Path
from typing import Any, Optional

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic

from report import report, targets_table
from results import tuned


def scene(name: str, ratio: Optional[float], counts: bool, **others: Any) -> dict[str, Any]:
    side = {"label": "flat [leaf=4]", "ms": 2.0, "repetitions": 5, "run": "r"}
    return {
        "scene": name, "order": "given", "triangles": 65522, "counts": counts, "ratio": ratio,
        "confidence_interval": None if ratio is None else [ratio - 1, ratio + 1], "range": None,
        "numerator": None if ratio is None else dict(side, label="peer | <b>", ms=2.0 * ratio), "denominator": side, **others,
    }  # fmt: skip


def target(what: str, measured: Optional[float], verdict: str, scenes: list[dict[str, Any]], **others: Any) -> dict[str, Any]:
    return {
        "schema": 2, "plan": "baseline", "what": what, "measured": measured, "at_least": 20.0, "aim": 30.0,
        "confidence_interval": None if measured is None else [measured - 1, measured + 1], "range": None, "verdict": verdict,
        "scene": None if measured is None else "cloth 65k", "scenes": ["cloth 65k"], "per_scene": scenes, "note": "",
        "commit": "0123456789abcdef", "dirty": False, "machine": synthetic.MACHINE, "when": "2025-01-31T12:00:00Z",
        "runs": ["r"], **others,
    }  # fmt: skip


def rows() -> list[dict[str, Any]]:
    return [
        target("refit over FCL", 45.25, "reached_aim", [scene("cloth 2k", 12.0, False), scene("cloth 65k", 45.25, True)]),
        target("query", 19.9, "missed", [scene("cloth 65k", 19.9, True), scene("cloth 65k-shuffled", 21.0, False)]),
        target("peer", None, "unmeasured", [scene("cloth 65k", None, True, reason="no peer")], reason="cloth 65k: no peer"),
    ]


class TargetsCase(shared.InFolder):
    def setUp(self) -> None:
        super().setUp()
        self.file = self.folder / "targets.json"

    def run_main(self, value: Any, *arguments: str) -> tuple[int, str, str]:
        self.file.write_text(value if isinstance(value, str) else json.dumps(value), encoding="utf-8")
        return shared.said(targets_table.main, self.file, *arguments)


class TestMarkdown(TargetsCase):
    def test_both_tables(self) -> None:
        code, out, _ = self.run_main(rows())
        self.assertEqual(code, 0)
        lines = out.splitlines()
        self.assertEqual(lines[0], "| what | measured (95 % interval) or [range] | at least | aim | verdict |")
        self.assertEqual(lines[2], "| refit over FCL | 45.2x (44.2–46.2) | 20x | 30x | aim reached |")
        self.assertEqual(lines[3], "| query | 19.9x (18.9–20.9) | 20x | 30x | missed |")
        self.assertEqual(lines[4], "| peer | – | 20x | 30x | not measured: cloth 65k: no peer |")
        self.assertIn("commit 0123456789ab, 2025-01-31", lines[6])
        self.assertEqual(lines[8], "| what | cloth 2k | cloth 65k | cloth 65k-shuffled |")
        self.assertEqual(lines[10], "| refit over FCL | 12.0x | **45.2x** | – |")
        self.assertEqual(lines[11], "| query | – | **19.9x** | 21.0x |")
        self.assertEqual(lines[12], "| peer | – | **–** | – |")

    def test_notes_stand_between_the_tables(self) -> None:
        noted = rows()
        noted[0]["note"] = "triangles, which cannot be collided"
        _, out, _ = self.run_main(noted)
        self.assertIn("\n- refit over FCL: triangles, which cannot be collided.\n", out)
        self.assertNotIn("Notes.", self.run_main(rows())[1])

    def test_cells_cannot_break_the_table(self) -> None:
        lines = rows()
        lines[0]["what"] = "a | b\nc"
        self.assertIn("| a \\| b c |", self.run_main(lines)[1])

    def test_uncommitted_changes_and_several_runs_are_told(self) -> None:
        lines = rows()
        for line in lines:
            line.update(dirty=True, runs=["a", "b"])
        out = self.run_main(lines)[1]
        self.assertIn("with uncommitted changes", out)
        self.assertIn("Not all of it in one run.", out)

    def test_no_interval(self) -> None:
        lines = rows()
        lines[0]["confidence_interval"] = None
        self.assertIn("| refit over FCL | 45.2x | 20x |", self.run_main(lines)[1])

    def test_ranges_and_disturbed_ratios_look_different(self) -> None:
        lines = rows()
        lines[0].update(confidence_interval=None, range=[40.0, 50.0])
        lines[0]["per_scene"][0]["denominator"] = dict(lines[0]["per_scene"][0]["denominator"], disturbed="30 involuntary switches")
        out = self.run_main(lines)[1]
        self.assertIn("| refit over FCL | 45.2x [40.0–50.0] | 20x |", out)
        self.assertIn("| refit over FCL | 12.0x? | **45.2x** | – |", out)

    def test_ratios_of_auto_are_marked_where_it_was_tuned(self) -> None:
        self.assertNotIn("†", self.run_main(rows())[1])
        auto = {"label": "auto [bounds=triangles]", "ms": 2.0, "repetitions": 5, "run": "r"}
        names = {"tablecloth 16k": 2.0, "tablecloth 16k (changes of pairs)": 3.0, "sheet over box 10k": 4.0, "dress 65k": None}
        scenes = [scene(name, ratio, "changes" not in name, denominator=auto) for name, ratio in names.items()]
        code, out, _ = self.run_main([target("auto", 2.0, "missed", scenes), target("join", 2.0, "missed", [scene("tablecloth 16k", 5.0, True)])])
        self.assertEqual(code, 0)
        self.assertIn("| auto | **2.00x** † | 3.00x † | **4.00x** | **–** |", out)
        self.assertIn("| join | **5.00x** | – | – | – |", out)
        self.assertIn(" five repetitions. †: `auto` was tuned on the scene.\n", out)

    def test_an_installed_analysis_finds_the_plan_auto(self) -> None:
        (self.folder / "plans").mkdir()
        (self.folder / "plans" / "auto.json").write_text('{"studies": [{"name": "tuned on", "scenes": [{"name": "a"}]}, {"name": "unseen"}]}', encoding="utf-8")
        self.assertEqual(tuned.scenes(self.folder), {"a"} | tuned.FITTED_LATER)


class TestWrite(TargetsCase):
    def test_only_what_is_between_the_markers_changes(self) -> None:
        page = self.folder / "README.md"
        other = "<!-- targets of field -->\nkept\n<!-- /targets of field -->\n"
        content = f"before\n{other}<!-- targets of baseline -->\nold\n<!-- /targets of baseline -->\nafter ü\n"
        page.write_text(content, encoding="utf-8")
        table = self.run_main(rows())[1]
        for _ in range(2):
            code, out, _ = self.run_main(rows(), "--write", str(page))
            self.assertEqual((code, out), (0, ""))
            self.assertEqual(page.read_text(encoding="utf-8"), content.replace("old\n", table))

    def test_pages_without_markers_stay_as_they_are(self) -> None:
        page = self.folder / "README.md"
        begin, end = targets_table.markers("baseline")
        for content in ("text\n", f"{end}\n{begin}\n", f"{begin}\n"):
            page.write_text(content, encoding="utf-8")
            code, _, err = self.run_main(rows(), "--write", str(page))
            self.assertEqual(code, 2)
            self.assertIn(f"should have the lines {begin} and {end} once, in this order.", err)
            self.assertEqual(page.read_text(encoding="utf-8"), content)

    def test_the_page_of_results_has_the_markers(self) -> None:
        page = (Path(__file__).resolve().parents[2] / "analysis" / "guides" / "results.md").read_text(encoding="utf-8")
        for plan in ("baseline", "field", "motion", "spacetime"):
            self.assertIn("| refit over FCL |", targets_table.rewrite(page, plan, self.run_main(rows())[1]))


class TestRefusals(TargetsCase):
    def test_wrong_files_end_in_one_sentence(self) -> None:
        lacking, schema, verdict, ratio = (copy.deepcopy(rows()) for _ in range(4))
        del lacking[1]["at_least"]
        old = copy.deepcopy(rows())
        schema[0]["schema"], old[0]["schema"] = 3, 1
        verdict[0]["verdict"] = "splendid"
        ratio[2]["per_scene"][0]["ratio"] = "many"
        for value, words in (
            ("{", "is not JSON"), ({}, "a list of targets is expected"), ([3], "row 1: an object is expected"),
            (lacking, "row 2: the field at_least is missing"), (schema, "row 1: schema 3 is not known"),
            (old, "row 1: schema 1 is not known: its times leave out the beginning of the clip"),
            (verdict, 'row 1: verdict is "splendid"'), (ratio, "row 3: "),
        ):  # fmt: skip
            with self.subTest(words):
                code, out, err = self.run_main(value)
                self.assertEqual((code, out, err.count("\n")), (2, "", 1))
                self.assertIn(words, err)

    def test_no_file(self) -> None:
        with self.assertRaisesRegex(targets_table.ResultError, "does not exist"):
            targets_table.load_targets(self.folder / "nowhere.json")


class TestReport(TargetsCase):
    def page(self) -> tuple[int, str]:
        wanted = [c for c in synthetic.CONTESTANTS if c["id"] == "bottom_up"]
        synthetic.write(self.folder, [synthetic.record(c, "tablecloth", 2000, "float", 1) for c in wanted])
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = report.main([str(self.folder), "--figures", "none", "--print"])
        page = self.folder / "report.html"
        return code, out.getvalue() + (page.read_text(encoding="utf-8") if page.exists() else "")

    def test_targets_are_shown_and_escaped(self) -> None:
        self.file.write_text(json.dumps(rows()), encoding="utf-8")
        code, page = self.page()
        self.assertEqual(code, 0)
        self.assertIn('id="targets"', page)
        self.assertIn("aim reached", page)
        self.assertIn("not measured: cloth 65k: no peer", page)
        self.assertIn("peer | &lt;b&gt;", page)
        self.assertIn("| query | 19.9x (18.9–20.9) |", page, "printed as text, too")

    def test_no_targets_no_section(self) -> None:
        code, page = self.page()
        self.assertEqual(code, 0)
        self.assertNotIn('id="targets"', page)

    def test_ratios_of_auto_are_marked_where_it_was_tuned(self) -> None:
        auto = {"label": "auto", "ms": 2.0, "repetitions": 5, "run": "r"}
        for label, marked in (("auto", True), ("front", False)):
            one = scene("tablecloth 16k", 2.0, True, denominator=dict(auto, label=label))
            self.file.write_text(json.dumps([target("a", 2.0, "missed", [one])]), encoding="utf-8")
            code, page = self.page()
            self.assertEqual(code, 0)
            self.assertEqual("2.00x † <span" in page, marked)
            self.assertEqual("†: auto was tuned on the scene." in page, marked)

    def test_a_wrong_file_is_refused(self) -> None:
        self.file.write_text("[3]", encoding="utf-8")
        code, page = self.page()
        self.assertEqual(code, 2)
        self.assertIn("row 1: an object is expected", page)


if __name__ == "__main__":
    unittest.main()
