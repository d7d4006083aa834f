#!/usr/bin/env python3
"""Says how many tests of the last CTest run were skipped, and why: a test that was skipped has shown nothing.

usage: skipped.py BUILD...

Reads BUILD/Testing/Temporary/LastTest.log of each build: skips of GoogleTest, of unittest (run with -v) and of programs that end
with the code 77, whose output says "skipped: WHY" or gives the reason in its first line. The exit code is 0.
"""
from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path

TEST = re.compile(r"^\d+/\d+ Testing: (.*)$", re.M)
OUTPUT = re.compile(r"^Output:\n-+\n(.*?)^<end of output>", re.M | re.S)
GTEST = re.compile(r"^\S+:\d+: Skipped\n(.*)$", re.M)
UNITTEST = re.compile(r"^(?:.* )?\.\.\. skipped (['\"])(.*)\1$", re.M)
UNKNOWN = "no reason was given"
PROGRAM = re.compile(r"^skipped: (.*)$", re.M)


def in_output(said: str) -> list[str]:
    """Returns the reasons that a test's output gives for skipped parts of it."""
    return [reason.strip() or UNKNOWN for reason in GTEST.findall(said) + [match[2] for match in UNITTEST.finditer(said)]]


def reasons(log: str) -> list[str]:
    """Returns a reason for each skipped test of a log."""
    found = []
    places = [match.start() for match in TEST.finditer(log)] + [len(log)]
    for begin, end in zip(places, places[1:]):
        test = log[begin:end]
        output = OUTPUT.search(test)
        said = output[1] if output else ""
        inside = in_output(said)
        if not inside and "\nTest Skipped." in test:
            inside = PROGRAM.findall(said)[:1] or [next((line for line in said.splitlines() if line.strip()), UNKNOWN)]
        found += inside
    return found


def summary(found: list[str]) -> str:
    """Formats the reasons, the most frequent first."""
    if not found:
        return "No test was skipped."
    counted = sorted(Counter(found).items(), key=lambda one: (-one[1], one[0]))
    lines = [f"{len(found)} {'test was' if len(found) == 1 else 'tests were'} skipped, and show nothing:"]
    return "\n".join(lines + [f"{count:6}  {reason}" for reason, count in counted])


def main() -> int:
    logs = [Path(build) / "Testing" / "Temporary" / "LastTest.log" for build in sys.argv[1:]]
    print(summary([one for log in logs if log.exists() for one in reasons(log.read_text(errors="replace"))]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
