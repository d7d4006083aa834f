"""Draws time against error as inline SVG in small panels: colours are variables of the page, and panels stand side by side or, on a
phone, one below the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Optional

from markupsafe import Markup

from claims.claim_pictures import ticks
from figures import label_places, time_error
from figures.colours import Look, on_dark, symbol
from figures.label_places import Box, Label, Segment, Spot, around, stacked
from figures.time_error import MEASURES, Measure, Place, Point, short
from results import text

#: Colours (Okabe and Ito's, and more) and markers of the approximate strategies, in the order of their ids.
COLOURS = ("#D55E00", "#009E73", "#AA4499", "#E69F00", "#56B4E9", "#8C7A00", "#CC79A7", "#A8324A", "#5D4A9C", "#117733")
MARKERS = ("o", "s", "^", "D", "v", "p", "<", "h", ">", "d")
EXACT = "#0072B2"


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
        told = "; ".join(f"{dial.replace('_', ' ')} {short(min(values))} to {short(max(values))}" for dial, values in dials.items())
        title = next(one.title for one in place.points if one.id == identity)
        result.append(Entry(_symbol(*looks[identity]), title, told))
    return result


def _symbol(colour: str, marker: str) -> Markup:
    return Markup(f'<svg class="time-error-key" viewBox="-6.5 -6.5 13 13" aria-hidden="true">{_mark(colour, marker, 0, 0, scale=1.15)}</svg>')


# ---- Drawing

WIDTH, HEIGHT = 420, 348
LEFT, RIGHT, TOP, BOTTOM = 60, 10, 44, 40  #: names of the vertical lines stand above the top, where no mark is
HEAD = 16  #: room for a label above the largest share
STRIP = 20  #: height of the strip of exact zeros, with one row of marks
ROW = 9.5  #: between two rows of the strip, and between two marks in a row: marks do not touch
ROWS = 10  #: at most; beyond, marks cover each other
WIDTHS = {"number": 8.2, "value": 6.4}  #: of a character, for labels that keep apart
NAME = 6.4  #: width of a character of the vertical lines' names
GAP = 4  #: between two labels on a line


class Scale:
    """Places of times (logarithmic) and shares (logarithmic; zero apart, in a strip of `rows` rows)."""

    def __init__(self, times: Sequence[float], shares: Sequence[float]) -> None:
        low, high = math.log10(min(times)), math.log10(max(times))
        room = max(0.05 * (high - low), 0.04)
        self.low, self.high = low - room, high + room
        positive = [share for share in shares if share > 0] or [0.01, 1.0]
        self.least = math.floor(math.log10(min(positive)) + 1e-9)
        self.most = max(math.ceil(math.log10(max(positive)) - 1e-9), self.least + 1)
        self.times = ticks(10**self.low, 10**self.high, 5)
        self.rows = 1

    @property
    def strip(self) -> float:
        """Returns the height of the strip of zeros."""
        return STRIP + ROW * (self.rows - 1)

    def x(self, time: float) -> float:
        """Returns the place of a time; those of slow contestants are at the edge."""
        return LEFT + min((math.log10(time) - self.low) / (self.high - self.low), 1.0) * (WIDTH - LEFT - RIGHT)

    def y(self, share: float, row: int = 0) -> float:
        """Returns the place of a share; that of zero is in a row of the strip, from the lowest one on."""
        bottom = HEIGHT - BOTTOM
        if share <= 0:
            return bottom - STRIP / 2 - ROW * row
        bottom -= self.strip + 4
        return bottom - (math.log10(share) - self.least) / (self.most - self.least) * (bottom - TOP - HEAD)

    def decades(self) -> list[float]:
        step = math.ceil((self.most - self.least) / 6)
        return [10.0**power for power in range(self.most, self.least - 1, -step)]


def panel(place: Place, name: str, looks: dict[str, tuple[str, str]]) -> Markup:
    """Draws one error of a place, a key of `MEASURES`, against time; points whose record does not know it are left out."""
    measure = MEASURES[name]
    share = measure.of
    points = [one for one in place.points if math.isfinite(share(one))]
    slow = place.slow
    scale = Scale([one.time for one in place.points if one not in slow], [share(one) for one in points])
    zeros = [one for one in points if share(one) <= 0]
    rows = stacked([scale.x(one.time) for one in zeros], ROW, ROWS)
    scale.rows = 1 + max(rows, default=0)
    row_of = {id(one): row for one, row in zip(zeros, rows)}
    at = {id(one): (scale.x(one.time), scale.y(share(one), row_of.get(id(one), 0))) for one in points}
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    made = [f'<text class="head" x="0" y="13">{escape(measure.title)}</text>',
            f'<rect class="strip" x="{LEFT}" y="{bottom - scale.strip:.1f}" width="{right - LEFT}" height="{scale.strip:.1f}"/>',
            f'<text class="tick end" x="{LEFT - 5}" y="{bottom - STRIP / 2 + 4:.1f}">{measure.none}</text>']  # fmt: skip
    if scale.rows > 1:  # a crowd: its number is easier to read than to count
        made.append(f'<text class="tick end" x="{LEFT - 5}" y="{bottom - STRIP / 2 - 8:.1f}">({len(zeros)})</text>')
    for value in scale.decades():
        y = scale.y(value)
        made.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        made.append(f'<text class="tick end" x="{LEFT - 5}" y="{y + 4:.1f}">{measure.tick(value)}</text>')
    for value in scale.times:
        x = scale.x(value)
        made.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{bottom}"/>')
        made.append(f'<text class="tick middle" x="{x:.1f}" y="{bottom + 15}">{text.tick(value)}</text>')
    made.append(f'<text class="tick middle" x="{(LEFT + right) / 2:.0f}" y="{bottom + 32}">time per frame (ms)</text>')
    exact = place.fastest_exact
    if exact is not None:
        x = scale.x(exact.time)
        made.append(f'<rect class="slower" x="{x:.1f}" y="{TOP}" width="{right - x:.1f}" height="{bottom - TOP}"/>')
    lines = [(exact, "fastest exact", "beat", 15)] + [(place.unknowing, "no foresight", "beat unknowing", 3)] * (place.unknowing is not exact)
    drawn: list[Segment] = []  # labels keep off them
    for one, word, kind, up in lines:  # the line further right begins below the name of the other
        if one is None:
            continue
        x = scale.x(one.time)
        end = x + 4 + 0.95 * NAME * len(word) > right
        made.append(f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - up - 8}" y2="{bottom}"/>')
        made.append(f'<text class="tick{" end" if end else ""}" x="{x + (-4 if end else 4):.1f}" y="{TOP - up}">{word}</text>')
        drawn.append(((x, TOP), (x, bottom)))
    front = [one for one in place.fronts[name] if id(one) in at]
    if front:
        corners = [(at[id(front[0])][0], float(TOP))]
        for one in front:
            x, y = at[id(one)]
            corners += [(x, corners[-1][1]), (x, y)]
        corners.append((float(right), corners[-1][1]))
        made.append(f'<path class="front" d="M{" L".join(f"{x:.1f} {y:.1f}" for x, y in corners)}"/>')
        drawn += zip(corners, corners[1:])
    for curve in place.curves:
        known = [one for one in curve.points if id(one) in at]
        steps = [(at[id(one)], at[id(other)]) for one, other in zip(known, known[1:]) if max(share(one), share(other)) > 0]  # none along the strip
        if steps:
            way = "".join(f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" for (x0, y0), (x1, y1) in steps)
            made.append(f'<path class="dial" style="{_paint(looks[curve.id][0])}" d="{way}"/>')
            drawn += steps
    for one in sorted(points, key=lambda one: (bool(one.mark), not one.exact)):
        made.append(_drawn(one, measure, *at[id(one)], looks))
    made += _labels(place, front, share, at, drawn, looks)
    return Markup(
        f'<svg class="time-error" role="img" viewBox="0 0 {WIDTH} {HEIGHT}" aria-label="{escape(_said(place, front, measure), quote=True)}">'
        + "".join(made) + "</svg>"
    )  # fmt: skip


def _paint(colour: str) -> str:
    return f"--l:{colour};--d:{on_dark(colour)}"


def _drawn(one: Point, measure: Measure, x: float, y: float, looks: dict[str, tuple[str, str]]) -> str:
    told = f"{one.name}: {text.milliseconds(one.time)} ms, missed {text.percent(one.missed)}, false {text.percent(one.false)}"
    told += "" if measure in (MEASURES["missed"], MEASURES["false"]) else f"; {measure.title[0].lower()}{measure.title[1:]}: {measure.says(one)}"
    says = f"<title>{escape(told)}</title>"
    if one.exact:
        return f'<circle class="exact" style="{_paint(EXACT)}" cx="{x:.1f}" cy="{y:.1f}" r="3.6">{says}</circle>'
    return _mark(*looks[one.id], x, y, says)


def _mark(colour: str, marker: str, x: float, y: float, says: str = "", scale: float = 0.85) -> str:
    inner = symbol(Look(colour, marker, "-", True))
    shape = inner[inner.index(">") + 1 : inner.rindex("</svg>")].split(" fill=")[0]  # in the colours of the scheme instead
    return f'<g class="mark" style="{_paint(colour)}" transform="translate({x:.1f} {y:.1f}) scale({scale:g})">{shape}/>{says}</g>'


def _labels(
    place: Place, front: Sequence[Point], share: Callable[[Point], float], at: dict[int, Spot], drawn: Sequence[Segment], looks: dict[str, tuple[str, str]]
) -> list[str]:
    """Writes the numbers of the front, then the values at both ends of each dial in the dial's colour, next to their marks. Labels cover
    neither marks nor each other (`label_places`). A number may cross a line; a value without room is left out.
    """
    wanted = [(one, one.mark, "number") for one in front if one.mark]
    slow = place.slow
    for one, word in _ends(place):
        told = any(other is one and (said, kind) == (word, "value") for other, said, kind in wanted)
        if one not in slow and id(one) in at and share(one) > 0 and not told:
            wanted.append((one, word, "value"))
    labels = [Label(at[id(one)], WIDTHS[kind] * len(word) + 2, 10.0, kind == "number") for one, word, kind in wanted]
    room = Box(LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM)
    made = []
    for (one, word, kind), found in zip(wanted, label_places.place(labels, [around(spot, 10, 9) for spot in at.values()], drawn, room, GAP)):
        if found is None:
            continue
        if found.lead:
            (x0, y0), (x1, y1) = found.lead
            edge = 5 / math.hypot(x1 - x0, y1 - y0)  # of the mark, as a share of the way
            made.append(f'<line class="lead" x1="{x0 + edge * (x1 - x0):.1f}" y1="{y0 + edge * (y1 - y0):.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')
        paint = f' style="{_paint(looks[one.id][0])}"' if kind == "value" else ""
        made.append(f'<text class="{kind}"{paint} x="{found.middle[0]:.1f}" y="{found.middle[1] + 4:.1f}">{escape(word)}</text>')
    return made


def _ends(place: Place) -> list[tuple[Point, str]]:
    """Returns the ends of the curves with their values; with the dial's last word before it where a strategy turns several dials."""
    dials: dict[str, set[str]] = {}
    for curve in place.curves:
        dials.setdefault(curve.id, set()).add(curve.dial)
    found = []
    for curve in place.curves:
        name = curve.dial.replace("_", " ").split(" ")[-1] + "\u00a0" if len(dials[curve.id]) > 1 else ""
        found += [(one, name + short(float(one.settings[curve.dial]))) for one in (curve.points[0], curve.points[-1])]
    return found


def _said(place: Place, front: Sequence[Point], measure: Measure) -> str:
    told = "; ".join(f"{one.name}: {text.milliseconds(one.time)} ms, {measure.says(one)}" for one in front)
    return f"{place.title}. {measure.title} against time per frame; not dominated: {told}."


@dataclass(frozen=True)
class Panel:
    """A drawn panel, and what it shows."""

    name: str  #: the key of its measure
    title: str
    drawn: Markup
    says: str


@dataclass(frozen=True)
class Shown:
    """A place as a page shows it."""

    place: Place
    panels: list[Panel]  #: missed and false pairs
    more: list[Panel]  #: how bad the missed pairs are; empty in older records
    legend: list[Entry]
    rows: list[dict[str, str]]  #: of the named points
    all_rows: list[dict[str, str]]
    slow: int  #: contestants at the right edge of the panels
    exact: str = _paint(EXACT)  #: the colours of exact contestants, as a style

    @property
    def sentences(self) -> list[str]:
        return self.place.sentences


def shown(found: Sequence[Place]) -> list[Shown]:
    """Returns all that a page shows."""
    looks = series(found)
    made = []
    for place in found:
        drawn = [
            Panel(name, measure.title, panel(place, name, looks), time_error.finding(place, name)) for name, measure in MEASURES.items()
            if any(math.isfinite(measure.of(one)) for one in place.points if not one.exact and one.missed + one.false > 0)
        ]  # fmt: skip
        made.append(
            Shown(
                place, [one for one in drawn if one.name in ("missed", "false")], [one for one in drawn if one.name not in ("missed", "false")],
                legend(place, looks), [_row(one) for one in place.named], [_row(one) for one in place.points], len(place.slow),
            )  # fmt: skip
        )
    return made


def _row(one: Point) -> dict[str, str]:
    first = "never" if one.missed == 0 else text.MISSING if one.first is None else f"{text.count(one.first)} of {text.count(one.frames)}"
    return {
        "mark": one.mark, "name": one.name, "exact": "exact" if one.exact else "", "time": text.milliseconds(one.time),
        "missed": text.percent(one.missed) if one.missed else "0", "false": text.percent(one.false) if one.false else "0",
        "depth": text.significant(one.depth, 2) if one.missed else "0", "first": first,
    }  # fmt: skip
