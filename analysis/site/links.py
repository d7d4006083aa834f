"""Checks every link between files of a site: the file exists, and so does the anchor in it.

usage: links.py FOLDER
Links to other sites are not followed: there is no network. Doxygen's pages and those of the lab are checked for files only, because
their scripts make some of the anchors, and a link to the lab has a state where others have an anchor.
"""

from __future__ import annotations

import sys
import urllib.parse
from html.parser import HTMLParser
from pathlib import Path


class Page(HTMLParser):
    """The links and the anchors of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text(errors="replace"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if value is None:
                continue
            if name in ("href", "src"):
                self.links.append(value)
            elif name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value)


def dead_links(folder: Path) -> tuple[list[str], int]:
    """Returns a sentence for each dead link, and the number of links."""
    pages = {file.resolve(): Page(file) for file in sorted(folder.rglob("*.html"))}

    def generated(file: Path) -> bool:
        return file.relative_to(folder.resolve()).parts[0] in ("api", "lab")

    dead, count = [], 0
    for file, page in pages.items():
        for link in dict.fromkeys(page.links):
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc or link.startswith("javascript:"):
                continue
            count += 1
            target = (file.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else file
            name = file.relative_to(folder.resolve())
            if not target.exists():
                dead.append(f"{name}: {link} leads to no file")
            elif parts.fragment and target in pages and not (generated(file) or generated(target)):
                if urllib.parse.unquote(parts.fragment) not in pages[target].anchors:
                    dead.append(f"{name}: {link} leads to no such place")
    return dead, count


def main() -> int:
    dead, count = dead_links(Path(sys.argv[1]))
    print("\n".join(dead) or f"{count} links, none of them dead")
    return 1 if dead else 0


if __name__ == "__main__":
    sys.exit(main())
