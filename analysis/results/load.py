"""Reads a folder's results.jsonl, checks it, and returns it as tables. Never writes to it.

experiments/RESULTS.md documents the schema. A line that lacks an indispensable field is skipped, with a note that names the
line and the field; other missing fields read as unknown.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Optional

import numpy as np
import pandas as pd

from results import clip_times, files, scene_names
from results.files import ResultError
from results.record import Record
from results.rows import PHASES, READ_COUNTERS, SCHEMA, raw_times_of, repetitions_of, row_of  # noqa: F401  (others import them from here)

#: Times of schema 1 leave out the beginning of the clip. They are shown, but in groups of their own.
OLD_SCHEMA = 1
FILE_NAME = "results.jsonl"


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


#: Of the runs with equal values in these columns, a report shows the newest.
ONE_OF_ALL_COMMITS = ("group", "contestant")
ONE_OF_EACH_COMMIT = (*ONE_OF_ALL_COMMITS, "commit", "dirty")
ONE_OF_EACH_STUDY = (*ONE_OF_ALL_COMMITS, "study")  #: of a plan: two studies may ask the same of one contestant


def load(folder: Path, newest_of: tuple[str, ...] = ONE_OF_ALL_COMMITS) -> Study:
    """Reads `folder`/results.jsonl, or results.jsonl.xz; of runs that agree in the columns `newest_of`, the newest. Raises ResultError."""
    path = folder / FILE_NAME
    try:
        lines = files.read_packed(path).decode("utf-8", errors="replace").split("\n")
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
        record = Record(data, place)
        schema = record.get("schema")
        if schema not in (SCHEMA, OLD_SCHEMA) or isinstance(schema, bool):
            raise ResultError(
                f"{place}: schema {json.dumps(schema)} is not known to this report, which reads schema {SCHEMA} and {OLD_SCHEMA}."
            )
        try:
            row = row_of(record, index)
            times = repetitions_of(record, index, row)
            if times:
                raw[index] = raw_times_of(record, row)
                row["disturbed"] = raw[index].disturbed = clip_times.doubts(raw[index])
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
