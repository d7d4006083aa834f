"""Joins the result files of the jobs of a study to OUT/results.jsonl. No line of any file is changed or removed."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any, Iterator


def read(file: Path) -> Iterator[tuple[bytes, dict[str, Any]]]:
    """Yields the lines of a file with their records; half a line of a killed program is left out."""
    if not file.exists():
        return
    for line in file.read_bytes().split(b"\n"):
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if isinstance(record, dict) and isinstance(record.get("key"), str):
            yield line, record


def is_finished(record: dict[str, Any]) -> bool:
    """Returns whether the configuration need not be measured again."""
    return record.get("unfinished") is not True


def append(file: Path, lines: list[bytes]) -> None:
    """Appends lines, one write each, flushed to disk. A line without an end is ended first. Raises OSError."""
    if not lines:
        return
    broken = file.exists() and file.stat().st_size > 0 and not file.read_bytes().endswith(b"\n")
    descriptor = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        for line in lines:
            text = (b"\n" if broken else b"") + line + b"\n"
            broken = False
            if os.write(descriptor, text) != len(text):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def join(out: Path, jobs: list[str]) -> int:
    """Appends the records of the jobs, in this order, to OUT/results.jsonl, those that it does not have. Of a configuration
    that several jobs or attempts have measured, the first finished record counts. Returns the number of new records."""
    known = {record["key"]: is_finished(record) for _, record in read(out / "results.jsonl")}
    new: dict[str, tuple[bytes, bool]] = {}
    for job in jobs:
        for file in sorted((out / "jobs" / job).glob("*.jsonl")):
            for line, record in read(file):
                key, finished = record["key"], is_finished(record)
                if known.get(key) or (key in new and new[key][1]):
                    continue
                if finished or key not in known:
                    new[key] = line, finished
    append(out / "results.jsonl", [line for line, _ in new.values()])
    return len(new)
