"""Turns a folder of results into explorer.html: one page with its data inside, for any browser, without a network.

usage: explore.py RESULTS_DIR [--title TEXT]

The page's program is analysis/explorer, built by `analysis/explorer/build` (Node.js and npm).
"""

from __future__ import annotations

import argparse
import hashlib
import html
import json
import sys
from pathlib import Path
from typing import Any, Optional

from claims import claims as paper_claims
from claims.claim_points import ClaimError
from explorer import explorer_data
from results import files
from results.load import ONE_OF_EACH_COMMIT, ResultError, Study, load

PROGRAM = Path(__file__).resolve().parent / "dist"
PAGE = "explorer.html"
TITLE = "BVH update strategies, measured"


class NotBuilt(Exception):
    """Says that the page's program has not been built, or from other sources than those next to it."""


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns its exit code: 0, or 2 for unusable results or a program that is not built."""
    parser = argparse.ArgumentParser(
        prog="explore.py", description="Turns RESULTS_DIR/results.jsonl into RESULTS_DIR/explorer.html.",
        epilog="example: explore.py results --title 'Both machines'",
    )  # fmt: skip
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl")
    parser.add_argument("--title", default="", help="heading of the page (default: the plan's name)")
    options = parser.parse_args(arguments)
    return files.run_command("explore", (ResultError, ClaimError, NotBuilt), lambda: run(options))


def run(options: argparse.Namespace) -> int:
    """Does what the options say; returns the exit code."""
    program()
    study = load(options.folder, ONE_OF_EACH_COMMIT)
    page = write(study, options.folder, options.title)
    for note in study.notes:
        print(f"explore: {note}", file=sys.stderr)
    print(page)
    return 0


def program() -> tuple[str, str]:
    """Returns the page's script and style. Raises NotBuilt without them, and for those of other sources: an older program shows other answers."""
    builds = f"{PROGRAM.parent / 'build'} builds it, with Node.js and npm."
    try:
        script, style = ((PROGRAM / name).read_text(encoding="utf-8") for name in ("explorer.js", "explorer.css"))
    except OSError:
        raise NotBuilt(f"the explorer's program is not built: {builds}") from None
    stamp = PROGRAM / "sources.sha256"
    if (PROGRAM.parent / "src").is_dir() and (not stamp.exists() or stamp.read_text(encoding="utf-8").strip() != sources(PROGRAM.parent)):
        raise NotBuilt(f"the explorer's program was built from other sources: {builds}")
    return script, style


def sources(folder: Path) -> str:
    """Returns the hash of the sources that a program is built from, as `build` writes it next to the program."""
    names = [name for name in ("package.json", "package-lock.json", "build") if (folder / name).is_file()]
    names += [str(file.relative_to(folder)) for file in (folder / "src").rglob("*") if file.is_file()]
    lines = [f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in sorted(names)]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def write(study: Study, folder: Path, title: str, claims: Optional[paper_claims.Claims] = None) -> Path:
    """Writes the page of a study that was loaded with ONE_OF_EACH_COMMIT; returns its path. Raises NotBuilt."""
    script, style = program()
    # Claims are judged on the newest measurements, as in the report.
    claims = claims or paper_claims.evaluate(load(folder), folder)
    content = explorer_data.data(study, title, claims, folder)
    path = folder / PAGE
    files.write_whole(path, page(content, script, style))
    return path


def page(content: dict[str, Any], script: str, style: str) -> str:
    """Returns the page. Its data cannot end the element that holds them."""
    data = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    names = list(dict.fromkeys(plan["name"] for plan in content["plans"] if plan["name"]))
    script = script.replace("</script", "<\\/script")
    about = content["title"] or (f"{', '.join(names)} study" if len(names) == 1 else ", ".join(names) if len(names) < 4 else f"{len(names)} studies")
    title = html.escape(f"kbvh explorer: {about or TITLE}")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<noscript><p>This page needs JavaScript; report.html next to it does not.</p></noscript>
<script type="application/json" id="data">{data}</script>
<script>{script}</script>
</body>
</html>
"""
