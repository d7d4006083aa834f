"""Draws a claim as a small picture: claimed and measured values, by corner, on a logarithmic axis.

Inline SVG: its colours are variables of the page's style, so that it is readable in light and dark, and a label says the same
in words.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, field
from html import escape
from typing import Any, Optional, Sequence

from claims.claim_points import CheckResult, Point
from claims.claim_words import NOT_MEASURED, number, rule, wanted, where
from results import text

WIDTH, LEFT, RIGHT = 424, 170, 8  #: of the drawing, of the names at its left, of the room at its right
ROW, HEAD, FOOT = 15, 17, 19  #: heights of a row, of a check's heading and of the axis
ROWS_OF_THEORY = 6
SIGNS = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}


@dataclass(frozen=True)
class Mark:
    """One measured value."""

    value: float
    met: bool
    second: bool  #: with motion evaluation


@dataclass(frozen=True)
class Bar:
    """One row: a corner of a check."""

    name: str
    marks: list[Mark]
    said: str  #: the row in words


@dataclass
class Block:
    """Rows that claim the same."""

    name: str
    relation: str
    bound: float
    tolerance: float
    claimed: str  #: in words
    bars: list[Bar] = field(default_factory=list)

    def zone(self) -> tuple[float, float]:
        """Returns the values that meet the claim: from, to."""
        if self.relation == "within a factor of":
            factor = self.bound * (1 + self.tolerance)
            return 1 / factor, factor
        if self.relation in ("<", "<="):
            return 0.0, self.bound * (1 + self.tolerance)
        return self.bound * (1 - self.tolerance), math.inf


def of_experiment(looked: Sequence[CheckResult]) -> str:
    """Draws a claim's checks; empty without measurements.

    A check with corners has a block of its own, or shares one with those of the same "row"; checks without corners that claim
    the same share one, too.
    """
    blocks: dict[Any, Block] = {}
    for number_of_check, one in enumerate(looked):
        shared = one.check.get("row") or ("alone" if len(one.corners) == 1 else "")
        name = "" if shared or len(looked) == 1 else one.check.get("short", "")
        kind = (shared or number_of_check, *_bound(one.check))
        block = blocks.setdefault(kind, Block(name, *_bound(one.check), wanted(one.check)))
        for bar in _bars(one):
            same = next((i for i, other in enumerate(block.bars) if other.name == bar.name), None)
            if same is None:
                block.bars.append(bar)
            else:
                block.bars[same] = _together(block.bars[same], bar)
    return draw([block for block in blocks.values() if block.bars])


def _bars(one: CheckResult) -> list[Bar]:
    """Returns a bar for each corner; without corners one for the check, or one for each scene if the check has no name."""

    def marks(points: list[Point]) -> list[Mark]:
        return [Mark(p.value.middle, p.met, p.quantity.endswith("with motion")) for p in points]

    if len(one.corners) > 1:
        by_corner = [(corner, [p for p in one.points if p.corner == corner.id]) for corner in one.corners]
        return [Bar(corner.short, marks(points), rule(one, corner)) for corner, points in by_corner]
    if one.check.get("short"):
        return [Bar(one.check["short"], marks(one.points), rule(one, one.corners[0]))]
    by_scene = [(scene, [p for p in one.points if p.scene == scene]) for scene in dict.fromkeys(p.scene for p in one.points)]
    return [Bar(scene, marks(points), where(points)) for scene, points in by_scene]


def _together(one: Bar, other: Bar) -> Bar:
    marks = one.marks + other.marks
    said_of_both = f"met at {sum(mark.met for mark in marks)} of {len(marks)} points" if one.marks and other.marks else one.said
    return Bar(one.name, marks, said_of_both if one.marks or not other.marks else other.said)


def _bound(check: dict[str, Any]) -> tuple[str, float, float]:
    return check["relation"], float(check["bound"]), float(check["tolerance"])


def of_theory(criteria: Sequence[dict[str, Any]]) -> str:
    """Draws a claim of theory.json: counts over their bounds; empty without a positive bound."""
    blocks: dict[str, Block] = {}
    for name, listed in grouped(criteria).items():
        relation = listed[0]["relation"]
        usable = [one for one in listed if one["bound"] > 0 and one["measured"] is not None]
        if relation not in SIGNS or not usable or all(one["measured"] == 0 and one["met"] for one in usable):
            continue
        block = blocks.setdefault(relation, Block("", relation, 1.0, 0.0, f"{SIGNS[relation]} the bound"))
        marks = [Mark(one["measured"] / one["bound"], bool(one["met"]), False) for one in usable]
        met = sum(mark.met for mark in marks)
        block.bars.append(Bar(name, marks, f"met at {met} of {len(marks)}"))
    for block in blocks.values():
        block.bars.sort(key=lambda bar: (all(mark.met for mark in bar.marks), -max(mark.value for mark in bar.marks)))
        del block.bars[ROWS_OF_THEORY:]
    return draw(list(blocks.values()), "measured over bound")


#: The part of a criterion's name that names its clip.
CLIP = re.compile(r", (?:l = \d+|[^,]*, [\d,]+ (?:polygons?|leaves)|[A-Za-z_-]+)(?:, l = \d+)?$")


def grouped(criteria: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Groups criteria that differ in the clip only."""
    found: dict[str, list[dict[str, Any]]] = {}
    for one in criteria:
        name = CLIP.sub("", str(one["what"]))
        name = name if not any(other["relation"] != one["relation"] for other in found.get(name, [])) else str(one["what"])
        found.setdefault(name, []).append(one)
    return found


def draw(blocks: Sequence[Block], unit: str = "") -> str:
    """Draws the blocks one below the other on one axis; empty without values, and without any above 0: the axis is logarithmic."""
    values = [mark.value for block in blocks for bar in block.bars for mark in bar.marks]
    placed = [value for value in values if value > 0] + [one.bound for one in blocks if one.bound > 0]
    if not values or not placed:
        return ""
    axis = Axis(placed, 0 in values)
    parts: list[str] = []
    y = 2.0
    for block in blocks:
        y = _block(parts, block, axis, y)
    bottom = y
    lines, names = [], []
    for tick in axis.ticks:
        x = f"{axis.at(tick):.1f}"
        kind = "grid one" if tick == 1 else "grid"
        lines.append(f'<line class="{kind}" x1="{x}" x2="{x}" y1="{HEAD:.1f}" y2="{bottom:.1f}"/>')
        names.append(f'<text class="tick" x="{x}" y="{bottom + 12:.1f}">{number(tick)}</text>')
    if axis.zero:
        names.append(f'<text class="tick" x="{axis.at(0):.1f}" y="{bottom + 12:.1f}">0</text>')
    if unit:
        names.append(f'<text class="name unit" x="0" y="{bottom + 12:.1f}">{escape(unit)}</text>')
    height = bottom + FOOT
    return (
        f'<svg class="claim-picture" role="img" viewBox="0 0 {WIDTH} {height:.0f}" width="{WIDTH}" height="{height:.0f}" '
        f'aria-label="{escape(said(blocks, unit), quote=True)}">' + "".join(parts[::2] + lines + parts[1::2] + names) + "</svg>"
    )


def _block(parts: list[str], block: Block, axis: Axis, y: float) -> float:
    """Draws a block below y: a shade, then the marks on it; returns the y of its end."""
    low, high = block.zone()
    left, right = axis.at(low), axis.at(high)
    top = y + HEAD
    bottom = top + ROW * len(block.bars)
    bounded = block.bound > 0
    sign = f"{SIGNS.get(block.relation, 'within ×')} {number(block.bound)}".replace("× ", "×")
    place = axis.at(block.bound if block.relation != "within a factor of" else 1)
    end = place > LEFT + (WIDTH - LEFT - RIGHT) * 0.7
    under = f'<rect class="zone" x="{left:.1f}" y="{top:.1f}" width="{max(right - left, 1):.1f}" height="{bottom - top:.1f}"/>'
    over = f'<text class="name head" x="0" y="{y + 12:.1f}">{escape(_short(block.name))}</text>' if block.name else ""
    if bounded:
        beside = f'class="claimed{" end" if end else ""}" x="{place + (-3 if end else 3):.1f}" y="{y + 12:.1f}"'
        over += f"<text {beside}>claimed {escape(sign)}</text>"
        if block.relation != "within a factor of":
            over += f'<line class="bound" x1="{place:.1f}" x2="{place:.1f}" y1="{y + 3:.1f}" y2="{bottom:.1f}"/>'
    for number_of_row, bar in enumerate(block.bars):
        middle = top + ROW * (number_of_row + 0.5)
        over += f'<text class="name" x="0" y="{middle + 3.5:.1f}">{escape(_short(bar.name))}</text>'
        over += _bar(bar, axis, middle)
    parts += [under, over]
    return bottom + 2


def _bar(bar: Bar, axis: Axis, y: float) -> str:
    if not bar.marks:
        return f'<text class="absent" x="{LEFT + 4}" y="{y + 3.5:.1f}">{NOT_MEASURED}</text>'
    places = [axis.at(mark.value) for mark in bar.marks]
    made = f'<line class="span" x1="{min(places):.1f}" x2="{max(places):.1f}" y1="{y:.1f}" y2="{y:.1f}"/>'
    for mark, x in sorted(zip(bar.marks, places), key=lambda pair: pair[0].met):
        kind = "met" if mark.met else "unmet"
        if mark.second:
            made += f'<path class="{kind}" d="M{x:.1f} {y - 3.4:.1f}l3.4 3.4-3.4 3.4-3.4-3.4z"/>'
        else:
            made += f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="2.7"/>'
    return made


def _short(name: str, most: int = 27) -> str:
    """Shortens a name in its middle: similar names often differ at their ends."""
    if len(name) <= most:
        return name
    tail = name.rpartition(", ")[2]
    end = f"…, {tail}" if len(tail) < most / 2 else "…"
    return name[: most - len(end)].rstrip(" ,") + end


class Axis:
    """Maps values to places: logarithmic, zero at the left edge."""

    def __init__(self, values: Sequence[float], zero: bool) -> None:
        low, high = math.log10(min(values)), math.log10(max(values))
        room = max((high - low) * 0.07, 0.04, 0.6 - (high - low) if zero else 0)
        self.low, self.high = low - room, high + room
        self.zero = zero
        self.ticks = [one for one in ticks(10**self.low, 10**self.high) if not zero or self.at(one) > LEFT + 22]

    def at(self, value: float) -> float:
        """Returns the place of a value, clipped to the edges."""
        if value <= 0:
            return LEFT + 5.0 if self.zero else float(LEFT)
        if math.isinf(value):
            return float(WIDTH - RIGHT)
        start = LEFT + (18 if self.zero else 0)
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return min(max(start + share * (WIDTH - RIGHT - start), float(LEFT)), float(WIDTH - RIGHT))


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Returns round numbers from low to high, `most` at most."""
    if high / low < 4:
        rounds = (digit * 10.0**power for power, digit in itertools.product(range(-12, 13), (1, 2, 5)))
        step = next(one for one in rounds if (high - low) / one < most)
        return [float(f"{i * step:.6g}") for i in range(math.ceil(low / step), math.floor(high / step) + 1)]
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps, every in (((1, 2, 5), 1), ((1,), 1), ((1,), 2), ((1,), 3), ((1,), 5), ((1,), 10)):
        found = [m * 10.0**p for p in powers if p % every == 0 for m in steps if low <= m * 10.0**p <= high]
        if len(found) <= most:
            return found
    return []


def said(blocks: Sequence[Block], unit: str = "") -> str:
    """Describes the picture in words."""
    told = []
    for block in blocks:
        rows = []
        for bar in block.bars:
            values = [mark.value for mark in bar.marks]
            spread = text.factor(min(values, default=math.nan))
            if values and text.factor(max(values)) != spread:
                spread += f" to {text.factor(max(values))}"
            rows.append(f"{bar.name}: {f'{spread}, {bar.said}'.rstrip(', ') if values else NOT_MEASURED}")
        name = f"{block.name}, claimed" if block.name else "Claimed"
        told.append(f"{name} {block.claimed}. {'; '.join(rows)}.")
    head = f"{unit[:1].upper()}{unit[1:]}, logarithmic axis" if unit else "Logarithmic axis"
    return f"{head}. {' '.join(told)}"


def picture(looked: Sequence[CheckResult], criteria: Optional[Sequence[dict[str, Any]]] = None) -> str:
    """Draws either kind of claim."""
    return of_experiment(looked) if looked else of_theory(criteria or [])
