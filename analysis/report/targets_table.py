"""The targets of a plan and the measurements, from targets.json, as Markdown tables.

usage: targets_table.py DIR/targets.json [--write analysis/guides/results.md]
A page has the tables of several plans, between `<!-- targets of PLAN -->` and `<!-- /targets of PLAN -->`.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional, Sequence

from results import files, text, tuned
from results.load import ResultError

SCHEMA = 2
FILE_NAME = "targets.json"
VERDICTS = {"reached_aim": "aim reached", "reached": "reached", "missed": "missed", "unmeasured": "not measured"}


@dataclass(frozen=True)
class Within:
    """The 95 % interval of a ratio, or the range over fewer than five repetitions."""

    low: float
    high: float
    is_interval: bool


@dataclass(frozen=True)
class Scene:
    """A target's ratio on one scene. Ratio, times and labels are missing if there is a reason."""

    name: str
    order: str
    triangles: Optional[float]
    counts: bool
    ratio: Optional[float]
    interval: Optional[Within]
    disturbed: bool
    numerator: str
    numerator_ms: Optional[float]
    denominator: str
    denominator_ms: Optional[float]
    reason: str
    tuned: str  #: " †" for a ratio of `auto` on a scene that it was tuned on


@dataclass(frozen=True)
class Target:
    """One row: a target ratio, and its measurement."""

    what: str
    measured: Optional[float]
    interval: Optional[Within]
    at_least: float
    aim: float
    verdict: str
    scene: str
    reason: str
    note: str
    scenes: list[Scene]
    plan: str
    commit: str
    dirty: bool
    when: str
    cpu: str
    compiler: str
    runs: int


def load_targets(path: Path) -> list[Target]:
    """Reads targets.json. Raises ResultError."""
    try:
        rows = files.read_json(path)
    except FileNotFoundError:
        raise ResultError(f"{path} does not exist: `kbvh run --plan PLAN --out DIR` writes it for a plan with targets.") from None
    except OSError as error:
        raise ResultError(f"{path} cannot be read: {error.strerror}.") from None
    except ValueError:
        raise ResultError(f"{path} is not JSON.") from None
    if not isinstance(rows, list):
        raise ResultError(f"{path}: a list of targets is expected.")
    targets = []
    for number, row in enumerate(rows, 1):
        try:
            targets.append(_target(row))
        except KeyError as error:
            raise ResultError(f"{path}: row {number}: the field {error.args[0]} is missing.") from None
        except (AttributeError, TypeError, ValueError) as error:
            raise ResultError(f"{path}: row {number}: {error}.") from None
    return targets


def _target(row: dict[str, Any]) -> Target:
    if not isinstance(row, dict):
        raise ValueError("an object is expected")
    if row["schema"] != SCHEMA:
        older = row["schema"] == 1
        why = "its times leave out the beginning of the clip; `kbvh run --plan PLAN --out DIR` makes it again" if older else f"only {SCHEMA}"
        raise ValueError(f"schema {json.dumps(row['schema'])} is not known: {why}" if older else f"schema {json.dumps(row['schema'])} is not known, {why}")
    if row["verdict"] not in VERDICTS:
        raise ValueError(f"verdict is {json.dumps(row['verdict'])}, but should be one of {', '.join(VERDICTS)}")
    machine = row.get("machine") or {}
    return Target(
        what=str(row["what"]),
        measured=_number(row, "measured"),
        interval=_interval(row),
        at_least=float(row["at_least"]),
        aim=float(row["aim"]),
        verdict=row["verdict"],
        scene=row.get("scene") or "",
        reason=row.get("reason", ""),
        note=row.get("note", ""),
        scenes=[_scene(one) for one in row["per_scene"]],
        plan=row.get("plan", ""),
        commit=row.get("commit", ""),
        dirty=bool(row.get("dirty", False)),
        when=row.get("when", ""),
        cpu=str(machine.get("cpu", "")),
        compiler=str(machine.get("compiler", "")),
        runs=len(row.get("runs", [])),
    )


def _scene(one: dict[str, Any]) -> Scene:
    above, below = one["numerator"] or {}, one["denominator"] or {}
    marks = [tuned.mark(side["label"].split(" ")[0], str(one["scene"])) for side in (above, below) if side and one["ratio"] is not None]
    return Scene(
        name=str(one["scene"]),
        order=one["order"] or "",
        triangles=_number(one, "triangles"),
        counts=bool(one["counts"]),
        ratio=_number(one, "ratio"),
        interval=_interval(one),
        disturbed=bool(above.get("disturbed") or below.get("disturbed")),
        numerator=above.get("label", ""),
        numerator_ms=_number(above, "ms") if above else None,
        denominator=below.get("label", ""),
        denominator_ms=_number(below, "ms") if below else None,
        reason=one.get("reason", ""),
        tuned=max(marks, default=""),
    )


def _number(row: dict[str, Any], key: str) -> Optional[float]:
    value = row[key]
    return None if value is None else float(value)


def _interval(row: dict[str, Any]) -> Optional[Within]:
    for name in ("confidence_interval", "range"):
        if row[name] is not None:
            low, high = row[name]
            return Within(float(low), float(high), name == "confidence_interval")
    return None


def times(value: Optional[float]) -> str:
    """Formats a ratio as 45.2x."""
    return text.MISSING if value is None else f"{text.factor(value)}x"


def wanted(value: float) -> str:
    """Formats a target as 60x."""
    return f"{value:g}x"


def within(interval: Optional[Within]) -> str:
    """Formats an interval as (44.1–46.3), a range over fewer than five repetitions as [44.1–46.3]; or nothing."""
    if interval is None:
        return ""
    ends = f"{text.factor(interval.low)}–{text.factor(interval.high)}"
    return f"({ends})" if interval.is_interval else f"[{ends}]"


def facts(targets: list[Target]) -> str:
    """States machine, source and time of the measurements in one sentence."""
    first = targets[0]
    where = ", ".join(value for value in (first.cpu, first.compiler) if value) or "an unknown machine"
    state = " with uncommitted changes" if first.dirty else ""
    made = f"commit {first.commit[:12] or 'unknown'}{state}, {first.when or 'undated'}"
    sentence = f"Plan {first.plan} on {where}, one thread unless a row names more, {made}."
    if any(target.runs > 1 for target in targets):
        sentence += " Not all of it in one run."
    return sentence


def remark(targets: Sequence[Target]) -> str:
    """Explains the mark of scenes that `auto` was tuned on; empty if no ratio has it."""
    return f"{tuned.MARK}: `auto` was tuned on the scene." if any(scene.tuned for target in targets for scene in target.scenes) else ""


def columns(targets: list[Target]) -> list[str]:
    """Returns the names of all scenes, in the order of measurement."""
    return list(dict.fromkeys(scene.name for target in targets for scene in target.scenes))


def markdown(targets: list[Target]) -> str:
    """Returns both tables: the targets, then every size and order."""
    if not targets:
        return "No targets.\n"
    lines = [_row(["what", "measured (95 % interval) or [range]", "at least", "aim", "verdict"]), _row(["---"] * 5)]
    for target in targets:
        measured = f"{times(target.measured)} {within(target.interval)}".rstrip()
        verdict = VERDICTS[target.verdict] + (f": {target.reason}" if target.reason else "")
        lines.append(_row([target.what, measured, wanted(target.at_least), wanted(target.aim), verdict]))
    noted = dict.fromkeys(f"{target.what}: {target.note}." for target in targets if target.note)
    if noted:
        lines += ["", "Notes.", *(f"- {note}" for note in noted)]
    names = columns(targets)
    meaning = (
        "A number is the speed of the side named first over that of the other, on the scenes that count: their geometric mean "
        "or the least of them, as the plan says. The verdict compares this number, not its interval; the table below has "
        "every scene, in bold if it counts, with ? if the machine was disturbed. A range is over fewer than five repetitions."
    )
    lines += ["", f"{facts(targets)} {meaning} {remark(targets)}".rstrip(), ""]
    lines += [_row(["what", *names]), _row(["---"] * (1 + len(names)))]
    for target in targets:
        cells = {scene.name: _cell(scene) for scene in target.scenes}
        lines.append(_row([target.what, *(cells.get(name, text.MISSING) for name in names)]))
    return "\n".join(lines) + "\n"


def _cell(scene: Scene) -> str:
    ratio = times(scene.ratio) + ("?" if scene.disturbed else "")
    return (f"**{ratio}**" if scene.counts else ratio) + scene.tuned


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def markers(plan: str) -> tuple[str, str]:
    """Returns the lines of a page between which the tables of a plan stand."""
    return f"<!-- targets of {plan} -->", f"<!-- /targets of {plan} -->"


def rewrite(page: str, plan: str, table: str, place: str = "the page") -> str:
    """Returns the page with the plan's table between its markers, each on a line of its own. Raises ResultError without them."""
    return files.inserted(page, *markers(plan), table, place)


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns its exit code: 0, or 2 for an unusable file."""
    parser = argparse.ArgumentParser(
        prog="targets_table.py",
        description="Prints the targets of a plan and their measurements as Markdown.",
        epilog="example: targets_table.py results/targets.json --write analysis/guides/results.md",
    )
    parser.add_argument("file", metavar="targets.json", type=Path, help="written by `kbvh run --plan PLAN --out DIR`")
    parser.add_argument("--write", metavar="PAGE", type=Path, help="write the tables between the plan's markers in this file")
    options = parser.parse_args(arguments)
    try:
        targets = load_targets(options.file)
    except ResultError as error:
        print(f"targets_table: {error}", file=sys.stderr)
        return 2
    table = markdown(targets)
    if options.write is None:
        print(table, end="")
        return 0
    try:
        page = rewrite(options.write.read_text(encoding="utf-8"), targets[0].plan if targets else "", table, str(options.write))
        files.write_whole(options.write, page)
    except OSError as error:
        print(f"targets_table: {error.filename}: {error.strerror}.", file=sys.stderr)
        return 2
    except ResultError as error:
        print(f"targets_table: {error}", file=sys.stderr)
        return 2
    return 0
