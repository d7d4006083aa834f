"""Places the labels of a figure next to their marks, one after the other: no label covers a mark, another label or a line that leads to one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Optional

#: A point, and a line from one to another; y grows downwards.
Spot = tuple[float, float]
Segment = tuple[Spot, Spot]

#: Directions in degrees, in the order in which they are tried: left of a mark first, where curves that run to the right leave room.
DIRECTIONS = (180, 135, 225, 90, 270, 45, 315, 0, 157.5, 202.5, 112.5, 247.5, 67.5, 292.5, 22.5, 337.5)
#: Distances between a mark and the nearest point of its label, in the order in which they are tried.
REACHES = (7.0, 10.0, 14.0, 19.0, 25.0, 33.0, 42.0, 52.0, 64.0, 78.0, 95.0, 115.0)
#: A label further away than this has a line that leads to it.
LEAD = 12.0


@dataclass(frozen=True)
class Box:
    """A rectangle."""

    left: float
    top: float
    right: float
    bottom: float

    def overlaps(self, other: Box) -> bool:
        """Returns whether both have a point inside of them in common; boxes that touch do not overlap."""
        return self.left < other.right and other.left < self.right and self.top < other.bottom and other.top < self.bottom

    def holds(self, other: Box) -> bool:
        """Returns whether the other one does not reach beyond this one."""
        return self.left <= other.left and self.top <= other.top and other.right <= self.right and other.bottom <= self.bottom

    def grown(self, across: float, down: float) -> Box:
        """Returns the box with as much more on each side."""
        return Box(self.left - across, self.top - down, self.right + across, self.bottom + down)

    def crossed_by(self, line: Segment) -> bool:
        """Returns whether a line has a point in the box, by the part of the line that lies between each pair of sides."""
        (x0, y0), (x1, y1) = line
        begin, end = 0.0, 1.0
        for start, step, low, high in ((x0, x1 - x0, self.left, self.right), (y0, y1 - y0, self.top, self.bottom)):
            if step == 0:
                if not low <= start <= high:
                    return False
                continue
            one, other = sorted(((low - start) / step, (high - start) / step))
            begin, end = max(begin, one), min(end, other)
        return begin <= end


def around(at: Spot, width: float, height: float) -> Box:
    """Returns the box with this middle."""
    return Box(at[0] - width / 2, at[1] - height / 2, at[0] + width / 2, at[1] + height / 2)


@dataclass(frozen=True)
class Label:
    """A text that belongs to a mark."""

    mark: Spot
    width: float
    height: float
    needed: bool  #: may cross lines of the figure where there is no other room


@dataclass(frozen=True)
class Placed:
    """Where a label stands."""

    middle: Spot
    box: Box
    lead: Optional[Segment]  #: from the mark to the label, if it stands further away


def place(labels: Sequence[Label], marks: Sequence[Box], lines: Sequence[Segment], room: Box, gap: float) -> list[Optional[Placed]]:
    """Returns where each label stands, or None if there is no room for it.

    The first labels choose first. Each takes the nearest place inside of `room` that is at least `gap` left or right of other labels, off all
    marks and all leading lines, and off `lines`; its own leading line runs over no mark and no label. A label that is needed takes the place
    where it and its leading line cross least, if there is none without. The work grows with labels times (labels, marks and lines).
    """
    texts: list[Box] = []
    leads: list[Segment] = []
    found: list[Optional[Placed]] = []
    for label in labels:
        best: Optional[Placed] = None
        fewest = math.inf if label.needed else 1
        for one in _candidates(label):
            wide = one.box.grown(gap, 0)
            if not room.holds(one.box) or any(wide.overlaps(other) for other in texts) or any(one.box.overlaps(other) for other in marks):
                continue
            if any(one.box.crossed_by(lead) for lead in leads):
                continue
            crossed = _crossed(one, label.mark, texts, marks, lines, fewest)
            if crossed < fewest:
                best, fewest = one, crossed
            if fewest == 0:
                break
        if best is not None:
            texts.append(best.box)
            leads += [best.lead] if best.lead else []
        found.append(best)
    return found


def _crossed(one: Placed, mark: Spot, texts: Sequence[Box], marks: Sequence[Box], lines: Sequence[Segment], enough: float) -> float:
    """Returns how much a label crosses: 1 for each line over it and for each mark under its leading line, but those around its own mark, and 3
    for each label under its leading line. Stops counting at `enough`.
    """
    crossed = 0
    if one.lead:
        own = around(mark, 0, 0)
        crossed += 3 * sum(box.crossed_by(one.lead) for box in texts) + sum(box.crossed_by(one.lead) for box in marks if not box.holds(own))
    for line in lines:
        if crossed >= enough:
            break
        crossed += one.box.crossed_by(line)
    return crossed


def _candidates(label: Label) -> list[Placed]:
    """Returns the places of a label, the nearest first."""
    places = []
    x, y = label.mark
    for reach in REACHES:
        for degrees in DIRECTIONS:
            across, down = math.cos(math.radians(degrees)), -math.sin(math.radians(degrees))
            near = (x + reach * across, y + reach * down)  # the point of the label that is nearest to the mark, or its end above and below
            middle = (near[0] + label.width / 2 * _side(across), near[1] + label.height / 2 * _side(down))
            lead = ((x, y), near) if reach > LEAD else None
            places.append(Placed(middle, around(middle, label.width, label.height), lead))
    return places


def _side(share: float) -> float:
    """Returns -1, 0 or 1: on which side of its nearest point a label lies; 0 in a direction along the other axis."""
    return 0.0 if abs(share) < 0.3 else math.copysign(1.0, share)


def stacked(places: Sequence[float], least: float, most: int) -> list[int]:
    """Returns a row for each of some places on a line, given from left to right, so that places of a row are `least` apart.

    Each takes the lowest row with room. From the row `most` on, it takes the one whose last place is furthest away: they cover each other.
    """
    ends: list[float] = []
    rows = []
    for at in places:
        row = next((row for row, end in enumerate(ends) if at - end >= least), len(ends))
        if row == most:
            row = min(range(most), key=lambda one: ends[one])
        if row == len(ends):
            ends.append(at)
        ends[row] = at
        rows.append(row)
    return rows
