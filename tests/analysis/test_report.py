"""The report from end to end: what it shows follows from the results, and wrong input ends in one clear sentence."""

from __future__ import annotations

import copy
import html
import json
import re
import unittest
from typing import Any, Optional

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic

from figures import colours
from report import report, tables


def small() -> list[dict[str, Any]]:
    """Three contestants at one size and two l."""
    wanted = [c for c in synthetic.CONTESTANTS if c["id"] in ("bottom_up", "kinetic_aabb", "fcl_own_verdict")]
    return [synthetic.record(c, "tablecloth", 2000, "float", l) for l in (1, 30) for c in wanted]


class ReportCase(shared.InFolder):
    def setUp(self) -> None:
        super().setUp()
        self.folder = self.folder / "results"

    def run_report(self, *arguments: str) -> tuple[int, str, str]:
        return shared.said(report.main, self.folder, *arguments)

    def page(self, lines: list[dict[str, Any]], tail: Optional[str] = None, figures: str = "none", title: str = "T") -> str:
        synthetic.write(self.folder, lines, tail)
        code, _, err = self.run_report("--figures", figures, "--title", title)
        self.assertEqual(code, 0, err)
        return (self.folder / "report.html").read_text(encoding="utf-8")

    def refusal(self, content: Optional[str]) -> str:
        """The sentence for a file with this content."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if content is not None:
            (self.folder / "results.jsonl").write_text(content, encoding="utf-8")
        code, out, err = self.run_report()
        self.assertEqual(code, 2)
        self.assertEqual(out, "")
        self.assertEqual(err.count("\n"), 1, "one sentence, no traceback")
        self.assertFalse((self.folder / "report.html").exists())
        return err


class TestPage(ReportCase):
    def test_a_refit_that_is_no_baseline_is_shown_and_is_no_denominator(self) -> None:
        lines = small()
        for l in (1, 30):
            mine = dict(id="my_refit", title="My own refit", family="refit", update=0.2, query=0.1, builder=(8, 16))
            lines.append(synthetic.record(mine, "tablecloth", 2000, "float", l))
        for line in lines:
            line["strategy"]["baseline"] = line["strategy"]["id"] == "bottom_up"
        page = self.page(lines)
        glance = page[page.index('id="glance"') : page.index("</table>", page.index('id="glance"'))]
        self.assertIn("My own refit", glance, "the fastest that is no baseline stands in the summary")
        self.assertRegex(page, r'<tr class="reference"><td>Bottom-up refit[^\n]*best refit</span>', "the denominator")
        self.assertNotRegex(page, r'<tr class="reference"><td>My own refit')

    def test_figures_without_data_are_left_out(self) -> None:
        lines = [line for line in small() if line["strategy"]["id"] == "bottom_up" and line["scene"]["per_keyframe"] == 1]
        for line in lines:
            line["verified"].update(looseness=0.0, candidates=line["verified"]["pairs"])
            del line["counters"], line["bytes"], line["events_at_depth"], line["verified"]["over_time"]
            for name in ("total_p50", "total_p99", "total_worst", "over_time"):
                del line["times"][name]
        self.page(lines, figures="main")
        self.assertEqual({file.stem for file in (self.folder / "figures").iterdir()}, {"tablecloth-cost"})

    def test_qualities_that_make_no_sense_are_one_sentence(self) -> None:
        line = small()[0]
        line["verified"]["over_time"][1]["sah"] = "large"
        self.assertIn("verified.over_time: sah should be a number", self.refusal(json.dumps(line) + "\n"))

    def test_lines_over_l_are_drawn_at_the_size_with_most_l(self) -> None:
        wanted = [c for c in synthetic.CONTESTANTS if c["id"] in ("bottom_up", "kinetic_aabb")]
        lines = [synthetic.record(c, "tablecloth", n, "float", l) for c in wanted for n, l in ((2000, 1), (2000, 10), (9000, 10))]
        page = self.page(lines, figures="main")
        self.assertIn("Frames per keyframe: tablecloth, float, 2k primitives", page)
        self.assertIn("Size: tablecloth, float, l = 10", page)

    def test_everything_from_results_is_escaped(self) -> None:
        lines = small()
        for line in lines:
            line["scene"]["name"] = "<script>alert(1)</script>"
            line["strategy"]["citation"] = "A & B <i>"
        page = self.page(lines)
        self.assertNotIn("<script>alert", page)
        self.assertIn("A &amp; B &lt;i&gt;", page)

    def test_pages_with_figures_are_self_contained_and_the_same_again(self) -> None:
        page = self.page(small(), figures="main")
        with self.subTest("self-contained"):
            for attribute in re.findall(r'src="([^"]*)"', page):
                self.assertTrue(attribute.startswith("data:image/png;base64,"), attribute[:60])
            for attribute in re.findall(r'href="([^"]*)"', page):
                # The explorer lies next to the report where its program is built; the report needs nothing of it.
                beside = attribute == "explorer.html" or (self.folder / attribute).is_file()
                self.assertTrue(attribute.startswith("#") or beside, attribute[:60])
            self.assertNotRegex(page, r"@import|url\(")
        with self.subTest("figures are PNG and PDF"):
            names = {file.name for file in (self.folder / "figures").iterdir()}
            for figure in ("cost", "counters", "depth", "quality", "pace", "latency", "l"):
                self.assertIn(f"tablecloth-{figure}.png", names)
                self.assertIn(f"tablecloth-{figure}.pdf", names)
            self.assertNotIn("tablecloth-n.png", names, "one size only: no figure over sizes")
        with self.subTest("a second run gives the same page"):
            self.assertEqual(self.page(small(), figures="main"), page)

    def test_the_top_is_five_short_sentences_and_one_small_chart(self) -> None:
        page = self.page(synthetic.study())
        top = re.sub(r"(?s)<details.*", "", page)
        said = re.findall(r"<li>(.*)</li>", top)
        self.assertEqual([re.sub("<.*?>", "", one).split("  ")[0] for one in re.findall(r'<a href="#[a-z-]+">.*?</a>', "".join(said))],
                         ["What to take", "Self-collision, rays", "Time against error", "The paper", "This run"])  # fmt: skip
        for one in said:
            self.assertLess(len(html.unescape(re.sub("<.*?>", "", one))), 300, one)
        self.assertEqual(top.count("<figure"), 1)
        self.assertEqual(top.count("<figcaption"), 2)
        words = re.sub("<.*?>", " ", top[top.index("<body>") :]).split()
        self.assertLess(len(words), 400)
        for place in re.findall(r'href="#([^"]*)"', top):
            self.assertIn(f'id="{place}"', page)
        code, out, _ = self.run_report("--figures", "none")
        self.assertEqual(code, 0)
        self.assertEqual(re.findall(r"(?m)^(What to take|Self-collision, rays|Time against error|The paper|This run): ", out),
                         ["What to take", "Self-collision, rays", "Time against error", "The paper", "This run"])  # fmt: skip

    def test_all_but_the_answers_is_folded(self) -> None:
        page = self.page(synthetic.study())
        self.assertEqual(re.findall(r'<section id="([^"]*)"', page), ["answers"])
        # What only a phone folds is open until the page's script has seen that the window is narrow; without a script nothing is lost.
        self.assertNotRegex(page, r'<details(?! class="fold")[^>]* open')
        self.assertGreater(page.count('<details class="fold" open><summary>'), 1)
        self.assertNotRegex(page, r'<details class="fold"(?! open)')
        self.assertNotIn("<table", re.sub(r"(?s)<details.*</details>", "", page), "before the first part that is folded, and after the last")
        self.assertEqual(page.count('<details class="part"'), page.count("<summary><h2>"))

    def test_long_tables_have_the_fastest_settings_and_the_refit(self) -> None:
        lines = [synthetic.line(f"tree_{i}", 1.0 + i, params={"a": str(k)}) for i in range(20) for k in (1, 2)]
        for one in lines:
            one["strategy"].update(baseline=one["strategy"]["id"] == "tree_15", title=one["strategy"]["id"])
        page = self.page(lines)
        rows = re.findall(r"<td>(tree_\d+)", page[page.index('id="group-1"') : page.index("more are not in this table")])
        self.assertEqual(rows, [f"tree_{i}" for i in range(10)] + ["tree_15"])
        self.assertIn("29 more are not in this table", page)

    def test_columns_of_page_and_terminal_are_those_of_the_list(self) -> None:
        page = self.page(small())
        table = page[page.index('<table class="results">') : page.index("</table>", page.index('<table class="results">'))]
        shown = [column for column in tables.COLUMNS if column.in_page]
        self.assertEqual(re.findall(r"<abbr[^>]*>([^<]*)</abbr>", table), [column.name for column in shown])
        rows = re.findall(r"<tr[^>]*><td>[^\n]*", table)
        self.assertGreater(len(rows), 1)
        for row in rows:
            self.assertEqual(row.count("<td"), 1 + len(shown))
        self.assertIn('<td class="n wrong">41</td>', table, "extra pairs")
        self.assertIn('<td class="n wrong">3</td>', table, "missed pairs")
        heading = next(line for line in self.run_report("--print")[1].splitlines() if line.startswith("strategy"))
        self.assertEqual(re.split(r"\s{2,}", heading), ["strategy", *(column.name for column in tables.COLUMNS)])

    def test_results_are_never_written(self) -> None:
        synthetic.write(self.folder, small(), '{"schema": 1, "ki')
        before = (self.folder / "results.jsonl").read_bytes()
        self.run_report("--figures", "none")
        self.assertEqual((self.folder / "results.jsonl").read_bytes(), before)

    def test_all_figures_on_request(self) -> None:
        lines = [line for line in small() if line["strategy"]["id"] == "bottom_up"]
        self.page(lines, figures="all")
        costs = list((self.folder / "figures").glob("*-cost.png"))
        self.assertEqual(len(costs), 2)

    def test_families_of_others_have_their_mark_in_every_figure(self) -> None:
        families = {"kinetic_aabb": "one's own", "linear_bounds": "another's", "embree_refit": "a third's", "bottom_up": "refit"}
        wanted = [c for c in synthetic.CONTESTANTS if c["id"] in families]
        lines = [synthetic.record({**c, "family": families[c["id"]]}, "tablecloth", 2000, "float", l) for l in (1, 30) for c in wanted]
        marks = {look.marker for look in colours.looks([(line["key"], line["strategy"]["id"], line["strategy"]["family"]) for line in lines]).values()}
        self.assertGreaterEqual(marks, {marker for _, marker in colours.FREE})
        self.page(lines, figures="all")

    def test_title(self) -> None:
        self.assertIn("<h1>My &lt;cloth&gt;</h1>", self.page(small(), title="My <cloth>"))


class TestShownValues(ReportCase):
    def table(self, lines: list[dict[str, Any]]) -> str:
        synthetic.write(self.folder, lines)
        code, out, err = self.run_report("--print", "--figures", "none")
        self.assertEqual(code, 0, err)
        return out

    @staticmethod
    def cells(printed: str, label: str) -> dict[str, str]:
        """The cells of the first row whose name begins so, by the names of their columns."""
        heading, *rows = (re.split(r"\s{2,}", line) for line in printed.splitlines() if "  " in line.strip())
        return dict(zip(heading, next(row for row in rows if row[0].startswith(label))))

    def test_altered_time_flips_the_ratio(self) -> None:
        lines = [line for line in small() if line["scene"]["per_keyframe"] == 30]
        kinetic = next(line for line in lines if line["strategy"]["params"].get("queue") == "avl")

        def ratio(text: str) -> float:
            return float(self.cells(text, "Kinetic AABB tree (queue avl)")["ratio"].split()[0])

        self.assertLess(ratio(self.table(lines)), 1)
        for repetition in kinetic["times"]["repetitions"]:
            for phase in repetition:
                repetition[phase] /= 100
        self.assertGreater(ratio(self.table(lines)), 1)
        self.assertIn('class="n faster"', (self.folder / "report.html").read_text(encoding="utf-8"))

    def test_broken_guarantee_takes_the_time_away(self) -> None:
        lines = small()
        kinetic = next(line for line in lines if line["strategy"]["id"] == "kinetic_aabb")
        kinetic["verified"].update(holds=False, first_violation="frame 3: a box is too small by one ulp")
        text = self.table(lines)
        self.assertIn("refused: Kinetic AABB tree (queue avl): its declared guarantee or tightness is broken: "
                      "frame 3: a box is too small by one ulp", text)  # fmt: skip

    def test_refused_contestants_are_listed_with_the_reason(self) -> None:
        lines = small()
        synthetic.refused(lines[0], "it would take 3 hours")
        self.assertIn("it would take 3 hours", self.page(lines))

    def test_best_refit_that_is_refused_is_no_reference(self) -> None:
        lines = [line for line in small() if line["scene"]["per_keyframe"] == 1]
        fast = next(line for line in lines if line["strategy"]["builder"] == {"method": "median", "width": 8, "leaf_size": 4})
        synthetic.refused(fast, "", "frame 1: a box is too small")
        self.assertRegex(self.table(lines), r"Bottom-up refit \(leaf 1, width 2\) +exact .* 1\.00 +1\.00")

    def test_missed_and_extra_are_shown(self) -> None:
        found = self.cells(self.table(small()), "FCL with its own")
        self.assertEqual([found[name] for name in ("missed", "extra")], ["3", "41"])

    def test_looseness_of_hidden_boxes_is_unknown(self) -> None:
        found = self.cells(self.table(small()), "FCL with its own")
        self.assertEqual([found[name] for name in ("protrusion", "looseness")], ["–", "–"])


class TestLimits(ReportCase):
    def test_dirty_tree_commits_and_sampling_are_told(self) -> None:
        lines = small()
        lines[0]["dirty"] = True
        lines[1]["commit"] = "fedcba9876543210"
        page = self.page(lines)
        self.assertIn("uncommitted changes", page)
        self.assertIn("2 commits", page)
        self.assertIn("compared with the oracle on every 3rd frame only", page)

    def test_threads_are_those_that_ran(self) -> None:
        lines = synthetic.study()
        self.assertIn("every contestant ran on one thread", self.page(lines))
        for line in lines:
            if line["strategy"]["id"] == "bottom_up":
                line["strategy"]["params"] = {"threads": "4"}
        page = self.page(lines)
        self.assertIn("Bottom-up refit ran on 4 threads, everything else on one", page)
        self.assertNotIn("of which 1 was used", page)
        self.assertNotIn("scaling over cores", page)

    def test_code_and_versions_of_peers_and_compared_frames_are_told(self) -> None:
        lines = synthetic.study()
        for line in lines:
            line["machine"] = {**line["machine"], "kernels": "avx512"}
            if line["strategy"]["id"].startswith("fcl"):
                line["strategy"].update(version="FCL 1.2.3", instructions="sse2", remark="its own test is not timed")
        page = self.page(lines)
        for words in ("<td>avx512</td>", "<td>sse2</td>", "FCL 1.2.3", "its own test is not timed.", "were compared with the oracle"):
            self.assertIn(words, page)

    def test_single_repetition_has_no_noise(self) -> None:
        lines = small()
        for line in lines:
            del line["times"]["repetitions"][1:]
        page = self.page(lines)
        self.assertIn("single repetition and no estimate of noise", page)


class TestRefusals(ReportCase):
    def test_no_file(self) -> None:
        self.assertIn("does not exist", self.refusal(None))

    def test_empty_file(self) -> None:
        self.assertIn("has no results yet", self.refusal(""))

    def test_only_a_broken_line(self) -> None:
        self.assertIn("no result that can be used. Line 1 of results.jsonl was skipped", self.refusal('{"schema": 1, "kind'))

    def test_unknown_schema(self) -> None:
        line = dict(small()[0], schema=3)
        self.assertIn("line 1: schema 3 is not known", self.refusal(json.dumps(line) + "\n"))

    def test_missing_fields_are_named_with_their_line(self) -> None:
        for path in ("kind", "scene.name", "scene.per_keyframe", "scene.primitives", "strategy.id", "strategy.guarantee",
                     "verified.holds"):  # fmt: skip
            with self.subTest(path):
                good, bad = small()[:2]
                *outer, name = path.split(".")
                holder = bad[outer[0]] if outer else bad
                del holder[name]
                said = f"Line 1 of results.jsonl was skipped: the field {path} is missing"
                self.assertIn(said, self.refusal(json.dumps(bad) + "\n"))
                # A line that is no measurement does not take the others with it.
                page = self.page([good, bad])
                self.assertIn(said.replace("1", "2", 1), page)
                (self.folder / "report.html").unlink()

    def test_wrong_values(self) -> None:
        def change(line: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
            changed: Any = copy.deepcopy(line)
            holder = changed
            *steps, last = path.split(".")
            for step in steps:
                holder = holder[int(step) if step.isdigit() else step]
            holder[last] = value
            return changed

        for path, value, words in (
            ("scene.primitives", "many", 'scene.primitives should be a number, but is "many"'),
            ("verified.holds", 1, "verified.holds should be true or false, but is 1"),
            ("strategy.guarantee", "mostly", 'strategy.guarantee is "mostly"'),
            ("times.unit", "s", 'times are in "s"'),
            ("times.repetitions", [], "at least one entry"),
            ("times.repetitions.0.update", -1, "update is -1.0, which is not a time"),
            ("times.repetitions.0.update", None, "repetition 1: update should be a number"),
            ("counters", 3, "should be objects"),
        ):
            with self.subTest(path):
                self.assertIn(words, self.refusal(json.dumps(change(small()[0], path, value))))

    def test_not_an_object(self) -> None:
        self.assertIn("Line 1 of results.jsonl was skipped: it is no result", self.refusal("[1, 2]\n"))


class TestLenience(ReportCase):
    def test_unfinished_last_line_is_skipped_with_a_note(self) -> None:
        lines = small()
        page = self.page(lines, json.dumps(lines[0])[:200])
        self.assertIn(f"Line {len(lines) + 1} of results.jsonl was skipped: it breaks off", page)

    def test_broken_line_in_the_middle_is_skipped_with_a_note(self) -> None:
        first, *rest = small()
        self.folder.mkdir(parents=True)
        text = json.dumps(first) + '\n{"schema": 1, "ki\n' + "".join(json.dumps(line) + "\n" for line in rest)
        (self.folder / "results.jsonl").write_text(text, encoding="utf-8")
        code, _, err = self.run_report("--figures", "none")
        self.assertEqual(code, 0)
        self.assertIn("Line 2 of results.jsonl was skipped: it is not JSON", err)

    def test_optional_fields_may_be_missing(self) -> None:
        lines = small()
        for line in lines:
            for name in ("when", "commit", "dirty", "machine", "seed", "counters", "bytes", "key", "run"):
                line.pop(name, None)
            for name in ("hash", "keyframes", "frames", "bodies"):
                line["scene"].pop(name, None)
            for name in ("title", "family", "tightness", "foresight", "citation", "own_scalar", "params", "builder"):
                line["strategy"].pop(name, None)
            line["verified"] = {"holds": True}
            for name in ("total_p50", "total_p99", "total_worst", "build_ms", "unit"):
                line["times"].pop(name)
        self.assertIn("not recorded", self.page(lines))

    def test_newest_of_equal_configurations_counts(self) -> None:
        lines = small()
        again = copy.deepcopy(lines[0])
        synthetic.refused(again, "", "frame 7: lost an event")
        page = self.page([*lines, again])
        self.assertIn("frame 7: lost an event", page)
        self.assertIn("1 older measurement", page)


if __name__ == "__main__":
    unittest.main()
