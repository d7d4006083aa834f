"""Time against error: what approximate contestants miss and falsely report, against their time and that of exact ones.

Finds points, curves, fronts and sentences; `time_error_panels` draws them, `time_error_file` keeps them for pages without the results.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Optional

import pandas as pd

from ratios import ratios
from results import text
from results.load import Study
from results.scene_names import short as short_name

#: The share of missed pairs below which an approximate contestant counts in the sentence on what exactness costs.
FEW = 0.01
#: Contestants that take more than this many times the fastest exact one are drawn at the right edge: the left part would shrink.
SLOW = 8.0


@dataclass
class Point:
    """One contestant of a table."""

    contestant: str
    id: str
    name: str  #: title and settings that are not the default
    title: str
    exact: bool
    foresight: str
    time: float  #: ms per frame of the whole clip, positions included
    missed: float  #: share of the true pairs
    false: float  #: share of the reported pairs
    depth: float  #: largest, of the missed pairs, in mean edge lengths of the two primitives; NaN in older records
    first: Optional[int]  #: frames before the first with a missed pair; None if there is none, or in older records
    frames: int
    settings: dict[str, str]
    run: int = -1
    mark: str = ""  #: its number, if it is on a front


@dataclass(frozen=True)
class Measure:
    """A kind of error as an axis, on which 0 is no error."""

    title: str
    of: Callable[[Point], float]  #: NaN where the record does not know
    tick: Callable[[float], str]
    none: str  #: at the place of 0
    says: Callable[[Point], str]


def _depth(one: Point) -> float:
    return one.depth if one.missed > 0 else 0.0


def _begin(one: Point) -> float:
    """Returns 1 for a miss in the first frame, 1/n for one in the n-th."""
    return 0.0 if one.missed == 0 else math.nan if one.first is None else 1 / (one.first + 1)


#: The errors that have a panel. The first two are errors of the answer as a whole; the others tell how bad the missed pairs are.
MEASURES: dict[str, Measure] = {
    "missed": Measure("True pairs missed", lambda one: one.missed, text.percent_tick, "0", lambda one: text.percent(one.missed)),
    "false": Measure("Reported pairs that are false", lambda one: one.false, text.percent_tick, "0", lambda one: text.percent(one.false)),
    "depth": Measure(
        "Deepest missed pair, in mean edge lengths", _depth, text.tick, "0", lambda one: f"{text.significant(_depth(one), 2)} edge lengths"
    ),
    "first": Measure(
        "Frame of the first missed pair", _begin, lambda value: text.count(round(1 / value)), "never",
        lambda one: "never" if one.missed == 0 else text.MISSING if one.first is None else f"frame {text.count(one.first + 1)}",
    ),
}  # fmt: skip


@dataclass
class Curve:
    """The points of a strategy that differ in one number only, in its order."""

    id: str
    dial: str
    points: list[Point]


@dataclass
class Place:
    """A table with wrong contestants."""

    title: str
    anchor: str
    points: list[Point]  #: by time
    curves: list[Curve]
    fronts: dict[str, list[Point]]  #: points that no other dominates in time and error, by measure; the fastest first
    sentences: list[str] = field(default_factory=list)  #: what errors buy
    measured: str = ""  #: when, by which commit and on which machine
    named: list[Point] = field(default_factory=list)  #: all points on the fronts of missed and of false pairs, by time

    @property
    def slow(self) -> list[Point]:
        """Returns the points at the right edge."""
        exact = self.fastest_exact
        return [one for one in self.points if exact is not None and one.time > SLOW * exact.time]

    @property
    def fastest_exact(self) -> Optional[Point]:
        return next((point for point in self.points if point.exact), None)

    @property
    def unknowing(self) -> Optional[Point]:
        """Returns the fastest exact one that knows nothing of the future."""
        return next((point for point in self.points if point.exact and point.foresight == "none"), None)


def places(study: Study) -> list[Place]:
    """Returns the tables in which a contestant missed or added pairs, with their sentences; float before double."""
    found = []
    for rows in study.groups():
        timed = ratios.without_oracles(rows[(rows["refused"] == "") & (rows["total_motion"] > 0) & (rows["pairs"] > 0)])
        if not ((timed["guarantee"] == "approximate") & (timed["missed"] + timed["extra"] > 0)).any():
            continue
        first = timed.iloc[0]
        title = f"{short_name(str(first['scene']))}, {text.size(first['primitives'])} triangles, {first['scalar']}, {first['l']:g} frames a keyframe"
        place = place_of(title, [_point(row) for _, row in timed.iterrows()], len(found))
        place.sentences = sentences(study, place)
        place.measured = _measured(timed)
        found.append(place)
    return found


def place_of(title: str, points: Sequence[Point], number: int) -> Place:
    """Finds curves and fronts of some points, and numbers those on the fronts; `number` is that of the place on its page, from 0."""
    points = sorted(points, key=lambda one: (one.time, one.contestant))
    fronts = {}
    for name, measure in MEASURES.items():
        front = ratios.pareto_front([(measure.of(one), one.time) for one in points])
        fronts[name] = sorted((points[i] for i in front), key=lambda one: one.time)
    place = Place(title, f"error-{number + 1}", points, _curves(points), fronts)
    place.named = [one for one in points if any(one is other for name in ("missed", "false") for other in fronts[name])]
    for mark, one in enumerate(place.named, start=1):
        one.mark = str(mark)
    return place


def _measured(rows: pd.DataFrame) -> str:
    """Says when a table was measured, by what, where, in how many rounds, and how disturbed."""
    days = sorted({str(when)[:10] for when in rows["when"] if when})
    when = "on a day that is not recorded" if not days else days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"
    commits = text.listing([f"{commit[:8]}{' with local changes' if dirty else ''}" for commit, dirty in sorted(set(zip(rows["commit"], rows["dirty"])))])
    machines = text.listing([f"{cpu} ({kernels} kernels)" for cpu, kernels in sorted(set(zip(rows["cpu"], rows["kernels"])))])
    rounds = sorted({int(one) for one in rows["repetitions"]})
    span = f"{rounds[0]} to {rounds[-1]} rounds" if rounds[0] < rounds[-1] else text.plural(rounds[0], "round")
    disturbed = int((rows["disturbed"] != "").sum())
    doubt = f"the machine was disturbed while {disturbed} of them were timed" if disturbed else "the machine was quiet"
    return f"Measured {when} by commit {commits} on {machines}: {text.plural(len(rows), 'contestant')}, {span}; {doubt}."


def _point(row: pd.Series) -> Point:
    reported = row["pairs"] - row["missed"] + row["extra"]
    builder = {f"builder {name}": str(value) for name, value in (row["builder"] or {}).items()}
    settings = {**{name: str(value) for name, value in row["params"].items()}, **builder}
    told = ", ".join(str(row["tag"]).removeprefix(str(row["id"])).strip(" []").split(" ")).replace("_", " ").replace("=", "\u00a0")
    told = re.sub(r"\d{7,}", lambda found: short(float(found[0])), told)
    return Point(
        contestant=row["contestant"], id=row["id"], name=f"{row['title']} ({told})" if told else row["title"], title=row["title"],
        exact=row["guarantee"] != "approximate", foresight=row["foresight"], time=float(row["total_motion"]),
        missed=float(row["missed"] / row["pairs"]), false=float(row["extra"] / reported) if reported > 0 else 0.0,
        depth=float(row["missed_depth_in_edges"]), first=int(row["first_missed"]) if text.known(row["first_missed"]) else None,
        frames=int(row["frames"]), settings=settings, run=int(row["run"]),
    )  # fmt: skip


def _number(value: str) -> Optional[float]:
    try:
        return float(value)
    except ValueError:
        return None


def _curves(points: Sequence[Point]) -> list[Curve]:
    """Connects approximate points that differ in one number only."""
    groups: dict[tuple[Any, ...], list[Point]] = {}
    for one in points:
        for dial, value in one.settings.items():
            if not one.exact and _number(value) is not None:
                others = tuple(sorted((name, other) for name, other in one.settings.items() if name != dial))
                groups.setdefault((one.id, dial, others), []).append(one)
    result = []
    for (identity, dial, _), members in groups.items():
        if len({one.settings[dial] for one in members}) > 1:
            result.append(Curve(identity, dial, sorted(members, key=lambda one: float(one.settings[dial]))))
    return result


def sentences(study: Study, place: Place) -> list[str]:
    """Returns what errors buy among contestants that know nothing of the future, and among all where that differs."""
    told: dict[tuple[str, str], str] = {}
    for known, words in (("none", "If nothing of the future is known"), ("", "Whatever is known of the future")):
        usable = [one for one in place.points if one.foresight == known or not known]
        exact = next((one for one in usable if one.exact), None)
        few = next((one for one in usable if not one.exact and one.missed < FEW), None)
        if exact is None or (exact.contestant, few.contestant if few else "") in told:
            continue
        says = f"{words}, on one scene ({place.title}): "
        allowing = f"missing up to {FEW:.0%} of the pairs ".replace("%", "\u00a0%")
        if few is None:
            says += f"no approximate contestant missed less than {FEW:.0%}.".replace("%", "\u00a0%")
        else:
            wrong = f"missed {text.percent(few.missed)}" if few.missed else "missed nothing here, but promises nothing"
            wrong += f"; {text.percent(few.false)} of its pairs are false" if few.false else ""
            one = f"{few.name} takes {text.milliseconds(few.time)}\u00a0ms a frame and {wrong}"
            other = f"the fastest exact one, {exact.name}, takes {text.milliseconds(exact.time)}\u00a0ms a frame"
            wins = few.time < exact.time
            times = _times_as_fast(study, few, exact, f"), {NO_GAIN}") if wins else _times_as_fast(study, exact, few, f"; {NOT_APART})")
            says += f"{allowing}makes a frame {times}: {one}; {other}." if wins else f"{allowing}gains nothing: {other} and is {times} as the fastest with errors ({one})."
        told[exact.contestant, few.contestant if few else ""] = says
    return list(told.values())


#: What makes a sentence's number doubtful: of a gain; of a loss; of both.
NO_GAIN, NOT_APART, DISTURBED = "which may be no gain", "this run does not tell them apart", "a doubtful run: the machine was disturbed"


def brief(place: Place) -> str:
    """Returns what errors buy in one short sentence: if nothing of the future is known or, without exact contestants of that kind, whatever is known."""
    usable = [one for one in place.points if one.foresight == "none"] if place.unknowing else place.points
    known = "" if not place.unknowing else " if nothing is known"
    exact = next((one for one in usable if one.exact), None)
    few = next((one for one in usable if not one.exact and one.missed < FEW), None)
    allowed = f"{FEW:.0%}".replace("%", "\u00a0%")
    where = ", ".join(place.title.split(", ")[:2])  # scene and size
    if exact is None:
        return f"No exact contestant was measured where one answers wrongly ({where})."
    if few is None:
        return f"No approximate contestant missed less than {allowed} of the pairs{known}; the exact {exact.title} takes {text.milliseconds(exact.time)} ms ({where})."
    said = place.sentences[0] if place.sentences else ""
    doubt = ", a doubtful run" if DISTURBED in said else ""
    if few.time < exact.time:
        span = re.search(r"times as fast \(([^;)]+ to [^;)]+)", said) if NO_GAIN in said else None
        gain = f" ({span[1]}, {NO_GAIN})" if span else ""
        buys = f"makes a frame {text.factor(exact.time / few.time)} times as fast{gain}{known}"
    else:
        buys = f"makes no difference that is sure{known}" if NOT_APART in said else f"gains nothing{known}"
    return (
        f"Missing up to {allowed} of the pairs {buys}: {text.milliseconds(few.time)} ms by {few.title}, "
        f"{text.milliseconds(exact.time)} ms exactly by {exact.title} ({where}{doubt})."
    )


def _times_as_fast(study: Study, quick: Point, slow: Point, not_apart: str) -> str:
    """Writes how many times as fast the first is, with the interval; ends with `not_apart` instead of ")" if the interval does not lie above 1."""
    found = ratios.ratio(study, quick.run, slow.run, "with_motion")
    doubts = [f"{text.factor(found.low)} to {text.factor(found.high)}"] if found and found.low < found.high else []
    doubts += [DISTURBED] if found and found.disturbed else []
    end = ")" if found is None or found.low > 1 else not_apart
    return f"{text.factor(slow.time / quick.time)} times as fast" + (f" ({'; '.join(doubts)}{end}" if doubts else "")


def finding(place: Place, name: str) -> str:
    """Returns one sentence on what the panel of a measure shows."""
    measure = MEASURES[name]
    wrong = [one for one in place.points if not one.exact]
    known = [one for one in wrong if math.isfinite(measure.of(one))]
    if len(known) < len(wrong):
        return "Records of this age do not know it."
    errs = [one for one in wrong if measure.of(one) > 0]
    of = text.plural(len(wrong), "approximate contestant")
    least, most = (end(errs, key=measure.of, default=None) for end in (min, max))
    if least is None or most is None:
        return {"false": f"None of {of} reports a false pair: their errors are missing pairs."}.get(name, f"None of {of} misses a pair.")
    if name == "missed":
        line = place.unknowing or place.fastest_exact
        if line is None:
            return f"{len(errs)} of {of} miss pairs: {measure.says(least)} ({least.name}) to {measure.says(most)} ({most.name})."
        quick = [one for one in wrong if one.time < line.time]
        if not quick:
            return f"None of {of} is faster than {line.name}, which is exact and knows nothing of the future."
        best, worst = (end(quick, key=lambda one: one.missed) for end in (min, max))
        span = "none of them misses a pair" if worst.missed == 0 else f"they miss {measure.says(best) if best.missed else 'none'} ({best.name}) to {measure.says(worst)} ({worst.name})"
        return f"{len(quick)} of {of} {'is' if len(quick) == 1 else 'are'} faster than {line.name}, which is exact and knows nothing of the future; {span}."
    if name == "false":
        others = f"; the other {len(wrong) - len(errs)} report none" if len(errs) < len(wrong) else ""
        return f"{len(errs)} of {of} report{'s' * (len(errs) == 1)} false pairs, at most {measure.says(most)} of what they report ({most.name}){others}."
    few = [one for one in errs if one.missed < FEW]
    if name == "depth":
        deepest = max(few, key=measure.of, default=None)
        first = f"Contestants that miss less than 1\u00a0% of the pairs miss none deeper than {measure.says(deepest)} ({deepest.name}); " if deepest else ""
        return f"{first}{'t' if first else 'T'}he deepest miss of all is {measure.says(most)} ({most.name})."
    soon = [one for one in errs if one.first is not None and most.first is not None and one.first < most.first + 10]
    return (
        f"{len(soon)} of the {len(errs)} that miss a pair begin within ten frames of the first of them ({measure.says(most)} of {text.count(most.frames)}); "
        f"the last to begin is {least.name}, at {measure.says(least)}."
    )


def short(value: float) -> str:
    """Formats a setting, without the zeros of its power of ten."""
    return f"{value:g}".replace("e+0", "e").replace("e+", "e")
