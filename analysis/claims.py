"""Checks the paper's claims against results: RESULTS_DIR/results.jsonl and theory.json become RESULTS_DIR/claims.json.

usage: claims.py RESULTS_DIR [--claims FILE]

Claims and their criteria are data: claims.json in this folder for the experiments, theory.json for the theory. This module
has no code for single claims.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Optional

import files
import text
from claim_points import SLACK, ClaimError, Looked, Looker, Point, Table
from load import ResultError, Study, load, read_json

SCHEMA = "kbvh-claims-1"
THEORY_SCHEMA = "kbvh-theory-1"
THEORY_FIELDS = ("id", "claim", "citation", "bound", "measured", "verdict", "condition", "why", "criteria")
FILE = Path(__file__).resolve().parent / "claims.json"
HOLDS, CONDITION, FAILS, OPEN = "holds", "holds with a condition", "does not hold", "not decided here"


@dataclass
class Apart:
    """A claim on some of its scenes: those that decide it, or one scene from another source."""

    scenes: list[str]
    l: list[float]
    verdict: str
    condition: str


@dataclass
class Row:
    """One claim in the form of the report."""

    id: str
    claim: str
    citation: str
    paper: str  #: the paper's number, or bound
    ours: dict[str, str]  #: by baseline ("" for what has none): the measured range
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


@dataclass
class Claims:
    """All rows, and the names of the baselines."""

    rows: list[Row]
    baselines: list[dict[str, Any]]


def read_claims(file: Path = FILE) -> dict[str, Any]:
    """Reads claims.json. Raises ClaimError."""
    return read_json(file, SCHEMA, ClaimError)


def evaluate(study: Study, folder: Path, file: Path = FILE) -> Claims:
    """Evaluates every claim, theory first. Raises ClaimError."""
    said = read_claims(file)
    looker = Looker(Table(study, said["scalar"]), said["baselines"])
    try:
        rows = theory_rows(said["theory"], folder)
        rows += [experiment_row(claim, looker, said["baselines"]) for claim in said["claims"]]
    except KeyError as problem:
        raise ClaimError(f"{file}: a claim has no {problem}") from None
    return Claims(rows, said["baselines"])


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
            rows.append(Row(one["id"], one["claim"], "", "", {}, OPEN, "", why, list(missing)))
            continue
        rows.append(
            Row(
                judged["id"], judged["claim"][:1].upper() + judged["claim"][1:], judged["citation"], judged["bound"], {"": judged["measured"]},
                judged["verdict"], judged["condition"], judged["why"], checks=judged["criteria"],
            )
        )  # fmt: skip
    return rows


def experiment_row(claim: dict[str, Any], looker: Looker, baselines: list[dict[str, Any]]) -> Row:
    """Checks one claim against the measurements."""
    names = {one["id"]: one["name"] for one in baselines}
    looked = [looker.look(check) for check in claim["checks"]]
    missing = list(dict.fromkeys(gap for one in looked for gap in one.missing))
    verdict = verdict_of(looked)
    sentences = [sentence(one, names) for one in looked if one.points]
    if missing:
        so_far = "Measured so far: " if sentences else ""
        sentences = [f"Missing: {text.listing(missing)}.", so_far + " ".join(sentences)]
    sentences += [shown(one, looker.table, claim) for one in claim.get("shown", [])]
    separate = apart(looked, names)
    return Row(
        id=claim["id"],
        claim=claim["claim"],
        citation=claim["citation"],
        paper=claim["paper"],
        ours=ours(looked),
        verdict=verdict,
        condition=condition(looked, names) if verdict == CONDITION else "",
        why=" ".join(one for one in sentences if one).strip(),
        missing=missing,
        note=claim.get("note", ""),
        figures=claim["figures"],
        groups=list(dict.fromkeys(group for one in looked for point in one.points for group in point.groups)),
        apart=separate,
        differ=differences(separate, looker.table, claim),
        checks=[_check_record(one) for one in looked],
    )


def verdict_of(looked: list[Looked]) -> str:
    """Decides: undecided while data are missing; refuted by a check that is met nowhere; else by whether all points are met.
    """
    if not looked or any(one.missing or not one.points for one in looked):
        return OPEN
    if any(not any(point.met for point in one.points) for one in looked):
        return FAILS
    return HOLDS if all(point.met for one in looked for point in one.points) else CONDITION


def apart(looked: list[Looked], names: dict[str, str]) -> list[Apart]:
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
        part = [Looked(one.check, [p for p in one.points if p.scene in scenes and p.l in common]) for one in looked]
        verdict = verdict_of(part)
        found.append(Apart(scenes, sorted(common), verdict, condition(part, names) if verdict == CONDITION else ""))
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


def ours(looked: list[Looked]) -> dict[str, str]:
    """Returns the range of the first check for each baseline, followed by further quantities and checks."""
    result: dict[str, list[str]] = {}
    for one in looked:
        for baseline in dict.fromkeys(point.baseline for point in one.points):
            parts = []
            for quantity in dict.fromkeys(point.quantity for point in one.points):
                values = [p.value.middle for p in one.points if (p.baseline, p.quantity) == (baseline, quantity)]
                if values:
                    parts.append(_range(values) + (" (with motion)" if quantity.endswith("with motion") else ""))
            name = one.check.get("short", "")
            result.setdefault(baseline, []).append((f"{name}: " if name else "") + ", ".join(parts))
    return {baseline: "; ".join(parts) for baseline, parts in result.items()}


def _range(values: list[float]) -> str:
    low, high = text.factor(min(values)), text.factor(max(values))
    return low if low == high else f"{low} to {high}"


def _wanted(check: dict[str, Any]) -> str:
    words = {"<": "below", "<=": "at most", ">": "above", ">=": "at least"}.get(check["relation"], check["relation"])
    room = f", give or take {text.percent(check['tolerance'])}" if check["tolerance"] else ""
    return f"{words} {text.factor(check['bound']) if check['bound'] else '0'}{room}"


def _kinds(points: list[Point]) -> list[tuple[str, str]]:
    return list(dict.fromkeys((point.baseline, point.quantity) for point in points))


def _against(baseline: str, quantity: str, names: dict[str, str], several: bool) -> str:
    told = f"against {names[baseline]}" if baseline else ""
    if quantity.endswith("with motion"):
        told += " with motion evaluation"
    elif several:
        told += " without motion evaluation"
    return told.strip()


def sentence(one: Looked, names: dict[str, str]) -> str:
    """Describes a check: the measured values, where it is met, and the requirement."""
    parts = []
    several = any(quantity.endswith("with motion") for quantity in one.check["quantities"])
    for baseline, quantity in _kinds(one.points):
        mine = [point for point in one.points if (point.baseline, point.quantity) == (baseline, quantity)]
        low, high = min(mine, key=lambda p: p.value.middle), max(mine, key=lambda p: p.value.middle)
        told = _against(baseline, quantity, names, several)
        told = f"{told} " if told else ""
        if len(mine) == 1:
            told += f"{text.factor(low.value.middle)} ({place(low)}): {where(mine)}"
        elif text.factor(low.value.middle) == text.factor(high.value.middle):
            told += f"{text.factor(low.value.middle)} at all {len(mine)} points: {where(mine)}"
        else:
            told += (
                f"{text.factor(low.value.middle)} ({place(low)}) to {text.factor(high.value.middle)} ({place(high)}): "
                f"{where(mine)}"
            )
        close = sum(point.close for point in mine)
        if close:
            told += f" (at {text.plural(close, 'point')} repetitions disagree)"
        parts.append(told)
    what = one.check["what"]
    return f"{what[0].upper()}{what[1:]} (wanted: {_wanted(one.check)}): " + "; ".join(parts) + "."


def place(point: Point) -> str:
    """Describes the place of a point."""
    return f"{point.scene} {text.size(point.size)}, l = {point.l:g}"


def where(points: list[Point]) -> str:
    """Describes the points at which the check is met: the simplest rule that separates them exactly, or a count."""
    good = [point for point in points if point.met]
    if len(good) == len(points):
        return "met everywhere"
    if not good:
        return "met nowhere"
    for name, of, show in (
        ("l", lambda p: p.l, lambda v: f"l = {v:g}"),
        ("size", lambda p: p.size, lambda v: f"{text.size(v)} polygons"),
    ):
        bad = [of(point) for point in points if not point.met]
        if min(of(point) for point in good) > max(bad):
            return f"met from {show(min(of(point) for point in good))} on"
        if max(of(point) for point in good) < min(bad):
            return f"met up to {show(max(of(point) for point in good))}"
    scenes = sorted({point.scene for point in good})
    if not any(point.scene in scenes for point in points if not point.met):
        return f"met on {text.listing(scenes)} only"
    told = "; ".join(place(point) for point in good[:3]) + ("; …" if len(good) > 3 else "")
    return f"met at {len(good)} of {len(points)} points ({told})"


def condition(looked: list[Looked], names: dict[str, str]) -> str:
    """Returns the condition under which all checks are met, one clause for each check that is not met everywhere."""
    clauses = []
    for one in looked:
        if all(point.met for point in one.points):
            continue
        several = any(quantity.endswith("with motion") for quantity in one.check["quantities"])
        parts = []
        kinds = _kinds(one.points)
        for baseline, quantity in kinds:
            mine = [point for point in one.points if (point.baseline, point.quantity) == (baseline, quantity)]
            if any(point.met for point in mine):
                parts.append(f"{_against(baseline, quantity, names, several)} {where(mine)}".strip())
        unmet = "; nothing else is met" if len(parts) < len(kinds) else ""
        clauses.append(f"{one.check['what']}: {'; '.join(parts)}{unmet}")
    return ". ".join(clauses)


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


def _check_record(one: Looked) -> dict[str, Any]:
    return {
        **{name: one.check[name] for name in ("what", "measure", "quantities", "relation", "bound", "tolerance")},
        "missing": one.missing,
        "points": [
            {
                "baseline": p.baseline, "quantity": p.quantity, "scene": p.scene, "size": p.size, "l": p.l,
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
            "checks": row.checks,
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
        for one in row.apart:
            lines.append(f"     on {text.listing(one.scenes)}: {one.verdict}")
        lines.append(f"     {row.why}")
    return "\n".join(lines)


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input. Verdicts are no errors."""
    parser = argparse.ArgumentParser(prog="claims.py", description="Checks the paper's claims against RESULTS_DIR.")
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl (and theory.json)")
    parser.add_argument("--claims", metavar="FILE", type=Path, default=FILE, help="claims other than the paper's")
    options = parser.parse_args(arguments)
    try:
        claims = evaluate(load(options.folder), options.folder, options.claims)
        print(plain(claims))
        print(write(claims, options.folder))
    except (ResultError, ClaimError) as error:
        print(f"claims: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        text, code = files.complaint(error)
        print(f"claims: {text}", file=sys.stderr)
        return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
