"""The choices of strategies that choose among others, compared with the best fixed choice."""

from __future__ import annotations

from dataclasses import dataclass

from results import text
from results.load import Study

TOTAL = ["update", "traversal", "triangle_tests"]  #: phases: the chosen strategy evaluates positions


@dataclass
class Choice:
    """One run of a choosing strategy."""

    scene: str
    size: str
    scalar: str
    l: str
    chosen: str
    seen: str  #: the inputs of the choice
    best: str  #: the fastest of the others in the same table
    ratio: float  #: its total over the chooser's; below 1: another would have been faster


def choices(study: Study) -> list[Choice]:
    """Returns a row for each timed run that reports its choice; the best fixed choices are kbvh's own, with one thread."""
    found = []
    timed = study.timed
    for _, rows in timed.groupby("group", sort=False):
        others = rows[(rows["choice"] == "") & (rows["guarantee"] == "exact") & rows["params"].map(_single)]
        for _, row in rows[rows["choice"] != ""].iterrows():
            if others.empty:
                continue
            totals = others[TOTAL].sum(axis=1)
            best = others.loc[totals.idxmin()]
            chosen, _, seen = str(row["choice"]).partition(" (")
            found.append(
                Choice(
                    str(row["scene_name"]), text.size(row["moving"]), str(row["scalar"]), f"{row['l']:g}", chosen,
                    seen.removesuffix(")"), str(best["label"]), float(totals.min() / row[TOTAL].sum()),
                )  # fmt: skip
            )
    return found


def _single(params: dict[str, object]) -> bool:
    return str(params.get("threads", "1")) == "1"
