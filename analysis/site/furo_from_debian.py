"""Sphinx extension: makes Debian's furo work from a folder.

Debian compiles furo's sources with other tools than furo does. Its style sheet imports normalize.css from /javascript of a web server, and lacks
the colours for a dark scheme that the reader's system asks for; its script is a module that is loaded as a plain one. So pages stand in
a white frame, stay bright, and have a dead theme switch. The build writes both files again: the imported sheet becomes a neighbour, the
dark colours follow the system, and the imported script becomes a part of the script.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Optional

#: Where Debian keeps what style sheets import from /javascript.
JAVASCRIPT = Path("/usr/share/javascript")


def mended_style(text: str, folder: Path, javascript: Path = JAVASCRIPT) -> str:
    """Returns a style sheet whose imports from /javascript lie in `folder`, where they are copied to, and whose dark colours are used
    where the reader's system asks for them. Raises FileNotFoundError or ValueError."""

    def copy(match: re.Match[str]) -> str:
        source = javascript / match.group(1)
        (folder / source.name).write_bytes(source.read_bytes())
        return f'@import url("{source.name}")'

    text = re.sub(r"@import url\(/javascript/([^)]+)\)", copy, text)
    if "prefers-color-scheme" in text:
        return text
    dark = re.search(r'body\[data-theme="dark"\] \{(.*?)\}', text, re.S)
    if not dark:
        raise ValueError("furo.css has no colours for the dark theme")
    return f'{text}\n@media screen and (prefers-color-scheme: dark) {{\n  body:not([data-theme="light"]) {{{dark.group(1)}}}\n}}\n'


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
