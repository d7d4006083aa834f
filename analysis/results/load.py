"""Reads a folder's results.jsonl, checks it, and returns it as tables. Never writes to it.

experiments/RESULTS.md documents the schema. A line that lacks an indispensable field is skipped, with a note that names the
line and the field; other missing fields read as unknown.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any, Optional

import numpy as np
import pandas as pd

from results import clip_times, files, scene_names
from results.files import ResultError

SCHEMA = 2
#: Times of schema 1 leave out the beginning of the clip. They are shown, but in groups of their own.
OLD_SCHEMA = 1
FILE_NAME = "results.jsonl"
PHASES = ("motion", "update", "traversal", "triangle_tests", "plan_changes")
#: Counters that tables and figures read. Others become columns, too, if the results have them.
READ_COUNTERS = ("certificates_failed", "values_written", "positions_fetched")
#: Counters that are a level, not a sum over the clip.
LEVELS = ("queue_peak", "list_peak", "most_nodes_searched")
GUARANTEES = ("exact", "candidate_superset", "approximate")


def read_json(file: Path, schema: str, error: type[Exception]) -> dict[str, Any]:
    """Returns the object in a JSON file of this schema; raises `error`, with one sentence, if there is none."""
    try:
        found = files.read_json(file)
    except (OSError, ValueError) as problem:
        raise error(f"{file} cannot be read: {problem}.") from problem
    if not isinstance(found, dict) or found.get("schema") != schema:
        raise error(f"{file}: the schema is not {schema}")
    return found


@dataclass
class Study:
    """The input of a report.

    `runs` has one row per contestant and group (scene, scalar, interpolated frames, machine); `repetitions` has one row per
    repetition with the mean time per frame of each phase in ms. Both share the column `run`. `raw` has the raw times of each
    timed run, from which ratios are computed. `notes` are sentences about skipped data.
    """

    source: Path
    runs: pd.DataFrame
    repetitions: pd.DataFrame
    notes: list[str]
    raw: dict[int, clip_times.RawTimes] = field(default_factory=dict, repr=False, compare=False)

    def groups(self) -> list[pd.DataFrame]:
        """Returns the runs of each group, in the order of a report: scenes as in the file, then size, scalar and l."""
        first = self.runs.groupby("scene")["run"].transform("min")
        ordered = self.runs.assign(first=first, doubles=self.runs["scalar"] != "float").sort_values(
            ["first", "primitives", "doubles", "scalar", "l", "group", "run"], kind="stable"
        )
        return [rows.drop(columns=["first", "doubles"]) for _, rows in ordered.groupby("group", sort=False)]

    @cached_property
    def sessions(self) -> dict[int, Any]:
        """The session of each run."""
        return dict(zip(map(int, self.runs["run"]), self.runs["session"]))

    @property
    def timed(self) -> pd.DataFrame:
        """Returns runs with times: verified, not refused."""
        return self.runs[self.runs["refused"] == ""]

    @property
    def refused(self) -> pd.DataFrame:
        """Returns runs without times, each with its reason."""
        return self.runs[self.runs["refused"] != ""]


_MISSING = object()


class _Record:
    """One line, with its place in the file for messages."""

    def __init__(self, data: dict[str, Any], place: str) -> None:
        self.data = data
        self.place = place

    def get(self, path: str, default: Any = _MISSING) -> Any:
        value: Any = self.data
        for step in path.split("."):
            value = value.get(step, _MISSING) if isinstance(value, dict) else _MISSING
            if value is _MISSING:
                break
        if value is _MISSING or (value is None and default is not _MISSING):
            if default is _MISSING:
                raise ResultError(f"{self.place}: the field {path} is missing.")
            return default
        return value

    def text(self, path: str, default: Any = _MISSING) -> str:
        value = self.get(path, default)
        if not isinstance(value, str):
            raise ResultError(f"{self.place}: {path} should be a text, but is {json.dumps(value)}.")
        return value

    def number(self, path: str, default: Any = _MISSING) -> float:
        value = self.get(path, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ResultError(f"{self.place}: {path} should be a number, but is {json.dumps(value)}.")
        if value is not default and not abs(value) <= sys.float_info.max:
            raise ResultError(f"{self.place}: {path} is too large for a number.")
        return float(value)

    def flag(self, path: str, default: Any = _MISSING) -> bool:
        value = self.get(path, default)
        if not isinstance(value, bool):
            raise ResultError(f"{self.place}: {path} should be true or false, but is {json.dumps(value)}.")
        return value


#: Of the runs with equal values in these columns, a report shows the newest.
ONE_OF_ALL_COMMITS = ("group", "contestant")
ONE_OF_EACH_COMMIT = (*ONE_OF_ALL_COMMITS, "commit", "dirty")


def load(folder: Path, newest_of: tuple[str, ...] = ONE_OF_ALL_COMMITS) -> Study:
    """Reads `folder`/results.jsonl; of runs that agree in the columns `newest_of`, the newest. Raises ResultError."""
    path = folder / FILE_NAME
    try:
        lines = path.read_bytes().decode("utf-8", errors="replace").split("\n")
    except FileNotFoundError:
        raise ResultError(f"{path} does not exist: `kbvh run --out {folder}` writes it.") from None
    except OSError as error:
        raise ResultError(f"{path} cannot be read: {error.strerror}.") from None

    notes: list[str] = []
    rows: list[dict[str, Any]] = []
    repetitions: list[dict[str, float]] = []
    raw: dict[int, clip_times.RawTimes] = {}
    last = max((i for i, line in enumerate(lines) if line.strip()), default=-1)
    for index, line in enumerate(lines):
        if not line.strip():
            continue
        place = f"{path} line {index + 1}"
        try:
            data = files.parse_json(line)
        except ValueError:
            why = "it breaks off, as after an interrupted run" if index == last else "it is not JSON"
            notes.append(f"Line {index + 1} of {FILE_NAME} was skipped: {why}.")
            continue
        if not isinstance(data, dict) or "schema" not in data:
            notes.append(f"Line {index + 1} of {FILE_NAME} was skipped: it is no result.")
            continue
        record = _Record(data, place)
        schema = record.get("schema")
        if schema not in (SCHEMA, OLD_SCHEMA) or isinstance(schema, bool):
            raise ResultError(
                f"{place}: schema {json.dumps(schema)} is not known to this report, which reads schema {SCHEMA} and {OLD_SCHEMA}."
            )
        try:
            row = _row(record, index)
            times = _repetitions(record, index, row)
            if times:
                raw[index] = _raw(record, row)
        except ResultError as problem:
            notes.append(f"Line {index + 1} of {FILE_NAME} was skipped: {str(problem).removeprefix(place).lstrip(':, ')}")
            continue
        repetitions += times
        rows.append(row)
    if not rows and notes:
        raise ResultError(f"{path} has no result that can be used. {notes[0]}")
    if not rows:
        raise ResultError(f"{path} has no results yet: `kbvh run --out {folder}` adds some.")
    runs = pd.DataFrame(rows)
    runs["scene"], told_apart = scene_names.told_apart(runs)
    notes += told_apart
    runs["label"] = _labels(runs)
    runs, dropped = _newest(runs, newest_of)
    if dropped:
        notes.append(
            f"{dropped} older measurement{'s' if dropped > 1 else ''} of the same configuration"
            f" {'are' if dropped > 1 else 'is'} kept in the file, but not shown: the newest counts."
        )
    measured = pd.DataFrame(repetitions, columns=["run", "repetition", *PHASES])
    measured = measured.astype({"run": int, "repetition": int, **{name: float for name in PHASES}})
    times = measured[measured["run"].isin(runs["run"])].reset_index(drop=True)
    raw = {run: raw[run] for run in map(int, runs["run"]) if run in raw}
    old = int((runs["schema"] == OLD_SCHEMA).sum())
    if old:
        notes.append(
            f"{old} of {len(runs)} results are of schema {OLD_SCHEMA}: their times leave out the beginning of the clip (the reset and "
            "the first frame), and are never compared with newer ones."
        )
    return Study(path, _with_times(runs, times, raw), times, notes, raw)


def _row(record: _Record, index: int) -> dict[str, Any]:
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


def _object(record: _Record, path: str) -> dict[str, Any]:
    found = record.get(path, {})
    if not isinstance(found, dict):
        raise ResultError(f"{record.place}: {path} should be an object.")
    return found


def _list(record: _Record, path: str) -> list[Any]:
    listed = record.get(path, [])
    if not isinstance(listed, list):
        raise ResultError(f"{record.place}: {path} should be a list.")
    return listed


def _over_time(record: _Record) -> list[dict[str, float]]:
    """Returns the quality of the boxes at some times of the clip, if it can be compared with a rebuilt tree."""
    samples = []
    for entry in _list(record, "verified.over_time"):
        one = _Record(entry if isinstance(entry, dict) else {}, f"{record.place}, verified.over_time")
        sample = {name: one.number(name) for name in ("t", "looseness", "sah", "sah_rebuilt")}
        if sample["sah"] > 0 and sample["sah_rebuilt"] > 0:
            samples.append(sample)
    return samples


def _times_over_time(record: _Record) -> list[dict[str, float]]:
    """Returns the times of equal parts of the clip; empty for results of older programs."""
    parts = []
    for entry in _list(record, "times.over_time"):
        one = _Record(entry if isinstance(entry, dict) else {}, f"{record.place}, times.over_time")
        parts.append({name: one.number(name) for name in ("begin", "update", "query")})
    return parts


def _changes(record: _Record) -> str:
    """Describes the script of plan changes; empty without one."""
    steps, changes = record.number("scene.script.steps", 0), record.number("scene.script.changes", 0)
    return f"{changes:.0f} of single vertices, in {steps:.0f} frames" if changes else ""


def _changed_per_frame(record: _Record) -> float:
    """Returns the pairs that begin or end per frame; unknown unless answers were asked as changes."""
    steps = record.number("scene.frames", math.nan) - 1
    changed = record.number("changes.begun", math.nan) + record.number("changes.ended", math.nan)
    return changed / steps if steps > 0 else math.nan


def _moving(bodies: Any) -> float:
    """Counts the primitives of moving bodies, as the paper does; 0 if unknown."""
    listed = [body for body in bodies if isinstance(body, dict)] if isinstance(bodies, list) else []
    counts = [body.get("primitives") for body in listed if body.get("moving") is True]
    return float(sum(count for count in counts if isinstance(count, (int, float))))


def _repetitions(record: _Record, index: int, row: dict[str, Any]) -> list[dict[str, float]]:
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
        one = _Record(entry if isinstance(entry, dict) else {}, f"{record.place}, repetition {number + 1}")
        values = {name: one.number(name, 0.0 if name == "plan_changes" else _MISSING) for name in PHASES}
        for name, value in values.items():
            if not (math.isfinite(value) and value >= 0):
                raise ResultError(f"{one.place}: {name} is {value}, which is not a time.")
        # Both are the strategy's answers to changes at run time: every sum has them together.
        values["plan_changes"] += one.number("geometry_changes", 0.0)
        result.append({"run": index, "repetition": number, **values})
    return result


def _instructions(record: _Record, params: dict[str, Any], machine: dict[str, str]) -> str:
    """Returns the instruction set of a contestant's code: a peer's own, the one it was held to, or that of kbvh's kernels in use."""
    chosen = str(params.get("kernels", "auto"))
    return record.text("strategy.instructions", "") or (chosen if chosen != "auto" else machine["kernels"])


def _raw(record: _Record, row: dict[str, Any]) -> clip_times.RawTimes:
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


def _sums(record: _Record, listed: list[Any], part: str) -> np.ndarray:
    """Returns the phases of each repetition, [repetition][clip_times.PARTS]; means serve as sums, because only shares count."""
    entries = [_Record(entry, f"{record.place}, repetition {number + 1}") for number, entry in enumerate(listed)]
    return np.array(
        [[one.number(part + name, 0.0 if name.endswith("changes") else _MISSING) for name in clip_times.PARTS] for one in entries]
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


def _labels(runs: pd.DataFrame) -> pd.Series:
    """Returns titles, followed only by the settings that distinguish configurations of one strategy."""
    labels: dict[str, str] = {}
    for _, rows in runs.groupby("id"):
        unique = rows.drop_duplicates("contestant")[["contestant", "title", "params", "builder"]]
        facts = [_facts(row.params, row.builder) for row in unique.itertuples()]
        names = sorted({name for fact in facts for name in fact})
        varying = [name for name in names if len({fact.get(name, "") for fact in facts}) > 1]
        for row, fact in zip(unique.itertuples(), facts):
            told = ", ".join(f"{name} {fact[name]}".replace("_", " ").strip().replace(" ", "\u00a0") for name in varying if fact.get(name, "") != "")
            labels[row.contestant] = f"{row.title} ({told})" if told else row.title
    for title, same in runs.drop_duplicates("contestant").groupby(lambda i: labels[runs.at[i, "contestant"]]):
        if same["id"].nunique() > 1:  # two strategies with one title would share a line in a legend
            for row in same[["id", "contestant"]].itertuples():
                labels[row.contestant] = f"{title} [{row.id}]"
    return runs["contestant"].map(labels)


def _facts(params: dict[str, Any], builder: Optional[dict[str, Any]]) -> dict[str, str]:
    facts = {name: str(value) for name, value in params.items()}
    for name, value in (builder or {}).items():
        facts[{"leaf_size": "leaf", "method": ""}.get(name, name)] = str(value)
    return facts


def _newest(runs: pd.DataFrame, columns: tuple[str, ...]) -> tuple[pd.DataFrame, int]:
    """Keeps one run per configuration, the newest: an older time must not hide a newer failure."""
    newest = runs.drop_duplicates(list(columns), keep="last")
    return newest.reset_index(drop=True), len(runs) - len(newest)


#: Times of runs, with the program's names of what they add up.
SUMS = {
    **{name: name for name in PHASES},
    "plan_changes": "changes",
    "query": "query",
    "updating": "upkeep",
    "total": "total",
    "total_motion": "total_with_motion",
}


def _with_times(runs: pd.DataFrame, times: pd.DataFrame, raw: dict[int, clip_times.RawTimes]) -> pd.DataFrame:
    """Adds the time of each phase and of the sums, in ms per frame (clip_times.time_of), the spread of the repetitions, the steady
    total, and `middle_` and a phase: that phase in the repetition with the median total.
    """
    found = pd.DataFrame(
        {name: [clip_times.time_of(one, phase) for one in raw.values()] for name, phase in SUMS.items()}, index=list(raw), dtype=float
    )
    found["steady"] = [clip_times.time_of(one, "total", steady=True) for one in raw.values()]
    sums = times.assign(total_motion=times[list(PHASES)].sum(axis=1))
    extremes = sums.groupby("run")["total_motion"].agg(["min", "max", "count", "median"])
    found["spread"] = (extremes["max"] - extremes["min"]) / extremes["median"].where(extremes["median"] > 0)
    found["repetitions"] = extremes["count"]
    # The repetition in the middle (the lower one of two), whose phases add up to its total.
    ordered = sums.sort_values(["run", "total_motion", "repetition"])
    same = ordered.groupby("run")["run"]
    middle = ordered[same.cumcount() == (same.transform("size") - 1) // 2].set_index("run")[list(PHASES)]
    found = found.join(middle.add_prefix("middle_").astype(float))
    joined = runs.merge(found, how="left", left_on="run", right_index=True)
    joined["repetitions"] = joined["repetitions"].fillna(0).astype(int)
    false = joined["candidates"] - joined["pairs"] + joined["missed_candidates"].fillna(0)
    joined["false_candidates"] = false / np.maximum(joined["pairs"], 1)
    return joined
