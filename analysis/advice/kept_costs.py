"""The cells that come with the project, line by line: what the recommended strategies cost at sizes and in situations that a study lacks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Optional

from advice import advice, summary
from results import text


@dataclass
class Cost:
    """What a strategy costs in a cell."""

    title: str
    ms: str
    ratio: str  #: times as fast as the best refit, with its interval; "the best refit" of that


@dataclass
class KeptLine:
    """One cell that comes with the project: the best refit, and what the rule takes in its situation."""

    scene: str
    asks: str
    primitives: str
    l: str
    refit: Cost
    advised: list[Optional[Cost]]  #: by what is known, in the order of FORESIGHT; None where less knowledge, or the refit, does as well
    counts: bool = True  #: False: another plan measured the same cell, and its measurement counts


def kept_lines(reference: Path = summary.REFERENCE) -> list[KeptLine]:
    """Returns a line for each cell that comes with the project, the small ones first; [] without such a file."""
    kept = summary.kept_cells(reference)
    if kept is None:
        return []
    found: list[tuple[float, KeptLine]] = []
    for asks in dict.fromkeys(cell.asks for cell in kept.cells):
        for name in advice.SIZES:
            own = summary.own_cells(kept, name, asks)
            once = advice.counted(own)
            for one in advice.situations(own):
                taken = {known: best.id for known, best in advice.changes(one)}
                found += [
                    (cell.primitives, _line(cell, taken, any(cell is other for other in once))) for cell in own if cell.frames == one.frames
                ]
    return [line for _, line in sorted(found, key=lambda one: (one[1].asks, one[0], one[1].l))]


def _line(cell: advice.Cell, taken: dict[str, str], counts: bool) -> KeptLine:
    """Returns the line of a cell; `taken` is what the rule takes in its situation, by what is known."""
    scene, _, rest = cell.title.partition(", ")
    advised = [_cost(cell, taken[known]) if taken.get(known, cell.best_refit) in cell.times.keys() - {cell.best_refit} else None for known in advice.FORESIGHT]
    asks = "" if cell.asks == advice.PAIRS else cell.asks
    return KeptLine(scene, asks, text.size(cell.primitives), rest.rpartition("l = ")[2], _cost(cell, cell.best_refit), advised, counts)


def _cost(cell: advice.Cell, id: str) -> Cost:
    told = "the best refit"
    if id != cell.best_refit:
        span = cell.span(id)
        ends = f"{text.factor(span[0])}–{text.factor(span[1])}" if span and span[0] < span[1] else ""
        told = text.factor(cell.speeds[id]) + ("?" if id in cell.doubtful else "")
        told += f" ({ends})" if ends and span and span[2] else f" [{ends}]" if ends else ""
    return Cost(cell.facts[id].title, text.milliseconds(cell.times[id]), told)
