"""Checks the paper's claims against results: RESULTS_DIR/results.jsonl and theory.json become RESULTS_DIR/claims.json.

usage: claims.py RESULTS_DIR [--claims FILE]

Claims and their criteria are data: claims.json in this folder for the experiments, theory.json for the theory. This module
has no code for single claims.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Optional

from claims import claim_file
from claims.claim_points import SLACK, ClaimError, CheckResult, CheckEvaluator, Table
from claims.claim_words import NOT_MEASURED, as_in_2006, brief, brief_theory, condition, rule, sentence, unmeasured
from results import files, text
from results.load import ResultError, Study, load, read_json

SCHEMA = "kbvh-claims-1"
THEORY_SCHEMA = "kbvh-theory-1"
THEORY_FIELDS = ("id", "claim", "citation", "bound", "measured", "verdict", "condition", "why", "criteria")
FILE = Path(__file__).resolve().parents[1] / "claims.json"
HOLDS, CONDITION, FAILS, OPEN = "holds", "holds with a condition", "does not hold", "not decided here"


@dataclass
class Apart:
    """A claim on some of its scenes: those that decide it, or one scene from another source."""

    scenes: list[str]
    l: list[float]
    verdict: str
    condition: str


@dataclass
class CornerVerdict:
    """A check in one corner of its square."""

    check: str
    id: str
    name: str
    verdict: str  #: one of a claim's, or "not measured here"
    rule: str  #: where it is met


@dataclass
class Row:
    """One claim in the form of the report."""

    id: str
    claim: str
    citation: str
    paper: str  #: the paper's number, or bound
    ours: dict[str, str]  #: by corner or baseline ("" for what has none): the measured range
    verdict: str
    condition: str
    why: str
    missing: list[str] = field(default_factory=list)
    note: str = ""
    figures: list[str] = field(default_factory=list)  #: panels of the paper, "18-left"
    groups: list[str] = field(default_factory=list)  #: tables that it is from
    apart: list[Apart] = field(default_factory=list)  #: generated scenes and others, each for itself
    differ: str = ""  #: by what these differ, where they do
    checks: list[dict[str, Any]] = field(default_factory=list)  #: for the data file
    brief: str = ""  #: why, in two sentences
    corners: list[CornerVerdict] = field(default_factory=list)  #: of checks with a square, each for itself
    shown: str = ""  #: numbers next to the verdict
    unmeasured: list[str] = field(default_factory=list)  #: corners that were not measured, or not all of them
    as_in_2006: list[str] = field(default_factory=list)  #: corners at their best that are no faster than in 2006
    looked: list[CheckResult] = field(default_factory=list)  #: for the picture and the tables


@dataclass
class Claims:
    """All rows, and the names of the baselines."""

    rows: list[Row]
    baselines: list[dict[str, Any]]


def read_claims(file: Path = FILE) -> dict[str, Any]:
    """Reads and checks claims.json. Raises ClaimError."""
    said = read_json(file, SCHEMA, ClaimError)
    claim_file.check(said, str(file))
    return said


def evaluate(study: Study, folder: Path, file: Path = FILE) -> Claims:
    """Evaluates every claim, theory first. Raises ClaimError."""
    said = read_claims(file)
    looker = CheckEvaluator(Table(study, said["scalar"]), said["baselines"], said.get("squares", {}))
    rows = theory_rows(said["theory"], folder)
    for claim in said["claims"]:
        try:
            rows.append(experiment_row(claim, looker))
        except ClaimError as problem:
            raise ClaimError(f"{file}: {claim['id']}: {problem}") from None
    return Claims(rows, said["baselines"])


def in_order(id: str) -> tuple[int, int, str]:
    """Returns the place of a claim in lists for readers, as a sort key: experiments (E), theory (T), the paper's conclusions (C), each by number."""
    kind, number = id[:1], id[1:]
    return "ETC".index(kind) if kind and kind in "ETC" else 3, int(number) if number.isdecimal() else 0, id


def theory_rows(listed: list[dict[str, Any]], folder: Path) -> list[Row]:
    """Takes the claims of theory.json with their verdicts; undecided if the file is missing."""
    path = folder / "theory.json"
    known: dict[str, dict[str, Any]] = {}
    missing = [f"{path.name} in this folder, which kbvh theory --out writes"]
    if path.exists():
        found = read_json(path, THEORY_SCHEMA, ClaimError)
        try:
            known = {claim["id"]: {name: claim[name] for name in THEORY_FIELDS} for claim in found["claims"]}
        except (KeyError, TypeError) as problem:
            raise ClaimError(f"{path}: a field is missing or of the wrong kind: {problem}.") from None
        missing = [f"the claim in {path.name}"]
    rows = []
    for one in listed:
        judged = known.get(one["id"])
        if judged is None:
            why = f"Missing: {missing[0]}."
            rows.append(Row(one["id"], one["claim"], "", "", {}, OPEN, "", why, list(missing), brief=why))
            continue
        rows.append(
            Row(
                judged["id"], judged["claim"][:1].upper() + judged["claim"][1:], judged["citation"], judged["bound"], {"": judged["measured"]},
                judged["verdict"], judged["condition"], judged["why"], checks=judged["criteria"],
                brief=brief_theory(judged["condition"], judged["why"]),
            )
        )  # fmt: skip
    return rows


def experiment_row(claim: dict[str, Any], looker: CheckEvaluator) -> Row:
    """Checks one claim against the measurements."""
    looked = [looker.look(check) for check in claim["checks"]]
    missing = list(dict.fromkeys(gap for one in looked for gap in one.missing))
    verdict = verdict_of(looked)
    sentences = [sentence(one) for one in looked if one.points]
    if missing:
        so_far = "Measured so far: " if sentences else ""
        sentences = [f"Missing: {text.listing(missing)}.", so_far + " ".join(sentences)]
    beside = [told for one in claim.get("shown", []) if (told := shown(one, looker.table, claim))]
    sentences += beside
    separate = apart(looked)
    return Row(
        id=claim["id"],
        claim=claim["claim"],
        citation=claim["citation"],
        paper=claim["paper"],
        ours=ours(looked),
        verdict=verdict,
        condition=condition(looked) if verdict == CONDITION else "",
        why=" ".join(one for one in sentences if one).strip(),
        missing=missing,
        note=claim.get("note", ""),
        figures=claim["figures"],
        groups=list(dict.fromkeys(group for one in looked for point in one.points for group in point.groups)),
        apart=separate,
        differ=differences(separate, looker.table, claim),
        checks=[_check_record(one) for one in looked],
        brief=brief(looked, missing),
        corners=[one for part in looked if "square" in part.check for one in corner_verdicts(part)],
        shown=" ".join(beside),
        unmeasured=unmeasured(looked),
        as_in_2006=as_in_2006(looked),
        looked=looked,
    )


def verdict_of(looked: list[CheckResult]) -> str:
    """Decides: undecided while data are missing; refuted by a check that is met nowhere; else by whether all points are met.

    A check with optional corners only does not count without points.
    """
    looked = [one for one in looked if one.points or not all(corner.optional for corner in one.corners)]
    if not looked or any(one.missing or not one.points for one in looked):
        return OPEN
    if any(not any(point.met for point in one.points) for one in looked):
        return FAILS
    return HOLDS if all(point.met for one in looked for point in one.points) else CONDITION


def corner_verdicts(looked: CheckResult) -> list[CornerVerdict]:
    """Evaluates each corner of a check by itself."""
    found = []
    for corner in looked.corners:
        mine = [point for point in looked.points if point.corner == corner.id]
        verdict = verdict_of([CheckResult(looked.check, [corner], mine)]) if mine else NOT_MEASURED
        found.append(CornerVerdict(looked.check["what"], corner.id, corner.name, verdict, rule(looked, corner)))
    return found


def apart(looked: list[CheckResult]) -> list[Apart]:
    """Evaluates the claim on the deciding scenes, and on each optional scene, at the l that all of them have; empty without
    optional scenes.
    """
    optional = list(dict.fromkeys(scene for one in looked for scene in one.check.get("optional_scenes", [])))
    depths: dict[str, set[float]] = {}
    for one in looked:
        for point in one.points:
            depths.setdefault(point.scene, set()).add(point.l)
    own = [scene for scene in depths if scene not in optional]
    others = [scene for scene in optional if scene in depths]
    if not own or not others:
        return []
    parts = [own, *([scene] for scene in others)]
    common = set.intersection(*(set().union(*(depths[scene] for scene in part)) for part in parts))
    found = []
    for scenes in parts:
        part = [
            CheckResult(one.check, one.corners, [p for p in one.points if p.scene in scenes and p.l in common]) for one in looked
        ]
        verdict = verdict_of(part)
        found.append(Apart(scenes, sorted(common), verdict, condition(part) if verdict == CONDITION else ""))
    return found


def differences(separate: list[Apart], table: Table, claim: dict[str, Any]) -> str:
    """Lists the counts on each of the scenes if their verdicts or conditions differ."""
    if len({(one.verdict, one.condition) for one in separate}) < 2 or "apart_shown" not in claim:
        return ""
    one, check = claim["apart_shown"], claim["checks"][0]
    low, high = check["size"]
    counted: dict[str, dict[float, float]] = {}
    for scene in [scene for part in separate for scene in part.scenes]:
        for size, l, rows in table.places(scene):
            run = table.chosen(rows, one["of"], one["quantity"])
            if run is not None and low / SLACK <= size <= high * SLACK and len(table.values(run, one["quantity"])):
                counted.setdefault(scene, {})[l] = float(table.values(run, one["quantity"])[0])  # the largest is last
    if not counted:
        return ""
    common = sorted(set.intersection(*(set(by_l) for by_l in counted.values())))
    told = "; ".join(
        f"{scene} " + ", ".join(f"{text.significant(by_l[l])} at l = {l:g}" for l in common)
        for scene, by_l in counted.items()
    )
    return f"{one['what'][0].upper()}{one['what'][1:]}: {told}." if common else ""


def ours(looked: list[CheckResult]) -> dict[str, str]:
    """Returns the range of the first check for each corner, followed by further quantities and checks."""
    result: dict[str, list[str]] = {}
    for one in looked:
        for corner in dict.fromkeys(point.corner for point in one.points):
            parts = []
            for quantity in dict.fromkeys(point.quantity for point in one.points):
                values = [p.value.middle for p in one.points if (p.corner, p.quantity) == (corner, quantity)]
                if values:
                    parts.append(_range(values) + (" (with motion)" if quantity.endswith("with motion") else ""))
            name = one.check.get("short", "")
            result.setdefault(corner, []).append((f"{name}: " if name else "") + ", ".join(parts))
    return {corner: "; ".join(parts) for corner, parts in result.items()}


def ranges_of_corners(corners: Sequence[dict[str, Any]], ours: dict[str, str]) -> list[list[str]]:
    """Returns a claim's corners as [name, range without motion evaluation, verdict].

    `ours` is what the function of that name returns: the ranges of a corner by its id, one for each check that has the corner, as in
    "kinetic AABB tree: 0.1 to 0.5; kinetic BoxTree: 0.2 to 0.7". A claim with several checks names the check of each corner.
    """
    several = len({one["check"] for one in corners}) > 1
    seen: dict[str, int] = {}
    found = []
    for one in corners:
        at = seen[one["id"]] = seen.get(one["id"], -1) + 1
        parts = ours.get(one["id"], "").split("; ")
        if at >= len(parts) or not parts[at]:
            continue
        label, _, span = parts[at].rpartition(": ")
        name = f"{label}: {one['name']}" if several and label and label != one["name"].removeprefix("the ") else one["name"]
        found.append([name, span.split(",")[0], one["verdict"]])
    return found


def _range(values: list[float]) -> str:
    low, high = text.factor(min(values)), text.factor(max(values))
    return low if low == high else f"{low} to {high}"


def shown(one: dict[str, Any], table: Table, claim: dict[str, Any]) -> str:
    """Returns a number next to the verdict: at the largest size of the claim's first scene, at each l."""
    check = claim["checks"][0]
    low, high = check["size"]
    found = []
    for size, l, rows in table.places(check["scenes"][0]):
        run = table.chosen(rows, one["of"], one["quantity"])
        if run is not None and low / SLACK <= size <= high * SLACK and len(table.values(run, one["quantity"])):
            found.append((size, l, float(table.values(run, one["quantity"])[0])))
    if not found:
        return ""
    largest = max(size for size, _, _ in found)
    told = ", ".join(f"{text.significant(value)} at l = {l:g}" for size, l, value in found if size == largest)
    return f"{one['what'][0].upper()}{one['what'][1:]} at {text.size(largest)} polygons: {told}."


def _check_record(one: CheckResult) -> dict[str, Any]:
    return {
        **{name: one.check[name] for name in ("what", "measure", "quantities", "relation", "bound", "tolerance")},
        "missing": one.missing,
        "corners": [{"id": corner.id, "name": corner.name, "missing": one.gaps.get(corner.id, [])} for corner in one.corners],
        "points": [
            {
                "corner": p.corner, "quantity": p.quantity, "scene": p.scene, "size": p.size, "l": p.l,
                "value": p.value.middle, "low": p.value.low, "high": p.value.high, "met": p.met, "close": p.close,
                "of": p.of, "keys": list(p.keys),
            }
            for p in one.points
        ],
    }  # fmt: skip


def write(claims: Claims, folder: Path) -> Path:
    """Writes claims.json into the results folder; returns its path."""
    path = folder / "claims.json"
    rows = [
        {
            "id": row.id, "claim": row.claim, "citation": row.citation, "paper": row.paper, "ours": row.ours,
            "verdict": row.verdict, "condition": row.condition, "why": row.why, "missing": row.missing,
            "note": row.note, "figures": row.figures, "apart": [asdict(one) for one in row.apart], "differ": row.differ,
            "brief": row.brief, "corners": [asdict(one) for one in row.corners], "not_measured": row.unmeasured,
            "as_in_2006": row.as_in_2006, "checks": row.checks,
        }
        for row in claims.rows
    ]  # fmt: skip
    whole = {"schema": SCHEMA, "baselines": claims.baselines, "claims": rows}
    files.write_whole(path, json.dumps(whole, indent=1, ensure_ascii=False) + "\n")
    return path


def plain(claims: Claims) -> str:
    """Formats one line per claim with its verdict, its reason below."""
    lines = []
    for row in claims.rows:
        lines.append(f"{row.id:<4} {row.verdict:<23} {row.claim}")
        if row.condition:
            lines.append(f"     if: {row.condition}")
        if row.unmeasured:
            lines.append(f"     {NOT_MEASURED}: {'; '.join(row.unmeasured)}")
        for one in row.apart:
            lines.append(f"     on {text.listing(one.scenes)}: {one.verdict}")
        lines.append(f"     {row.brief}")
    return "\n".join(lines)


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input. Verdicts are no errors."""
    parser = argparse.ArgumentParser(prog="claims.py", description="Checks the paper's claims against RESULTS_DIR.")
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl (and theory.json)")
    parser.add_argument("--claims", metavar="FILE", type=Path, default=FILE, help="claims other than the paper's")
    options = parser.parse_args(arguments)

    def work() -> int:
        claims = evaluate(load(options.folder), options.folder, options.claims)
        print(plain(claims))
        print(write(claims, options.folder))
        return 0

    return files.run_command("claims", (ResultError, ClaimError), work)
