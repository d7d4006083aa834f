"""Gathers the pages of the site: the tree's own Markdown, the pages of this folder, and pages made from registry and results.

usage: stage.py LIST_JSON RESULTS_DIR PAGES_DIR COURSE_DIR
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
import lessons_page  # noqa: E402
import strategy_pages  # noqa: E402

#: Pages of the tree that are part of the site, in their places.
TREE = [
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "core/README.md", "experiments/README.md", "experiments/RESULTS.md",
    "analysis/reference/README.md",
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


def decisions(staged: list[str]) -> str:
    adrs = [page for page in staged if page.startswith("core/adr/")]
    lines = ["# Decisions", "", "Decisions of weight, one page each: what was decided, why, and at which price.", ""]
    lines += ["```{toctree}", ":maxdepth: 1", "", *(page.removesuffix(".md") for page in adrs), "```", ""]
    return "\n".join(lines)


def main() -> int:
    listed, results, pages = json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]), Path(sys.argv[3])
    pages_of_tree = staged_pages()
    staged = set(pages_of_tree)
    for page in pages_of_tree:
        target = pages / page
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(rewritten(page, (ROOT / page).read_text(), staged, pages))
    for file in (HERE / "pages").glob("*.md"):
        # In the tree, links lead from this folder.
        text = file.read_text().replace("](../../../", "](")
        (pages / file.name).write_text(text.replace("{{api}}", '<a href="api/index.html">C++ interfaces</a>'))
    (pages / "adr.md").write_text(decisions(pages_of_tree))
    strategy_pages.write(listed, results, ROOT, pages)
    (pages / "claims.md").write_text(claims_page.page(results))
    built = (Path(sys.argv[4]) / "index.html").exists()
    (pages / "lessons.md").write_text(lessons_page.page(ROOT / "analysis" / "lessons" / "text", built))
    return 0


if __name__ == "__main__":
    sys.exit(main())
