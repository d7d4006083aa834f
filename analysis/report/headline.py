"""The headline tables of README.md and of the results guide, from the results of plan `headline`.

usage: headline.py RESULTS_DIR [--write PAGE]... [--picture FILE.png]

A page has tables between `<!-- headline NAME -->` and `<!-- /headline NAME -->`; NAME is one of TABLES. Without --write all of
them are printed. Every number is a median over repetitions, in ms per frame of the clip; every ratio is against the best refit
of its own table.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Optional

import pandas as pd

from figures import canvas, figures
from figures.colours import looks
from ratios import ratios
from results import files, text, tuned
from results.load import ResultError, Study, load

CLOTH = "tablecloth 16k"  #: the scene of the tables of strategies
PEER = "‡"  #: marks the two configurations of a peer


@dataclass(frozen=True)
class Contestant:
    """A row or column: words, and which configurations of a strategy may stand for it."""

    words: str
    id: str
    params: dict[str, str] = field(default_factory=dict)
    leaf_size: Optional[int] = None
    update_of: dict[str, str] = field(default_factory=dict)  #: parameters of the configuration whose update is shown


EMBREE = Contestant("Embree, refit and `rtcCollide`", "embree_refit", {"geometry": "user"}, None, {"geometry": "triangles"})
AUTO = Contestant("automatic choice (`auto`): may use the next keyframe", "auto")
JOIN = Contestant("interval join (`interval_join`): needs the next keyframe", "interval_join")
DRIFT = Contestant("drifting boxes (`drift_boxes`): no foresight", "drift_boxes")
ENVELOPE = Contestant("kinetic AABB tree by envelopes (`kinetic_envelope`): needs the next keyframe", "kinetic_envelope")
AABB = Contestant("kinetic AABB tree (`kinetic_aabb`): needs the whole clip", "kinetic_aabb", {"queue": "segment_heap"})
AABB_2006 = Contestant("kinetic AABB tree as in 2006: needs the whole clip", "kinetic_aabb", {"queue": "avl"}, 1)
PERIOD = Contestant("bottom-up refit as written in 2006 (`bottom_up_period`)", "bottom_up_period")
FCL = Contestant("FCL in float, bottom-up refit", "fcl_float_bottom_up")
BULLET = Contestant("Bullet, quantised BVH refit", "bullet_bvh")
REFITS = [
    Contestant("bottom-up refit (`bottom_up`)", "bottom_up"),
    Contestant("refit with slabs at the leaves (`leaf_slabs`)", "leaf_slabs"),
    Contestant("front of the test tree (`front`)", "front"),
    Contestant("hybrid refit (`hybrid`)", "hybrid"),
]
SHORT = [AUTO, JOIN, DRIFT, ENVELOPE, AABB, PERIOD, EMBREE, AABB_2006, FCL]
WHOLE = [
    *SHORT, *REFITS, BULLET,
    Contestant("inflated boxes, lazy refit (`inflated_lazy`): needs a bound on each step", "inflated_lazy"),
    Contestant("bounds linear in time, a query per frame (`linear_bounds`): needs the next keyframe", "linear_bounds"),
    Contestant("kinetic separation list (`kinetic_separation_list`): needs the whole clip", "kinetic_separation_list", {"queue": "segment_heap"}),
    Contestant("kinetic separation list as in 2006: needs the whole clip", "kinetic_separation_list", {"queue": "avl"}, 1),
    Contestant("kinetic BoxTree (`kinetic_boxtree`): needs the whole clip", "kinetic_boxtree", {"queue": "segment_heap"}),
    Contestant("kinetic BoxTree as in 2006: needs the whole clip", "kinetic_boxtree", {"queue": "avl"}, 1),
    Contestant("kinetic AABB tree by a calendar of events (`kinetic_calendar`): needs the next keyframe", "kinetic_calendar"),
    Contestant("boxes blended by morph weights (`morph_boxes`): needs the whole clip", "morph_boxes"),
    Contestant("refit and rotations (`rotations`)", "rotations"),
    Contestant("special regions (`special_regions`): needs the next keyframe", "special_regions"),
    Contestant("refit, sorted again when queries have become dear (`drift_rebuild`)", "drift_rebuild"),
    Contestant("linear BVH, built at every frame (`lbvh`)", "lbvh"),
    Contestant("rebuild by medians at every frame (`rebuild`)", "rebuild"),
]  # fmt: skip
CASES = [AUTO, JOIN, DRIFT, ENVELOPE, EMBREE, FCL]


class Case:
    """The timed runs of one scene, scalar and l, with their best refit."""

    def __init__(self, study: Study, rows: pd.DataFrame) -> None:
        self.study, self.rows = study, rows
        best = ratios.best_refit(study, rows)
        self.refit = None if best is None else rows[rows["run"] == best].iloc[0]

    @property
    def scene(self) -> str:
        return str(self.rows["scene_name"].iloc[0])

    @property
    def l(self) -> float:
        return float(self.rows["l"].iloc[0])

    def run(self, who: Contestant, params: Optional[dict[str, str]] = None) -> Optional[pd.Series]:
        """Returns the run of a contestant whose clip takes the shortest time; None if it did not take part."""
        wanted = {**who.params, **(params or {})}
        mine = self.rows[self.rows["id"] == who.id]
        mine = mine[[all(str(has.get(key, value)) == value for key, value in wanted.items()) for has in mine["params"]]]
        if who.leaf_size is not None:
            mine = mine[[isinstance(tree, dict) and tree.get("leaf_size") == who.leaf_size for tree in mine["builder"]]]
        if mine.empty:
            return None
        totals = {int(run): ratios.clip_total(self.study, int(run)) for run in mine["run"]}
        return mine[mine["run"] == min(totals, key=lambda run: (totals[run], run))].iloc[0]

    def ratio(self, run: pd.Series) -> str:
        """Formats how many times as fast a run's clip is as that of the best refit, positions included."""
        if self.refit is None:
            return text.MISSING
        own, other = int(run["run"]), int(self.refit["run"])
        found = ratios.ratio(self.study, own, other, "with_motion")
        if found is None:
            return text.MISSING
        low, high = text.factor(found.low), text.factor(found.high)
        ends = "" if found.low == found.high else f" ({low}–{high})" if found.is_interval else f" [{low}–{high}]"
        return f"{text.factor(found.middle)}x{' ?' if found.disturbed else ''}{ends}"


def cases(study: Study) -> list[Case]:
    """Returns the tables of the newest commit, in the order of the study."""
    timed = study.timed
    if timed.empty:
        raise ResultError(f"{study.source} has no times.")
    newest = timed.sort_values("when", kind="stable").iloc[-1]
    timed = timed[(timed["commit"] == newest["commit"]) & (timed["dirty"] == newest["dirty"])]
    return [Case(study, rows) for _, rows in timed.groupby("group", sort=False)]


def share(run: pd.Series, column: str) -> str:
    """Formats the share of a frame, positions included, that one column takes."""
    return f"{100 * run[column] / run['total_motion']:.0f} %"


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def facts(all_cases: list[Case]) -> str:
    """States machine, source, repetitions and what was compared with the oracle."""
    rows = pd.concat([case.rows for case in all_cases])
    first = rows.iloc[0]
    state = " with uncommitted changes" if first["dirty"] else ""
    repetitions = sorted({int(count) for count in rows["repetitions"]})
    few = " (brackets are ranges: fewer than five repetitions)" if repetitions[0] < 5 else ""
    counts = f"{repetitions[0]}" if len(repetitions) == 1 else f"{repetitions[0]} to {repetitions[-1]}"
    frames = sum(int(case.rows["verified_frames"].fillna(0).max()) for case in all_cases)
    comparisons = int(rows["verified_frames"].fillna(0).sum())
    wrong = {name: int(rows[name].fillna(0).sum()) for name in ("missed", "extra")}
    found = "no pair was missed, none was extra" if not any(wrong.values()) else f"{wrong['missed']} pairs were missed, {wrong['extra']} were extra"
    protruding = int((rows["protrusion"].fillna(0) > 0).sum())
    boxes = "no box was too small" if not protruding else f"{text.plural(protruding, 'contestant')} had a box that was too small"
    disturbed = [str(why) for why in rows["disturbed"] if why]
    was = "was" if len(disturbed) == 1 else "were"
    doubt = f"{text.count(len(disturbed))} of {text.plural(len(rows), 'contestant')} {was} disturbed (?), for example: {disturbed[0]}" if disturbed else ""
    days = sorted({str(when)[:10] for when in rows["when"] if when})
    day = "undated" if not days else days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    kernels = text.listing(sorted({str(word) for word in rows["kernels"] if word}))
    return (
        f"One thread of {first['cpu'] or 'an unknown processor'} ({kernels or 'unknown'} kernels), float, medians of {counts} repetitions{few}, commit "
        f"{str(first['commit'])[:12] or 'unknown'}{state}, {day}; {doubt or 'the machine was quiet'}. {text.count(frames)} "
        f"frames were compared with the oracle, each for every contestant ({text.count(comparisons)} comparisons): {found}; {boxes} where boxes can be seen."
    )


def strategies(all_cases: list[Case], rows: list[Contestant]) -> str:
    """Returns the table of strategies on the cloth at l = 10, the fastest first."""
    case = next((one for one in all_cases if one.scene == CLOTH and one.l == 10), None)
    if case is None or case.refit is None:
        raise ResultError(f"{CLOTH} at l = 10 with a refit is missing: the results are not those of plan headline.")
    best = case.refit
    own = next((one.words for one in REFITS if one.id == best["id"]), str(best["label"]))
    lines: list[tuple[float, str]] = [(
        ratios.clip_total(case.study, int(best["run"])),
        _row([f"best refit: {own}", text.milliseconds(best["updating"]), text.milliseconds(best["query"]), text.milliseconds(best["motion"]), "1"]),
    )]  # fmt: skip
    remarks = []
    for who in rows:
        run = case.run(who)
        if run is None or int(run["run"]) == int(best["run"]):
            continue
        updating, mark = run["updating"], ""
        other = case.run(who, who.update_of) if who.update_of else None
        if other is not None:
            updating, mark = other["updating"], f" {PEER}"
            whole = text.factor(best["total_motion"] / (updating + run["query"] + run["motion"]))
            remarks.append(
                f"{PEER} {run['title']}, {run['version'] or 'of unknown version'}: {run['remark']}. With the update shown, a clip would be {whole}x."
            )
        version = f" ({run['version']})" if run["version"] and other is None else ""
        tuned_mark = tuned.mark(who.id, case.scene)
        cells = [who.words + version + mark + tuned_mark, text.milliseconds(updating), text.milliseconds(run["query"]),
                 text.milliseconds(run["motion"]) if run["motion"] > 0 else "fetched", f"{case.ratio(run)}"]  # fmt: skip
        lines.append((ratios.clip_total(case.study, int(run["run"])), _row(cells)))
        if tuned_mark:
            remarks.append(f"{tuned.MARK} `auto` was tuned on this scene; the table of cases has some that it was not.")
    head = ["strategy", "update", "query", "positions", "clip: times as fast as the best refit (95 % interval)"]
    table = [_row(head), _row(["---"] * len(head)), *(line for _, line in sorted(lines, key=lambda line: line[0]))]
    return "\n".join([*table, "", " ".join([*dict.fromkeys(remarks), facts([case])])]) + "\n"


def picture(all_cases: list[Case], path: Path) -> None:
    """Writes the picture of README: the frames of the table of strategies, split into phases. Those as in 2006 are left out."""
    case = next((one for one in all_cases if one.scene == CLOTH and one.l == 10), None)
    if case is None:
        raise ResultError(f"{CLOTH} at l = 10 is missing: the results are not those of plan headline.")
    runs = [case.run(who) for who in (*WHOLE, Contestant("", "leaf_slabs")) if who.leaf_size is None]
    rows = pd.DataFrame([run.to_frame().T.assign(label=run["title"]).iloc[0] for run in runs if run is not None]).drop_duplicates("run")
    rows = rows.infer_objects().astype({name: float for name in rows.columns if name.startswith(("middle_", "total_"))})
    all_looks = looks(zip(rows["contestant"], rows["id"], rows["family"]))
    with tempfile.TemporaryDirectory() as folder:
        canvas.picture(Path(folder), "cost", "Where the time goes", "", lambda: figures.cost_split(rows, all_looks), embedded=False)
        files.write_whole(path, (Path(folder) / "cost.png").read_bytes())


def by_case(all_cases: list[Case]) -> str:
    """Returns the table of scenes and l: the best refit, its shares, and the others against it."""
    head = ["scene", "l", "best refit", "ms", "update", "query", *(who.words.split(" (")[0].split(",")[0] for who in CASES)]
    lines = [_row(head), _row(["---"] * len(head))]
    for case in all_cases:
        if case.refit is None:
            continue
        cells = [case.scene, f"{case.l:g}", f"`{case.refit['id']}`", text.milliseconds(case.refit["total_motion"]),
                 share(case.refit, "updating"), share(case.refit, "query")]  # fmt: skip
        for who in CASES:
            run = case.run(who)
            cells.append(text.MISSING if run is None else case.ratio(run) + tuned.mark(who.id, case.scene))
        lines.append(_row(cells))
    said = (
        f"ms: a frame of the best refit, positions included; update and query: their shares of it. The other columns: times as fast as the best "
        f"refit, over the whole clip (95 % interval); Embree by user geometry, the only one that it can collide, whose refit calls back for each "
        f"primitive. {tuned.MARK}: `auto` was tuned on the scene. {text.MISSING}: not measured on this scene."
    )
    return "\n".join([*lines, "", f"{said} {facts(all_cases)}"]) + "\n"


TABLES: dict[str, Callable[[list[Case]], str]] = {
    "short": lambda all_cases: strategies(all_cases, SHORT),
    "whole": lambda all_cases: strategies(all_cases, WHOLE),
    "cases": by_case,
}


def inserted(page: str, place: str, all_cases: list[Case]) -> str:
    """Returns a page with its tables replaced. Raises ResultError for a page without any, or with an unknown or open one."""
    names = re.findall(r"^<!-- headline (\w+) -->$", page, flags=re.M)
    if not names:
        raise ResultError(f"{place} has no line `<!-- headline NAME -->` with NAME one of {', '.join(TABLES)}.")
    for name in names:
        if name not in TABLES:
            raise ResultError(f"{place}: there is no headline table {name}, only {', '.join(TABLES)}.")
        page = files.inserted(page, f"<!-- headline {name} -->", f"<!-- /headline {name} -->", TABLES[name](all_cases), place)
    return page


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="headline.py", description="Writes the headline tables from the results of plan headline.")
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl")
    parser.add_argument("--write", metavar="PAGE", type=Path, action="append", default=[], help="insert them into this page; repeatable")
    parser.add_argument("--picture", metavar="FILE", type=Path, help="draw the table of strategies into this PNG file")
    options = parser.parse_args(arguments)

    def work() -> int:
        all_cases = cases(load(options.folder))
        pages = {page: inserted(page.read_text(encoding="utf-8"), str(page), all_cases) for page in options.write}
        for page, content in pages.items():
            files.write_whole(page, content)
        if options.picture is not None:
            picture(all_cases, options.picture)
        if not options.write and options.picture is None:
            print("\n".join(f"<!-- headline {name} -->\n{table(all_cases)}" for name, table in TABLES.items()))
        return 0

    return files.run_command("headline", (ResultError,), work)
