"""The page of the course: its lessons from their front matter, linked if the course is built."""

from __future__ import annotations

import re
from pathlib import Path


def front_matter(text: str) -> dict[str, str]:
    """Returns the simple keys of a lesson's front matter."""
    found = re.match(r"---\n(.*?)\n---\n", text, re.S)
    return {key: value.strip('"') for key, value in re.findall(r"^(\w+): (.+)$", found.group(1), re.M)} if found else {}


def page(texts: Path, built: bool) -> str:
    """Returns the page. `built`: the course stands in the site's folder lab/lessons."""
    lines = [
        "# Lessons", "",
        "A course on kinetic bounding volume hierarchies, for a lecture or for reading alone. Each lesson is a page with predictions, proofs, "
        "exercises, and a lab that checks them: the project's own C++ runs there, in the browser.", "",
    ]  # fmt: skip
    if built:
        lines += ['<a href="lab/lessons/index.html">Open the course</a>, or <a href="lab/index.html">the lab alone</a>.', ""]
    else:
        lines += ["`experiments/lab` builds it: open `build/lab/lessons/index.html`. This site was built without it.", ""]
    lines += ["| lesson | minutes | what it is about |", "|---|---|---|"]
    for file in sorted(texts.glob("*.md")):
        about = front_matter(file.read_text())
        title = f"{about['lesson']}. {about['title']}"
        if built:
            title = f'<a href="lab/lessons/{file.stem}.html">{title}</a>'
        lines.append(f"| {title} | {about['minutes']} | {about['lead']} |")
    return "\n".join([*lines, ""])
