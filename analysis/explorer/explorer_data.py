"""The data of the explorer: results as columns, small enough to lie in the page, and nothing that the page cannot show.

The page computes ratios, intervals and profiles from the times of all repetitions; raw_times.cpp and profiles.py define them, and
a test compares the two.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any, Optional

import pandas as pd

from advice import advice, cells_file, methods, summary
from claims import claim_pictures, claims as paper_claims
from figures import colours
from ratios import profiles
from results import clip_times, text
from results.load import PHASES, SUMS, ResultError, Study

SCHEMA = "kbvh-explorer-1"

#: Parts of a machine's description that tell machines apart, the most telling first.
MACHINE_PARTS = ("cpu", "kernels", "simd", "compiler", "flags", "build_type", "os", "cores", "memory_gb")

#: Columns of one run that are numbers, as they are in the page.
NUMBERS = ("p50", "p99", "worst", "bytes", "build_ms", "pairs", "candidates", "missed_candidates", "missed", "extra", "protrusion",
           "looseness", "verified_frames")  # fmt: skip
#: Counters that the page has, per frame.
COUNTERS = ("certificates_failed", "values_written", "nodes_visited", "box_tests", "triangle_tests")
COLUMNS = ("cell", "contestant", "session", "plan", "when", "kind", "repetitions", "limit", "every", "rounds", *NUMBERS, *COUNTERS, "refused",
           "disturbed", "clips", "times", "middle", "draws", "pace", "quality")  # fmt: skip
#: The sums of phases that the page has for each resample of the rounds.
DRAWN = ("motion", "upkeep", "query")


def number(value: Any, digits: Optional[int] = None) -> Optional[float]:
    """Returns a number for JSON: None if unknown, whole where it is whole, with as many significant digits as asked for."""
    if value is None or not math.isfinite(value):
        return None
    value = float(value) if digits is None else float(f"{value:.{digits}g}")
    return int(value) if value == int(value) and abs(value) < 2**53 else value


class Index:
    """Numbers values in the order of their first appearance."""

    def __init__(self) -> None:
        self.of: dict[Any, int] = {}

    def __call__(self, value: Any) -> int:
        return self.of.setdefault(value, len(self.of))


def data(study: Study, title: str, claims: Optional[paper_claims.Claims], folder: Path) -> dict[str, Any]:
    """Returns everything that the page shows."""
    runs = study.runs
    unique = runs.drop_duplicates("contestant")
    looks = colours.looks(zip(unique["contestant"], unique["id"], unique["family"]))
    contestants, cells, plans = Index(), Index(), Index()
    times = {int(run): rows for run, rows in study.repetitions.sort_values("repetition").groupby("run")}
    sessions = Index()
    columns: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    cell_rows: list[pd.Series] = []
    contestant_rows: list[pd.Series] = []
    for index, row in runs.iterrows():
        where = (row["group"], row["commit"], row["dirty"])
        if where not in cells.of:
            cell_rows.append(row)
        if row["contestant"] not in contestants.of:
            contestant_rows.append(row)
        plan = row["plan"]
        columns["cell"].append(cells(where))
        columns["contestant"].append(contestants(row["contestant"]))
        columns["session"].append(sessions(row["session"]))
        columns["plan"].append(plans((str(plan.get("name", "")), str(plan.get("description", "")))))
        columns["when"].append(row["when"])
        columns["kind"].append(row["kind"])
        columns["refused"].append(row["refused"])
        for name in NUMBERS:
            columns[name].append(number(row[name]))
        for name in COUNTERS:
            columns[name].append(number(row.get(f"{name}_per_frame"), 5))
        mine = times.get(int(row["run"]))
        columns["times"].append([] if mine is None else [[number(v) for v in line] for line in mine[list(PHASES)].to_numpy()])
        columns["repetitions"].append(len(columns["times"][-1]))
        raw = study.raw.get(int(row["run"]))
        columns["disturbed"].append(row["disturbed"])
        columns["clips"].append(raw is None or raw.by_clips)
        columns["middle"].append([] if raw is None else [number(clip_times.time_of(raw, SUMS[phase], False)) for phase in PHASES])
        columns["draws"].append([] if raw is None else _draws(raw))
        again = row["again"]
        columns["limit"].append(again.get("frames_limit", _limit(row)))
        columns["rounds"].append({key: again[key] for key in ("repetitions", "interval_width", "seconds") if key in again})
        columns["every"].append(number(again.get("oracle_every", row["sampled_every"])))
        columns["pace"].append([[number(p["begin"], 4), number(p["update"], 4), number(p["query"], 4)] for p in row["times_over_time"]])
        columns["quality"].append(
            [[number(p["t"], 5), number(p["sah"] / p["sah_rebuilt"], 4), number(p["looseness"], 4)] for p in row["over_time"]]
        )
    known = None if claims is None else summary.paper(claims, folder)
    taking_part = set(profiles.contestants(runs)["contestant"])
    machines, commits = _machines(cell_rows), _commits(runs)
    return {
        "schema": SCHEMA,
        "title": title,
        "source": study.source.name,
        "plans": [{"name": name, "description": description} for name, description in plans.of],
        "notes": study.notes,
        "phases": list(PHASES),
        "machines": [machine for machine, _ in machines],
        "commits": commits,
        "contestants": [_contestant(row, looks[row["contestant"]], row["contestant"] in taking_part) for row in contestant_rows],
        "cells": [_cell(row, dict((m, i) for i, (_, m) in enumerate(machines)), commits) for row in cell_rows],
        "runs": columns,
        "palette": colours.palette(),
        "methods": methods.METHODS,
        "claims": _claims(known),
        "paper": summary.parts_on_the_paper(known)[:-1] if known else [],
        "kept": kept(),
        "reference": known.reference if known else "",
        "report": "report.html" if (folder / "report.html").exists() else "",
    }


def kept(file: Path = summary.REFERENCE / cells_file.FILE) -> Optional[dict[str, Any]]:
    """Returns the cells that come with the project, each once, for questions that the results do not answer; None without such a file.

    Raises ResultError for a cell whose title has no size or no l.
    """
    if not file.exists():
        return None
    found = cells_file.read(file)
    cells = []
    for cell in advice.counted(found.cells):
        parts = re.search(r", ([\d.]+)([kM]?), l = ([\d.]+)", cell.title)
        if parts is None:
            raise ResultError(f"{file}: the cell {cell.title} has no size or no l in its title.")
        cells.append({
            "title": cell.title, "asks": cell.asks, "size": parts[1] + parts[2],
            "primitives": number(cell.primitives), "l": number(float(parts[3])),
            "refit": cell.best_refit, "speeds": {id: number(speed, 7) for id, speed in cell.speeds.items()},
            "times": {id: number(time, 7) for id, time in cell.times.items()}, "doubtful": sorted(cell.doubtful),
            "spans": {id: [number(span[0], 7), number(span[1], 7), span[2]] for id in cell.speeds if (span := cell.span(id))},
        })  # fmt: skip
    facts = {id: fact for cell in found.cells for id, fact in cell.facts.items()}
    return {
        "told": found.told.replace("`", ""),
        "strategies": {id: [one.title, one.foresight.replace("_", " "), one.baseline] for id, one in sorted(facts.items())},
        "cells": cells,
    }


def _draws(raw: clip_times.RawTimes) -> list[list[Optional[float]]]:
    """Returns the sums of DRAWN over resampled rounds, by frames; empty where there is no interval, and for contestants that count by
    clips, whose resamples the page makes from their repetitions."""
    if raw.by_clips or raw.repetitions < clip_times.FEWEST_OF_AN_INTERVAL:
        return []
    return [[number(v, 5) for v in clip_times.replicates(raw, phase)] for phase in DRAWN]


def _limit(row: pd.Series) -> int:
    """Guesses the limit of frames of an older record: their number, if the clip has more."""
    clip = (row["keyframes"] - 1) * row["l"] + 1
    return int(row["frames"]) if row["frames"] < clip else 0


def _machines(rows: list[pd.Series]) -> list[tuple[dict[str, Any], str]]:
    """Returns the machines with short labels, which name only the parts that differ, and with their full texts in groups."""
    unique: dict[str, pd.Series] = {}
    for row in rows:
        unique.setdefault(row["machine"], row)
    differing = [part for part in MACHINE_PARTS if len({row[part] for row in unique.values()}) > 1]
    result = []
    for machine, row in unique.items():
        facts = {part.replace("_gb", " (GB)").replace("_", " "): str(row[part]) for part in MACHINE_PARTS if row[part]}
        own = [str(row[part]) for part in differing if part != "cpu" and row[part]]
        result.append(({"label": " · ".join([row["cpu"] or "unknown machine", *own[:2]]), "facts": facts}, machine))
    labels = [machine["label"] for machine, _ in result]
    for i, (machine, _) in enumerate(result):
        if labels.count(labels[i]) > 1:
            machine["label"] += f" (machine {i + 1})"
    return result


def _commits(runs: pd.DataFrame) -> list[dict[str, Any]]:
    """Returns the commits in the order of their first measurements."""
    found = []
    for (commit, dirty), rows in runs.groupby(["commit", "dirty"], sort=False):
        when = min((w for w in rows["when"] if w), default="")
        found.append({"commit": commit, "dirty": bool(dirty), "when": when})
    return sorted(found, key=lambda one: one["when"])


def _contestant(row: pd.Series, look: colours.Look, takes_part: bool) -> dict[str, Any]:
    return {
        "id": row["id"],
        "title": row["title"],
        "label": row["label"].replace("\u00a0", " "),
        "tag": row["tag"] or " ".join([row["id"], *(f"{name}={value}" for name, value in sorted(row["params"].items()))]),
        "family": row["family"],
        "guarantee": row["guarantee"],
        "baseline": bool(row["baseline"]),
        "foresight": row["foresight"].replace("_", " "),
        "citation": row["citation"],
        "params": row["params"],
        "builder": row["builder"],
        "usual": takes_part,
        "look": colours.for_page(look),
    }


def _cell(row: pd.Series, machines: dict[str, int], commits: list[dict[str, Any]]) -> dict[str, Any]:
    commit = next(i for i, one in enumerate(commits) if (one["commit"], one["dirty"]) == (row["commit"], bool(row["dirty"])))
    return {
        "scene": row["scene"],
        "name": row["scene_name"],
        "hash": row["hash"],
        "primitives": number(row["primitives"]),
        "size": text.size(row["primitives"]),
        "scalar": row["scalar"],
        "l": number(row["l"]),
        "frames": number(row["frames"]),
        "keyframes": number(row["keyframes"]),
        "continuous": bool(row["continuous"]),
        "asks": advice.asked(row),
        "asked": _asked(row),
        "machine": machines[row["machine"]],
        "commit": commit,
        "again": _again(row),
    }


def _asked(row: pd.Series) -> dict[str, Any]:
    """Returns what a run was asked other than pairs at frames, as keys of a plan; options of the same names ask it on a command line.

    Read from the scene, because records of rays from before `asked_of` (experiments/study/plan.hpp) lack it in `again`.
    """
    asked = {
        "continuous": bool(row["continuous"]),
        "changes": row["answer"],
        "rays": row["rays"],
        "within": row["within"],
        "kernels": row["held_to"],
    }
    return {key: value for key, value in asked.items() if value}


def _again(row: pd.Series) -> dict[str, Any]:
    """Returns what makes the scene again: options of the command line, or an object of a plan, or why neither is known."""
    scenes = row["again"].get("scenes", [])
    if len(scenes) == 1 and isinstance(scenes[0], dict):
        scene = scenes[0]
        options = _options(scene)
        return {"options": options} if options else {"scene": scene}
    return _reconstructed(row)


#: Keys of a built-in scene in a plan, with their options.
SCENE_OPTIONS = (("builtin", "--scene"), ("triangles", "--triangles"), ("obstacle", "--obstacle"), ("keyframes", "--keyframes"),
                 ("radius", "--radius"), ("seed", None), ("order", "--order"))  # fmt: skip


def _options(scene: dict[str, Any]) -> str:
    """Returns the options of a built-in scene; empty if the command line has no option for one of its keys."""
    if not isinstance(scene.get("builtin"), str) or not set(scene) <= {*(key for key, _ in SCENE_OPTIONS), "optional"}:
        return ""
    words = [f"{option} {scene[key]}" for key, option in SCENE_OPTIONS if option and key in scene and scene[key] != "given"]
    if scene.get("seed", 1) != 1:
        words.append(f"--seed {scene['seed']}")
    return " ".join(words)


def _reconstructed(row: pd.Series) -> dict[str, Any]:
    """Returns the options of a built-in scene of an older record, from its name and the sizes of its bodies."""
    bodies = [body for body in row["bodies"] if isinstance(body, dict)]
    name = str(row["scene"]).split(" (", 1)[0]
    for order in ("shuffled", "renumbered"):
        name = name.removesuffix(f"-{order}")
    if row["origin"] != "built_in" or not bodies or not re.fullmatch(r"\w+", name):
        return {"why": "The record is older than the field that names the files or shapes of a scene: its plan has them."}
    words = [f"--scene {name}", f"--triangles {bodies[0].get('primitives')}"]
    if len(bodies) == 2 and not bodies[1].get("moving", True):
        words.append(f"--obstacle {bodies[1].get('primitives')}")
    if row["seed"] not in ("", "1"):
        words.append(f"--seed {row['seed']}")
    if row["order"] not in ("", "given"):
        words.append(f"--order {row['order']}")
    return {"options": " ".join(words)}


def _claims(known: Optional[summary.Paper]) -> list[dict[str, Any]]:
    """Returns the claims of the paper, in the order of their numbers, each with its verdict, whose it is, its ranges and its picture of these results."""
    if known is None:
        return []
    return [
        {"id": one.row.id, "claim": one.row.claim, "paper": one.row.paper, "verdict": one.verdict, "source": one.source, "brief": one.brief,
         "corners": paper_claims.ranges_of_corners(one.corners, one.ours),
         "picture": str(claim_pictures.picture(one.row.looked, one.row.checks)) if one.source == summary.HERE else ""}
        for one in known.verdicts if one.source
    ]  # fmt: skip
