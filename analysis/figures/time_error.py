"""Time against error: what approximate contestants miss and falsely report, against their time and that of exact ones.

The figure is inline SVG in small panels: its colours are variables of the page, and two panels stand side by side or, on a phone, one
below the other. Data and drawing are apart: `places` finds the points, curves and fronts, `panel` draws them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Optional

import pandas as pd
from markupsafe import Markup

from claims.claim_pictures import ticks
from figures.colours import Look, on_dark, symbol
from ratios import ratios
from results import text
from results.load import Study

#: The share of missed pairs below which an approximate contestant counts in the sentence on what exactness costs.
FEW = 0.01
#: Contestants that take more than this many times the fastest exact one are drawn at the right edge: the left part would shrink.
SLOW = 8.0
#: Colours (Okabe and Ito's, and more) and markers of the approximate strategies, in the order of their ids.
COLOURS = ("#D55E00", "#009E73", "#AA4499", "#E69F00", "#56B4E9", "#8C7A00", "#CC79A7", "#A8324A", "#5D4A9C", "#117733")
MARKERS = ("o", "s", "^", "D", "v", "p", "<", "h", ">", "d")
EXACT = "#0072B2"


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
    fronts: dict[str, list[Point]]  #: points that no other dominates in time and error, by column; the fastest first
    named: list[Point] = field(default_factory=list)  #: all points on a front, by time

    @property
    def slow(self) -> list[Point]:
        """Returns the points at the right edge."""
        exact = self.fastest_exact
        return [one for one in self.points if exact is not None and one.time > SLOW * exact.time]

    @property
    def fastest_exact(self) -> Optional[Point]:
        return next((point for point in self.points if point.exact), None)


def places(study: Study) -> list[Place]:
    """Returns the tables in which a contestant missed or added pairs; float before double."""
    found = []
    for rows in study.groups():
        timed = ratios.without_oracles(rows[(rows["refused"] == "") & (rows["total_motion"] > 0) & (rows["pairs"] > 0)])
        if not ((timed["guarantee"] == "approximate") & (timed["missed"] + timed["extra"] > 0)).any():
            continue
        first = timed.iloc[0]
        points = sorted((_point(row) for _, row in timed.iterrows()), key=lambda one: (one.time, one.contestant))
        title = f"{first['scene']}, {text.size(first['primitives'])} primitives, {first['scalar']}, l = {first['l']:g}"
        fronts = {}
        for column in ("missed", "false"):
            front = ratios.pareto_front([(getattr(one, column), one.time) for one in points])
            fronts[column] = sorted((points[i] for i in front), key=lambda one: one.time)
        place = Place(title, f"error-{len(found) + 1}", points, _curves(points), fronts)
        place.named = [one for one in points if any(one is other for front in fronts.values() for other in front)]
        for number, one in enumerate(place.named, start=1):
            one.mark = str(number)
        found.append(place)
    return found


def _point(row: pd.Series) -> Point:
    reported = row["pairs"] - row["missed"] + row["extra"]
    builder = {f"builder {name}": str(value) for name, value in (row["builder"] or {}).items()}
    settings = {**{name: str(value) for name, value in row["params"].items()}, **builder}
    told = ", ".join(str(row["tag"]).removeprefix(str(row["id"])).strip(" []").split(" ")).replace("_", " ").replace("=", "\u00a0")
    told = re.sub(r"\d{7,}", lambda found: _short(float(found[0])), told)
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
    """Returns what exactness costs among contestants that know nothing of the future, and among all where that differs."""
    told: dict[tuple[str, str], str] = {}
    for known, words in (("none", "Without knowledge of the future"), ("", "With any knowledge of the future")):
        usable = [one for one in place.points if one.foresight == known or not known]
        exact = next((one for one in usable if one.exact), None)
        few = next((one for one in usable if not one.exact and one.missed < FEW), None)
        if exact is None or (exact.contestant, few.contestant if few else "") in told:
            continue
        says = f"{words}, on {place.title}: "
        if few is None:
            says += f"no approximate contestant missed less than {FEW:.0%}.".replace("%", "\u00a0%")
        else:
            faster = few.time >= exact.time
            slow, quick = (few, exact) if faster else (exact, few)
            found = ratios.ratio(study, quick.run, slow.run, "with_motion")
            apart = found is None or found.low > 1
            doubts = [f"{text.factor(found.low)} to {text.factor(found.high)}"] if found and found.low < found.high else []
            doubts += ["machine disturbed"] if found and found.disturbed else []
            doubts += [] if apart else ["this run does not tell them apart"]
            range_of = f" ({'; '.join(doubts)})" if doubts else ""
            wrong = f"missed {text.percent(few.missed)}" if few.missed else "missed nothing here, but promises nothing"
            wrong += f"; {text.percent(few.false)} of its pairs are false" if few.false else ""
            says += (
                f"exact is {text.factor(slow.time / quick.time)}{range_of} times as {'fast' if faster else 'slow'} as the fastest that misses less than "
                f"{FEW:.0%}. ".replace("%", "\u00a0%")
                + f"The fastest exact one, {exact.name}, takes {text.milliseconds(exact.time)}\u00a0ms a frame, the other, {few.name}, "
                f"{text.milliseconds(few.time)}\u00a0ms; it {wrong}." + (" So an error buys no time here." if faster and apart else "")
            )
        told[exact.contestant, few.contestant if few else ""] = says
    return list(told.values())


def series(found: Sequence[Place]) -> dict[str, tuple[str, str]]:
    """Returns colour and marker of each approximate strategy of these places."""
    ids = sorted({one.id for place in found for one in place.points if not one.exact})
    return {one: (COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)]) for i, one in enumerate(ids)}


@dataclass(frozen=True)
class Entry:
    """A line of the legend."""

    symbol: Markup  #: in the colours of the panels
    name: str
    dials: str  #: the dial that its curves turn, and its range


def legend(place: Place, looks: dict[str, tuple[str, str]]) -> list[Entry]:
    """Returns a line for each approximate strategy of a place, in the order of their fastest point."""
    result = []
    for identity in dict.fromkeys(one.id for one in place.points if not one.exact):
        dials: dict[str, list[float]] = {}
        for curve in place.curves:
            if curve.id == identity:
                dials.setdefault(curve.dial, []).extend(float(one.settings[curve.dial]) for one in curve.points)
        told = "; ".join(f"{dial.replace('_', ' ')} {_short(min(values))} to {_short(max(values))}" for dial, values in dials.items())
        title = next(one.title for one in place.points if one.id == identity)
        result.append(Entry(_symbol(*looks[identity]), title, told))
    return result


def _symbol(colour: str, marker: str) -> Markup:
    return Markup(f'<svg class="time-error-key" viewBox="-6.5 -6.5 13 13" aria-hidden="true">{_mark(colour, marker, 0, 0, scale=1.15)}</svg>')


def _short(value: float) -> str:
    return f"{value:g}".replace("e+0", "e").replace("e+", "e")


# ---- Drawing

WIDTH, HEIGHT = 420, 348
LEFT, RIGHT, TOP, BOTTOM = 48, 10, 44, 40  #: names of the vertical lines stand above the top, where no mark is
HEAD = 16  #: room for a label above the largest share
STRIP = 20  #: height of the strip of exact zeros
FONT = 6.4  #: width of a character, for labels that keep apart


class Scale:
    """Places of times (logarithmic) and shares (logarithmic, zero apart)."""

    def __init__(self, times: Sequence[float], shares: Sequence[float]) -> None:
        low, high = math.log10(min(times)), math.log10(max(times))
        room = max(0.05 * (high - low), 0.04)
        self.low, self.high = low - room, high + room
        positive = [share for share in shares if share > 0] or [0.01, 1.0]
        self.least = math.floor(math.log10(min(positive)) + 1e-9)
        self.most = max(math.ceil(math.log10(max(positive)) - 1e-9), self.least + 1)
        self.times = ticks(10**self.low, 10**self.high, 5)

    def x(self, time: float) -> float:
        """Returns the place of a time; those of slow contestants are at the edge."""
        return LEFT + min((math.log10(time) - self.low) / (self.high - self.low), 1.0) * (WIDTH - LEFT - RIGHT)

    def y(self, share: float) -> float:
        bottom = HEIGHT - BOTTOM
        if share <= 0:
            return bottom - STRIP / 2
        bottom -= STRIP + 4
        return bottom - (math.log10(share) - self.least) / (self.most - self.least) * (bottom - TOP - HEAD)

    def decades(self) -> list[float]:
        step = math.ceil((self.most - self.least) / 6)
        return [10.0**power for power in range(self.most, self.least - 1, -step)]


def panel(place: Place, column: str, title: str, looks: dict[str, tuple[str, str]]) -> Markup:
    """Draws one error of a place against time: `missed` or `false`."""
    share: Callable[[Point], float] = lambda one: getattr(one, column)  # noqa: E731
    slow = place.slow
    scale = Scale([one.time for one in place.points if one not in slow], [share(one) for one in place.points])
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    made = [f'<text class="head" x="0" y="13">{escape(title)}</text>',
            f'<rect class="strip" x="{LEFT}" y="{bottom - STRIP}" width="{right - LEFT}" height="{STRIP}"/>',
            f'<text class="tick end" x="{LEFT - 5}" y="{bottom - STRIP / 2 + 4:.1f}">0</text>']  # fmt: skip
    for value in scale.decades():
        y = scale.y(value)
        made.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        made.append(f'<text class="tick end" x="{LEFT - 5}" y="{y + 4:.1f}">{text.percent_tick(value)}</text>')
    for value in scale.times:
        x = scale.x(value)
        made.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{bottom}"/>')
        made.append(f'<text class="tick middle" x="{x:.1f}" y="{bottom + 15}">{text.tick(value)}</text>')
    made.append(f'<text class="tick middle" x="{(LEFT + right) / 2:.0f}" y="{bottom + 32}">time per frame (ms)</text>')
    exact = place.fastest_exact
    if exact is not None:
        x = scale.x(exact.time)
        made.append(f'<rect class="slower" x="{x:.1f}" y="{TOP}" width="{right - x:.1f}" height="{bottom - TOP}"/>')
    unknowing = next((one for one in place.points if one.exact and one.foresight == "none"), None)
    lines = [(exact, "fastest exact", "beat", 15)] + [(unknowing, "no foresight", "beat unknowing", 3)] * (unknowing is not exact)
    for one, name, kind, up in lines:  # the line further right begins below the name of the other
        if one is None:
            continue
        x = scale.x(one.time)
        end = x + 4 + 0.95 * FONT * len(name) > right
        made.append(f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - up - 8}" y2="{bottom}"/>')
        made.append(f'<text class="tick{" end" if end else ""}" x="{x + (-4 if end else 4):.1f}" y="{TOP - up}">{name}</text>')
    front = place.fronts[column]
    if front:
        way = f"M{scale.x(front[0].time):.1f} {TOP}"
        for one in front:
            way += f"H{scale.x(one.time):.1f}V{scale.y(share(one)):.1f}"
        made.append(f'<path class="front" d="{way}H{right}"/>')
    for curve in place.curves:
        points = " ".join(f"{scale.x(one.time):.1f},{scale.y(share(one)):.1f}" for one in curve.points)
        made.append(f'<polyline class="dial" style="{_paint(looks[curve.id][0])}" points="{points}"/>')
    for one in sorted(place.points, key=lambda one: (bool(one.mark), not one.exact)):
        made.append(_drawn(one, scale.x(one.time), scale.y(share(one)), looks))
    made += _labels(place, front, scale, share)
    return Markup(
        f'<svg class="time-error" role="img" viewBox="0 0 {WIDTH} {HEIGHT}" aria-label="{escape(_said(place, front, column, title), quote=True)}">'
        + "".join(made) + "</svg>"
    )  # fmt: skip


def _paint(colour: str) -> str:
    return f"--l:{colour};--d:{on_dark(colour)}"


def _drawn(one: Point, x: float, y: float, looks: dict[str, tuple[str, str]]) -> str:
    says = f"<title>{escape(f'{one.name}: {text.milliseconds(one.time)} ms, missed {text.percent(one.missed)}, false {text.percent(one.false)}')}</title>"
    if one.exact:
        return f'<circle class="exact" style="{_paint(EXACT)}" cx="{x:.1f}" cy="{y:.1f}" r="3.6">{says}</circle>'
    return _mark(*looks[one.id], x, y, says)


def _mark(colour: str, marker: str, x: float, y: float, says: str = "", scale: float = 0.85) -> str:
    inner = symbol(Look(colour, marker, "-", True))
    shape = inner[inner.index(">") + 1 : inner.rindex("</svg>")].split(" fill=")[0]  # in the colours of the scheme instead
    return f'<g class="mark" style="{_paint(colour)}" transform="translate({x:.1f} {y:.1f}) scale({scale:g})">{shape}/>{says}</g>'


def _labels(place: Place, front: Sequence[Point], scale: Scale, share: Callable[[Point], float]) -> list[str]:
    """Writes the numbers of the front, then the values at both ends of each dial, next to their marks, where they cover neither marks nor
    each other; values without room are left out."""
    slow = place.slow
    taken = [(scale.x(one.time), scale.y(share(one)), 5.0, 4.0) for one in place.points]
    ends = [(curve.points[i], _short(float(curve.points[i].settings[curve.dial]))) for curve in place.curves for i in (0, -1)]
    wanted = [(one, one.mark, "number") for one in front]
    wanted += [(one, value, "value") for one, value in ends if one not in slow and share(one) > 0]
    made = []
    for one, word, kind in dict.fromkeys((id(one), word, kind) for one, word, kind in wanted):
        point = next(other for other in place.points if id(other) == one)
        x, y, half = scale.x(point.time), scale.y(share(point)), FONT * len(word) / 2 + 1
        around = [(reach * math.cos(angle / 57.3) + math.copysign(half - 3, math.cos(angle / 57.3)) * (abs(math.cos(angle / 57.3)) > 0.1), reach * math.sin(angle / 57.3))
                  for reach in (10, 14, 19, 25, 33) for angle in (135, 180, 225, 90, 270, 45, 315, 0)]  # fmt: skip
        free = [
            (dx, dy) for dx, dy in around
            if LEFT < x + dx - half and x + dx + half < WIDTH - RIGHT and TOP < y + dy - 5 and y + dy + 5 < HEIGHT - BOTTOM
            and not any(abs(x + dx - cx) < half + w and abs(y + dy - cy) < 5 + h for cx, cy, w, h in taken)
        ]  # fmt: skip
        if not free and kind == "value":
            continue
        dx, dy = free[0] if free else around[0]
        taken.append((x + dx, y + dy, half, 5.0))
        if math.hypot(dx, dy) > 19:
            made.append(f'<line class="lead" x1="{x:.1f}" y1="{y:.1f}" x2="{x + dx * 0.7:.1f}" y2="{y + dy * 0.7:.1f}"/>')
        made.append(f'<text class="{kind}" x="{x + dx:.1f}" y="{y + dy + 4:.1f}">{word}</text>')
    return made


def _said(place: Place, front: Sequence[Point], column: str, title: str) -> str:
    told = "; ".join(f"{one.name}: {text.milliseconds(one.time)} ms, {text.percent(getattr(one, column))}" for one in front)
    return f"{place.title}. {title} against time per frame; not dominated: {told}."


@dataclass(frozen=True)
class Shown:
    """A place as the page shows it."""

    place: Place
    sentences: list[str]
    panels: list[Markup]
    legend: list[Entry]
    rows: list[dict[str, str]]  #: of the named points
    all_rows: list[dict[str, str]]
    slow: int  #: contestants at the right edge of the panels


def shown(study: Study) -> list[Shown]:
    """Returns all that the page shows."""
    found = places(study)
    looks = series(found)
    return [
        Shown(
            place, sentences(study, place),
            [panel(place, "missed", "True pairs missed", looks), panel(place, "false", "Reported pairs that are false", looks)],
            legend(place, looks), [_row(one) for one in place.named], [_row(one) for one in place.points],
            len(place.slow),
        )
        for place in found
    ]  # fmt: skip


def _row(one: Point) -> dict[str, str]:
    first = "never" if one.missed == 0 else text.MISSING if one.first is None else f"{text.count(one.first)} of {text.count(one.frames)}"
    return {
        "mark": one.mark, "name": one.name, "exact": "exact" if one.exact else "", "time": text.milliseconds(one.time),
        "missed": text.percent(one.missed) if one.missed else "0", "false": text.percent(one.false) if one.false else "0",
        "depth": text.significant(one.depth, 2) if one.missed else "0", "first": first,
    }  # fmt: skip
