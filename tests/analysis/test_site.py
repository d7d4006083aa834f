"""Parts of the site: dead links are seen, links of the tree's pages are rewritten, strategies have their files."""

import re
import sys
import tempfile
import unittest
from pathlib import Path

import paths

ROOT = paths.HERE.parents[1]
sys.path.insert(0, str(ROOT / "analysis" / "site"))
import error_page  # noqa: E402
import furo_from_debian  # noqa: E402
import lessons_page  # noqa: E402
import links  # noqa: E402
import python_pages  # noqa: E402
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


    def test_a_link_to_the_lab_carries_a_state(self):
        self.assertEqual(self.dead(a='<a href="lab/index.html#scene=cloth">lab</a>', lab__index=""), [])
        self.assertEqual(len(self.dead(a='<a href="lab/none.html#scene=cloth">lab</a>', lab__index="")), 1)


class Errors(unittest.TestCase):
    def test_every_figure_says_when_it_was_measured_and_what_each_panel_shows(self):
        page = error_page.page(ROOT / "analysis" / "reference")
        figures = page.split("\n## ")[1:]
        self.assertGreater(len(figures), 0)
        for figure in figures:
            self.assertRegex(figure, r"\nMeasured \d{4}-\d\d-\d\d.* by commit [0-9a-f]{8}.*: \d+ contestants, \d+ .*rounds?; the machine was (quiet|disturbed while \d+)")
            self.assertRegex(figure, r"missing up to 1\xa0% of the pairs|no approximate contestant")
            self.assertEqual(figure.count('<svg class="time-error" '), 4)
            self.assertEqual(len(re.findall(r"</svg><figcaption>[^<]{30,}\.</figcaption>", figure)), 4)
            # A blank line would end raw HTML for no reader of Sphinx, but a fence inside of it would.
            self.assertEqual(figure.count("```"), 2)

    def test_results_without_the_file_are_no_error(self):
        with tempfile.TemporaryDirectory() as name:
            self.assertIn("There is no `errors.json`", error_page.page(Path(name)))


class Furo(unittest.TestCase):
    """Debian's furo.css imports from a web server's /javascript and has no dark scheme; its furo.js is a module."""

    STYLE = '@import url(/javascript/x.css/x.css);\n@media not print {\n  body[data-theme="dark"] {\n    --a: #111; } }\n'

    def test_what_is_imported_lies_beside_it_and_the_system_chooses_dark(self):
        with tempfile.TemporaryDirectory() as name:
            folder, javascript = Path(name, "styles"), Path(name, "javascript")
            folder.mkdir()
            (javascript / "x.css").mkdir(parents=True)
            (javascript / "x.css" / "x.css").write_text("html {}")
            text = furo_from_debian.mended_style(self.STYLE, folder, javascript)
            self.assertTrue(text.startswith('@import url("x.css");'))
            self.assertEqual((folder / "x.css").read_text(), "html {}")
            self.assertRegex(text, r'prefers-color-scheme: dark\) \{\s*body:not\(\[data-theme="light"\]\) \{\s*--a: #111;')
            self.assertEqual(furo_from_debian.mended_style(text, folder, javascript), text)
            with self.assertRaises(FileNotFoundError):
                furo_from_debian.mended_style("@import url(/javascript/none.css);", folder, javascript)

    def test_an_imported_script_becomes_a_part(self):
        with tempfile.TemporaryDirectory() as name:
            (Path(name) / "g.js").write_text("var G = 1;")
            self.assertEqual(furo_from_debian.mended_script('import G from "./g.js";\nuse(G);', Path(name)), "var G = 1;\nuse(G);")
            self.assertEqual(furo_from_debian.mended_script("use(1);", Path(name)), "use(1);")


class PythonPages(unittest.TestCase):
    def test_every_public_name_is_on_the_page(self):
        page = python_pages.reference(ROOT / "analysis" / "kbvh")
        for name in python_pages.public(ROOT / "analysis" / "kbvh"):
            self.assertIn(f"\n### {name}\n", page)
        self.assertIn("#### World.advance\n", page)
        self.assertNotIn("self", re.findall(r"```python\n(World\(.*?\))\n", page)[0])

    def test_outputs_of_a_notebook(self):
        cells = [
            {"cell_type": "markdown", "source": ["# T\n", "text"]},
            {"cell_type": "code", "source": "f()", "outputs": [
                {"output_type": "stream", "name": "stdout", "text": "said\n"},
                {"output_type": "execute_result", "data": {"text/html": "<table border=\"1\"></table>", "text/plain": "t"}},
                {"output_type": "display_data", "data": {"image/png": "AAAA", "text/plain": "<Figure>"}}]},
        ]  # fmt: skip
        with tempfile.TemporaryDirectory() as name:
            page = python_pages.notebook(cells, "n", Path(name))
            self.assertEqual([file.name for file in Path(name).iterdir()], ["n-1-2.png"])
        for part in ("# T\ntext", "```python\nf()\n```", "```text\nsaid\n```", "<table></table>", '<img src="n-1-2.png" alt="&lt;Figure&gt;">'):
            self.assertIn(part, page)
        cells[1]["outputs"] = [{"output_type": "error", "ename": "E", "evalue": "v"}]
        with self.assertRaises(SystemExit):
            python_pages.notebook(cells, "n", Path("."))


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
