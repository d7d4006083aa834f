"""The ratios of kbvh_broad_phase_bench and their targets, as a Markdown table.

usage: broad_phase_table.py FILE.json [--write analysis/guides/ipc-toolkit.md]
FILE.json is what `kbvh_broad_phase_bench FRAMES REPETITIONS FILE.json` wrote; a page has the table between
`<!-- broad phase -->` and `<!-- /broad phase -->`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, Optional

from results import files
from results.files import ResultError

VERDICTS = ("reported", "missed", "met", "met, and the aim")


def read(file: Path) -> dict[str, Any]:
    """Reads a file of the bench. Raises ResultError."""
    try:
        result = files.read_json(file)
    except OSError as error:
        raise ResultError(f"{file} cannot be read: {error.strerror}.") from None
    except ValueError:
        raise ResultError(f"{file} is not JSON.") from None
    if not isinstance(result, dict) or result.get("program") != "kbvh_broad_phase_bench":
        raise ResultError(f"{file} was not written by kbvh_broad_phase_bench.")
    return result


def _ms(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def table(result: dict[str, Any]) -> str:
    """Returns the rows, and a line about the run. Raises ResultError for a field that is missing or wrong."""
    try:
        times = {one["name"]: one["median_ms"] for comparison in result["comparisons"] for one in comparison["contestants"]}
        lines = [
            "| what | ms | over ms | ratio | at least | aim | verdict |",
            "|---|---|---|---|---|---|---|",
        ]
        for row in result["targets"]:
            if row["verdict"] not in VERDICTS:
                raise ValueError(f"verdict is {json.dumps(row['verdict'])}, but should be one of {', '.join(VERDICTS)}")
            least, aim = (f"{row[key]:g}x" if row[key] else "–" for key in ("at_least", "aim"))
            lines.append(
                f"| {row['what']} | {_ms(times[row['ours']])} | {_ms(times[row['rival']])} | {row['ratio']:.2f}x | {least} | {aim} "
                f"| {row['verdict']} |"
            )
        machine = result["machine"]
        dirty = " with local changes" if result["dirty"] else ""
        lines += [
            "",
            f"Measured: {result['time'][:10]}, commit {result['commit'][:8]}{dirty}, {machine['cpu']}, {result['kernels']}, frames "
            f"{result['frames']}, {result['repetitions']} repetitions by turns, medians of processor time, one thread.",
        ]
        return "\n".join(lines) + "\n"
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        what = f"the field {error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise ResultError(f"The file of kbvh_broad_phase_bench: {what}.") from None


def inserted(page: str, rows: str, place: str) -> str:
    """Returns a page with its table replaced. Raises ResultError for a page without a place for it."""
    return files.inserted(page, "<!-- broad phase -->", "<!-- /broad phase -->", rows, place)


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="broad_phase_table.py", description="Prints what kbvh_broad_phase_bench measured.")
    parser.add_argument("file", metavar="FILE.json", type=Path, help="what kbvh_broad_phase_bench wrote")
    parser.add_argument("--write", metavar="PAGE", type=Path, help="insert the table into this page")
    options = parser.parse_args(arguments)

    def work() -> int:
        rows = table(read(options.file))
        if options.write is None:
            print(rows, end="")
        else:
            files.write_whole(options.write, inserted(options.write.read_text(encoding="utf-8"), rows, str(options.write)))
        return 0

    return files.run_command("broad_phase_table.py", (ResultError,), work)
