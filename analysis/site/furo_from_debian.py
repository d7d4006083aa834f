"""Sphinx extension: makes Debian's furo work from a folder.

Debian ships furo's sources as they are. Its style sheet imports normalize.css from /javascript of a web server, and its script is a
module that is loaded as a plain one, so no page has styles that reset, a working theme switch or a marked table of contents. The
build writes both files again: the imported sheet becomes a neighbour, and the imported script a part of the script.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Optional

#: Where Debian keeps what style sheets import from /javascript.
JAVASCRIPT = Path("/usr/share/javascript")


def mended_style(text: str, folder: Path, javascript: Path = JAVASCRIPT) -> str:
    """Returns a style sheet whose imports from /javascript lie in `folder`, where they are copied to. Raises FileNotFoundError."""

    def copy(match: re.Match[str]) -> str:
        source = javascript / match.group(1)
        (folder / source.name).write_bytes(source.read_bytes())
        return f'@import url("{source.name}")'

    return re.sub(r"@import url\(/javascript/([^)]+)\)", copy, text)


def mended_script(text: str, folder: Path) -> str:
    """Returns a script with the scripts of `folder` that it imports put in front: they define globals, and a page that is opened
    from a folder cannot load modules."""
    imports = re.compile(r'^import \w+ from "\./([\w.-]+)";\n', re.M)
    before = [(folder / name).read_text() for name in imports.findall(text)]
    return "".join(f"{part}\n" for part in before) + imports.sub("", text)


def mend(app: Any, error: Optional[Exception]) -> None:
    if error or app.builder.format != "html":
        return
    static = Path(app.outdir) / "_static"
    for name, mended in (("styles/furo.css", mended_style), ("scripts/furo.js", mended_script)):
        file = static / name
        if file.exists():
            file.write_text(mended(file.read_text(), file.parent))


def setup(app: Any) -> dict[str, Any]:
    app.connect("build-finished", mend)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
