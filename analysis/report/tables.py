"""Tables of the report as rows of finished texts, for the page and for the terminal."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Callable, Optional, Union

import pandas as pd

from ratios import ratios
from ratios.ratios import Ratio
from results import clip_times, text
from results.load import OLD_SCHEMA, Study

GUARANTEE_NAMES = {"exact": "exact", "candidate_superset": "superset", "approximate": "approximate"}


@dataclass(frozen=True)
class Shown:
    """A ratio as text, and its interval (in parentheses) or its range over fewer than five repetitions (in brackets), which is
    empty for a single repetition. `disturbed` ratios look different.
    """

    middle: str
    range: str
    disturbed: bool = False

    def __str__(self) -> str:
        return f"{self.middle} {self.range}".rstrip()


@dataclass(frozen=True)
class Row:
    """One contestant of one group."""

    id: str
    contestant: str
    label: str
    note: str
    instructions: str
    guarantee: str
    motion: str
    update: str
    query: str
    total: str
    p99: str  #: without motion
    ratio: Shown
    ratio_without_motion: Shown
    steady: Shown  #: without motion, of the frames from the second knot on
    paid_from: str  #: the frame from which preparation and beginning have paid
    disturbed: str  #: why, or empty
    missed: str
    extra: str
    protrusion: str
    looseness: str
    memory: str
    reference: bool
    wrong: bool
    faster: Optional[bool]


@dataclass(frozen=True)
class Column:
    """A column of the table of results, after the contestant's name: in the page and in the terminal."""

    name: str
    meaning: str  #: in the page, over the name
    cell: Callable[[Row], Union[str, Shown]]
    words: bool = False  #: to the left; numbers stand to the right
    errors: bool = False  #: anything but 0 is wrong
    compared: bool = False  #: looks different where the contestant is faster than the best refit
    in_page: bool = True

    def css(self, row: Row) -> str:
        """Returns the classes of a row's cell in the page."""
        wrong = self.errors and self.cell(row) not in ("0", text.MISSING)
        return " ".join(["n"] * (not self.words) + ["wrong"] * wrong + ["faster"] * bool(self.compared and row.faster))


#: From left to right. RESULTS.md and the glossary at the end of the page say more about some.
COLUMNS = (
    Column("guarantee", "exact: its candidates are complete. superset: the candidates of a peer library are complete. approximate: pairs may "
           "be wrong; missed and extra give their number.", lambda row: row.guarantee, words=True),
    Column("code", "instruction set of the contestant's code: of kbvh's kernels, chosen at run time, or of a peer library",
           lambda row: row.instructions, words=True),
    Column("motion", "evaluating the positions of all vertices", lambda row: row.motion),
    Column("update", "bringing the boxes up to date, plan changes included", lambda row: row.update),
    Column("query", "traversal and triangle tests", lambda row: row.query),
    Column("total", "motion, update and query", lambda row: row.total),
    Column("p99", "99th percentile of the frames of the repetition with the median total, without motion", lambda row: row.p99),
    Column("ratio", "total time of the best refit over this total; above 1 is faster. In parentheses: 95 % interval; in brackets: range over "
           "fewer than five repetitions", lambda row: row.ratio, compared=True),
    Column("w/o motion", "the same ratio of update and query", lambda row: row.ratio_without_motion, in_page=False),
    Column("steady", "ratio without motion, of the frames from the second knot on: nothing of the beginning", lambda row: row.steady),
    Column("paid from", "the frame from which preparation and all frames so far take no longer than those of the best refit",
           lambda row: row.paid_from),
    Column("missed", "pairs of the oracle that were not reported, over all verified frames", lambda row: row.missed, errors=True),
    Column("extra", "reported pairs that the oracle does not have", lambda row: row.extra, errors=True),
    Column("protrusion", "largest distance of a vertex from a box that was read, in scene units", lambda row: row.protrusion, errors=True),
    Column("looseness", "surface area of all boxes over that of tight ones, minus one", lambda row: row.looseness),
    Column("memory", "of the strategy's own structures", lambda row: row.memory),
)  # fmt: skip


@dataclass(frozen=True)
class Group:
    """All contestants of one scene, scalar and number of interpolated frames, on one machine."""

    title: str
    anchor: str
    facts: str
    rows: list[Row]
    refused: list[tuple[str, str, str]]  #: contestant, label, reason
    notes: list[str] = field(default_factory=list)

    def first(self) -> list[Row]:
        """Returns the rows of the page: each strategy at its fastest, of these the MOST fastest, the best refit, and what is wrong."""
        fastest = {row.id: row for row in reversed(self.rows)}
        kept = [row for row in self.rows if fastest[row.id] is row][:MOST]
        return [row for row in self.rows if row in kept or row.reference or (row.wrong and fastest[row.id] is row)]


#: Strategies of a table in the page; the explorer, results.jsonl and --print have all of them.
MOST = 10

class Ratios:
    """Ratios to the best refit of a study, computed once."""

    def __init__(self, study: Study) -> None:
        self.with_motion = ratios.ratios(study, "with_motion")
        self.without_motion = ratios.ratios(study, "without_motion")
        self.steady: dict[int, Optional[Ratio]] = {}
        self.paid_from: dict[int, str] = {}
        build = dict(zip(map(int, study.runs["run"]), study.runs["build_ms"]))
        for run, one in self.without_motion.items():
            self.steady[run] = ratios.ratio(study, run, one.reference, "without_motion", steady=True)
            known = run != one.reference and study.raw[run].totals.shape[1] > 1 and build[run] == build[run]
            if known and build[one.reference] == build[one.reference]:
                frame = clip_times.paid_from(study.raw[run], build[run], study.raw[one.reference], build[one.reference])
                self.paid_from[run] = "never" if frame is None else str(frame)


def groups(study: Study, all_ratios: Ratios) -> list[Group]:
    """Returns every group, by scene, size, scalar and l."""
    several_machines = study.runs["machine"].nunique() > 1
    result = []
    for number, rows in enumerate(study.groups()):
        first = rows.iloc[0]
        title = f"{text.size(first['primitives'])} primitives, {first['scalar']}, l = {first['l']:g}"
        facts = _facts(first, several_machines)
        timed = rows[rows["refused"] == ""].sort_values("total_motion", kind="stable")
        refused = [
            (row.contestant, row.label, row.refused)
            for row in rows.loc[rows["refused"] != "", ["contestant", "label", "refused"]].itertuples()
        ]  # fmt: skip
        made = [_row(row, all_ratios) for row in timed.itertuples()]
        result.append(Group(title, anchor(number), facts, made, refused, _notes(study, timed, all_ratios)))
    return result


def anchor(number: int) -> str:
    """Returns the fragment of a group's table in the page."""
    return f"group-{number + 1}"


def _facts(first: pd.Series, several_machines: bool) -> str:
    parts = [first["scene_name"], text.plural(int(first["primitives"]), "primitive")]
    if first["frames"] == first["frames"]:
        parts.append(text.plural(int(first["frames"]), "frame"))
    if first["keyframes"] == first["keyframes"]:
        parts.append(text.plural(int(first["keyframes"]), "keyframe"))
    if first["hash"]:
        parts.append(f"hash {first['hash'][:12]}")
    if first["answer"]:
        parts.append(
            f"asked as changes of {first['answer']}: {text.significant(first['changed_per_frame'], 3)} pairs begin or end per frame"
        )
    if several_machines:
        parts.append(first["machine"])
    return ", ".join(parts)


def _row(row: object, all_ratios: Ratios) -> Row:
    run = row.run
    with_motion, without = all_ratios.with_motion.get(run), all_ratios.without_motion.get(run)
    own = row.own_scalar
    return Row(
        id=row.id,
        contestant=row.contestant,
        label=row.label,
        note=text.listing(
            ([f"computes in {own}"] if own and own != row.scalar else [])
            + ([f"{row.threads} threads"] if row.threads > 1 else [])
            + ([row.version] if row.version else [])
            + (["fetches positions itself"] if row.motion == 0 or (row.changes and row.positions_fetched_per_frame > 0) else [])
        ),
        instructions=row.instructions or text.MISSING,
        guarantee=GUARANTEE_NAMES[row.guarantee],
        motion=text.milliseconds(row.motion),
        update=text.milliseconds(row.updating),
        query=text.milliseconds(row.query),
        total=text.milliseconds(row.total_motion),
        p99=text.milliseconds(row.p99),
        ratio=shown_ratio(with_motion),
        ratio_without_motion=shown_ratio(without),
        steady=shown_ratio(all_ratios.steady.get(run)),
        paid_from=all_ratios.paid_from.get(run, text.MISSING),
        disturbed=row.disturbed,
        missed=text.count(row.missed),
        extra=text.count(row.extra),
        protrusion=text.significant(row.protrusion, 2),
        looseness=text.percent(row.looseness),
        memory=text.memory(row.bytes),
        reference=with_motion is not None and with_motion.reference == run,
        wrong=row.missed > 0 or row.extra > 0 or row.protrusion > 0,
        faster=None if with_motion is None or with_motion.reference == run else _faster(with_motion),
    )


def _faster(one: Ratio) -> Optional[bool]:
    """Returns True or False if the interval, or else all repetitions, agree; None otherwise."""
    if one.low > 1:
        return True
    return False if one.high < 1 else None


def shown_ratio(one: Optional[Ratio]) -> Shown:
    """Formats a ratio: (interval) or [range over fewer than five repetitions]; ~ where repetitions could not be paired, and ? where
    the machine was disturbed.
    """
    if one is None:
        return Shown(text.MISSING, "")
    low, high = text.factor(one.low), text.factor(one.high)
    middle = ("" if one.paired else "~\u2009") + text.factor(one.middle) + ("\u2009?" if one.disturbed else "")
    ends = f"({low}–{high})" if one.is_interval else f"[{low}–{high}]"
    return Shown(middle, "" if one.low == one.high else ends, one.disturbed)


def _notes(study: Study, timed: pd.DataFrame, all_ratios: Ratios) -> list[str]:
    notes = []
    with_motion = [run for run in timed["run"] if getattr(all_ratios.with_motion.get(run), "reference", None) == run]
    if len(timed) and not with_motion:
        notes.append("No refit was timed here, so there are no ratios.")
    lost = [row.label for row in timed[["label", "run"]].itertuples() if row.run not in all_ratios.with_motion]
    if with_motion and lost:
        notes.append(f"No ratio for {text.listing(lost)}: measured at another commit than any refit here.")
    if any(not all_ratios.with_motion[run].paired for run in timed["run"] if run in all_ratios.with_motion):
        notes.append("~ marks ratios whose repetitions could not be paired; their interval or range is wider.")
    if len(timed) and (timed["schema"] == OLD_SCHEMA).all():
        notes.append("Measured before the clock counted the beginning of a clip: reset and first frame are missing in these times.")
    elif len(timed):
        why = [f"{row.label}: {row.disturbed}" for row in timed[["label", "disturbed"]].itertuples() if row.disturbed]
        notes.append(f"Disturbed (?): {'; '.join(why)}." if why else "Quiet: no contestant waited for a processor.")
    sampled = sorted({int(every) for every in timed["sampled_every"] if every > 1})
    if sampled:
        notes.append(f"Verified on every {text.listing([text.ordinal(s) for s in sampled])} frame and the last.")
    compared = timed["verified_frames"].dropna()
    if len(compared) and compared.max() > 0:
        fewest, most = int(compared.min()), int(compared.max())
        frames = f"{fewest} to {most} frames" if fewest < most else text.plural(most, "frame")
        notes.append(f"Missed and extra pairs are those of {frames} that were compared with the oracle.")
    return notes


def remarks(study: Study) -> list[str]:
    """Returns what strategies say of their times, each once."""
    rows = study.timed[study.timed["remark"] != ""].drop_duplicates("id")
    return [f"{row.title}: {row.remark}." for row in rows[["title", "remark"]].itertuples()]


def plain(scene: str, group: Group) -> str:
    """Formats a group as text for a terminal."""
    cells = [["strategy", *(column.name for column in COLUMNS)]]
    cells += [[row.label, *(str(column.cell(row)) for column in COLUMNS)] for row in group.rows]
    words = [True, *(column.words for column in COLUMNS)]
    widths = [max(map(len, column)) for column in zip(*cells)]
    lines = [f"{scene}: {group.title}; times in ms per frame, ratio to the best refit (above 1 is faster)"]
    for row in cells:
        lines.append("  ".join(cell.ljust(width) if left else cell.rjust(width) for cell, width, left in zip(row, widths, words)).rstrip())
    lines += [f"  refused: {label}: {reason}" for _, label, reason in group.refused]
    spaces = str.maketrans("\u202f\u00a0\u2009", "   ")
    return "\n".join(lines).translate(spaces)
