"""Files that are read with care and written whole: JSON of any make, and pages that a full disk cannot empty."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Union


def parse_json(content: str) -> Any:
    """The value of a JSON text; raises ValueError for whatever is none, also for NaN, Infinity and endless nesting."""

    def refuse(word: str) -> Any:
        raise ValueError(f"{word} is not a number of JSON")

    try:
        return json.loads(content.removeprefix("\ufeff"), parse_constant=refuse)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def read_json(file: Path) -> Any:
    """The value of a JSON file, a byte order mark before it or not. Raises OSError and ValueError."""
    return parse_json(file.read_bytes().decode("utf-8"))


def write_whole(file: Path, content: Union[str, bytes]) -> None:
    """Writes a file under another name beside it and renames it: it is as it was until all is on the disk. Raises
    OSError that names the file.
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
