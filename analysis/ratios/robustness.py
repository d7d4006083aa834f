"""The results of `kbvh stress` and `kbvh ccd` in a folder, as tables of the report: stress.json and ccd.json."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional

from results import files, text
from results.load import ResultError, read_json

STRESS_FILE, CCD_FILE = "stress.json", "ccd.json"
STRESS_SCHEMA = "kbvh-stress-1"
#: Failures of any contestant, with the singular and the plural.
FAILURES = {"crashes": "crash", "hangs": "hang", "threw": "exception", "broken": "broken promise"}

Cells = tuple[str, ...]


@dataclass
class Stress:
    """Adversarial scenes: a line per strategy over all families, and one for each family and strategy."""

    facts: str
    strategies: list[Cells]
    families: list[tuple[str, str, list[Cells]]]  #: name, meaning, a line per strategy
    failures: list[str]


@dataclass
class Ccd:
    """Queries of continuous collision detection with known verdicts."""

    facts: str
    head: Cells
    rows: list[Cells]


def stress(folder: Path) -> Optional[Stress]:
    """Returns the tables of stress.json, or None if there is no such file. Raises ResultError."""
    file = folder / STRESS_FILE
    if not file.exists():
        return None
    data = read_json(file, STRESS_SCHEMA, ResultError)
    try:
        return _stress(data)
    except KeyError as problem:
        raise ResultError(f"{file} is not what `kbvh stress` writes: the field {problem.args[0]} is missing.") from None
    except (TypeError, ValueError, AttributeError, IndexError):
        raise ResultError(f"{file} is not what `kbvh stress` writes: a field is of the wrong kind.") from None


def _stress(data: dict[str, Any]) -> Stress:
    by_family: dict[str, list[dict[str, Any]]] = defaultdict(list)
    by_strategy: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in data["rows"]:
        by_family[row["family"]].append(row)
        by_strategy[row["strategy"]].append(row)
    options = data["options"]
    facts = (
        f"{text.plural(int(options['scenes']), 'scene')} of {text.plural(len(data['families']), 'family', 'families')}, seed "
        f"{options['seed']}, in {text.listing(list(options['scalars']))}, l = {text.listing([str(l) for l in options['l']])}; the "
        f"longest clip has {text.count(options['many_keyframes'])} keyframes. Commit {data['commit'][:12]}."
    )
    played = int(data.get("played", options["scenes"]))
    if played < int(options["scenes"]):
        facts += f" The run was interrupted after {text.count(played)} of them."
    return Stress(
        facts,
        [_line(name, rows) for name, rows in by_strategy.items()],
        [
            (family["name"], family["meaning"], [_line(row["strategy"], [row]) for row in by_family[family["name"]]])
            for family in data["families"]
        ],
        [
            f"{one['strategy']} ({one['scalar']}, l = {one['l']}) on {one['family']}, seed {one['seed']}: {one['failure']} ({one['file']})"
            for one in data["failures"]
        ],
    )


def _line(name: str, rows: list[dict[str, Any]]) -> Cells:
    """Formats strategy, scenes, frames, protrusion over the scene's size, looseness, missed, extra, events, failures."""
    total = lambda key: sum(int(row[key]) for row in rows)  # noqa: E731
    known = [row["looseness"] for row in rows if row["looseness"] is not None]
    failed = [text.plural(total(key), word, None if word != "crash" else "crashes") for key, word in FAILURES.items() if total(key)]
    promises = " (promises nothing)" if rows[0]["approximate"] else ""
    return (
        name + promises, text.count(total("scenes")), text.count(total("frames")),
        text.significant(max(row["relative_protrusion"] for row in rows), 2),
        text.significant(max(known), 2) if known else text.MISSING,
        text.count(total("missed")), text.count(total("extra")), text.count(total("events")), ", ".join(failed) or "nothing",
    )  # fmt: skip


def ccd(folder: Path) -> Optional[Ccd]:
    """Returns the table of ccd.json, or None if there is no such file. Raises ResultError."""
    file = folder / CCD_FILE
    if not file.exists():
        return None
    try:
        data = files.read_json(file)
        peers = sorted({peer for one in data["files"] for peer in one.get("peers", {})})
        rows = [_queries(one, peers) for one in data["files"]]
        head = ("queries of", "queries", "touch", "missed", "extra", "by the filter", "per second")
        for peer in peers:
            head += (f"{peer}: missed", "extra", "per second")
        return Ccd(f"Commit {data['commit'][:12]}.", head, rows)
    except (OSError, ValueError) as problem:
        raise ResultError(f"{file} cannot be read: {problem}.") from None
    except KeyError as problem:
        raise ResultError(f"{file} is not what `kbvh ccd` writes: the field {problem.args[0]} is missing.") from None
    except (TypeError, AttributeError):
        raise ResultError(f"{file} is not what `kbvh ccd` writes: a field is of the wrong kind.") from None


def _queries(one: dict[str, Any], peers: list[str]) -> Cells:
    share = 100 * one["filtered"] / one["queries"] if one["queries"] else 0.0
    cells: Cells = (
        str(one["name"]), text.count(one["queries"]), text.count(one["positives"]), text.count(one["missed"]),
        text.count(one["extra"]), f"{share:.1f} %", text.significant(one["queries_per_second"], 3),
    )  # fmt: skip
    for peer in peers:
        found = one.get("peers", {}).get(peer)
        cells += (
            (text.count(found["missed"]), text.count(found["extra"]), text.significant(found["queries_per_second"], 3))
            if found
            else (text.MISSING,) * 3
        )
    return cells
