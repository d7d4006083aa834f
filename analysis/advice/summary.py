"""The answers of a report in full, computed: what to take, what errors buy, what holds of the paper, how disturbed the run was; its chart, and the
table of scenes. `top` says the same in five short sentences."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Optional

from advice import advice, cells_file, methods
from advice.advice import Advice, MeasuredCell, Situation
from claims import claims as paper_claims
from claims.claims import CONDITION, FAILS, HOLDS, OPEN, Claims
from figures import time_error_file, time_error_panels
from ratios import ratios
from results import files, text
from results.load import OLD_SCHEMA, Study
from results.scene_names import short

REFERENCE = Path(__file__).resolve().parents[1] / "reference"
#: The claim that the paper's abstract makes: kinetic trees are updated faster than by a refit.
MAIN = "E3"
HERE, BY_REFERENCE = "this study", "the reference run"


@dataclass
class Verdict:
    """What is known of one claim of the paper."""

    row: paper_claims.Row  #: of this study
    reference: str  #: the verdict of the reference run, "" if it has none
    reference_brief: str = ""
    reference_corners: list[dict[str, Any]] = field(default_factory=list)  #: as claims.json has them
    reference_ours: dict[str, str] = field(default_factory=dict)  #: the measured ranges, by corner

    @property
    def source(self) -> str:
        """Returns which of the two decides it: this study if it can; "" if neither does."""
        return HERE if self.row.verdict != OPEN else BY_REFERENCE if self.reference else ""

    @property
    def verdict(self) -> str:
        return self.row.verdict if self.source != BY_REFERENCE else self.reference

    @property
    def brief(self) -> str:
        return self.row.brief if self.source != BY_REFERENCE else self.reference_brief

    @property
    def corners(self) -> list[dict[str, Any]]:
        """Returns the corners of the claim's square, as claims.json has them."""
        return self.reference_corners if self.source == BY_REFERENCE else [asdict(one) for one in self.row.corners]

    @property
    def ours(self) -> dict[str, str]:
        """Returns the ranges that were measured, by corner, as `claims.ours` writes them."""
        return self.reference_ours if self.source == BY_REFERENCE else self.row.ours

    @property
    def judged(self) -> list[tuple[str, str, str]]:
        """Returns the id of each corner of a claim with one check, the range without motion evaluation, and where it is met."""
        return [(one["id"], self.ours[one["id"]].split(",")[0], str(one.get("rule", ""))) for one in self.corners if one["id"] in self.ours]

    def span(self, id: str) -> tuple[str, str]:
        """Returns the ranges of a corner, without and with motion evaluation, and where it is met; empty texts without that corner."""
        rule = next((str(corner.get("rule", "")) for corner in self.corners if corner["id"] == id), "")
        return self.ours.get(id, ""), rule

    @property
    def differs(self) -> bool:
        """Returns whether both decide it and disagree."""
        return self.source == HERE and bool(self.reference) and self.reference != self.row.verdict


@dataclass
class Paper:
    """What is known of the paper's claims, and of the reference run that stands in for what a study does not decide."""

    verdicts: list[Verdict]  #: E1 to E15, then T1 to T16, then C1 to C4
    reference: str  #: machine and day of the reference run; "" where it takes no part

    @property
    def tally(self) -> list[tuple[str, int, int]]:
        """Returns verdict, claims that this study decides, and claims that the reference run decides."""
        rows = []
        for verdict in (HOLDS, CONDITION, FAILS, OPEN):
            mine = [one for one in self.verdicts if one.verdict == verdict]
            rows.append((verdict, sum(one.source != BY_REFERENCE for one in mine), sum(one.source == BY_REFERENCE for one in mine)))
        return rows


def paper(claims: Claims, folder: Path, reference: Path = REFERENCE) -> Paper:
    """Adds the verdicts of the reference run, if it comes with the program and is not itself the subject of the report."""
    known: dict[str, dict[str, str]] = {}
    about = ""
    file = reference / "claims.json"
    if file.exists() and folder.resolve() != reference.resolve():
        known = {one["id"]: one for one in json.loads(file.read_text(encoding="utf-8"))["claims"] if one["verdict"] != OPEN}
        first = json.loads(files.read_packed(reference / "results.jsonl").split(b"\n", 1)[0])
        about = f"{first['machine']['cpu']}, {first['when'][:10]}, commit {first['commit'][:8]}"
    verdicts = []
    for row in sorted(claims.rows, key=lambda row: paper_claims.in_order(row.id)):
        one = known.get(row.id, {})
        verdicts.append(Verdict(row, one.get("verdict", ""), one.get("brief", ""), one.get("corners", []), one.get("ours", {})))
    return Paper(verdicts, about)


#: The corners that the question of MAIN is answered in: the refit, the tree, and how a condition names both.
ASKED = (
    ("best:2006", "Against a refit as in 2006", "if tuned here", "tuned here against the refit of 2006"),
    ("2006:2006", "Against a refit as in 2006", "if built as in 2006", "built as in 2006 against the refit of 2006"),
    ("best:best", "Against today's best refit", "", "tuned here against today's best refit"),
)
#: The best kinetic tree of any kind against today's best refit, where the positions that it need not evaluate count.
OTHERS = "any:best"


def on_the_main_claim(one: Verdict) -> str:
    """Answers whether the kinetic AABB tree is updated faster than a refit: yes, no or not always, by corner, then the condition."""
    known = {id: (span, rule) for id, span, rule in one.judged}
    answers: dict[str, list[str]] = {}
    for id, refit, tree, _ in ASKED:
        if id in known:
            answers.setdefault(refit, []).append(f"{answer(known[id][0])}{f' {tree}' if tree else ''} ({known[id][0]} times as fast)")
    claim = f"The claim “{one.row.claim}” ({MAIN}) {one.verdict}, by {one.source}."
    if not answers:
        return claim
    said = ". ".join(f"{refit}: {', '.join(parts)}" for refit, parts in answers.items())
    where = [f"{name}, {_plain(known[id][1]).removeprefix('met ')}" for id, _, _, name in ASKED if id in known and known[id][1]]
    factor = f" Where its factor is met: {'; '.join(where)}." if where else ""
    return f"Is updating a kinetic AABB tree faster than a bottom-up refit? {said}. {claim}{factor}{_on_others(one)}"


def _on_others(one: Verdict) -> str:
    """Says whether another kinetic tree beats today's best refit where the evaluation of positions counts; "" if none does or it is not known."""
    spans, rules = one.span(OTHERS)
    moving = re.search(r"([\d.\u202f]+(?: to [\d.\u202f]+)?) \(with motion\)", spans)
    if moving is None or answer(moving[1]) == "no":
        return ""
    since = re.search(r"met from l = ([\d.]+) on with motion", rules)
    reach = f"; the claimed factor is met from {since[1]} frames a keyframe on" if since else ""
    return (
        f" Kinetic trees of other kinds against today's best refit, if the time counts that it takes to evaluate positions: {answer(moving[1])} "
        f"({moving[1]} times as fast{reach})."
    )


def answer(span: str) -> str:
    """Returns whether all ratios of a range are above 1: yes, no, or not always."""
    ends = [float(end.replace("\u202f", "")) for end in span.split(" to ")]
    return "yes" if ends[0] > 1 else "no" if ends[-1] <= 1 else "not always"


def _plain(rule: str) -> str:
    """Writes a rule without its list of points, and l in words."""
    return re.sub(r"l = ([\d.]+)", r"\1 frames a keyframe", re.sub(r" \([^()]*\)", "", rule))


def parts_on_the_paper(found: Paper) -> list[str]:
    """Answers whether the paper holds, by this study where it decides, else by the reference run: its main claim, and the tally
    of all of them."""
    counts = {verdict: here + there for verdict, here, there in found.tally}
    decided = [one for one in found.verdicts if one.source]
    if not decided:
        return ["Does the paper hold? These results decide none of its claims, and no reference run comes with this program."]
    parts = [f"{counts[HOLDS]} hold", f"{counts[CONDITION]} hold with a condition", f"{counts[FAILS]} do not hold"]
    parts += [f"{counts[OPEN]} are open"] if counts[OPEN] else []
    here = [one for one in decided if one.source == HERE]
    there = len(decided) - len(here)
    by = [f"{len(here)} decided by this study"] if here else []
    by += [f"{there} by the reference run that comes with the project ({found.reference})"] if there else []
    says = f"Does the paper hold? Of its {len(found.verdicts)} claims {text.listing(parts)}: {text.listing(by)}."
    differ = [one.row.id for one in found.verdicts if one.differs]
    if differ:
        says += f" The reference run judges {text.listing(differ)} otherwise."
    main = next((one for one in decided if one.row.id == MAIN), None)
    return ([on_the_main_claim(main)] if main is not None else []) + [says]


def on_disturbance(study: Study) -> list[str]:
    """Says how disturbed the run was, as far as the records know; in a second sentence what is doubtful, for example."""
    timed = study.timed
    old = int((timed["schema"] == OLD_SCHEMA).sum())
    if old == len(timed):
        return ["How disturbed the run was is unknown: its records are older than that field, and leave out the beginning of each clip."]
    rest = timed[timed["schema"] != OLD_SCHEMA]
    doubtful = rest[rest["disturbed"] != ""]
    of = f"{text.count(len(rest))} timed contestants"
    if doubtful.empty:
        return [f"The machine was quiet: none of {of} waited for a processor or slowed down."]
    example = doubtful.iloc[0]
    share = len(doubtful) / len(rest)
    return [
        f"The machine was {'often ' if share > 0.1 else ''}disturbed: {len(doubtful)} of {of} are doubtful and have a question mark.",
        f"For example {example['title']} on {short(example['scene'])}: {example['disturbed']}.",
    ]


@dataclass(frozen=True)
class Sentence:
    """One answer: its subject, its sentences, each a paragraph of the page, and the id of the part with the details."""

    subject: str
    parts: list[str]
    place: str
    more: Optional[tuple[str, str]] = None  #: id and title of a part with more, which the page links after the sentences

    @property
    def says(self) -> str:
        """Returns the sentences as one text."""
        return " ".join(self.parts)


def kept_cells(reference: Path = REFERENCE) -> Optional[cells_file.Cells]:
    """Returns the cells that come with the project; None without them."""
    file = reference / cells_file.FILE
    return cells_file.read(file) if file.exists() else None


def _beyond(found: Sequence[Situation]) -> tuple[float, list[str]]:
    """Returns the size of the largest cell with pairs of two bodies, and the classes of sizes beyond it."""
    largest = max((one.sizes[1] for one in found if one.asks == advice.PAIRS), default=math.nan)
    return largest, [name for name, (low, _) in advice.SIZES.items() if low > largest]


def larger(found: Sequence[Situation], reference: Path = REFERENCE) -> list[Situation]:
    """Returns the situations that `on_larger` tells of."""
    kept = kept_cells(reference)
    every = [advice.situations(own_cells(kept, name)) for name in _beyond(found)[1]] if kept else []
    return [one for situations in every for one in _ends(situations)]


def own_cells(kept: cells_file.Cells, name: str, asks: str = advice.PAIRS) -> list[advice.Cell]:
    """Returns the cells that come with the project of one class of SIZES."""
    low, high = advice.SIZES[name]
    return [cell for cell in kept.cells if cell.asks == asks and low <= cell.primitives < high]


def _ends(situations: Sequence[Situation]) -> list[Situation]:
    """Returns those with the fewest and the most frames a keyframe."""
    return [situations[0], situations[-1]] if len(situations) > 1 else list(situations)


def on_larger(found: Sequence[Situation], reference: Path = REFERENCE) -> list[str]:
    """Says up to which size a study measured pairs, and what the cells that come with the project have in the classes beyond it."""
    largest, classes = _beyond(found)
    if not classes:
        return []
    kept = kept_cells(reference)
    said, absent = [], []
    for name in classes:
        situations = advice.situations(own_cells(kept, name)) if kept else []
        ends = _ends(situations)
        told = [f"with {advice.brief(one)}" for one in ends] + [lost for one in situations if one not in ends and (lost := _losses(one))]
        if told and kept:
            said.append(f"By measurements that come with the project ({kept.short}), {name} triangles: {'. '.join(one[0].upper() + one[1:] for one in told)}.")
        else:
            absent.append(name)
    first = f"This study has at most {text.size(largest)} triangles, both bodies together."
    none = [f"{text.listing(absent)} {'were' if len(absent) > 1 else 'was'} not measured."] if absent else []
    return [" ".join([first, *said, *(one[0].upper() + one[1:] for one in none)])]


def _losses(one: Situation) -> str:
    """Says where what a situation recommends loses to the best refit; "" if nothing does."""
    lost = [f"{best.title} is slower than the best refit on {advice.lost(best)}" for _, best in advice.changes(one) if best.losses]
    return f"with {advice.said_of(one.frames)} {'; '.join(lost)}" if lost else ""


def on_others(found: Sequence[Situation], reference: Path = REFERENCE) -> str:
    """Answers the questions other than pairs of two bodies: by this study, else by the cells that come with the project."""
    return " ".join(parts_on_others(found, reference))


def parts_on_others(found: Sequence[Situation], reference: Path = REFERENCE) -> list[str]:
    """Returns the sentences of on_others."""
    others: dict[str, Situation] = {one.asks: one for one in found if one.asks != advice.PAIRS}  # the one with the most frames a keyframe
    named = [others[asks] for asks in dict.fromkeys([advice.SELF, advice.RAYS, *others]) if asks in others][:2]
    said = [advice.sentence(one) for one in named]
    said += _on_positions_only(found, reference) if advice.SELF in others else []
    absent = [asks for asks in (advice.SELF, advice.RAYS) if asks not in others]
    if absent:
        kept = kept_cells(reference)
        known = {one.asks: one for one in advice.situations(kept.cells)} if kept else {}
        names = {advice.SELF: "pairs within a body (self-collision)", advice.RAYS: "rays"}
        begin = f"{text.listing([names[asks] for asks in absent])} were not asked for in this study."
        begin = begin[0].upper() + begin[1:]
        told = [advice.sentence(known[asks]) for asks in absent if asks in known]
        if kept and told:
            begin += f" By measurements that come with the project ({kept.short}):"
        said += [begin, *told]
    return said


def _on_positions_only(found: Sequence[Situation], reference: Path) -> list[str]:
    """Says that pairs within a body were not measured with positions only, if so, and what is nearest: also of the cells that come with the project."""
    own = [one for one in found if one.asks == advice.SELF]
    only = next(iter(advice.FRAMES))
    if any(one.frames == only for one in own):
        return []
    says = f"Pairs within a body with {advice.said_of(only)}, and above {text.size(max(one.sizes[1] for one in own))} triangles, were not measured in this study."
    first = own[-1].advice[0][1]
    if first is not None and first.baseline:
        says += f" {first.title[0].upper()}{first.title[1:]} uses no keyframes: take it with positions only, too; its time there is not known."
    kept = kept_cells(reference)
    known = [one for one in advice.situations([cell for cell in kept.cells if cell.asks == advice.SELF])] if kept else []
    if kept and known:
        nearest = next((one for one in known if one.frames == only), known[0])
        titles = text.listing([cell.title for cell in advice.counted(kept.cells) if (cell.asks, cell.frames) == (nearest.asks, nearest.frames)])
        says += f" Nearest, by measurements that come with the project ({kept.short}; {titles}): {advice.brief(nearest)}."
    return [says]


def on_errors(errors: Sequence[time_error_panels.Shown], reference: Path = REFERENCE) -> str:
    """Says what errors buy: by this study, else by the figures that come with the project."""
    if errors:
        return " ".join(errors[0].sentences)
    says = "No contestant of this study answers wrongly, so it does not say what exactness costs."
    file = reference / time_error_file.FILE
    kept = time_error_file.read(file) if file.exists() else []
    return f"{says} By measurements that come with the project: {kept[0].sentences[0]} {kept[0].measured}" if kept else says


def sentences(study: Study, found: Sequence[Situation], errors: Sequence[time_error_panels.Shown], known: Paper) -> list[Sentence]:
    """Returns the five answers; four in a study of other questions than pairs of two bodies."""
    pairs = [one for one in found if one.asks == advice.PAIRS]
    said: list[Sentence] = []
    told: list[tuple[str, str]] = []
    if pairs:
        ends = _ends(pairs)
        told = [one for situation in [*ends, *larger(found)] for one in advice.recommended(situation)]
        parts = [*(advice.sentence(one) for one in ends), *on_larger(found), methods.explained(told)]
        kept = ("kept", "The project's measurements, scene by scene")
        said.append(Sentence("What to take", [part for part in parts if part], "glance", kept))
    place = next((anchor for asks, anchor in advice.ANCHORS.items() if any(one.asks == asks for one in found)), "kept" if kept_cells() else "limits")
    new = [one for situation in found if situation.asks in advice.ANCHORS for one in advice.recommended(situation) if one not in told]
    others = [part for part in [*parts_on_others(found), methods.explained(new)] if part]
    said.append(Sentence("Self-collision, rays", others, place))
    bought = errors[0].sentences if errors else [on_errors(errors)]
    said.append(Sentence("Time against error", bought, "errors" if errors else "limits"))
    said.append(Sentence("The paper", parts_on_the_paper(known), "claims"))
    said.append(Sentence("This run", on_disturbance(study), "limits"))
    return said


# ---- The chart

TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@dataclass
class Bar:
    """One line of the chart: the advice at one level of knowledge; places are percentages of the axis."""

    known: str
    best: Advice
    low: float
    at: float
    high: float


@dataclass
class Chart:
    """The advice by situation, on one logarithmic axis of speeds over the best refit."""

    groups: list[tuple[Situation, list[Bar]]]
    ticks: list[tuple[float, str]]


def chart(found: Sequence[Situation]) -> Chart:
    """Lays out the chart; advice that more knowledge does not change has no line of its own."""
    kept: list[tuple[Situation, list[tuple[str, Advice]]]] = []
    for one in found:
        lines: list[tuple[str, Advice]] = []
        for known, best in one.advice:
            if best is not None and (not lines or best.id != lines[-1][1].id):
                lines.append((known, best))
        if lines:
            kept.append((one, lines))
    every = [value for _, lines in kept for _, best in lines for value in (best.low, best.high, best.speed) if value > 0] + [1.0]
    low, high = math.log(min(min(every), 0.7) / 1.1), math.log(max(max(every), 1.5) * 1.1)

    def place(value: float) -> float:
        return round(100 * (math.log(value) - low) / (high - low), 2) if value > 0 else 0.0

    groups = [(one, [Bar(known, best, place(best.low), place(best.speed), place(best.high)) for known, best in lines]) for one, lines in kept]
    ticks = [(place(tick), f"{tick:g}") for tick in TICKS if low <= math.log(tick) <= high]
    return Chart(groups, ticks)


# ---- Scene by scene

@dataclass
class Fastest:
    """The fastest contestant of a cell among those that need to know no more."""

    title: str
    contestant: str
    ms: str  #: with a question mark if the machine was disturbed
    ratio: str
    sure: bool  #: the interval, or range, excludes 1


@dataclass
class Line:
    """One cell of the table of scenes."""

    scene: str
    asks: str
    primitives: str
    l: str
    group: str  #: of the study
    by_knowledge: list[Optional[Fastest]]  #: in the order of FORESIGHT; None where less knowledge does as well

    @property
    def anchor(self) -> str:
        """Returns the id of the first line that asks the same, if the sentences lead there; else ""."""
        return advice.ANCHORS.get(self.asks, "")


def lines(study: Study, every: Sequence[MeasuredCell]) -> list[Line]:
    """Returns a line for each cell, in the order of the tables: what is the fastest in it, by what is known, in ms and over the best refit."""
    order = {rows["group"].iloc[0]: place for place, rows in enumerate(study.groups())}
    total = dict(zip(map(int, study.runs["run"]), study.runs["total_motion"]))
    disturbed = dict(zip(map(int, study.runs["run"]), study.runs["disturbed"] != ""))
    titles = dict(zip(study.runs["id"], study.runs["title"]))
    allowed = {known: advice.allowed(every, known) for known in advice.FORESIGHT}
    found = []
    for cell in sorted(every, key=lambda cell: order[cell.row["group"]]):
        by_knowledge: list[Optional[Fastest]] = []
        last = None
        for known in advice.FORESIGHT:
            id = cell.best(allowed[known])
            if id is None or id == last:
                by_knowledge.append(None)
                continue
            last = id
            run = cell.runs[id]
            ratio = ratios.ratio(study, run, cell.refit, "with_motion") if run != cell.refit else None
            told = "the best refit" if ratio is None else text.factor(ratio.middle) + ("?" if ratio.disturbed else "")
            if ratio is not None and ratio.low < ratio.high:
                ends = f"{text.factor(ratio.low)}–{text.factor(ratio.high)}"
                told += f" ({ends})" if ratio.is_interval else f" [{ends}]"
            by_knowledge.append(
                Fastest(
                    titles[id], cell.contestants[id], text.milliseconds(total[run]) + "?" * disturbed[run], told, ratio is not None and ratio.low > 1
                )
            )
        row = cell.row
        scalar = "" if row["scalar"] == "float" else f", {row['scalar']}"
        found.append(
            Line(
                short(str(row["scene"])) + scalar, "" if cell.asks == advice.PAIRS else cell.asks, text.size(row["primitives"]), f"{row['l']:g}",
                str(row["group"]), by_knowledge,
            )  # fmt: skip
        )
    return found
