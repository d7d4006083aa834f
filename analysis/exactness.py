"""The cost and the benefit of exactness: approximate contestants next to their exact counterparts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pandas as pd

import text
from load import Study

#: The exact counterpart of contestants that promise nothing, and what the two differ in.
COUNTERPARTS = {
    "kinetic_aabb_approximate": ("kinetic_aabb", "event times and formula"),
    "bottom_up_approximate": ("bottom_up", "positions and rounding of boxes"),
}


@dataclass
class Comparison:
    """One approximate contestant against its exact counterpart, over all tables that have both."""

    label: str
    differs: str
    tables: int
    ratio: float  #: time of the exact one over its own, positions included, geometric mean
    lowest: float
    highest: float
    pairs: int  #: true ones, of the frames that were compared
    missed: int
    extra: int
    protrusion: float  #: furthest that a vertex left its box, in units of the scene


def comparisons(study: Study) -> list[Comparison]:
    """Returns the comparisons in the order of the file."""
    timed = study.timed
    found: dict[str, list[tuple[float, pd.Series]]] = {}
    for _, rows in timed.groupby("group", sort=False):
        for _, row in rows[rows["id"].isin(list(COUNTERPARTS))].iterrows():
            exact = rows[rows["id"] == COUNTERPARTS[row["id"]][0]]
            if not exact.empty:
                ratio = float(exact["total_motion"].min() / row["total_motion"])
                found.setdefault(str(row["label"]), []).append((ratio, row))
    result = []
    for label, members in found.items():
        ratios = [ratio for ratio, _ in members]
        rows = pd.DataFrame([row for _, row in members])
        result.append(
            Comparison(
                label, COUNTERPARTS[rows["id"].iloc[0]][1], len(members),
                math.exp(sum(map(math.log, ratios)) / len(ratios)), min(ratios), max(ratios),
                int(rows["pairs"].sum()), int(rows["missed"].sum()), int(rows["extra"].sum()), float(rows["protrusion"].max()),
            )  # fmt: skip
        )
    return result


def paragraph(listed: list[Comparison]) -> str:
    """Describes the cost of exactness in a few sentences; empty without suitable contestants."""
    if not listed:
        return ""
    right = [one for one in listed if not one.missed and not one.extra and not one.protrusion > 0]
    wrong = [one for one in listed if one.missed or one.extra]
    leaves = [one for one in listed if not one.missed and not one.extra and one.protrusion > 0]
    cheap, dear = min(listed, key=lambda one: one.ratio), max(listed, key=lambda one: one.ratio)
    words = [
        f"In {text.plural(max(one.tables for one in listed), 'table')} the exact contestants took {text.factor(cheap.ratio)} "
        f"({cheap.label}) to {text.factor(dear.ratio)} ({dear.label}) times as long as those that promise nothing, positions included."
    ]
    for one in wrong:
        words.append(
            f"{one.label} missed {text.count(one.missed)} and made up {text.count(one.extra)} of {text.count(one.pairs)} pairs, for "
            f"{_gain(one.ratio)}; a vertex left its box by up to {text.significant(one.protrusion, 2)}."
        )
    if leaves:
        furthest = max(one.protrusion for one in leaves)
        words.append(
            f"Vertices leave boxes by up to {text.significant(furthest, 2)}, and by luck no pair is wrong: "
            f"{text.listing([one.label for one in leaves])}."
        )
    if right:
        words.append(
            f"Right on these scenes, with nothing to say so beforehand: {text.listing([one.label for one in right])} "
            "(scenes made to break them are under Stress)."
        )
    return " ".join(words)


def _gain(ratio: float) -> str:
    share = ratio - 1
    if abs(share) < 0.005:
        return "nothing"
    return f"{text.percent(abs(share))} of speed" if share > 0 else f"being {text.percent(abs(share))} slower"
