"""Compares the verdicts of two studies on the claims.

usage: agree.py FOLDER FOLDER

Each folder holds a claims.json, which `kbvh report` writes. Prints a line for each claim with two different verdicts, and
lists claims that only one study decides. Exit codes: 0 no two verdicts differ, 1 some do, 2 wrong use. Only the standard
library is needed.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path

OPEN = "not decided here"


@dataclass
class Agreement:
    """Ids of claims, in the order of the first study."""

    same: list[str] = field(default_factory=list)
    different: list[tuple[str, str, str]] = field(default_factory=list)  #: with both verdicts
    only_first: list[str] = field(default_factory=list)  #: decided there only
    only_second: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)


def verdicts(folder: Path) -> dict[str, str]:
    """Returns the verdicts by claim. Raises OSError, ValueError or KeyError if there is no readable claims.json."""
    whole = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    return {claim["id"]: claim["verdict"] for claim in whole["claims"]}


def agreement(first: dict[str, str], second: dict[str, str]) -> Agreement:
    """Compares verdicts; a claim unknown to a study counts as undecided by it."""
    found = Agreement()
    for claim in [*first, *(claim for claim in second if claim not in first)]:
        one, other = first.get(claim, OPEN), second.get(claim, OPEN)
        if one == other:
            (found.open if one == OPEN else found.same).append(claim)
        elif other == OPEN:
            found.only_first.append(claim)
        elif one == OPEN:
            found.only_second.append(claim)
        else:
            found.different.append((claim, one, other))
    return found


def main(arguments: list[str]) -> int:
    """Runs the command; see the usage above."""
    if len(arguments) != 2:
        print("usage: agree.py FOLDER FOLDER", file=sys.stderr)
        return 2
    try:
        found = agreement(*(verdicts(Path(folder)) for folder in arguments))
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"agree: no readable claims.json: {error}", file=sys.stderr)
        return 2
    for claim, one, other in found.different:
        print(f"{claim}: {one} in {arguments[0]}, {other} in {arguments[1]}")
    for claims, folder in ((found.only_first, arguments[0]), (found.only_second, arguments[1])):
        if claims:
            print(f"decided in {folder} only: {', '.join(claims)}")
    if found.open:
        print(f"decided in neither: {', '.join(found.open)}")
    same, different = len(found.same), len(found.different)
    print(f"{same} {'verdict is' if same == 1 else 'verdicts are'} the same, {different} {'differs' if different == 1 else 'differ'}")
    return 1 if found.different else 0
