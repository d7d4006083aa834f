"""The ageing table: what the motion does to a tree that keeps its shape, and to those that do not."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from results.load import Study

#: The families that are compared, and their names in the table.
FAMILIES: dict[str, str] = {
    "refit": "refit", "restructuring": "restructuring", "rebuild": "rebuild", "sweep": "no tree",
}  # fmt: skip


@dataclass
class Age:
    """The fastest contestant of one family on one scene."""

    family: str
    contestant: str
    label: str
    quality: tuple[float, float] | None  #: expected cost over that of a rebuilt tree, at the first and the last sample
    query: tuple[float, float] | None  #: ms per frame in the first and the last part of the clip
    total: float  #: ms per frame over the clip, with motion evaluation
    over_refit: float  #: speed over the best refit's


@dataclass
class Scene:
    """One scene at one size, scalar and l."""

    title: str
    l: str
    primitives: float
    growth: float  #: of the refit's quality from the first sample to its worst
    ages: list[Age]

    @property
    def ages_much(self) -> bool:
        """Returns whether the cost grows by a quarter or more."""
        return self.growth >= 1.25


def scenes(study: Study) -> list[Scene]:
    """Returns the scenes on which a refit and another of these families have a time, the most aged first."""
    found = []
    timed = study.timed
    verified = timed[(timed["guarantee"] != "approximate") & timed["family"].isin(FAMILIES)]
    for _, rows in verified.groupby("group", sort=False):
        fastest = rows.sort_values("total_motion").drop_duplicates("family").set_index("family")
        if "refit" not in fastest.index or len(fastest) < 2:
            continue
        refit = fastest.loc["refit"]
        quality = _quality(refit)
        if not quality:
            continue
        ages = [_age(fastest.loc[family], name, refit) for family, name in FAMILIES.items() if family in fastest.index]
        found.append(
            Scene(str(refit["scene_name"]), f"{refit['l']:g}", float(refit["primitives"]), max(quality) / quality[0], ages)
        )
    return sorted(found, key=lambda scene: -scene.growth)


def _quality(row: pd.Series) -> list[float]:
    return [sample["sah"] / sample["sah_rebuilt"] for sample in row["over_time"]]


def _age(row: pd.Series, family: str, refit: pd.Series) -> Age:
    quality = _quality(row)
    query = [part["query"] for part in row["times_over_time"]]
    return Age(
        family,
        str(row["contestant"]),
        str(row["label"]),
        (quality[0], quality[-1]) if quality else None,
        (query[0], query[-1]) if query else None,
        float(row["total_motion"]),
        float(refit["total_motion"]) / float(row["total_motion"]),
    )
