"""Which strategy for what, by one rule over the cells of a study: for the report, its lines on the terminal, the guide and the site.

A cell is one scene at one size, scalar and l, as measured by one program on one machine. Strategies with a guarantee and one thread take
part, each with its fastest setting of the cell; a cell without a refit, or with a single strategy, is left out. A strategy's speed
in a cell is the time of the best refit over its own, of whole clips, positions included. A situation is the knowledge of the future, the
frames from one keyframe to the next, and the question asked. **The rule:** of the strategies that need to know no more than is known, and
were measured in at least half of the situation's cells, take the one with the largest geometric mean of its speeds; a cell in which it
was not measured counts as its slowest. A cell that several plans measured counts once (`counted`). The explorer uses the same rule
(explorer/src/advice.js), and a test compares the two.

The same cells are kept with the project (`cells_file`): the guide's table comes from them, and a report names them for questions that
its own study did not ask.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Optional

import pandas as pd

from ratios import profiles, ratios
from results import clip_times, text
from results.load import Study
from results.scene_names import short

#: What a strategy may know about motion, from least to most.
FORESIGHT: dict[str, tuple[str, ...]] = {
    "nothing is known": ("", "none"),
    "the next keyframe is known": ("", "none", "step_bound", "next_keyframe"),
    "the whole clip is known": ("", "none", "step_bound", "next_keyframe", "whole_clip"),
}

#: Frames from one keyframe to the next, with the first l of each class and the first beyond it.
FRAMES: dict[str, tuple[float, float]] = {
    "a keyframe at every frame": (0, 2),
    "2 to 9 frames a keyframe": (2, 10),
    "10 frames a keyframe and more": (10, math.inf),
}

#: Classes of sizes in primitives, each with its first and the first beyond it: those of the explorer.
SIZES: dict[str, tuple[float, float]] = {
    "below 10k": (0, 1e4),
    "10k to 100k": (1e4, 1e5),
    "100k and more": (1e5, math.inf),
}

#: What is asked of a cell (`asked`), in the order of pages.
PAIRS, SELF, RAYS = "pairs of two bodies", "pairs within a body, too", "rays"

#: Ids of the first line of the table of scenes that asks one of these.
ANCHORS = {SELF: "glance-self", RAYS: "glance-rays"}


def asked(row: Any) -> str:
    """Returns what a cell asks for, from the record of one of its contestants."""
    if row["rays"]:
        return RAYS
    if row["within"]:
        return "primitives near points"
    if row["continuous"]:
        return "contacts between keyframes"
    if row["answer"]:
        return f"changes of {row['answer']}"
    if row["changes"]:
        return "pairs while plans change"
    within = any(isinstance(body, dict) and body.get("self") is True for body in row["bodies"])
    return SELF if within else PAIRS


def frames_of(l: float) -> str:
    """Returns the class of FRAMES that an l belongs to."""
    return next(name for name, (low, high) in FRAMES.items() if low <= l < high)


def said_of(frames: str) -> str:
    """Writes a class of FRAMES as those say it who have positions and no keyframes."""
    return f"positions only ({frames})" if frames == next(iter(FRAMES)) else frames


@dataclass(frozen=True)
class Facts:
    """What the rule has to know of a strategy."""

    title: str
    foresight: str
    baseline: bool


#: Ends of the interval of a ratio, or of the range of few rounds, and whether it is an interval.
Span = tuple[float, float, bool]


@dataclass
class Cell:
    """One scene at one size, scalar and l."""

    title: str
    asks: str
    frames: str
    primitives: float
    best_refit: str  #: the strategy whose fastest setting is the best refit
    speeds: dict[str, float]  #: by strategy: times as fast as the best refit
    times: dict[str, float]  #: by strategy: ms per frame of the whole clip, positions included
    doubtful: frozenset[str]  #: strategies whose ratio was measured on a disturbed machine
    facts: dict[str, Facts]
    span: Callable[[str], Optional[Span]]  #: of a strategy's ratio

    @property
    def identity(self) -> tuple[Any, ...]:
        """Returns what two measurements of one cell have in common: its title names scene, size, scalar and l."""
        return self.title, self.asks, self.primitives

    @property
    def last(self) -> int:
        """Returns the place of its newest result in the file of results; 0 if it is not known."""
        return 0

    def share(self, id: str) -> float:
        """Returns the time of the fastest over that of a strategy."""
        return self.speeds[id] / max(self.speeds.values())

    def best(self, ids: Iterable[str]) -> Optional[str]:
        """Returns the fastest of some strategies; None if none of them was measured."""
        known = [id for id in ids if id in self.speeds]
        return max(known, key=lambda id: (self.speeds[id], id)) if known else None


@dataclass
class MeasuredCell(Cell):
    """A cell of a study."""

    refit: int  #: run of the best refit
    runs: dict[str, int]  #: by strategy: its fastest setting
    contestants: dict[str, str]
    row: pd.Series  #: of the best refit

    @property
    def identity(self) -> tuple[Any, ...]:
        return self.title, self.asks, self.primitives, self.row["machine"]

    @property
    def last(self) -> int:
        return max(self.runs.values())


@dataclass
class Advice:
    """The strategy that the rule chooses in one situation."""

    id: str
    title: str
    baseline: bool
    speed: float  #: geometric mean, over the best refit
    low: float  #: ends of the interval of the ratio in a single cell (the range of its rounds, if few), or of its range over several
    high: float
    cells: int  #: of the situation
    measured: int  #: of these, in which it was measured
    worst: str  #: the title of the cell with its lowest speed
    best_in: int  #: of a refit: cells in which it is the best refit
    disturbed: bool = False
    is_interval: bool = False  #: in a single cell: of at least five rounds
    times: tuple[float, float] = (math.nan, math.nan)  #: ms per frame in the cell with the shortest, and the longest
    sizes: tuple[float, float] = (math.nan, math.nan)  #: primitives of these two cells
    word: str = "cell"  #: for one of the situation's cells: "scene" where no two are of one scene
    faster: int = 0  #: cells in which it is faster than the best refit
    refit: str = "the best refit"  #: what it is compared with: one refit's title if that is the best one in all cells
    doubtful: list[tuple[str, float]] = field(default_factory=list)  #: cells that were measured on a disturbed machine, and their speeds
    best_doubtful: list[str] = field(default_factory=list)  #: of a refit: those of them in which it is the best refit; `doubtful` has the others
    slower: int = 0  #: cells in which it is slower than the best refit
    unsure: int = 0  #: other cells in which the interval of its ratio contains 1, or the machine was disturbed
    why: str = ""  #: which of the two
    at: tuple[str, str] = ("", "")  #: scenes of the cells with the shortest, and the longest time
    losses: list[tuple[str, float]] = field(default_factory=list)  #: cells in which it is slower than the best refit, and its speeds there
    equals: list[str] = field(default_factory=list)  #: of a best refit: titles of other refits that no interval tells apart from it
    per_primitive: tuple[float, float] = (math.nan, math.nan)  #: nanoseconds per frame and primitive: least and most of the cells

    @property
    def says(self) -> str:
        """Writes the speed out, as in "1.6 times as fast as the best refit (faster in 7 of 8 scenes, 0.90 to 2.10; slower on ball, 2k, l = 10)"."""
        missing = f", measured in {self.measured}" if self.measured < self.cells else ""
        doubt = self._doubt(self.doubtful)
        disturbed = f" ({doubt})" if doubt else ""
        if self.baseline and not self.best_in:
            span = text.factor(self.low) + (f" to {text.factor(self.high)}" if self.low < self.high else "")
            return f"a refit, {span} times as fast as the best one of the {self.word if self.cells == 1 else self.word + 's'}{missing}{disturbed}"
        if self.baseline:
            return self._says_of_refit(missing)
        span = f"{text.factor(self.low)} to {text.factor(self.high)}" if self.low < self.high else ""
        of = f"in {text.plural(self.cells, self.word)}"
        if span and self.cells == 1:
            of = ("95\u00a0% interval " if self.is_interval else "range of its rounds ") + span
        elif span:
            of = f"faster in {self.faster} of {text.plural(self.measured, self.word)}, {span}"
            of += f"; slower on {lost(self)}" if self.losses else ""
            named = {title for title, _ in self.losses[:3]}
            rest = [one for one in self.doubtful if one[0] not in named]
            doubt = self._doubt(rest) if rest else ""
        doubt = f"; {doubt}" if doubt else ""
        mean = " on average" if self.cells > 1 else ""
        return f"{text.factor(self.speed)} times as fast as {self.refit}{mean} ({of}{missing}{doubt})"

    def _says_of_refit(self, missing: str) -> str:
        """Writes in how many cells it is the best refit and how far behind it is in the others, each with what is doubtful there."""
        equal = f" ({text.listing(self.equals)} {'is' if len(self.equals) == 1 else 'are'} as fast, within the 95\u00a0% interval)" if self.equals else ""
        if self.cells == 1:
            doubt = f" ({self._doubt(())})" if self.disturbed else ""
            return f"the best refit in the only {self.word}{missing}{equal}{doubt}"
        said = f"the best refit in {self.best_in} of {text.plural(self.cells, self.word)}{missing}{equal}"
        if self.best_doubtful:
            said += f" (doubtful, from a disturbed machine: {_first_two(self.best_doubtful)})"
        others = self.measured - self.best_in
        if not others:
            return said
        behind = "less than 1\u00a0% slower" if text.factor(self.low) == "1.00" else f"{'at worst ' * (others > 1)}{text.factor(self.low)} times as fast"
        doubt = f" ({self._doubt(self.doubtful)})" if self.doubtful else ""
        return f"{said}; in the other {'one' if others == 1 else others} {behind}{doubt}"

    def _doubt(self, doubtful: Sequence[tuple[str, float]]) -> str:
        """Names ratios that a disturbed machine makes doubtful, each with its cell."""
        if not self.disturbed:
            return ""
        if self.cells == 1 or not doubtful:
            return "a doubtful run: the machine was disturbed"
        return f"doubtful, from a disturbed machine: {_first_two([f'{text.factor(speed)} on {title}' for title, speed in doubtful])}"

    @property
    def sure(self) -> str:
        """Answers in words whether it is surely faster than the best refit; "" of a refit."""
        if self.baseline:
            return ""
        every = f"the only {self.word}" if self.measured == 1 else f"all {self.measured} {self.word}s"
        if self.slower:
            return f"surely faster: no, {self.slower} of {text.plural(self.measured, self.word)} {'is' if self.slower == 1 else 'are'} slower"
        if self.unsure:
            which = f"{self.unsure} of {text.plural(self.measured, self.word)}" if self.measured > 1 else every
            return f"surely faster: not beyond doubt, in {which} {self.why}"
        return f"surely faster: yes, in {every}, intervals included"

    @property
    def costs(self) -> str:
        """Writes the times out with the sizes that they were measured at, as in "0.12 ms (2k) to 0.64 ms (9k triangles) a frame"."""
        low, high = (text.milliseconds(one) for one in self.times)
        small, large = (text.size(one) for one in self.sizes)
        if low == high and small == large:
            return f"{low} ms a frame ({small} triangles)"
        first, last = (f"{one}, " if one else "" for one in self.at)
        return f"{low} ms ({first}{small}) to {high} ms ({last}{large} triangles) a frame"

    @property
    def rates(self) -> str:
        """Writes the times per primitive out, as in "2.3 to 17 ns a triangle": for sizes between those that were measured. "" of a single cell."""
        low, high = (text.significant(one, 2) for one in self.per_primitive)
        return f"{low} to {high} ns a triangle" if self.measured > 1 and low != high else ""


def _first_two(named: Sequence[str]) -> str:
    """Lists two names and counts the others: names contain commas."""
    return "; ".join(named[:2]) + (f"; and {len(named) - 2} more" if len(named) > 2 else "")


def lost(one: Advice) -> str:
    """Names the cells in which a strategy is slower than the best refit, three at most, with its speeds and whether they are doubtful."""
    doubtful = {title for title, _ in one.doubtful}
    named = [f"{title}: {text.factor(speed)}{', a doubtful run: the machine was disturbed' if title in doubtful else ''}" for title, speed in one.losses[:3]]
    return "; ".join(named) + (f"; and {len(one.losses) - 3} more" if len(one.losses) > 3 else "")


@dataclass
class Situation:
    """What is asked and how many frames a keyframe has, with the advice by what is known."""

    asks: str
    frames: str
    cells: int
    advice: list[tuple[str, Optional[Advice]]]  #: in the order of FORESIGHT
    sizes: tuple[float, float] = (math.nan, math.nan)  #: primitives of the smallest and the largest cell


@dataclass
class Record:
    """How one strategy did in the whole study."""

    cells: int = 0
    fastest: list[str] = field(default_factory=list)  #: titles of the cells in which nothing was faster
    near: int = 0  #: cells in which it is within a tenth of the fastest
    share: float = math.nan  #: geometric mean of the fastest time over its own
    worst: float = math.nan
    worst_cell: str = ""


def cells(study: Study) -> list[MeasuredCell]:
    """Returns the cells of a study, in the order of its groups."""
    found = []
    timed = profiles.contestants(study.timed)
    unique = study.runs.drop_duplicates("id")
    facts = {str(one.id): Facts(str(one.title), str(one.foresight), bool(one.baseline)) for one in unique[["id", "title", "foresight", "baseline"]].itertuples()}
    for _, rows in timed.groupby(["group", "commit", "dirty"], sort=False):
        refit = ratios.best_refit(study, rows)
        best = rows.sort_values(["total_motion", "run"]).drop_duplicates("id")
        if refit is None or len(best) < 2:
            continue
        row = rows[rows["run"] == refit].iloc[0]
        runs = dict(zip(map(str, best["id"]), map(int, best["run"])))
        found.append(
            MeasuredCell(
                title=_title(row), asks=asked(row), frames=frames_of(float(row["l"])), primitives=float(row["primitives"]), refit=refit, runs=runs, row=row,
                best_refit=next((id for id, run in runs.items() if run == refit), ""), contestants=dict(zip(best["id"], best["contestant"])),
                speeds={id: _speed(study, run, refit) for id, run in runs.items()}, times=dict(zip(map(str, best["id"]), map(float, best["total_motion"]))),
                doubtful=frozenset(id for id, run in runs.items() if ratios.is_disturbed(study, run, refit)), facts=facts,
                span=_spans(study, runs, refit),
            )  # fmt: skip
        )
    return found


def _spans(study: Study, runs: dict[str, int], refit: int) -> Callable[[str], Optional[Span]]:
    """Returns a function that resamples the ratio of a strategy: too slow to do for all."""

    def span(id: str) -> Optional[Span]:
        found = ratios.ratio(study, runs[id], refit, "with_motion")
        return (found.low, found.high, found.is_interval) if found else None

    return span


def _speed(study: Study, run: int, refit: int) -> float:
    """Returns the middle of ratios.ratio, without its interval."""
    own, other = study.raw[run], study.raw[refit]
    by_clips = own.by_clips or other.by_clips
    top, bottom = (clip_times.time_of(side, ratios.SCOPES["with_motion"], by_clips) for side in (other, own))
    return top / bottom if bottom > 0 else math.nan


def counted(every: Sequence[Cell]) -> list[Cell]:
    """Returns every cell once: of a cell that several plans measured, for example in clips of different lengths, the measurement with the most
    strategies; of equal ones the newest.
    """
    chosen: dict[tuple[Any, ...], Cell] = {}
    for cell in every:
        known = chosen.get(cell.identity)
        if known is None or (len(cell.speeds), cell.last) >= (len(known.speeds), known.last):
            chosen[cell.identity] = cell
    return list(chosen.values())


def situations(every: Sequence[Cell]) -> list[Situation]:
    """Returns the advice for each situation that there are cells of: pairs of two bodies first."""
    every = counted(every)
    kinds = list(dict.fromkeys([PAIRS, SELF, *(cell.asks for cell in every)]))
    found = []
    for asks in kinds:
        for frames in FRAMES:
            own = [cell for cell in every if (cell.asks, cell.frames) == (asks, frames)]
            if own:
                sizes = [cell.primitives for cell in own]
                found.append(Situation(asks, frames, len(own), [(known, advise(own, known)) for known in FORESIGHT], (min(sizes), max(sizes))))
    return found


def allowed(every: Sequence[Cell], known: str) -> list[str]:
    """Returns the strategies of some cells that need to know no more than `known`, a key of FORESIGHT."""
    return sorted({id for cell in every for id in cell.speeds if cell.facts[id].foresight in FORESIGHT[known]})


def advise(own: Sequence[Cell], known: str) -> Optional[Advice]:
    """Applies the rule to the cells of one situation; None if no strategy was measured in half of them."""
    best: Optional[str] = None
    most = -math.inf
    for id in allowed(own, known):
        speeds = [cell.speeds[id] for cell in own if id in cell.speeds]
        if 2 * len(speeds) < len(own):
            continue
        mean = geometric_mean(speeds + [min(speeds)] * (len(own) - len(speeds)))
        if mean > most:
            best, most = id, mean
    if best is None:
        return None
    measured = [cell for cell in own if best in cell.speeds]
    worst = min(measured, key=lambda cell: cell.speeds[best])
    low, high = worst.speeds[best], max(cell.speeds[best] for cell in measured)
    is_interval = False
    if len(own) == 1:
        low, high, is_interval = own[0].span(best) or (low, high, False)
    by_time = sorted(measured, key=lambda cell: (cell.times[best], cell.primitives))
    ends = by_time[0], by_time[-1]
    facts = measured[0].facts[best]
    unsure = [] if facts.baseline else [why for cell in measured if (why := _unsure(cell, best))]
    refits = {cell.best_refit for cell in measured}
    one_refit = next(iter(refits)) if len(refits) == 1 else ""
    scenes = {cell.title.split(", ")[0] for cell in own}
    rates = [1e6 * cell.times[best] / cell.primitives for cell in measured if cell.primitives > 0] or [math.nan]
    return Advice(
        best, facts.title, facts.baseline, most, low, high, len(own), len(measured), worst.title,
        sum(cell.best_refit == best for cell in measured), any(best in cell.doubtful for cell in measured), is_interval,
        times=(ends[0].times[best], ends[1].times[best]), sizes=(ends[0].primitives, ends[1].primitives),
        word="scene" if len(scenes) == len(own) else "cell", faster=sum(cell.speeds[best] > 1 for cell in measured),
        refit=f"the {measured[0].facts[one_refit].title}" if one_refit in measured[0].facts else "the best refit",
        doubtful=[(cell.title, cell.speeds[best]) for cell in measured if best in cell.doubtful and cell.best_refit != best],
        best_doubtful=[cell.title for cell in measured if best in cell.doubtful and cell.best_refit == best],
        slower=sum(cell.speeds[best] < 1 for cell in measured), unsure=len(unsure), why=" or ".join(dict.fromkeys(unsure)),
        at=(ends[0].title.split(", ")[0], ends[1].title.split(", ")[0]) if len(scenes) > 1 else ("", ""),
        losses=sorted(((cell.title, cell.speeds[best]) for cell in measured if cell.speeds[best] < 1), key=lambda one: one[1]),
        equals=_equals(own, best) if facts.baseline else [], per_primitive=(min(rates), max(rates)),
    )  # fmt: skip


#: A refit that is slower than this share of the best one's speed in some cell is not asked for its interval: that takes long.
NEAR = 0.9


def _equals(own: Sequence[Cell], best: str) -> list[str]:
    """Returns the titles of the other refits that no interval of any cell tells apart from the best refit of all of them."""
    found = []
    if any(cell.best_refit != best for cell in own):
        return []
    for id in sorted({id for cell in own for id in cell.speeds if cell.facts[id].baseline and id != best}):
        if all(NEAR <= cell.speeds.get(id, 0) <= 1 and (span := cell.span(id)) is not None and span[2] and span[1] >= 1 for cell in own):
            found.append(own[0].facts[id].title)
    return found


def _unsure(cell: Cell, id: str) -> str:
    """Says why a strategy that is not slower in a cell may be: "" if it is sure, or slower. A single round has no interval."""
    if cell.speeds[id] < 1:
        return ""
    if id in cell.doubtful:
        return "the run is doubtful"
    span = cell.span(id)
    if span is None or span[0] >= span[1]:
        return "there is no interval"
    return "" if span[0] > 1 else "the interval contains 1"


def records(every: Sequence[Cell]) -> dict[str, Record]:
    """Returns the record of every strategy with a time in some cell."""
    result: dict[str, Record] = {}
    shares: dict[str, list[float]] = {}
    for cell in counted(every):
        for id in cell.speeds:
            share = cell.share(id)
            record = result.setdefault(id, Record())
            record.cells += 1
            record.near += share >= 1 / 1.1
            if share == 1:
                record.fastest.append(cell.title)
            if not share >= record.worst:
                record.worst, record.worst_cell = share, cell.title
            shares.setdefault(id, []).append(share)
    for id, record in result.items():
        record.share = geometric_mean(shares[id])
    return result


def geometric_mean(values: Sequence[float]) -> float:
    """Returns the geometric mean of positive values."""
    return math.exp(sum(map(math.log, values)) / len(values))


def _title(row: pd.Series) -> str:
    scalar = "" if row["scalar"] == "float" else f", {row['scalar']}"
    return f"{short(row['scene'])}, {text.size(row['primitives'])}, l = {row['l']:g}{scalar}"


def changes(one: Situation) -> list[tuple[str, Advice]]:
    """Returns what is known and what to take then, without advice that more knowledge does not change."""
    found: list[tuple[str, Advice]] = []
    for known, best in one.advice:
        if best is not None and (not found or best.id != found[-1][1].id):
            found.append((known, best))
    return found


def sentence(one: Situation) -> str:
    """Writes the advice of a situation in one sentence; advice that more knowledge does not change is not repeated."""
    parts = [
        f"{best.title} {'if' if i else 'where'} {known}: {best.says}, at {best.costs}{f' ({best.sure})' if best.sure else ''}"
        for i, (known, best) in enumerate(changes(one))
    ]
    asks = {PAIRS: "", SELF: " and pairs within a body"}.get(one.asks, f" and {one.asks}")
    begin = f"With {said_of(one.frames)}{asks}"
    return f"{begin}, take {'; '.join(parts)}." if parts else f"{begin}, no strategy was measured in half of the cells."


def brief(one: Situation) -> str:
    """Writes the advice of a situation shorter, for measurements that are quoted: titles, times, also per triangle, and in how many scenes
    each is faster."""
    parts = [
        f"{best.title}{f' if {known}' if i else ''}, {best.costs}{f' ({best.rates})' if best.rates else ''}"
        + (f"; {best.says}" if best.equals or not best.baseline else "") + ("" if best.baseline else f"; {best.sure}")
        for i, (known, best) in enumerate(changes(one))
    ]
    return f"{said_of(one.frames)}: {'; '.join(parts)}"


def recommended(one: Situation) -> list[tuple[str, str]]:
    """Returns id and title of what is recommended in a situation, each once."""
    return list(dict.fromkeys((best.id, best.title) for _, best in changes(one)))
