"""The choices of strategies that choose among others, compared with the best fixed choice."""

from __future__ import annotations

import re
from dataclasses import dataclass

from results import text
from results.load import Study
from results.scene_names import short

FRAMES = r" for \d+ frame"  #: in the report of a strategy that chooses; others report the sizes of what they work with
TOTAL = ["update", "traversal", "triangle_tests"]  #: phases: the chosen strategy evaluates positions


@dataclass
class Choice:
    """One run of a choosing strategy."""

    scene: str
    size: str  #: primitives of both bodies together
    scalar: str
    l: str
    chooser: str
    chosen: str  #: titles, each with its frames
    seen: str  #: the inputs of the choice
    best: str  #: the fastest of the others in the same table
    ratio: float  #: its total over the chooser's; below 1: another would have been faster


def choices(study: Study) -> list[Choice]:
    """Returns a row for each timed run that reports for how many frames it chose which strategy; the best fixed choices are kbvh's own, with
    one thread."""
    found = []
    timed = study.timed
    titles = dict(zip(map(str, study.runs["id"]), map(str, study.runs["title"])))

    def title(id: re.Match[str]) -> str:
        return titles.get(id[0], id[0])

    for _, rows in timed.groupby("group", sort=False):
        others = rows[(rows["choice"] == "") & (rows["guarantee"] == "exact") & rows["params"].map(_single)]
        for _, row in rows[rows["choice"].str.contains(FRAMES)].iterrows():
            if others.empty:
                continue
            totals = others[TOTAL].sum(axis=1)
            best = others.loc[totals.idxmin()]
            chosen, _, seen = str(row["choice"]).partition(" (")
            found.append(
                Choice(
                    short(str(row["scene"])), text.size(row["primitives"]), str(row["scalar"]), f"{row['l']:g}", str(row["label"]),
                    re.sub(r"\w+(?= for \d)", title, chosen),
                    seen.removesuffix(")"), str(best["label"]), float(totals.min() / row[TOTAL].sum()),
                )  # fmt: skip
            )
    return found


def _single(params: dict[str, object]) -> bool:
    return str(params.get("threads", "1")) == "1"
