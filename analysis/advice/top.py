"""The top of a report: five short sentences, computed, and its small chart; the command prints the same sentences. `summary` has the
answers in full.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from advice import advice, summary
from advice.advice import Advice, Situation
from advice.summary import BY_REFERENCE, MAIN, REFERENCE, Paper
from claims.claims import CONDITION, FAILS, HOLDS, OPEN
from figures import time_error, time_error_file, time_error_panels
from results import text
from results.load import Study

#: The questions that the top answers, as its sentences and its chart call them.
ASKED = {advice.PAIRS: "Two bodies", advice.SELF: "Within a body", advice.RAYS: "Rays"}
POSITIONS_ONLY = "positions only"
KEPT = "By the project's own runs"


@dataclass(frozen=True)
class Line:
    """One sentence of the top, its subject, and the id of the part with the details."""

    subject: str
    says: str
    place: str


def lines(
    study: Study, found: Sequence[Situation], errors: Sequence[time_error_panels.Shown], known: Paper, reference: Path = REFERENCE
) -> list[Line]:
    """Returns the five lines; four in a study that asks for rays or pairs within a body only, or compares nothing."""
    asks = main_question(found)
    main = [one for one in found if one.asks == asks]
    said = [Line("What to take", on_taking(main), "glance")] if main else []
    place = next((anchor for ask, anchor in advice.ANCHORS.items() if any(one.asks == ask for one in found)), "kept" if summary.kept_cells(reference) else "full")
    said.append(Line("Self-collision, rays", on_others(found, reference), place))
    said.append(Line("Time against error", on_errors(errors, reference), "errors" if errors else "full"))
    said.append(Line("The paper", on_the_paper(known), "claims"))
    said.append(Line("This run", summary.on_disturbance(study)[0], "limits"))
    return said


def shown(found: Sequence[Situation]) -> list[Situation]:
    """Returns the situations of the small chart."""
    return [one for one in found if one.asks in {*ASKED, main_question(found)}]


def main_question(found: Sequence[Situation]) -> str:
    """Returns what the first sentence is about: pairs of two bodies, or what a study asks instead; "" if the second sentence has all."""
    kinds = [one.asks for one in found]
    return advice.PAIRS if advice.PAIRS in kinds else next((asks for asks in kinds if asks not in ASKED), "")


# ---- What to take

def on_taking(group: Sequence[Situation]) -> str:
    """Says what to take for one question, and with how many triangles that was measured."""
    low, high = (text.size(end) for end in (min(one.sizes[0] for one in group), max(one.sizes[1] for one in group)))
    return f"{called(group[0].asks)}{_span(group)}: {taken(group, ' as the best refit')}. Measured with {low if low == high else f'{low} to {high}'} triangles."


def on_others(found: Sequence[Situation], reference: Path = REFERENCE) -> str:
    """Says what to take for pairs within a body and for rays: by this study, else by the cells that come with the project."""
    kept = summary.kept_cells(reference)
    known = advice.situations(kept.cells) if kept else []
    said: dict[bool, list[str]] = {True: [], False: []}
    absent = []
    for asks in (advice.SELF, advice.RAYS):
        own, other = ([one for one in every if one.asks == asks] for every in (found, known))
        if most := max(own or other, key=lambda one: one.cells, default=None):
            said[bool(own)].append(f"{called(asks)}, {frames_label(most.frames)}: {taken([most], '')}.")
        else:
            absent.append(called(asks).lower())
    parts = [*said[True], *([f"{KEPT}: {' '.join(said[False])}"] if said[False] else [])]
    parts += [f"Not measured: {text.listing(absent)}."] if absent else []
    return " ".join(parts)


def called(asks: str) -> str:
    """Returns a question as the top calls it."""
    return ASKED.get(asks, asks[0].upper() + asks[1:])


def taken(group: Sequence[Situation], than: str) -> str:
    """Says what to take in the situations of one question, by what is known; `than` follows the first factor."""
    by_known: dict[str, dict[str, list[tuple[str, Advice]]]] = {}
    for one in group:
        for known, best in advice.changes(one):
            by_known.setdefault(known, {}).setdefault(best.id, []).append((one.frames, best))
    parts = []
    for known in advice.FORESIGHT:
        told = []
        for own in by_known.get(known, {}).values():
            where = frames_words([frames for frames, _ in own]) if len(own) < len(group) else ""
            speeds = _speeds([best for _, best in own], than)
            than = "" if speeds else than
            told.append(" ".join(part for part in (own[0][1].title, where, speeds) if part))
        if told:
            parts.append(f"{f'if {known}, ' if parts else ''}{', '.join(told)}")
    return "; ".join(parts) or "no strategy was measured in half of the cells"


def _speeds(found: Sequence[Advice], than: str) -> str:
    """Writes how many times as fast as the best refit a strategy is in some situations, and where it loses; "" of a refit."""
    if all(best.baseline for best in found):
        return ""
    low, high = (text.factor(end(best.speed for best in found)) for end in (min, max))
    slower, unsure, cells = (sum(numbers) for numbers in zip(*((best.slower, best.unsure, best.measured) for best in found)))
    doubt = f", slower in {slower} of {text.plural(cells, 'cell')}" if slower else ", not beyond doubt" if unsure else ""
    return f"({low if low == high else f'{low} to {high}'} times as fast{than}{doubt})"


def _span(group: Sequence[Situation]) -> str:
    """Names the frames a keyframe that were measured, unless they go from the fewest to the most."""
    names = [one.frames for one in group]
    every = list(advice.FRAMES)
    return "" if {every[0], every[-1]} <= set(names) else f", {frames_words(names)}"


def frames_label(frames: str) -> str:
    """Returns a class of FRAMES as those say it who have positions and no keyframes."""
    return POSITIONS_ONLY if frames == next(iter(advice.FRAMES)) else frames


def frames_words(names: Sequence[str]) -> str:
    """Writes some classes of FRAMES out, neighbours as one: "with positions only", "from 2 frames a keyframe on"."""
    every = list(advice.FRAMES)
    places = sorted(every.index(name) for name in names)
    said = []
    for _, run in groupby(enumerate(places), key=lambda one: one[1] - one[0]):
        own = [place for _, place in run]
        low, high = advice.FRAMES[every[own[0]]][0], advice.FRAMES[every[own[-1]]][1]
        if own == [0]:
            said.append(f"with {POSITIONS_ONLY}")
        elif own[-1] == len(every) - 1:
            said.append(f"from {max(low, 1):g} frames a keyframe on" if low > 1 else "with any number of frames a keyframe")
        else:
            said.append(f"with {max(low, 1):g} to {high - 1:g} frames a keyframe")
    return " and ".join(said)


# ---- The other sentences

def on_errors(errors: Sequence[time_error_panels.Shown], reference: Path = REFERENCE) -> str:
    """Says what errors buy: by this study, else by the figures that come with the project."""
    if errors:
        return time_error.brief(errors[0].place)
    file = reference / time_error_file.FILE
    kept = time_error_file.read(file) if file.exists() else []
    if not kept:
        return "No contestant of this study answers wrongly: it does not say what exactness costs."
    brief = time_error.brief(kept[0])
    return f"{KEPT}, {brief[0].lower()}{brief[1:]}"


#: Where updating a kinetic AABB tree is measured against two refits: how the tree is built, and the refit.
TREES = {"2006": "as of 2006", "best": "tuned here"}
REFITS = {"2006": "a refit as of 2006", "best": "today's best"}
VERBS = {"yes": "", "no": "not ", "not always": "not always "}


def on_the_paper(found: Paper) -> str:
    """Says whether the paper holds: the tally of its claims, and its main one in numbers."""
    counts = {verdict: (here, there) for verdict, here, there in found.tally}
    decided = sum(here + there for verdict, (here, there) in counts.items() if verdict != OPEN)
    if not decided:
        return "These results decide none of its claims, and no reference run comes with this program."
    words = {HOLDS: "hold", CONDITION: "hold with a condition", FAILS: "do not", OPEN: "are open"}
    tally = text.listing([f"{sum(counts[verdict])} {word}" for verdict, word in words.items() if verdict != OPEN or sum(counts[verdict])])
    by = [sum(counts[verdict][source] for verdict in words if verdict != OPEN) for source in (0, 1)]
    whose = [f"{number} {source}" for number, source in zip(by, ("decided here", f"by {BY_REFERENCE}")) if number]
    main = next((one for one in found.verdicts if one.row.id == MAIN and one.source), None)
    said = f"Of its {text.plural(len(found.verdicts), 'claim')} {tally} ({', '.join(whose)})."
    if main is None or not (answer := on_the_main_claim(main)):
        return said
    return f"Of its {text.plural(len(found.verdicts), 'claim')} {tally}. {answer}"  # who decides stands with each claim


def on_the_main_claim(one: summary.Verdict) -> str:
    """Says whether updates of a kinetic AABB tree are faster than those of a refit: both as in 2006, then the tree tuned here, against a refit of
    2006 and today's best; "" if not measured."""
    spans = {id: span for id, span, _ in one.judged}
    said: list[str] = []
    for tree, words in TREES.items():
        told = [(refit, spans[f"{tree}:{refit}"]) for refit in REFITS if f"{tree}:{refit}" in spans]
        if tree == "2006":
            told = [(refit, span) for refit, span in told if refit == "2006"]
        if not told:
            continue
        each = []
        for verb, same in groupby(told, key=lambda one: f"{VERBS[summary.answer(one[1])]}faster"):
            names, unit = ({**REFITS, "2006": "that refit"}, "") if said else (REFITS, " times")
            each.append(f"{verb} {' and '.join(f'than {names[refit]} ({span}{unit})' for refit, span in same)}")
        said.append(f"{words} {'it ' if said else ''}is {', '.join(each)}")
    return f"Updating a kinetic AABB tree {'; '.join(said)}." if said else ""


# ---- The small chart

def known_words(known: str) -> str:
    """Returns what is known as a chart writes it: "next keyframe known"."""
    return known.removeprefix("the ").replace(" is ", " ")


def costs(best: Advice) -> str:
    """Writes the ms a frame of the cells with the shortest and the longest time."""
    low, high = (text.milliseconds(one) for one in best.times)
    return low if low == high else f"{low} to {high}"
