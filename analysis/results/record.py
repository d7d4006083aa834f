"""Reads fields of one record, with messages that name the line and the field."""

from __future__ import annotations

import json
import sys
from typing import Any

from results.files import ResultError

#: Stands for no default: the field must be there.
MISSING = object()


class Record:
    """One line, with its place in the file for messages."""

    def __init__(self, data: dict[str, Any], place: str) -> None:
        self.data = data
        self.place = place

    def get(self, path: str, default: Any = MISSING) -> Any:
        value: Any = self.data
        for step in path.split("."):
            value = value.get(step, MISSING) if isinstance(value, dict) else MISSING
            if value is MISSING:
                break
        if value is MISSING or (value is None and default is not MISSING):
            if default is MISSING:
                raise ResultError(f"{self.place}: the field {path} is missing.")
            return default
        return value

    def text(self, path: str, default: Any = MISSING) -> str:
        value = self.get(path, default)
        if not isinstance(value, str):
            raise ResultError(f"{self.place}: {path} should be a text, but is {json.dumps(value)}.")
        return value

    def number(self, path: str, default: Any = MISSING) -> float:
        value = self.get(path, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ResultError(f"{self.place}: {path} should be a number, but is {json.dumps(value)}.")
        if value is not default and not abs(value) <= sys.float_info.max:
            raise ResultError(f"{self.place}: {path} is too large for a number.")
        return float(value)

    def flag(self, path: str, default: Any = MISSING) -> bool:
        value = self.get(path, default)
        if not isinstance(value, bool):
            raise ResultError(f"{self.place}: {path} should be true or false, but is {json.dumps(value)}.")
        return value
