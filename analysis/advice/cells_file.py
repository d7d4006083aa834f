"""The cells of studies as data: what the rule needs of them, without the results, which are hundreds of times as large.

usage: advice.py RESULTS_DIR... [--cells FILE] [--write PAGE]

Prints the table of advice of some folders of results, or of files that --cells wrote. --write puts it between `<!-- advice -->` and
`<!-- /advice -->` of a page instead.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Optional

from advice import advice
from advice.advice import Cell, Facts, Situation, Span
from results import files, text
from results.load import ResultError, Study, load, read_json

#: The name of the file among the results of the reference run.
FILE = "cells.json"
SCHEMA = "kbvh-cells-1"


@dataclass
class Cells:
    """Cells, and when and where they were measured."""

    measured: list[list[str]]  #: plan, days, commit and processor
    cells: list[Cell]

    @property
    def told(self) -> str:
        """Says when and where they were measured; plans of the same day, commit and processor together."""
        plans: dict[tuple[str, ...], list[str]] = {}
        for plan, *rest in self.measured:
            plans.setdefault(tuple(rest), []).append(f"`{plan}`")
        return "; ".join(f"plan{'s' * (len(names) > 1)} {text.listing(names)}, {days}, commit {commit}, {cpu}" for (days, commit, cpu), names in plans.items())

    @property
    def short(self) -> str:
        """Says where and on which days, without plans and commits, as in "AMD EPYC, 2026-11-27 to 2026-11-28"."""
        days = sorted(day for _, days, _, _ in self.measured for day in days.split(" to "))
        span = " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""
        return ", ".join([*dict.fromkeys(cpu for *_, cpu in self.measured if cpu), *([span] if span else [])])


def of_study(study: Study) -> Cells:
    """Returns the cells of a study."""
    return Cells(_measured(study), list(advice.cells(study)))


def _measured(study: Study) -> list[list[str]]:
    found: dict[tuple[str, str, str], set[str]] = {}
    for row in study.runs[["plan", "when", "commit", "dirty", "cpu"]].itertuples():
        commit = f"{row.commit[:8]}{' with local changes' if row.dirty else ''}"
        found.setdefault((str(row.plan.get("name", "")) or "without a name", commit, row.cpu), set()).add(str(row.when)[:10] or "day not recorded")
    return [[plan, " to ".join(dict.fromkeys([min(days), max(days)])), commit, cpu] for (plan, commit, cpu), days in found.items()]


def content(found: Cells) -> str:
    """Returns the file for some cells, with the interval of each ratio to the best refit."""
    facts = {id: cell.facts[id] for cell in found.cells for id in cell.speeds}
    lines = []
    for cell in found.cells:
        one = {
            "title": cell.title, "asks": cell.asks, "frames": cell.frames, "primitives": cell.primitives, "best_refit": cell.best_refit, "doubtful": sorted(cell.doubtful),
            "speeds": _short(cell.speeds), "times": _short(cell.times),
            "spans": {id: [_digits(span[0]), _digits(span[1]), span[2]] for id in sorted(cell.speeds) if id != cell.best_refit and (span := cell.span(id))},
        }  # fmt: skip
        lines.append(json.dumps(one, ensure_ascii=False))
    strategies = json.dumps({id: astuple(facts[id]) for id in sorted(facts)}, ensure_ascii=False)
    return (
        f'{{"schema": "{SCHEMA}", "measured": {json.dumps(found.measured, ensure_ascii=False)},\n"strategies": {strategies},\n"cells": [\n'
        + ",\n".join(lines) + "]}\n"
    )  # fmt: skip


def _digits(value: float) -> float:
    return float(f"{value:.7g}")


def _short(values: dict[str, float]) -> dict[str, float]:
    return {id: _digits(values[id]) for id in sorted(values)}


def read(file: Path) -> Cells:
    """Returns the cells of a file. Raises ResultError for what is not such a file."""
    data = read_json(file, SCHEMA, ResultError)
    try:
        facts = {id: Facts(*one) for id, one in data["strategies"].items()}
        return Cells([[str(word) for word in one] for one in data["measured"]], [_cell(one, facts) for one in data["cells"]])
    except (AttributeError, KeyError, TypeError, ValueError) as problem:
        raise ResultError(f"{file}: a field is missing or of the wrong kind: {problem}.") from None


def _cell(one: dict[str, Any], facts: dict[str, Facts]) -> Cell:
    spans: dict[str, Span] = {id: (float(low), float(high), bool(is_interval)) for id, (low, high, is_interval) in one["spans"].items()}
    speeds, times = one["speeds"], one["times"]
    if set(speeds) != set(times) or not set(speeds) <= set(facts) or one["frames"] not in advice.FRAMES:
        raise ValueError("speeds, times and strategies do not belong together, or the frames have no class")
    return Cell(one["title"], one["asks"], one["frames"], float(one["primitives"]), one["best_refit"], speeds, times, frozenset(one["doubtful"]), facts, spans.get)


def markdown(found: Sequence[Situation]) -> str:
    """Returns the advice as a table of Markdown."""
    lines = ["| situation | cells | " + " | ".join(advice.FORESIGHT) + " |", "|---|---|" + "---|" * len(advice.FORESIGHT)]
    for one in found:
        row = [f"{one.asks}, {advice.said_of(one.frames)}", str(one.cells)]
        last = ""
        for _, best in one.advice:
            row.append(text.MISSING if best is None else "the same" if best.id == last else f"{best.title} (`{best.id}`): {best.says}, at {best.costs}")
            last = best.id if best else ""
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


def table(found: Cells) -> str:
    """Returns the table of some cells, and when they were measured."""
    return f"{markdown(advice.situations(found.cells))}\nMeasured: {found.told}.\n"


def inserted(page: str, table: str, place: str) -> str:
    """Returns a page with its table replaced. Raises ResultError for a page without a place for it."""
    return files.inserted(page, "<!-- advice -->", "<!-- /advice -->", table, place)


def gathered(places: Sequence[Path]) -> Cells:
    """Returns the cells of folders of results and of files, together."""
    every = [read(place) if place.is_file() else of_study(load(place)) for place in places]
    return Cells([row for one in every for row in one.measured], [cell for one in every for cell in one.cells])


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="advice.py", description="Prints which strategy the results recommend for what.")
    parser.add_argument("places", metavar="RESULTS_DIR", type=Path, nargs="+", help="folder with results.jsonl, or file of --cells")
    parser.add_argument("--cells", metavar="FILE", type=Path, help="write the cells to this file")
    parser.add_argument("--write", metavar="PAGE", type=Path, help="insert the table into this page")
    options = parser.parse_args(arguments)

    def work() -> int:
        found = gathered(options.places)
        if options.cells:
            files.write_whole(options.cells, content(found))
            found = read(options.cells)
        if options.write:
            page = options.write.read_text(encoding="utf-8")
            files.write_whole(options.write, inserted(page, table(found), str(options.write)))
        else:
            print(table(found), end="")
        return 0

    return files.run_command("advice", (ResultError,), work)
