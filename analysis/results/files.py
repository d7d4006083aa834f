"""Careful reading and atomic writing of files: JSON from any source, and pages that a full disk cannot truncate."""

from __future__ import annotations

import errno
import json
import lzma
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Union


class ResultError(Exception):
    """Reports an unusable result file in one sentence for the user."""


def parse_json(content: str) -> Any:
    """Returns the value of a JSON text; raises ValueError for invalid JSON, including NaN, Infinity and excessive nesting.
    """

    def refuse(word: str) -> Any:
        raise ValueError(f"{word} is not a number of JSON")

    try:
        return json.loads(content.removeprefix("\ufeff"), parse_constant=refuse)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def read_json(file: Path) -> Any:
    """Returns the value of a JSON file, with or without a byte order mark. Raises OSError and ValueError."""
    return parse_json(file.read_bytes().decode("utf-8"))


def read_packed(file: Path) -> bytes:
    """Returns the content of a file, or that of `file`.xz if only this exists. Raises OSError."""
    packed = file.with_name(file.name + ".xz")
    if file.exists() or not packed.exists():
        return file.read_bytes()
    try:
        return lzma.decompress(packed.read_bytes())
    except lzma.LZMAError as problem:
        raise OSError(errno.EIO, f"it is damaged ({problem})", str(packed)) from problem


def complaint(error: OSError) -> tuple[str, int]:
    """Returns a sentence for an error of the system and an exit code: 3 where no input is at fault, 2 otherwise."""
    if error.errno in (errno.EMFILE, errno.ENFILE, errno.ENOMEM):
        return f"{error.strerror}: the limits of this process (ulimit) or machine are too low.", 3
    return f"{error.filename} cannot be written: {error.strerror}.", 2


def run_command(name: str, expected: tuple[type[Exception], ...], work: Callable[[], int]) -> int:
    """Runs the work of a command; returns its exit code. Expected errors and those of the system become one sentence on stderr,
    and the codes 2 and 3 (`complaint`)."""
    try:
        return work()
    except expected as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        text, code = complaint(error)
        print(f"{name}: {text}", file=sys.stderr)
        return code


def inserted(page: str, begin: str, end: str, content: str, place: str) -> str:
    """Returns a page with what stands between two lines replaced by `content`, which ends with a line's end. `place` names the page.
    Raises ResultError if the lines are not there once, in this order.
    """
    begin, end = begin + "\n", end + "\n"
    if page.count(begin) != 1 or page.count(end) != 1 or page.index(end) < page.index(begin):
        raise ResultError(f"{place} should have the lines {begin.strip()} and {end.strip()} once, in this order.")
    return page.split(begin)[0] + begin + content + end + page.split(end)[1]


def write_whole(file: Path, content: Union[str, bytes]) -> None:
    """Writes a file under a temporary name and renames it: the old content stays until all is on disk. Raises OSError that
    names the file.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    temporary = file.with_name(f".{file.name[:100]}.tmp-{os.getpid()}")
    try:
        try:
            with temporary.open("wb") as out:
                out.write(data)
                out.flush()
                os.fsync(out.fileno())
            os.replace(temporary, file)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as problem:
        raise OSError(problem.errno, problem.strerror or str(problem), str(file)) from problem
