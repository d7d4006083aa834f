"""Which strategy for what: recommendations that are computed from the results of a study, and nothing else.

A cell is one scene at one size, scalar and l, as measured on one machine. Each cell has kinds of work, which follow from what
was recorded: does the best refit's tree age, how many frames lie between keyframes, are pairs within a body asked for, do
plans change. For each kind, strategies are compared by the geometric mean over its cells of the fastest time of the cell over
their own. Of several settings of a strategy, the fastest counts in each cell. A strategy that was not measured in more than half
of the cells takes no part; otherwise a cell without it counts as its worst.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pandas as pd

import text
from load import Study

#: A tree ages if its expected cost, over that of a rebuilt tree, grows by this factor in the clip.
AGES = 2.0

#: What a strategy may know about motion, from least to most.
FORESIGHT: dict[str, tuple[str, ...]] = {
    "without foresight": ("none",),
    "knows the next keyframe": ("none", "step_bound", "next_keyframe"),
    "knows the whole clip": ("none", "step_bound", "next_keyframe", "whole_clip"),
}


@dataclass
class Cell:
    """One scene at one size, scalar and l."""

    title: str
    kinds: list[str]
    shares: dict[str, float]  #: by strategy: the fastest time of the cell over its own, at most 1
    refit: float  #: the share of the best refit
    contestant: dict[str, str]  #: by strategy: its fastest setting


@dataclass
class Advice:
    """The best choice for one kind of work among the strategies with some foresight."""

    id: str
    contestant: str
    share: float  #: geometric mean of its shares
    worst: float
    worst_cell: str
    over_refit: float  #: geometric mean of its speed over the best refit's
    cells: int  #: in which it was measured


@dataclass
class Kind:
    """One kind of work."""

    name: str
    cells: int
    by_foresight: list[tuple[str, Advice | None]]


@dataclass
class Record:
    """How one strategy did in the whole study."""

    cells: int = 0
    fastest: list[str] = field(default_factory=list)  #: titles of the cells in which nothing was faster
    near: int = 0  #: cells in which it is within a tenth of the fastest
    share: float = math.nan
    worst: float = math.nan
    worst_cell: str = ""


def cells(study: Study) -> list[Cell]:
    """Returns the cells in which at least two strategies, a verified baseline among them, have a time."""
    found = []
    timed = study.timed
    single = timed["params"].map(lambda params: str(params.get("threads", "1")) == "1")
    usable = timed[single & (timed["guarantee"] != "approximate") & ~timed["family"].isin(["oracle", "limit"])]
    for _, rows in usable.groupby("group", sort=False):
        rows = rows.sort_values("total_motion")
        refits = rows[rows["baseline"]]
        if refits.empty or rows["id"].nunique() < 2:
            continue
        best = rows.drop_duplicates("id")
        least = float(best["total_motion"].iloc[0])
        found.append(
            Cell(
                _title(rows.iloc[0]),
                _kinds(refits.iloc[0]),
                {str(row.id): least / float(row.total_motion) for row in best[["id", "total_motion"]].itertuples()},
                least / float(refits["total_motion"].iloc[0]),
                {str(row.id): str(row.contestant) for row in best[["id", "contestant"]].itertuples()},
            )
        )
    return found


def kinds(study: Study) -> list[Kind]:
    """Returns the advice for each kind of work, the most frequent kind first."""
    foresight = dict(zip(study.runs["id"], study.runs["foresight"]))
    every = cells(study)
    names = dict.fromkeys(kind for cell in every for kind in cell.kinds)
    found = []
    for name in names:
        own = [cell for cell in every if name in cell.kinds]
        if len(own) == len(every) and name != "all":
            continue  # the same cells once more
        advice: list[tuple[str, Advice | None]] = []
        for column, allowed in FORESIGHT.items():
            advice.append((column, _advice(own, [id for id, word in foresight.items() if word in allowed])))
        found.append(Kind(name, len(own), advice))
    return sorted(found, key=lambda kind: -kind.cells)


def records(study: Study) -> dict[str, Record]:
    """Returns the record of every strategy with a time in some cell."""
    result: dict[str, Record] = {}
    shares: dict[str, list[float]] = {}
    for cell in cells(study):
        for id, share in cell.shares.items():
            record = result.setdefault(id, Record())
            record.cells += 1
            record.near += share >= 1 / 1.1
            if share == 1:
                record.fastest.append(cell.title)
            if not share >= record.worst:
                record.worst, record.worst_cell = share, cell.title
            shares.setdefault(id, []).append(share)
    for id, record in result.items():
        record.share = _mean(shares[id])
    return result


def _advice(own: list[Cell], ids: list[str]) -> Advice | None:
    """Returns the best of these strategies; a cell without a time counts as the worst of a strategy's others."""
    best: Advice | None = None
    for id in sorted(ids):
        measured = [cell for cell in own if id in cell.shares]
        if 2 * len(measured) < len(own) or not measured:
            continue
        worst = min(measured, key=lambda cell: cell.shares[id])
        missing = [worst.shares[id]] * (len(own) - len(measured))
        share = _mean([cell.shares[id] for cell in measured] + missing)
        if best is not None and share <= best.share:
            continue
        over_refit = _mean([cell.shares[id] / cell.refit for cell in measured])
        settings = [cell.contestant[id] for cell in measured]
        contestant = max(sorted(set(settings)), key=settings.count)
        best = Advice(id, contestant, share, worst.shares[id], worst.title, over_refit, len(measured))
    return best


def _kinds(refit: pd.Series) -> list[str]:
    """Returns the kinds of work of a cell, from the record of its best refit."""
    frames = refit["l"]
    step = "a keyframe at each frame" if frames <= 1 else "10 frames between keyframes, or more" if frames >= 10 else (
        "2 to 9 frames between keyframes")  # fmt: skip
    found = ["all", step]
    samples = refit["over_time"]
    if len(samples) > 1:
        quality = [sample["sah"] / sample["sah_rebuilt"] for sample in samples]
        ages = max(quality) / quality[0] >= AGES
        found.append(f"trees age (cost grows {AGES:g}x or more)" if ages else "trees do not age")
    if any(isinstance(body, dict) and body.get("self") is True for body in refit["bodies"]):
        found.append("pairs within a body")
    if refit["changes"]:
        found.append("plans change")
    return found


def _title(row: pd.Series) -> str:
    scalar = "" if row["scalar"] == "float" else f", {row['scalar']}"
    return f"{row['scene_name']}, {text.size(row['primitives'])}, l = {row['l']:g}{scalar}"


def _mean(values: list[float]) -> float:
    return math.exp(sum(map(math.log, values)) / len(values))
