"""Parts of the site: dead links are seen, links of the tree's pages are rewritten, strategies have their files."""

import re
import sys
import tempfile
import unittest
from pathlib import Path

import paths

ROOT = paths.HERE.parents[1]
sys.path.insert(0, str(ROOT / "analysis" / "site"))
import lessons_page  # noqa: E402
import links  # noqa: E402
import stage  # noqa: E402
import strategy_pages  # noqa: E402


class Links(unittest.TestCase):
    def dead(self, **pages):
        with tempfile.TemporaryDirectory() as name:
            for page, text in pages.items():
                file = Path(name) / (page.replace("__", "/") + ".html")
                file.parent.mkdir(exist_ok=True)
                file.write_text(text)
            return links.dead_links(Path(name))[0]

    def test_dead_links_are_seen(self):
        good = '<a href="b.html#here">b</a><a href="#top" id="top">a</a><a href="https://x.org/none.html">x</a>'
        self.assertEqual(self.dead(a=good, b='<p id="here">'), [])
        self.assertEqual(self.dead(a='<a href="c.html">c</a>'), ["a.html: c.html leads to no file"])
        self.assertEqual(self.dead(a='<img src="none.png">'), ["a.html: none.png leads to no file"])
        self.assertEqual(len(self.dead(a='<a href="b.html#there">b</a>', b='<p id="here">')), 1)
        self.assertEqual(len(self.dead(a='<a href="#there">b</a>')), 1)

    def test_of_doxygen_only_files_count(self):
        self.assertEqual(self.dead(api__a='<a href="b.html#made-by-script">b</a>', api__b=""), [])
        self.assertEqual(len(self.dead(api__a='<a href="c.html">c</a>')), 1)


class Stage(unittest.TestCase):
    def rewritten(self, page, text):
        with tempfile.TemporaryDirectory() as name:
            return stage.rewritten(page, text, set(stage.staged_pages()), Path(name))

    def test_links(self):
        for page, text, result in (
            ("README.md", "[why](core/adr/0001-two-truths.md)", "[why](core/adr/0001-two-truths.md)"),
            ("README.md", "[all](core/adr/)", "[all](adr.md)"),
            ("core/README.md", "[all](adr/)", "[all](../adr.md)"),
            ("README.md", "[contract](core/contract/strategy.hpp)", "contract (`core/contract/strategy.hpp`)"),
            ("README.md", "[core/contract/strategy.hpp](core/contract/strategy.hpp)", "`core/contract/strategy.hpp`"),
            ("README.md", "[try](analysis/site/pages/tutorial.md)", "[try](tutorial.md)"),
            ("core/README.md", "[try](../analysis/site/pages/tutorial.md#here)", "[try](../tutorial.md#here)"),
            ("README.md", "[x](https://x.org) [y](#here)", "[x](https://x.org) [y](#here)"),
            ("README.md", "```\n[code](core/none.hpp)\n```", "```\n[code](core/none.hpp)\n```"),
        ):
            self.assertEqual(self.rewritten(page, text), result)

    def test_a_link_to_nothing_ends_it(self):
        with self.assertRaises(SystemExit):
            self.rewritten("README.md", "[x](core/none.md)")

    def test_the_first_lesson_and_the_tutorial_show_one_refit(self):
        """The test of the installed package compiles the tutorial's strategies and runs the conformance suite on them."""
        pages = ("analysis/site/pages/tutorial.md", "analysis/lessons/text/1-boxes.md")
        tutorial, lesson = (re.findall(r"\n```cpp\n(.*?)\n```\n", (ROOT / page).read_text(), re.S) for page in pages)
        self.assertEqual(len(tutorial), 2)
        self.assertEqual(lesson, tutorial[:1])
        self.assertIn("KBVH_STRATEGY(my_refit)", tutorial[0])


class Lessons(unittest.TestCase):
    def test_every_lesson_is_listed_and_linked_if_built(self):
        texts = ROOT / "analysis" / "lessons" / "text"
        for built in (False, True):
            page = lessons_page.page(texts, built)
            rows = [line for line in page.split("\n") if line.startswith("| ")][1:]
            self.assertEqual(len(rows), 9)
            for number, (row, file) in enumerate(zip(rows, sorted(texts.glob("*.md"))), 1):
                self.assertRegex(row, rf"\b{number}\. \w")
                self.assertEqual(f'href="lab/lessons/{file.stem}.html"' in row, built)
                self.assertEqual(row.count(" | "), 2, row)


class Strategies(unittest.TestCase):
    def test_every_registered_strategy_has_its_file(self):
        for id, file in (
            ("interval_join", "strategies/interval_join.cpp"),
            ("bottom_up_period", "strategies/bottom_up_period.cpp"),
            ("embree_refit", "adapters/embree.cpp"),
        ):
            self.assertEqual(strategy_pages.source_of(ROOT, id), file)
        self.assertTrue(strategy_pages.source_of(ROOT, "fcl_float_rebuild").startswith("adapters/fcl"))

    def test_cells_cannot_break_a_table(self):
        self.assertEqual(strategy_pages.table(["a"], [["x|y\nz"]])[2], "| x\\|y z |")


if __name__ == "__main__":
    unittest.main()
