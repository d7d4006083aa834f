"""Flattens a record: the columns of its run, its repetitions, and its raw times.

A field without a default is indispensable: without it the record is skipped (load.py). experiments/RESULTS.md documents them all.
"""

from __future__ import annotations

import json
import math
from datetime import datetime
from typing import Any, Optional

import numpy as np

from results import clip_times, scene_names
from results.files import ResultError
from results.record import MISSING, Record

SCHEMA = 2
PHASES = ("motion", "update", "traversal", "triangle_tests", "plan_changes")
#: Counters that tables and figures read. Others become columns, too, if the results have them.
READ_COUNTERS = ("certificates_failed", "values_written", "positions_fetched")
#: Counters that are a level, not a sum over the clip.
LEVELS = ("queue_peak", "list_peak", "most_nodes_searched")
GUARANTEES = ("exact", "candidate_superset", "approximate")


def row_of(record: Record, index: int) -> dict[str, Any]:
    """Flattens one record."""
    counters = record.get("counters", {})
    params = record.get("strategy.params", {})
    builder = record.get("strategy.builder", None)
    if not isinstance(counters, dict) or not isinstance(params, dict) or not isinstance(builder, (dict, type(None))):
        raise ResultError(f"{record.place}: counters, strategy.params and strategy.builder should be objects.")
    guarantee = record.text("strategy.guarantee")
    if guarantee not in GUARANTEES:
        raise ResultError(
            f"{record.place}: strategy.guarantee is {json.dumps(guarantee)}, but should be one of {', '.join(GUARANTEES)}."
        )
    machine = {
        name: str(record.get(f"machine.{name}", ""))
        for name in ("cpu", "cores", "memory_gb", "os", "compiler", "flags", "build_type", "simd", "kernels")
    }
    if isinstance(record.get("machine.simd", ""), list):
        machine["simd"] = ", ".join(map(str, record.get("machine.simd")))
    holds = record.flag("verified.holds")
    violation = record.text("verified.first_violation", "")
    times = record.get("times", None)
    refused = ""
    if not holds:
        refused = f"its declared guarantee or tightness is broken: {violation or 'no detail was recorded'}"
    elif times is None:
        refused = record.text("refused", "") or "no time was taken"
    bodies = record.get("scene.bodies", [])
    row: dict[str, Any] = {
        "run": index,
        "schema": int(record.number("schema")),
        "key": str(record.get("key", "")),
        "session": str(record.get("run", "")),
        "study": str(record.get("study", "")),
        "kind": record.text("kind"),
        "when": _time(record.text("when", "")),
        "commit": record.text("commit", ""),
        "dirty": record.flag("dirty", False),
        **machine,
        "seed": str(record.get("seed", "")),
        "scene": scene_names.family(record.text("scene.name"), bodies),
        "scene_name": record.text("scene.name"),
        "origin": record.text("scene.origin", ""),
        "changes": _changes(record),
        "answer": record.text("scene.changes", ""),
        "rays": record.text("scene.rays", ""),
        "within": record.text("scene.within", ""),
        "held_to": record.text("scene.kernels", ""),
        "changed_per_frame": _changed_per_frame(record),
        "hash": str(record.get("scene.hash", "")),
        "card": str(record.get("scene.card", "")),
        "scalar": record.text("scene.scalar"),
        "l": record.number("scene.per_keyframe"),
        "keyframes": record.number("scene.keyframes", math.nan),
        "frames": record.number("scene.frames", math.nan),
        "primitives": record.number("scene.primitives"),
        "moving": _moving(bodies) or record.number("scene.primitives"),
        "bodies": bodies if isinstance(bodies, list) else [],
        "id": record.text("strategy.id"),
        "tag": record.text("strategy.label", ""),
        "title": record.text("strategy.title", record.text("strategy.id")),
        "family": record.text("strategy.family", "unknown"),
        # Records from before baselines were declared are classified by family.
        "baseline": record.flag("strategy.baseline", record.text("strategy.family", "unknown") == "refit"),
        "guarantee": guarantee,
        "tightness": record.text("strategy.tightness", ""),
        "foresight": record.text("strategy.foresight", ""),
        "citation": record.text("strategy.citation", ""),
        "about": record.text("strategy.about", ""),
        "plan": _object(record, "plan"),
        "again": _object(record, "again"),
        "order": record.text("scene.order", ""),
        "continuous": record.flag("scene.continuous", False),
        "choice": record.text("choice", ""),
        "own_scalar": record.text("strategy.own_scalar", ""),
        "version": record.text("strategy.version", ""),
        "instructions": _instructions(record, params, machine),
        "remark": record.text("strategy.remark", ""),
        "params": params,
        "threads": _threads(params),
        "builder": builder,
        "over_time": _over_time(record),
        "times_over_time": _times_over_time(record),
        "events_at_depth": _list(record, "events_at_depth"),
        "holds": holds,
        "violation": violation,
        "audited": record.flag("verified.audited", False),
        "refused": refused,
        "sampled_every": record.number("verified.sampled_every", 1),
        "p50": record.number("times.total_p50", math.nan),
        "p99": record.number("times.total_p99", math.nan),
        "worst": record.number("times.total_worst", math.nan),
        "build_ms": record.number("times.build_ms", math.nan),
        "disturbed": record.text("times.disturbed", ""),
        "bytes": record.number("bytes", math.nan),
    }
    for name in ("frames", "pairs", "candidates", "missed_candidates", "missed", "extra", "wrong_frames", "first_missed",
                 "missed_depth", "missed_depth_mean", "missed_depth_in_edges", "repeated", "malformed", "protrusion", "looseness", "invalid", "not_tight"):  # fmt: skip
        row["verified_frames" if name == "frames" else name] = record.number(f"verified.{name}", math.nan)
    if not row["audited"]:  # a hierarchy that cannot be seen has no measured boxes, whatever was recorded
        row["protrusion"] = row["looseness"] = math.nan
    counters = record.get("counters", {})
    for name in dict.fromkeys((*READ_COUNTERS, *(counters if isinstance(counters, dict) else ()))):
        total = record.number(f"counters.{name}", math.nan)
        row[f"{name}_per_frame"] = total if name in LEVELS or not row["frames"] > 0 else total / row["frames"]
    row["contestant"] = _identity(row["id"], params, builder)
    row["machine"] = " · ".join(
        machine[name] for name in ("cpu", "os", "compiler", "flags", "build_type", "simd", "kernels") if machine[name]
    )
    row["group"] = json.dumps(
        [row["scene_name"], row["hash"], row["primitives"], row["scalar"], row["l"], str(row["frames"]), row["machine"]]
        + ([f"schema {row['schema']}"] if row["schema"] != SCHEMA else [])
    )
    return row


def _time(text: str) -> str:
    """Returns a time as kbvh writes it; empty for a day that does not exist: it would be the newest one.

    >>> _time("2026-01-31T23:59:59Z"), _time("2999-13-45T00:00:00Z")
    ('2026-01-31T23:59:59Z', '')
    """
    try:
        return text if datetime.strptime(text, "%Y-%m-%dT%H:%M:%SZ") else ""
    except ValueError:
        return ""


def _object(record: Record, path: str) -> dict[str, Any]:
    found = record.get(path, {})
    if not isinstance(found, dict):
        raise ResultError(f"{record.place}: {path} should be an object.")
    return found


def _list(record: Record, path: str) -> list[Any]:
    listed = record.get(path, [])
    if not isinstance(listed, list):
        raise ResultError(f"{record.place}: {path} should be a list.")
    return listed


def _over_time(record: Record) -> list[dict[str, float]]:
    """Returns the quality of the boxes at some times of the clip, if it can be compared with a rebuilt tree."""
    samples = []
    for entry in _list(record, "verified.over_time"):
        one = Record(entry if isinstance(entry, dict) else {}, f"{record.place}, verified.over_time")
        sample = {name: one.number(name) for name in ("t", "looseness", "sah", "sah_rebuilt")}
        if sample["sah"] > 0 and sample["sah_rebuilt"] > 0:
            samples.append(sample)
    return samples


def _times_over_time(record: Record) -> list[dict[str, float]]:
    """Returns the times of equal parts of the clip; empty for results of older programs."""
    parts = []
    for entry in _list(record, "times.over_time"):
        one = Record(entry if isinstance(entry, dict) else {}, f"{record.place}, times.over_time")
        parts.append({name: one.number(name) for name in ("begin", "update", "query")})
    return parts


def _changes(record: Record) -> str:
    """Describes the script of plan changes; empty without one."""
    steps, changes = record.number("scene.script.steps", 0), record.number("scene.script.changes", 0)
    return f"{changes:.0f} of single vertices, in {steps:.0f} frames" if changes else ""


def _changed_per_frame(record: Record) -> float:
    """Returns the pairs that begin or end per frame; unknown unless answers were asked as changes."""
    steps = record.number("scene.frames", math.nan) - 1
    changed = record.number("changes.begun", math.nan) + record.number("changes.ended", math.nan)
    return changed / steps if steps > 0 else math.nan


def _moving(bodies: Any) -> float:
    """Counts the primitives of moving bodies, as the paper does; 0 if unknown."""
    listed = [body for body in bodies if isinstance(body, dict)] if isinstance(bodies, list) else []
    counts = [body.get("primitives") for body in listed if body.get("moving") is True]
    return float(sum(count for count in counts if isinstance(count, (int, float))))


def repetitions_of(record: Record, index: int, row: dict[str, Any]) -> list[dict[str, float]]:
    """Returns the repetitions of a record with times."""
    if row["refused"]:
        return []
    unit = record.text("times.unit", "ms")
    if unit != "ms":
        raise ResultError(f'{record.place}: times are in "{unit}", but this report reads ms.')
    listed = record.get("times.repetitions")
    if not isinstance(listed, list) or not listed:
        raise ResultError(f"{record.place}: times.repetitions should be a list with at least one entry.")
    result = []
    for number, entry in enumerate(listed):
        one = Record(entry if isinstance(entry, dict) else {}, f"{record.place}, repetition {number + 1}")
        values = {name: one.number(name, 0.0 if name == "plan_changes" else MISSING) for name in PHASES}
        for name, value in values.items():
            if not (math.isfinite(value) and value >= 0):
                raise ResultError(f"{one.place}: {name} is {value}, which is not a time.")
        # Both are the strategy's answers to changes at run time: every sum has them together.
        values["plan_changes"] += one.number("geometry_changes", 0.0)
        result.append({"run": index, "repetition": number, **values})
    return result


def _instructions(record: Record, params: dict[str, Any], machine: dict[str, str]) -> str:
    """Returns the instruction set of a contestant's code: a peer's own, the one it was held to, or that of kbvh's kernels in use."""
    chosen = str(params.get("kernels", "auto"))
    return record.text("strategy.instructions", "") or (chosen if chosen != "auto" else machine["kernels"])


def raw_times_of(record: Record, row: dict[str, Any]) -> clip_times.RawTimes:
    """Returns the raw times of a record whose repetitions are known to have times."""
    listed = record.get("times.repetitions")
    sums = _sums(record, listed, "")
    if not all(isinstance(one, dict) and "totals" in one for one in listed):
        if row["schema"] == SCHEMA:
            raise ResultError(f"{record.place}: times.repetitions: totals are missing.")
        motions = np.array([[one["motion"]] for one in listed], dtype=float)
        return clip_times.RawTimes(sums.sum(axis=1, keepdims=True), motions, sums, None, None, True, row["session"], row["disturbed"])
    try:
        totals, motions = (np.array([one[name] for one in listed], dtype=float) for name in ("totals", "motions"))
    except (KeyError, TypeError, ValueError) as problem:
        raise ResultError(f"{record.place}: times.repetitions: totals and motions should be lists of numbers: {problem}.") from None
    if totals.ndim != 2 or totals.shape != motions.shape or not totals.size or not np.isfinite([totals, motions]).all():
        raise ResultError(f"{record.place}: times.repetitions: totals and motions should have a number for each frame.")
    begin, steady = record.get("times.steady_from", None), None
    if begin is not None:
        if isinstance(begin, bool) or not isinstance(begin, int) or not 0 <= begin < totals.shape[1]:
            raise ResultError(f"{record.place}: times.steady_from should be a frame.")
        steady = _sums(record, listed, "steady.")
    by_clips = record.text("times.by", "frames") != "frames"
    return clip_times.RawTimes(totals, motions, sums, steady, begin, by_clips, row["session"], row["disturbed"])


def _sums(record: Record, listed: list[Any], part: str) -> np.ndarray:
    """Returns the phases of each repetition, [repetition][clip_times.PARTS]; means serve as sums, because only shares count."""
    entries = [Record(entry, f"{record.place}, repetition {number + 1}") for number, entry in enumerate(listed)]
    return np.array(
        [[one.number(part + name, 0.0 if name.endswith("changes") else MISSING) for name in clip_times.PARTS] for one in entries]
    )


def _threads(params: dict[str, Any]) -> int:
    """Returns the threads that a contestant shared its work among."""
    try:
        return max(1, int(float(params.get("threads", 1))))
    except (TypeError, ValueError):
        return 1


def _identity(strategy: str, params: dict[str, Any], builder: Optional[dict[str, Any]]) -> str:
    """Returns a text that is equal for equal configurations of a strategy."""
    return strategy + json.dumps([params, builder], sort_keys=True)
