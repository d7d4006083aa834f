"""The figures of time against error as data, so that pages can draw them without the results, which are a hundred times as large.

usage: errors.py RESULTS_DIR... [--write FILE]     prints what each figure shows; FILE gets the points, times and sentences
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Optional

from figures import time_error
from figures.time_error import MEASURES, Place, Point
from results import files
from results.load import ResultError, load, read_json

#: The name of the file among the results of the reference run.
FILE = "errors.json"
SCHEMA = "kbvh-errors-1"
#: Not stored: it follows from the other points, or means nothing outside of its study.
DERIVED = ("mark", "run")


def content(found: Sequence[Place]) -> str:
    """Returns the file for some places: one line for each point."""
    figures = []
    for place in found:
        points = [{key: _finite(value) for key, value in asdict(one).items() if key not in DERIVED} for one in place.points]
        lines = ",\n  ".join(json.dumps(one, ensure_ascii=False) for one in points)
        head = json.dumps({"title": place.title, "measured": place.measured, "sentences": place.sentences}, ensure_ascii=False)
        figures.append(f'{head[:-1]}, "points": [\n  {lines}]}}')
    return f'{{"schema": "{SCHEMA}", "figures": [\n' + ",\n".join(figures) + "]}\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def read(file: Path) -> list[Place]:
    """Returns the places of a file. Raises ResultError for what is not such a file."""
    data = read_json(file, SCHEMA, ResultError)
    known = {one.name for one in fields(Point)} - set(DERIVED)
    found = []
    for figure in data.get("figures", []):
        try:
            points = []
            for one in figure["points"]:
                if set(one) != known:
                    raise KeyError(f"a point has not exactly the fields {', '.join(sorted(known))}")
                points.append(Point(**{**one, "depth": math.nan if one["depth"] is None else one["depth"]}))
            place = time_error.place_of(str(figure["title"]), points, len(found))
            place.measured, place.sentences = str(figure["measured"]), [str(one) for one in figure["sentences"]]
        except (KeyError, TypeError) as problem:
            raise ResultError(f"{file}: a field is missing or of the wrong kind: {problem}.") from None
        found.append(place)
    return found


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="errors.py", description="Prints what the figures of time against error show.")
    parser.add_argument("folders", metavar="RESULTS_DIR", type=Path, nargs="+", help="folder with results.jsonl")
    parser.add_argument("--write", metavar="FILE", type=Path, help="write the figures' data to this file")
    options = parser.parse_args(arguments)

    def work() -> int:
        found = [place for folder in options.folders for place in time_error.places(load(folder))]
        if not found:
            raise ResultError("no contestant of these results answers wrongly (plan error has such contestants).")
        for place in found:
            print(f"{place.title}\n{place.measured}")
            for said in [*place.sentences, *(time_error.finding(place, name) for name in MEASURES)]:
                print(f"- {said}")
        if options.write:
            files.write_whole(options.write, content(found))
        return 0

    return files.run_command("errors", (ResultError,), work)
