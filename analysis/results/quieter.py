"""Of several runs of one plan by one commit, the quieter one of each table.

A machine that is shared is quiet for a while. Played twice, a plan has tables in which fewer contestants were disturbed. Each scene, l,
scalar, order and question of each study is taken as a whole from the run with the most contestants and, of these, the fewest disturbed
ones; of equal ones, from the first. Nothing is chosen by a time.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from results import files
from results.load import FILE_NAME, ONE_OF_EACH_STUDY, ResultError, load


@dataclass(frozen=True)
class Table:
    """One table of one run."""

    lines: list[str]  #: of its results file
    disturbed: int  #: contestants


def tables(folder: Path) -> tuple[set[str], dict[tuple[str, ...], Table]]:
    """Returns the commits of a folder of results, and its tables. Raises ResultError."""
    study = load(folder, ONE_OF_EACH_STUDY)
    lines = files.read_packed(folder / FILE_NAME).decode("utf-8").split("\n")
    asks = ["scene_name", "hash", "scalar", "l", "frames", "answer", "rays", "within", "held_to", "study"]
    found = {}
    for asked, rows in study.runs.groupby(asks, sort=False, dropna=False):
        key = tuple(map(str, asked))  # what is not known is equal, too
        runs = [int(run) for run in rows["run"]]
        found[key] = Table([lines[run] for run in runs], sum(bool(study.raw[run].disturbed) for run in runs if run in study.raw))
    return set(study.runs["commit"]), found


def quieter(folders: list[Path]) -> tuple[list[str], list[str]]:
    """Returns the lines of a results file, and for each table where it is from. Raises ResultError."""
    commits, runs = zip(*map(tables, folders))
    if len(set.union(*commits)) != 1:
        raise ResultError(f"{', '.join(map(str, folders))} are not results of one commit: their times cannot be mixed.")
    lines, said = [], []
    for key in dict.fromkeys(key for run in runs for key in run):
        of = [(folder, run[key]) for folder, run in zip(folders, runs) if key in run]
        folder, table = min(of, key=lambda one: (-len(one[1].lines), one[1].disturbed))
        lines += table.lines
        counts = ", ".join(f"{one.disturbed} of {len(one.lines)} disturbed in {place}" for place, one in of)
        study = f"{key[-1]}: " if key[-1] else ""
        said.append(f"{study}{key[0]}, l = {float(key[3]):g}: {counts}: {folder}")
    return lines, said


def main() -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="RESULTS_DIR")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="folder for results, which must not have any")
    arguments = parser.parse_args()

    def work() -> int:
        out = arguments.out / FILE_NAME
        if out.exists():
            raise ResultError(f"{out} exists already.")
        lines, said = quieter(arguments.folders)
        arguments.out.mkdir(parents=True, exist_ok=True)
        files.write_whole(out, "\n".join(lines) + "\n")
        print("\n".join(said))
        return 0

    return files.run_command("quieter.py", (ResultError,), work)
