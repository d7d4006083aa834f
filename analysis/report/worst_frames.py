"""The worst frames of the best refit and of the interval joins, from the results of plan `spacetime`.

usage: worst_frames.py RESULTS_DIR [--write PAGE]...
The page has the table between `<!-- worst frames -->` and `<!-- /worst frames -->`. A row is a table of results in which the join
made ahead takes part, with contestants of the same study: another one may have measured the same join at another time. A worst
frame is the median over repetitions of each repetition's longest frame, in ms, positions included: "later" leaves out frame 0,
which holds `reset` and the first query.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Optional

import numpy as np
import pandas as pd

from report import headline
from report.headline import Case, Contestant
from results import files, text
from results.load import ONE_OF_EACH_STUDY, ResultError, Study, load

AHEAD = Contestant("join made ahead", "interval_join_ahead")
BEGIN, END = "<!-- worst frames -->", "<!-- /worst frames -->"


def timed_with_ahead(study: Study) -> Study:
    """Keeps, of each group, the runs of the study that has the newest run of the join made ahead."""
    wanted = study.runs[study.runs["id"] == AHEAD.id].drop_duplicates("group", keep="last").set_index("group")["study"]
    return study if wanted.empty else replace(study, runs=study.runs[study.runs["study"] == study.runs["group"].map(wanted)])


def worst(case: Case, run: pd.Series) -> tuple[float, float]:
    """Returns a run's worst frame of all and of those after frame 0, in ms; NaN for the second if the clip has one frame."""
    raw = case.study.raw[int(run["run"])]
    frames = np.asarray(raw.totals) + np.asarray(raw.motions)
    return tuple(float(np.median(part.max(axis=1))) if part.shape[1] else np.nan for part in (frames, frames[:, 1:]))  # type: ignore[return-value]


def table(cases: list[Case]) -> str:
    """Returns the rows, and a line about machine and repetitions. Raises ResultError if no table has the join made ahead."""
    head = ["scene", "l", "best refit: worst", "join at once: worst", "join made ahead: worst", "join made ahead: worst of the later frames"]
    lines = []
    used = []
    for case in cases:
        ahead = case.run(AHEAD)
        if ahead is None or case.refit is None:
            continue
        used.append(case)
        cells = [case.scene, f"{case.l:g}"]
        for run, part in ((case.refit, 0), (case.run(headline.JOIN), 0), (ahead, 0), (ahead, 1)):
            if run is None:
                cells.append(text.MISSING)
                continue
            cells.append(text.milliseconds(worst(case, run)[part]) + (" ?" if run["disturbed"] else ""))
        lines.append("| " + " | ".join(cells) + " |")
    if not lines:
        raise ResultError("No table has interval_join_ahead and a refit: the results are not those of plan spacetime.")
    rows = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines]
    return "\n".join([*rows, "", f"Milliseconds, exact triangle tests and positions included. {headline.facts(used)}"]) + "\n"


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="worst_frames.py", description="Writes the table of worst frames from the results of plan spacetime.")
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl")
    parser.add_argument("--write", metavar="PAGE", type=Path, action="append", default=[], help="insert it into this page; repeatable")
    options = parser.parse_args(arguments)

    def work() -> int:
        rows = table(headline.cases(timed_with_ahead(load(options.folder, ONE_OF_EACH_STUDY))))
        pages = {page: files.inserted(page.read_text(encoding="utf-8"), BEGIN, END, rows, str(page)) for page in options.write}
        for page, content in pages.items():
            files.write_whole(page, content)
        if not options.write:
            print(rows, end="")
        return 0

    return files.run_command("worst_frames", (ResultError,), work)
