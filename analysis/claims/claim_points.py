"""Finds the points of a study at which a claim's check can be evaluated: values at scenes, sizes and l."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np

from results import clip_times, text
from results.load import Study

#: The program's names (clip_times) of the times of claims.json.
TIMES = {
    "update": "upkeep",
    "update with motion": "upkeep_with_motion",
    "update per keyframe": "upkeep",
    "query": "query",
    "total": "total",
    "total with motion": "total_with_motion",
}
#: The quantity by which the best refit is chosen: `ratios.clip_total`.
CLIP_TOTAL = "total with motion"
#: Columns of what is counted.
COUNTED: dict[str, str] = {
    "events": "certificates_failed_per_frame",
    "events per keyframe": "certificates_failed_per_frame",
    "values": "values_written_per_frame",
    "looseness": "looseness",
    "false candidates": "false_candidates",
}
#: What is computed from several columns of a run (`Table.values`).
DERIVED = ("values per event", "ageing")
SLACK = 1.25  #: measured sizes reach a claimed one within this factor
MEASURES = ("ratio", "value", "exponent", "next_l", "ten_l", "across")
#: The names in a term, by column of a run.
NAMED = {"id": "strategy", "family": "family", "baseline": "baseline"}
RELATIONS = ("<", "<=", ">", ">=", "within a factor of")


class ClaimError(Exception):
    """Reports an unusable claims.json in one sentence."""


@dataclass(frozen=True)
class Value:
    """A number with the extremes of its repetitions (equal to the number if nothing is timed)."""

    middle: float
    low: float
    high: float


@dataclass(frozen=True)
class Point:
    """A check's value at one place."""

    corner: str  #: id of the corner or baseline, or "" where the check has none
    quantity: str
    scene: str
    size: float
    l: float
    value: Value
    met: bool
    groups: tuple[str, ...]  #: tables that it is from
    keys: tuple[str, ...]  #: records that it is from
    of: str  #: the configurations, in words
    close: bool  #: do repetitions disagree on whether the check is met?


@dataclass(frozen=True)
class Corner:
    """The two sides of a check: a corner of its square, a baseline in turn, or the check's own terms."""

    id: str  #: "" where the check has only one
    name: str  #: in a sentence
    who: str  #: the side that is judged, without what it is compared with
    short: str  #: the text next to a picture
    above: dict[str, Any]  #: the numerator, or the only term
    below: Optional[dict[str, Any]]
    optional: bool  #: its absence leaves the claim decided
    needs: Optional[dict[str, Any]]  #: tables without a run of this term do not count


@dataclass
class CheckResult:
    """All points of one check, and the missing data."""

    check: dict[str, Any]
    corners: list[Corner] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    gaps: dict[str, list[str]] = field(default_factory=dict)  #: by optional corner: the missing data

    def unmeasured(self) -> list[Corner]:
        """Returns the corners without points; none if the check is required and has no points at all."""
        known = {point.corner for point in self.points}
        counts = self.points or all(one.optional for one in self.corners)
        return [one for one in self.corners if counts and one.id not in known]


def met(check: dict[str, Any], value: float) -> bool:
    """Returns whether a value satisfies the check, with its tolerance in the claim's favour."""
    bound, room = check["bound"], check["tolerance"] * abs(check["bound"])
    relation = check["relation"]
    if relation == "<":
        return value < bound + room
    if relation == "<=":
        return value <= bound + room
    if relation == ">":
        return value > bound - room
    if relation == ">=":
        return value >= bound - room
    if relation == "within a factor of":
        factor = bound + room
        return 1 / factor <= value <= factor
    raise ClaimError(f'the relation "{relation}" is none of {", ".join(RELATIONS)}')


#: Size, l and runs of one table.
Place = tuple[float, float, list[dict[str, Any]]]


class Table:
    """The timed runs of a study in the form of claims: one scalar, the runs of the last commit, with sizes."""

    def __init__(self, study: Study, scalar: str) -> None:
        rows = study.timed
        rows = rows[rows["scalar"] == scalar]
        self.rows = rows.assign(size=rows["bodies"].map(largest_moving)).copy() if len(rows) else rows.assign(size=[])
        self.rows["size"] = self.rows["size"].where(self.rows["size"] > 0, self.rows["primitives"])
        self._row: dict[int, dict[str, Any]] = {int(row["run"]): row for row in self.rows.to_dict("records")}
        self._raw = study.raw
        self._places: dict[str, list[Place]] = {}

    def places(self, scene: str) -> list[Place]:
        """Returns every table of a scene; of tables for the same size and l, the one measured last."""
        if scene in self._places:
            return self._places[scene]
        found = self.rows[self.rows["scene"] == scene]
        last: dict[tuple[float, float], list[dict[str, Any]]] = {}
        for _, group in sorted(found.groupby(["group", "commit", "dirty"]), key=lambda item: item[1]["run"].max()):
            rows = [self._row[int(run)] for run in group["run"]]
            last[(float(rows[0]["size"]), float(rows[0]["l"]))] = rows
        self._places[scene] = [(size, l, rows) for (size, l), rows in sorted(last.items(), key=lambda item: item[0])]
        return self._places[scene]

    def _scale(self, run: int, quantity: str) -> float:
        return float(self._row[run]["l"]) if quantity.endswith("per keyframe") else 1.0

    def value(self, run: int, quantity: str) -> Optional[Value]:
        """Returns the quantity of a run, with the extremes of its repetitions; None if unknown."""
        if quantity in TIMES:
            middle = clip_times.time_of(self._raw[run], TIMES[quantity]) * self._scale(run, quantity)
            each = clip_times.single_times(self._raw[run], TIMES[quantity]) * self._scale(run, quantity)
            return Value(middle, min(middle, float(each.min())), max(middle, float(each.max())))
        known = self.values(run, quantity)
        return Value(float(known[0]), float(known[0]), float(known[0])) if len(known) else None

    def ratio(self, above: int, below: int, quantity: str) -> Optional[Value]:
        """Returns the ratio of the times of two runs, with its interval or range."""
        found = clip_times.ratio_of(self._raw[above], self._raw[below], TIMES[quantity])
        scale = self._scale(above, quantity) / self._scale(below, quantity)
        return None if found is None else Value(found.middle * scale, found.low * scale, found.high * scale)

    def values(self, run: int, quantity: str) -> np.ndarray:
        """Returns the counted quantity of a run, as a single number; empty if unknown."""
        row = self._row[run]
        scale = self._scale(run, quantity)
        if quantity in TIMES:
            return np.array([clip_times.time_of(self._raw[run], TIMES[quantity]) * scale])
        if quantity == "values per event":
            events = row["certificates_failed_per_frame"]
            known = [row["values_written_per_frame"] / events] if events > 0 else []
        elif quantity == "ageing":
            known = [ageing(row["over_time"])]
        elif quantity in COUNTED:
            steps = row["frames"] - 1  # the first frame belongs to no keyframe interval, and counts nothing
            scale *= row["frames"] / steps if quantity.endswith("per keyframe") and steps > 0 else 1.0
            known = [row[COUNTED[quantity]] * scale]
        else:
            raise ClaimError(f'there is no quantity "{quantity}"')
        return np.array([value for value in known if math.isfinite(value)], dtype=float)

    def chosen(self, rows: list[dict[str, Any]], term: dict[str, Any], quantity: str) -> Optional[int]:
        """Selects the run of a table for a term: the fastest, or for counts the smallest, if several match.

        The best refit is one run for all quantities, the baseline with the smallest time of the clip (`ratios.clip_total`).
        """
        by = CLIP_TOTAL if "baseline" in term and "strategy" not in term else quantity
        best: Optional[tuple[float, int]] = None
        for row in rows:
            if not _fits(row, term, quantity):
                continue
            known = self.values(row["run"], by)
            if len(known) and (best is None or float(known[0]) < best[0]):
                best = (float(known[0]), int(row["run"]))
        return best[1] if best is not None and len(self.values(best[1], quantity)) else None

    def row(self, run: int) -> dict[str, Any]:
        """Returns one run."""
        return self._row[run]


def _fits(row: dict[str, Any], term: dict[str, Any], quantity: str) -> bool:
    """Returns whether a run matches the term."""
    if "one_of" in term:
        return any(_fits(row, one, quantity) for one in term["one_of"])
    if any(row[column] != term[name] for column, name in NAMED.items() if name in term):
        return False
    if row["id"] in term.get("except", []):
        return False
    if row["guarantee"] == "approximate" or row["id"] in term.get("not_for", {}).get(quantity, []):
        return False
    builder = row["builder"] if isinstance(row["builder"], dict) else {}
    if any(builder.get(name) != value for name, value in term.get("builder", {}).items()):
        return False
    return all(str(row["params"].get(name, value)) == value for name, value in term.get("params", {}).items())


def ageing(samples: list[dict[str, float]]) -> float:
    """Returns the SAH cost over that of a rebuilt tree, of the last sample over the first; NaN with fewer than two."""
    if len(samples) < 2:
        return math.nan
    first, last = (one["sah"] / one["sah_rebuilt"] for one in (samples[0], samples[-1]))
    return last / first


def largest_moving(bodies: Any) -> float:
    """Returns the number of primitives of the largest moving body; 0 if unknown."""
    counts = [body.get("primitives") for body in bodies if isinstance(body, dict) and body.get("moving") is True]
    return float(max((count for count in counts if isinstance(count, (int, float))), default=0))


def quotient(table: Table, above: int, below: int, quantity: str) -> Optional[Value]:
    """Divides one run's quantity by another's; times with the interval or range of their ratio."""
    if quantity in TIMES:
        return table.ratio(above, below, quantity)
    a, b = table.values(above, quantity), table.values(below, quantity)
    if not len(a) or not len(b) or b[0] <= 0:
        return None
    return Value(*[float(a[0] / b[0])] * 3)


def words_of(term: dict[str, Any]) -> str:
    """Describes a term in words, for messages about missing data."""
    if "one_of" in term:
        return " or ".join(words_of(one) for one in term["one_of"])
    settings = {**term.get("builder", {}), **term.get("params", {})}
    told = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in settings.items())
    who = term.get("strategy") or ("the best refit" if "baseline" in term else f"any {term['family']}")
    return f"{who} ({told})" if told else who


class CheckEvaluator:
    """Evaluates checks on one study."""

    def __init__(
        self, table: Table, baselines: list[dict[str, Any]], squares: Optional[dict[str, list[dict[str, Any]]]] = None
    ) -> None:
        self.table = table
        self.baselines = {one["id"]: one for one in baselines}
        self.squares = squares or {}

    def look(self, check: dict[str, Any]) -> CheckResult:
        """Returns all points of the check, and the missing data. Raises ClaimError for an inconsistent check."""
        if check["measure"] not in MEASURES:
            raise ClaimError(f'the measure "{check["measure"]}" is none of {", ".join(MEASURES)}')
        looked = CheckResult(check, self._corners(check))
        for quantity in check["quantities"]:
            for corner in looked.corners:
                for scene in check["scenes"]:
                    points, missing = self._scene(check, quantity, corner, scene)
                    looked.points += points
                    listed = looked.gaps.setdefault(corner.id, []) if corner.optional else looked.missing
                    listed += [one for one in missing if one not in listed]
                for scene in check.get("optional_scenes", []):
                    looked.points += self._scene(check, quantity, corner, scene)[0]
        return looked

    def _corners(self, check: dict[str, Any]) -> list[Corner]:
        """Returns the corners of the check's square, else a corner for each baseline that it names, else one for its own terms."""
        if "square" in check:
            if check["square"] not in self.squares:
                raise ClaimError(f'there is no square "{check["square"]}"')
            listed = self.squares[check["square"]]
        elif "baselines" in (check.get("numerator"), check.get("denominator"), check.get("of")):
            sides = {name: check[name] for name in ("numerator", "denominator", "of") if name in check}
            listed = [
                {**{name: one["id"] if term == "baselines" else term for name, term in sides.items()},
                 "id": one["id"], "name": f"against {one['name']}", "short": one["short"]}
                for one in self.baselines.values()
            ]  # fmt: skip
        else:
            listed = [{**check, "id": "", "name": "", "short": ""}]
        return [self._corner(check, one) for one in listed]

    def _corner(self, check: dict[str, Any], said: dict[str, Any]) -> Corner:
        above, below = said.get("numerator", said.get("of")), said.get("denominator")
        if above is None or (check["measure"] == "ratio") != (below is not None):
            raise ClaimError(f'the check "{check["what"]}" does not say what it is of')
        return Corner(
            said["id"], said["name"], said.get("who", said["name"]), said["short"], self._term(above),
            None if below is None else self._term(below), bool(said.get("optional", False)), said.get("needs"),
        )  # fmt: skip

    def _term(self, said: Any) -> dict[str, Any]:
        """Returns a term, or the term of the named baseline."""
        if isinstance(said, dict):
            return said
        if said not in self.baselines:
            raise ClaimError(f'there is no baseline "{said}"')
        return self.baselines[said]

    def _scene(self, check: dict[str, Any], quantity: str, corner: Corner, scene: str) -> tuple[list[Point], list[str]]:
        """Returns the points of one scene, and the reasons why they do not suffice."""
        above, below = corner.above, corner.below
        low, high = check["size"]
        everywhere = self.table.places(scene)
        if not everywhere:
            return [], [f"results of the scene {scene}"]
        places = [place for place in everywhere if low / SLACK <= place[0] <= high * SLACK]
        if places and corner.needs is not None:
            places = [one for one in places if any(_fits(row, corner.needs, quantity) for row in one[2])]
            if not places:
                return [], [f"{words_of(corner.needs)} on {scene}"]
        wanted = f"{text.size(low)} to {text.size(high)}"
        if not places:
            there = text.listing([text.size(size) for size in sorted({place[0] for place in everywhere})])
            return [], [f"{scene} of {wanted} polygons (measured: {there})"]
        made = {
            "ratio": self._ratio, "value": self._value, "exponent": self._exponent, "next_l": self._over_l,
            "ten_l": self._over_l, "across": self._across,
        }[check["measure"]](check, quantity, corner.id, above, below, scene, places)  # fmt: skip
        if not made:
            terms = text.listing([words_of(term) for term in (above, below) if term is not None])
            return [], [self._why_nothing(check, terms, scene, places)]
        return made, self._gaps(check, scene, made)

    @staticmethod
    def _why_nothing(check: dict[str, Any], terms: str, scene: str, places: list[Any]) -> str:
        depths = text.listing([f"{l:g}" for l in sorted({l for _, l, _ in places})])
        sizes = len({size for size, _, _ in places})
        if check["measure"] == "exponent":
            return f"{check['least_sizes']} sizes of {scene} with events of {terms} ({sizes} measured)"
        if check["measure"] in ("next_l", "ten_l"):
            factor = "ten times apart " if check["measure"] == "ten_l" else ""
            return f"timed runs of {terms} on {scene} at two l {factor}of one clip (measured: l = {depths})"
        beside = f" and of {check['other_scene']}" if check["measure"] == "across" else ""
        return f"timed runs of {terms} on {scene}{beside} in one table"

    @staticmethod
    def _gaps(check: dict[str, Any], scene: str, points: list[Point]) -> list[str]:
        """Lists the claimed sizes and l that the points do not cover."""
        low, high = check["size"]
        sizes, deepest = sorted({one.size for one in points}), max(one.l for one in points)
        gaps = []
        if check["measure"] != "exponent" and not check.get("any_size"):
            if sizes[0] > low * SLACK or sizes[-1] < high / SLACK:
                there = text.listing([text.size(size) for size in sizes])
                gaps.append(f"{scene} of {text.size(low)} to {text.size(high)} polygons (measured: {there})")
        if deepest < check["l_reaches"]:
            depths = text.listing([f"{l:g}" for l in sorted({one.l for one in points})])
            gaps.append(f"{scene} at l = {check['l_reaches']:g} or more (measured: {depths})")
        return gaps

    def _point(self, check: dict[str, Any], quantity: str, corner: str, scene: str, size: float, l: float,
               value: Optional[Value], runs: list[int]) -> list[Point]:  # fmt: skip
        if value is None or not math.isfinite(value.middle):
            return []
        rows = [self.table.row(run) for run in runs]
        ends = {met(check, value.low), met(check, value.high)}
        return [
            Point(
                corner, quantity, scene, size, l, value, met(check, value.middle),
                tuple(dict.fromkeys(str(row["group"]) for row in rows)), tuple(str(row["key"]) for row in rows),
                " / ".join(dict.fromkeys(str(row["label"]) for row in rows)), len(ends) > 1,
            )
        ]  # fmt: skip

    def _ratio(self, check, quantity, corner, above, below, scene, places) -> list[Point]:  # type: ignore[no-untyped-def]
        points: list[Point] = []
        for size, l, rows in places:
            a, b = self.table.chosen(rows, above, quantity), self.table.chosen(rows, below, quantity)
            if a is not None and b is not None:
                value = quotient(self.table, a, b, quantity)
                points += self._point(check, quantity, corner, scene, size, l, value, [a, b])
        return points

    def _value(self, check, quantity, corner, of, _, scene, places) -> list[Point]:  # type: ignore[no-untyped-def]
        points: list[Point] = []
        for size, l, rows in places:
            run = self.table.chosen(rows, of, quantity)
            if run is not None:
                value = self.table.value(run, quantity)
                points += self._point(check, quantity, corner, scene, size, l, value, [run])
        return points

    def _exponent(self, check, quantity, corner, of, _, scene, places) -> list[Point]:  # type: ignore[no-untyped-def]
        """Returns the slope in logarithms at each l with enough sizes; its extremes come from leaving one size out."""
        points: list[Point] = []
        for depth in sorted({l for _, l, _ in places}):
            found = []
            for size, l, rows in places:
                run = self.table.chosen(rows, of, quantity) if l == depth else None
                if run is not None and (known := float(self.table.values(run, quantity)[0])) > 0:
                    found.append((size, known, run))
            if len(found) < max(check["least_sizes"], 2):
                continue
            x, y = np.log([one[0] for one in found]), np.log([one[1] for one in found])
            slope = lambda keep: float(np.polyfit(x[keep], y[keep], 1)[0])  # noqa: E731
            every = np.ones(len(x), dtype=bool)
            without = [slope(np.arange(len(x)) != i) for i in range(len(x))] if len(x) > 2 else [slope(every)]
            value = Value(slope(every), min(without), max(without))
            points += self._point(check, quantity, corner, scene, found[-1][0], depth, value, [one[2] for one in found])
        return points

    def _over_l(self, check, quantity, corner, of, _, scene, places) -> list[Point]:  # type: ignore[no-untyped-def]
        """Compares, at each size, the next l with the preceding l, or ten times an l with that l; within one clip only.

        Only contestants that were measured at both l count.
        """
        points: list[Point] = []
        for size in sorted({size for size, _, _ in places}):
            depths = [(l, rows) for at, l, rows in places if at == size]
            pairs = list(zip(depths[:-1], depths[1:]))
            if check["measure"] == "ten_l":
                pairs = [(one, other) for one in depths for other in depths if other[0] == 10 * one[0]]
            for (_, fewer), (l, more) in pairs:
                both = {row["contestant"] for row in more} & {row["contestant"] for row in fewer}
                a, b = (
                    self.table.chosen([row for row in rows if row["contestant"] in both], of, quantity)
                    for rows in (more, fewer)
                )
                if a is None or b is None or not self._one_clip(a, b):
                    continue
                value = quotient(self.table, a, b, quantity)
                points += self._point(check, quantity, corner, scene, size, l, value, [a, b])
        return points

    def _one_clip(self, one: int, other: int) -> bool:
        """Returns whether two runs are of the same scene over the same keyframe intervals."""
        a, b = self.table.row(one), self.table.row(other)
        cut_alike = (a["frames"] - 1) * b["l"] == (b["frames"] - 1) * a["l"]
        return bool(a["hash"] == b["hash"] and cut_alike and self._comparable(one, other))

    def _comparable(self, one: int, other: int) -> bool:
        """Returns whether two runs are from one machine and one commit."""
        a, b = self.table.row(one), self.table.row(other)
        return all(a[name] == b[name] for name in ("machine", "commit", "dirty"))

    def _across(self, check, quantity, corner, of, _, scene, places) -> list[Point]:  # type: ignore[no-untyped-def]
        """Divides each point by the largest of the other scene at the same l."""
        low, high = check["other_size"]
        others: dict[float, int] = {}
        for size, l, rows in self.table.places(check["other_scene"]):
            if low / SLACK <= size <= high * SLACK and (run := self.table.chosen(rows, of, quantity)) is not None:
                others[l] = run
        points: list[Point] = []
        for size, l, rows in places:
            run = self.table.chosen(rows, of, quantity)
            if run is not None and l in others and self._comparable(run, others[l]):
                value = quotient(self.table, run, others[l], quantity)
                points += self._point(check, quantity, corner, scene, size, l, value, [run, others[l]])
        return points
