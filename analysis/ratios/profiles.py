"""Performance profiles (Dolan and Moré 2002): how often a strategy is within a factor of the best.

A cell is one scene at one size, scalar and l, measured by one commit on one machine. In each cell, a strategy counts with its
fastest setting, and its factor is that time over the fastest time of the cell. Contestants without a guarantee, with several
threads, brute force and limits take no part; the rules are those of advice.py.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import pandas as pd

from results.load import Study

#: A family of these answers no query, or none in a reasonable time.
NO_CONTESTANTS = ("oracle", "limit")


@dataclass(frozen=True)
class Profile:
    """The factors of one strategy, ascending, in the cells where it has a time."""

    id: str
    factors: list[float]
    cells: int  #: of the study

    def within(self, factor: float) -> float:
        """Returns the share of its own cells in which the strategy is within a factor of the best."""
        return sum(one <= factor for one in self.factors) / len(self.factors)


def contestants(rows: pd.DataFrame) -> pd.DataFrame:
    """Keeps the runs that take part: guaranteed, on one thread, and answering queries."""
    single = rows["params"].map(lambda params: str(params.get("threads", "1")) == "1")
    return rows[single & (rows["guarantee"] != "approximate") & ~rows["family"].isin(NO_CONTESTANTS)]


def profiles(study: Study, column: str = "total_motion", ids: Iterable[str] = ()) -> list[Profile]:
    """Returns the profiles of a study, the best (largest mean of 1 / factor) first; of these strategies only, if given.

    Cells with a single strategy are left out: it would be the best of one.
    """
    rows = contestants(study.timed)
    wanted = set(ids)
    if wanted:
        rows = rows[rows["id"].isin(wanted)]
    rows = rows[rows[column] > 0]
    found: dict[str, list[float]] = {}
    cells = 0
    for _, cell in rows.groupby(["group", "commit", "dirty"], sort=False):
        best = cell.groupby("id")[column].min()
        if len(best) < 2:
            continue
        cells += 1
        for id, factor in (best / best.min()).items():
            found.setdefault(str(id), []).append(float(factor))
    result = [Profile(id, sorted(factors), cells) for id, factors in found.items()]
    return sorted(result, key=lambda one: (-sum(1 / f for f in one.factors) / len(one.factors), one.id))
