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


def rank(record: dict[str, Any]) -> tuple[bool, str]:
    """Orders the records of one key: the largest counts, the newest finished one. Of equal ones, the one that stands later.
    This is the rule of `kbvh merge` (experiments/results/merge.cpp), and a test compares the two."""
    when = record.get("when")
    return record.get("unfinished") is not True, when if isinstance(when, str) else ""


def identity(line: bytes, record: dict[str, Any]) -> tuple[Any, ...]:
    """Returns what two copies of one measurement share."""
    return (record["key"], record.get("run") or line, record.get("when"))


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
    """Appends records of the jobs, in this order, to OUT/results.jsonl: of each configuration the one that counts, unless it is
    the last of its key there, which readers take. Returns the number of new records."""
    best: dict[str, tuple[tuple[bool, str], bytes, tuple[Any, ...]]] = {}  # by key: rank, line and identity
    last: dict[str, tuple[Any, ...]] = {}  # by key: identity of the last record in the results
    order: dict[str, None] = {}  # keys of the jobs

    def take(line: bytes, record: dict[str, Any]) -> None:
        known = best.get(record["key"])
        if known is None or rank(record) >= known[0]:
            best[record["key"]] = rank(record), line, identity(line, record)

    for line, record in read(out / "results.jsonl"):
        take(line, record)
        last[record["key"]] = identity(line, record)
    for job in jobs:
        for file in sorted((out / "jobs" / job).glob("*.jsonl")):
            for line, record in read(file):
                take(line, record)
                order[record["key"]] = None
    new = [best[key][1] for key in order if best[key][2] != last.get(key)]
    append(out / "results.jsonl", new)
    return len(new)
