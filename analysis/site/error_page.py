"""The page of time against error: every figure of a results folder's errors.json, with a sentence on what each panel shows."""

from __future__ import annotations

from pathlib import Path

from figures import time_error, time_error_file, time_error_panels
from report.report import environment

#: The theme's colours under the names that the figures use, and the dark ones where the reader's switch or system asks for them.
COLOURS = """<style>
.errors { --ink: var(--color-foreground-primary); --soft: var(--color-foreground-muted); --line: var(--color-background-border);
  --page: var(--color-background-primary); --ground: var(--color-background-secondary); --accent: var(--color-brand-primary); }
.errors figure { margin: 1rem 0 2rem; }
.errors .small { color: var(--soft); font-size: .82rem; }
.errors .scroll { overflow-x: auto; }
.errors .error-table { border-collapse: collapse; font-size: .84rem; margin: .8rem 0; }
.errors .error-table :is(td, th) { padding: .2rem .5rem .2rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
.errors .error-table .n { text-align: right; padding-left: .4rem; }
.errors .tag { font-size: .75rem; color: var(--accent); }
.errors figcaption.title { display: none; }  /* the heading says it */
.errors summary { cursor: pointer; }
@media (max-width: 760px) { .errors .error-table { font-size: .7rem; } .errors .error-table :is(td, th) { padding: .25rem .2rem .25rem 0; }
  .errors .error-table td:nth-child(2) { overflow-wrap: anywhere; } .errors .error-table .tag { font-size: .65rem; }
  .errors .error-table .n { padding-left: .1rem; } }
body[data-theme="dark"] .errors [style] { --paint: var(--d); }
body[data-theme="light"] .errors [style] { --paint: var(--l); }
</style>"""


def page(results: Path) -> str:
    """Returns the page, in Markdown. Raises ResultError for a file of another kind."""
    lines = ["# Time against error", ""]
    file = results / time_error_file.FILE
    if not file.exists():
        return "\n".join([*lines, f"There is no `{file.name}` in `{results.name}`; `analysis/errors.py` makes it from results of plan `error`.", ""])
    found = time_error_panels.shown(time_error_file.read(file))
    lines += [
        "What does an exact answer cost, and what does a fast wrong one miss? The contestants of plan `error` are wrong on purpose, most of them as "
        "far as a dial says: boxes are refitted only at every n-th frame, with a margin or without; boxes or positions have fewer digits; a bound on "
        "the motion is too small; a query stops after a budget of box tests; event times come from a textbook's formula; a peer uses its own triangle "
        "test. Exact contestants run by turns with them, and every answer is compared with the exact one.",
        "",
        f"The figures are drawn from `{file.name}` in `{results.name}`. `kbvh run --plan experiments/plans/error.json --out results/error` measures "
        "again, and `analysis/errors.py results/error --write FILE` makes the file.",
        "",
    ]
    macros = environment().get_template("error_figure.html.j2").module
    html = [COLOURS, str(macros.style())]  # type: ignore[attr-defined]
    for one in found:
        title = one.place.title.replace(" = ", "\u00a0=\u00a0")
        lines += [f"## {title}", "", *(f"{said}\n" for said in one.sentences), f"{one.place.measured}", ""]
        html.append(str(macros.figure(one, time_error.SLOW, True)))  # type: ignore[attr-defined]
        lines += ["```{raw} html", '<div class="errors">', *html, "</div>", "```", ""]
        html = []
    return "\n".join(lines)
