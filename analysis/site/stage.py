"""Gathers the pages of the site: the tree's own Markdown, the pages of this folder, and pages made from registry and results.

usage: stage.py LIST_JSON RESULTS_DIR PAGES_DIR HTML_DIR NOTEBOOKS_DIR
HTML_DIR already holds what lies next to the pages: lab, lab/lessons, report. NOTEBOOKS_DIR holds the notebooks that were run.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(HERE), str(HERE.parent)]

import claims_page  # noqa: E402
import error_page  # noqa: E402
import lessons_page  # noqa: E402
import python_pages  # noqa: E402
import strategy_pages  # noqa: E402

#: Pages of the tree that are part of the site, in their places.
TREE = [
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "core/README.md", "experiments/README.md", "experiments/RESULTS.md",
    "analysis/reference/README.md", "analysis/kbvh/README.md",
]  # fmt: skip
#: The folder of the site's own pages, which stand at the root of the site.
PAGES = "analysis/site/pages/"
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")


def staged_pages() -> list[str]:
    folders = (ROOT / "core" / "adr", ROOT / "analysis" / "guides")
    return TREE + sorted(path.relative_to(ROOT).as_posix() for folder in folders for path in folder.glob("*.md"))


def rewritten(page: str, text: str, staged: set[str], pages: Path) -> str:
    """Returns the text with links that work in the site: pictures are copied, files that are no pages are named."""

    def link(match: re.Match[str]) -> str:
        picture, words, target = match.groups()
        path, _, anchor = target.partition("#")
        if re.match(r"[a-z]+:", target) or not path:
            return match.group(0)
        full = os.path.normpath(os.path.join(os.path.dirname(page), path))
        if not (ROOT / full).exists():
            raise SystemExit(f"{page}: there is no {full}")
        if picture:
            (pages / full).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / full, pages / full)
            return match.group(0)
        if full in staged:
            return match.group(0)
        if full.startswith(PAGES):
            return f"[{words}]({os.path.relpath(full.removeprefix(PAGES), os.path.dirname(page) or '.')}{'#' * bool(anchor)}{anchor})"
        if full == "core/adr":
            return f"[{words}]({os.path.relpath('adr.md', os.path.dirname(page) or '.')})"
        return f"{words} (`{full}`)" if full not in words else f"`{full}`"

    lines, code = [], False
    for line in text.split("\n"):
        if line.lstrip().startswith("```"):
            code = not code
        lines.append(line if code or line.lstrip().startswith("```") else LINK.sub(link, line))
    return "\n".join(lines)


#: The first page's comparison, where the lab is built; site.css and comparison.js belong to it.
COMPARISON = """<section class="comparison" data-comparison>
<p class="finding" aria-live="polite">A kinetic tree and a refit, on one cloth. Your browser is measuring both …</p>
<div class="comparison-lab"></div>
<p class="what">The project's own C++ runs here, compiled to WebAssembly: a kinetic AABB tree and a bottom-up refit, each a binary tree with one
triangle in a leaf. Times are those of update and query together: the median of several clips, played by turns on your machine. <a href="lab/index.html#scene=cloth-on-box">Open it in the lab.</a></p>
</section>"""
#: The links that lead on from the first page: page, question, answer.
WAYS = [
    ("analysis/guides/choosing.html", "What do I take?", "Which strategy suits your motion, and what it costs."),
    ("claims.html", "Does the paper hold?", "Each claim of 2006, measured, with its verdict."),
    ("lessons.html", "How does it work?", "A course of nine lessons, with the lab inside."),
]


def first_page(html: Path) -> str:
    """Returns the comparison, if the site has the lab, and the links that lead on."""
    lab = COMPARISON if (html / "lab" / "lab.js").exists() else "<p>The lab is not part of this site: <code>experiments/lab</code> builds it.</p>"
    ways = "".join(f'<li><a href="{page}"><b>{question}</b>{answer}</a></li>' for page, question, answer in WAYS)
    return "\n".join(["```{raw} html", lab, f'<ul class="ways">{ways}</ul>', "```"])


def filled(text: str, html: Path) -> str:
    """Returns the text of a page of this folder with its marks replaced: {{comparison}}, {{api:PAGE|words}}, {{file:PATH}}."""
    text = text.replace("{{comparison}}", first_page(html))
    text = re.sub(r"\{\{api:(\w+)\\?\|([^}]+)\}\}", r'<a href="api/\1.html">\2</a>', text)
    return re.sub(r"\{\{file:([^}]+)\}\}", lambda match: (ROOT / match.group(1)).read_text().rstrip(), text)


def report_page(html: Path, results: Path) -> str:
    """Returns the page that leads to report and explorer, as far as the site has them."""
    lines = ["# Report and explorer", "", f"Both show the results in `{results.name}`. Each is one file and needs no network.", ""]
    for name, title, about in (
        ("report.html", "Report", "tables and figures, claim by claim"),
        ("explorer.html", "Explorer", "every measurement, filtered and drawn as you choose"),
    ):
        if (html / "report" / name).exists():
            lines.append(f'- <a href="report/{name}">{title}</a>: {about}')
        else:
            lines.append(f"- {title}: not part of this site")
    return "\n".join([*lines, "", "`kbvh report --out DIR` makes the same two pages of your own results.", ""])


def notebooks(folder: Path, pages: Path) -> str:
    """Writes a page for each notebook that was run, and returns the list of them."""
    (pages / "notebooks").mkdir(exist_ok=True)
    lines = ["# Notebooks", "", "Four notebooks of the Python package, as they ran when this site was built.", "", "```{toctree}", ":maxdepth: 1", ""]
    for file in sorted(folder.glob("*.ipynb")):
        name = file.stem
        (pages / "notebooks" / f"{name}.md").write_text(python_pages.notebook(json.loads(file.read_text())["cells"], name, pages / "notebooks"))
        lines.append(f"notebooks/{name}")
    return "\n".join([*lines, "```", ""])


def decisions(staged: list[str]) -> str:
    adrs = [page for page in staged if page.startswith("core/adr/")]
    lines = ["# Decisions", "", "Decisions of weight, one page each: what was decided, why, and at which price.", ""]
    lines += ["```{toctree}", ":maxdepth: 1", "", *(page.removesuffix(".md") for page in adrs), "```", ""]
    return "\n".join(lines)


def main() -> int:
    listed = json.loads(Path(sys.argv[1]).read_text())
    results, pages, html, run = map(Path, sys.argv[2:])
    pages_of_tree = staged_pages()
    staged = set(pages_of_tree)
    for page in pages_of_tree:
        target = pages / page
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(rewritten(page, (ROOT / page).read_text(), staged, pages))
    for file in (HERE / "pages").glob("*.md"):
        # In the tree, links lead from this folder.
        text = file.read_text().replace("](../../../", "](")
        text = text.replace("](analysis/site/pages/", "](")
        (pages / file.name).write_text(filled(text, html))
    (pages / "adr.md").write_text(decisions(pages_of_tree))
    strategy_pages.write(listed, results, ROOT, pages)
    (pages / "claims.md").write_text(claims_page.page(results))
    (pages / "errors.md").write_text(error_page.page(results))
    (pages / "report.md").write_text(report_page(html, results))
    (pages / "python.md").write_text(python_pages.reference(ROOT / "analysis" / "kbvh"))
    (pages / "notebooks.md").write_text(notebooks(run, pages))
    for picture in (pages / "notebooks").glob("*.png"):  # named by raw HTML, which Sphinx does not read
        (html / "notebooks").mkdir(exist_ok=True)
        shutil.move(picture, html / "notebooks" / picture.name)
    built = (html / "lab" / "lessons" / "index.html").exists()
    (pages / "lessons.md").write_text(lessons_page.page(ROOT / "analysis" / "lessons" / "text", built))
    return 0


if __name__ == "__main__":
    sys.exit(main())
