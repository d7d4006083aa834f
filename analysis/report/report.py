"""Turns a folder of results into report.html and figures/.

usage: report.py RESULTS_DIR [--title TEXT] [--figures main|all|paper|none] [--print]
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Optional, Sequence

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from advice import advice, kept_costs, summary, top
from claims import claim_pictures, claims as paper_claims
from claims.claim_points import ClaimError, Table
from explorer import explore
from figures import break_even, paper_figures, theory_figures, time_error, time_error_panels
from figures.canvas import Picture, picture
from figures.colours import Look, looks
from ratios import ageing, choices, robustness
from ratios.limits import limits, threads_said
from report import loop_part, sections, tables, targets_table
from results import files, text
from results.load import ONE_OF_EACH_COMMIT, ResultError, Study, load

#: The heading of a report without a title of its own.
TITLE = "Which BVH update to take?"
TEMPLATES = Path(__file__).resolve().parent / "templates"


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns its exit code: 0, or 2 for unusable results."""
    parser = argparse.ArgumentParser(
        prog="report.py",
        description="Turns RESULTS_DIR/results.jsonl into RESULTS_DIR/report.html and RESULTS_DIR/figures/.",
        epilog="example: report.py results --title 'My cloth'",
    )
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl")
    parser.add_argument("--title", default=TITLE, help="heading of the report")
    parser.add_argument(
        "--figures", choices=("paper", "main", "all", "none"), default="paper",
        help="figures of the paper and its claims in the page (default); next to it also those of one group per scene (main) or of every "
        "group (all); or none",
    )  # fmt: skip
    parser.add_argument("--print", dest="printed", action="store_true", help="also print the tables as text")
    options = parser.parse_args(arguments)
    return files.run_command("report", (ResultError, ClaimError), lambda: run(options))


def run(options: argparse.Namespace) -> int:
    """Does what the options say; returns the exit code."""
    study = load(options.folder)
    file = options.folder / targets_table.FILE_NAME
    targets = targets_table.load_targets(file) if file.exists() else []
    claims = paper_claims.evaluate(study, options.folder)
    paper_claims.write(claims, options.folder)
    hint = ""
    try:
        explorer = explore.PAGE if explore.program() else ""
    except explore.NotBuilt as reason:
        explorer, hint = "", f"{explore.PAGE} is not written: {reason}"
    made = write(study, options.folder, options.title, options.figures, targets, claims, explorer)
    if explorer:
        title = "" if options.title == TITLE else options.title  # else the plan's question
        explore.write(load(options.folder, ONE_OF_EACH_COMMIT), options.folder, title, claims)
    for note in [*study.notes, *([hint] if hint else [])]:  # last: a report that is not written needs no hint
        print(f"report: {note}", file=sys.stderr)
    if options.printed:
        for scene, group in plain_groups(study):
            print(tables.plain(scene, group) + "\n")
        if targets:
            print(targets_table.markdown(targets))
        print(paper_claims.plain(claims) + "\n")
    for said in made.sentences:
        print("\n".join(textwrap.wrap(said, 100, subsequent_indent="  ")) + "\n")
    print(made.page)
    return 0


@dataclass(frozen=True)
class Made:
    """The page, and the lines at its top."""

    page: Path
    sentences: list[str]


def plain_groups(study: Study) -> list[tuple[str, tables.Group]]:
    """Returns groups with the name of their scene."""
    scenes = [rows["scene_name"].iloc[0] for rows in study.groups()]
    return list(zip(scenes, tables.groups(study, tables.Ratios(study))))


def write(
    study: Study, folder: Path, title: str, which: str, targets: Sequence[targets_table.Target], claims: paper_claims.Claims,
    explorer: str = "",
) -> Made:
    """Writes the report and its figures, with a link to the explorer if there is one."""
    groups = tables.groups(study, tables.Ratios(study))
    unique = study.runs.drop_duplicates("contestant")
    all_looks = looks(zip(unique["contestant"], unique["id"], unique["family"]))
    cells = advice.cells(study)
    situations = advice.situations(cells)
    errors = time_error_panels.shown(time_error.places(study))
    known = summary.paper(claims, folder)
    lines = top.lines(study, situations, errors, known)
    anchors = {rows["group"].iloc[0]: group.anchor for rows, group in zip(study.groups(), groups)}
    page = render(
        title=title,
        explorer=explorer,
        questions=_questions(study),
        study=study,
        top=lines,
        top_words=top,
        small_chart=summary.chart(top.shown(situations)),
        answers=summary.sentences(study, situations, errors, known),
        chart=summary.chart(situations),
        lines=summary.lines(study, cells),
        anchors=anchors,
        kept_lines=kept_costs.kept_lines(),
        said_of=advice.said_of,
        kept=kept.told.replace("`", "") if (kept := summary.kept_cells()) else "",
        foresight=list(advice.FORESIGHT),
        time_error=errors,
        time_error_slow=time_error.SLOW,
        paper=known,
        claim_pictures={row.id: Markup(claim_pictures.picture(row.looked, row.checks)) for row in claims.rows},
        several_checks={row.id: len({corner.check for corner in row.corners}) > 1 for row in claims.rows},
        paper_figures=_paper(study, claims, all_looks, folder / "figures", which),
        theory=_theory(folder, which),
        break_even=_break_even(study, claims, all_looks, folder / "figures", which),
        targets=targets,
        targets_facts=targets_table.facts(list(targets)) if targets else "",
        targets_remark=targets_table.remark(targets).replace("`", ""),
        verdicts=targets_table.VERDICTS,
        times=targets_table.times,
        wanted=targets_table.wanted,
        within=targets_table.within,
        significant=text.significant,
        factor=text.factor,
        milliseconds=text.milliseconds,
        size=text.size,
        sections=sections.sections(study, groups, all_looks, folder / "figures", which),
        most=tables.MOST,
        table_columns=[column for column in tables.COLUMNS if column.in_page],
        remarks=tables.remarks(study),
        ageing_scenes=ageing.scenes(study),
        choices=choices.choices(study),
        stress=robustness.stress(folder),
        ccd=robustness.ccd(folder),
        loops=loop_part.loop_part(folder, which, study.notes),
        strategies=_strategies(study),
        machine=_machine(study),
        made=_made(study),
        limits=limits(study),
    )
    path = folder / "report.html"
    files.write_whole(path, page)
    return Made(path, [f"{one.subject}: {one.says}" for one in lines])


def _questions(study: Study) -> list[tuple[str, str]]:
    """Returns the names and descriptions of the plans, each once."""
    plans = [(str(plan.get("name", "")), str(plan.get("description", ""))) for plan in study.runs["plan"]]
    return [plan for plan in dict.fromkeys(plans) if plan[1]]


def _break_even(
    study: Study, claims: paper_claims.Claims, all_looks: dict[str, Look], folder: Path, which: str
) -> Optional[Picture]:
    """Draws the break-even points; None without any."""
    names, places, _ = break_even.places(Table(study, "float"), claims.baselines)
    if which == "none" or not places:
        return None
    reading = (
        "A bar begins at the l from which on a strategy is faster than a baseline, and ends at the largest measured l. Sizes are triangles "
        "of both bodies together, those at rest included. An open arrow marks the largest measured l of a strategy that is slower at every "
        "measured l: its break-even point is unknown. Between measured l the ratio is interpolated on logarithmic axes; nothing is "
        "extrapolated. Names have only the settings in which contestants of a strategy differ."
    )
    return picture(
        folder, "break-even", "From which l on kinetic contestants are faster", reading,
        lambda: break_even.figure(places, names, all_looks),
    )  # fmt: skip


def _theory(folder: Path, which: str) -> list[Picture]:
    """Returns the figures of theory.json, if it exists."""
    file = folder / "theory.json"
    if which == "none" or not file.exists():
        return []
    try:
        return theory_figures.pictures(theory_figures.load(file), folder / "figures")
    except theory_figures.TheoryError as problem:
        raise ClaimError(str(problem)) from None
    except (KeyError, TypeError, ValueError) as problem:
        raise ClaimError(f"{file}: a field is missing or of the wrong kind: {problem}.") from None


def _paper(
    study: Study, claims: paper_claims.Claims, all_looks: dict[str, Look], folder: Path, which: str
) -> list[tuple[paper_figures.PaperFigure, Optional[Picture], list[str]]]:
    """Returns the paper's own figures; without any of their panels, or if none are wanted, only the missing data."""
    if which == "none":
        return []
    return paper_figures.drawn(Table(study, "float"), claims.baselines, all_looks, folder)


def environment() -> Environment:
    """Returns the templates; all content from results is escaped in them."""
    return Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def render(**values: object) -> str:
    """Renders the page as a text."""
    return environment().get_template("report.html.j2").render(**values)


def _values(column: pd.Series, shorten: Optional[int] = None) -> str:
    values = [str(value)[:shorten] for value in column.unique() if str(value)]
    return ", ".join(values) if values else "not recorded"


def _machine(study: Study) -> list[tuple[str, str]]:
    """Describes the machine of the study, as pairs of a name and a value."""
    runs = study.runs
    memory = _values(runs["memory_gb"])
    return [
        ("Processor", f"{_values(runs['cpu'])}; {_values(runs['cores'])} cores; {threads_said(runs)}"),
        ("Memory", memory if memory == "not recorded" else f"{memory} GB"),
        ("System", _values(runs["os"])),
        ("Compiler", f"{_values(runs['compiler'])}, {_values(runs['build_type'])}"),
        ("Flags", _values(runs["flags"])),
        ("Vector instructions", f"{_values(runs['simd'])}; kernels used: {_values(runs['kernels'])}"),
    ]


def _made(study: Study) -> list[tuple[str, str]]:
    """Describes how the study was made."""
    runs, timed = study.runs, study.timed
    when = sorted(value for value in runs["when"].unique() if value)
    dirty = runs[runs["dirty"]]
    state = "clean tree"
    if len(dirty):
        state = "with uncommitted changes" if len(dirty) == len(runs) else "partly with uncommitted changes"
    repetitions = sorted(timed["repetitions"].unique())
    span = "" if not repetitions else text.listing([str(n) for n in repetitions])
    every = int(runs["sampled_every"].max())
    return [
        ("Commit", f"{_values(runs['commit'], 12)} ({state})"),
        ("When", "not recorded" if not when else when[0] if when[0] == when[-1] else f"{when[0]} to {when[-1]}"),
        ("Seeds", _values(runs["seed"])),
        ("Runs", f"{text.plural(len(timed), 'timed run')} in {text.plural(runs['group'].nunique(), 'group')}"
                 + (f", {span} repetitions each" if span else "")
                 + (f"; {len(study.refused)} refused" if len(study.refused) else "")),
        ("Verified", f"{text.count(runs['verified_frames'].sum())} frames against the oracle before any time was taken"
                     + ("" if every <= 1 else f" (of long clips a sample, down to every {text.ordinal(every)} frame)")),
    ]  # fmt: skip


def _strategies(study: Study) -> list[dict[str, object]]:
    """Describes each strategy, once, with the number of its settings that took part."""
    rows = study.runs.sort_values(["family", "title"])
    settings = rows.groupby("id")["contestant"].nunique()
    return [
        {
            "id": row.id, "title": row.title, "family": row.family, "guarantee": tables.GUARANTEE_NAMES[row.guarantee],
            "tightness": row.tightness or text.MISSING, "foresight": row.foresight.replace("_", " ") or text.MISSING,
            "settings": int(settings[row.id]), "citation": row.citation or text.MISSING,
        }
        for row in rows.drop_duplicates("id").itertuples()
    ]  # fmt: skip
