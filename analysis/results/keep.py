"""Packs a results file for the repository: the raw times of frames at three digits, compressed.

A time of 0.0643 ms instead of 0.064262 ms is far below what two clocks differ by; sums and means keep all their digits. The same input
gives the same bytes.
"""

from __future__ import annotations

import json
import lzma
from pathlib import Path
from typing import Any

from results import files

DIGITS = 3
#: The tables of a repetition that have a number for each frame.
OF_FRAMES = ("totals", "motions")


def rounded(record: dict[str, Any]) -> dict[str, Any]:
    """Rounds a record's times of frames, in place; returns the record."""
    for one in (record.get("times") or {}).get("repetitions") or []:
        for name in OF_FRAMES:
            if name in one:
                one[name] = [float(f"{value:.{DIGITS}g}") for value in one[name]]
    return record


def packed(file: Path) -> bytes:
    """Returns a results file, packed. Raises ResultError for a line that is no record, and OSError."""
    lines = []
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            record = files.parse_json(line)
        except ValueError as problem:
            raise files.ResultError(f"{file} line {number}: {problem}.") from None
        lines.append(json.dumps(rounded(record), separators=(",", ":"), ensure_ascii=False) + "\n")
    return lzma.compress("".join(lines).encode("utf-8"))
