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
from figures import time_error
from figures.colours import Look, on_dark, symbol
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
STRIP = 20  #: height of the strip of exact zeros
FONT = 6.4  #: width of a character, for labels that keep apart
GAP = 4  #: between two labels on a line


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


def panel(place: Place, name: str, looks: dict[str, tuple[str, str]]) -> Markup:
    """Draws one error of a place, a key of `MEASURES`, against time; points whose record does not know it are left out."""
    measure = MEASURES[name]
    share = measure.of
    points = [one for one in place.points if math.isfinite(share(one))]
    slow = place.slow
    scale = Scale([one.time for one in place.points if one not in slow], [share(one) for one in points])
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    made = [f'<text class="head" x="0" y="13">{escape(measure.title)}</text>',
            f'<rect class="strip" x="{LEFT}" y="{bottom - STRIP}" width="{right - LEFT}" height="{STRIP}"/>',
            f'<text class="tick end" x="{LEFT - 5}" y="{bottom - STRIP / 2 + 4:.1f}">{measure.none}</text>']  # fmt: skip
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
    for one, word, kind, up in lines:  # the line further right begins below the name of the other
        if one is None:
            continue
        x = scale.x(one.time)
        end = x + 4 + 0.95 * FONT * len(word) > right
        made.append(f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - up - 8}" y2="{bottom}"/>')
        made.append(f'<text class="tick{" end" if end else ""}" x="{x + (-4 if end else 4):.1f}" y="{TOP - up}">{word}</text>')
    front = place.fronts[name]
    if front:
        way = f"M{scale.x(front[0].time):.1f} {TOP}"
        for one in front:
            way += f"H{scale.x(one.time):.1f}V{scale.y(share(one)):.1f}"
        made.append(f'<path class="front" d="{way}H{right}"/>')
    for curve in place.curves:
        way = " ".join(f"{scale.x(one.time):.1f},{scale.y(share(one)):.1f}" for one in curve.points if math.isfinite(share(one)))
        made.append(f'<polyline class="dial" style="{_paint(looks[curve.id][0])}" points="{way}"/>')
    for one in sorted(points, key=lambda one: (bool(one.mark), not one.exact)):
        made.append(_drawn(one, measure, scale.x(one.time), scale.y(share(one)), looks))
    made += _labels(place, points, front, scale, share, looks)
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
    place: Place, points: Sequence[Point], front: Sequence[Point], scale: Scale, share: Callable[[Point], float], looks: dict[str, tuple[str, str]]
) -> list[str]:
    """Writes the numbers of the front, then the values at both ends of each dial in the dial's colour, next to their marks. Labels cover
    neither marks nor each other, values no dial, and two on a line have a gap between them; values without room are left out, numbers are
    led further away.
    """
    taken = [(scale.x(one.time), scale.y(share(one)), 5.0, 4.0) for one in points]
    along = [spot for curve in place.curves for spot in _along([(scale.x(one.time), scale.y(share(one))) for one in curve.points if math.isfinite(share(one))])]
    wanted = [(one, one.mark, "number") for one in front if one.mark]
    ends = [(curve.points[i], short(float(curve.points[i].settings[curve.dial])), "value") for curve in place.curves for i in (0, -1)]
    slow = place.slow
    wanted += [(one, word, kind) for one, word, kind in ends if one not in slow and share(one) > 0]
    made, written = [], set()
    for one, word, kind in wanted:
        if (id(one), word, kind) in written:
            continue
        written.add((id(one), word, kind))
        x, y, half = scale.x(one.time), scale.y(share(one)), FONT * len(word) / 2 + 1
        reaches = (10, 14, 19, 25, 33)
        spot = _free(x, y, half, taken + along, reaches) or (_free(x, y, half, taken, (*reaches, 42, 52, 63, 75, 90)) if kind == "number" else None)
        if spot is None:
            continue
        dx, dy = spot
        taken.append((x + dx, y + dy, half + GAP, 6.0))
        if math.hypot(dx, dy) > 19:
            made.append(f'<line class="lead" x1="{x:.1f}" y1="{y:.1f}" x2="{x + dx * 0.7:.1f}" y2="{y + dy * 0.7:.1f}"/>')
        paint = f' style="{_paint(looks[one.id][0])}"' if kind == "value" else ""
        made.append(f'<text class="{kind}"{paint} x="{x + dx:.1f}" y="{y + dy + 4:.1f}">{word}</text>')
    return made


def _along(way: Sequence[tuple[float, float]]) -> list[tuple[float, float, float, float]]:
    """Returns spots on a polyline, 6 apart."""
    found = []
    for (x0, y0), (x1, y1) in zip(way, way[1:]):
        steps = math.ceil(math.hypot(x1 - x0, y1 - y0) / 6) or 1
        found += [(x0 + (x1 - x0) * i / steps, y0 + (y1 - y0) * i / steps, 1.0, 0.0) for i in range(1, steps)]
    return found


def _free(
    x: float, y: float, half: float, taken: Sequence[tuple[float, float, float, float]], reaches: Sequence[int]
) -> Optional[tuple[float, float]]:
    """Returns where, relative to (x, y), a label of this half width is inside the panel and free of what is taken; None without room."""
    for reach in reaches:
        for angle in (135, 180, 225, 90, 270, 45, 315, 0):
            along = math.cos(math.radians(angle))
            dx = reach * along + math.copysign(half - 3, along) * (abs(along) > 0.1)
            dy = reach * math.sin(math.radians(angle))
            inside = LEFT < x + dx - half and x + dx + half < WIDTH - RIGHT and TOP < y + dy - 5 and y + dy + 5 < HEIGHT - BOTTOM
            if inside and not any(abs(x + dx - cx) < half + w and abs(y + dy - cy) < 5 + h for cx, cy, w, h in taken):
                return dx, dy
    return None


def _said(place: Place, front: Sequence[Point], measure: Measure) -> str:
    told = "; ".join(f"{one.name}: {text.milliseconds(one.time)} ms, {measure.says(one)}" for one in front)
    return f"{place.title}. {measure.title} against time per frame; not dominated: {told}."


@dataclass(frozen=True)
class Panel:
    """A drawn panel, and what it shows."""

    name: str  #: the key of its measure
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

    @property
    def sentences(self) -> list[str]:
        return self.place.sentences


def shown(found: Sequence[Place]) -> list[Shown]:
    """Returns all that a page shows."""
    looks = series(found)
    made = []
    for place in found:
        drawn = [
            Panel(name, panel(place, name, looks), time_error.finding(place, name)) for name, measure in MEASURES.items()
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
