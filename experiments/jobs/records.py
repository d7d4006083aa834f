"""Joins the result files of the jobs of a study to OUT/results.jsonl. No line of any file is changed or removed."""

from __future__ import annotations

import errno
import json
import os
import re
from datetime import datetime
from pathlib import Path
from typing import Any, Iterator

#: Exit codes of kbvh after which the records are complete: all guarantees hold, or one is broken.
COMPLETE = (0, 1)


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


def is_time(text: Any) -> bool:
    """Whether a text is a time as kbvh writes it, 2026-01-31T23:59:59Z, on a day that exists."""
    if not isinstance(text, str) or not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", text, re.ASCII):
        return False
    try:
        datetime.strptime(text, "%Y-%m-%dT%H:%M:%SZ")
    except ValueError:
        return False
    return True


def rank(record: dict[str, Any]) -> tuple[bool, str]:
    """Orders the records of one key: the largest counts, the newest finished one; those without a valid time are the oldest. Of
    equal ones, the later one in the file. This is the rule of `kbvh merge` (experiments/results/merge.cpp), and a test compares
    the two."""
    when = record.get("when")
    return record.get("unfinished") is not True, when if isinstance(when, str) and is_time(when) else ""


def keys(file: Path) -> set[str]:
    """Returns the keys of the records of a file."""
    return {record["key"] for _, record in read(file)}


def done_code(out: Path, job: str, known: set[str]) -> int | None:
    """Returns kbvh's exit code of a job that is finished, and whose records are all there: `known` are the keys of
    OUT/results.jsonl. Else None."""
    try:
        done = json.loads((out / "jobs" / job / "done").read_text())
        code, wanted = done["exit"], set(done["keys"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if code not in COMPLETE:
        return None
    missing = wanted - known
    for file in (out / "jobs" / job).glob("*.jsonl") if missing else ():
        missing -= keys(file)
    return None if missing else code


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
