"""Turns a folder of results into report.html and figures/.

usage: report.py RESULTS_DIR [--title TEXT] [--figures main|all|paper|none] [--print]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Optional, Sequence

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

import ageing
import choices
import break_even
import claim_pictures
import claim_tables
import claims as paper_claims
import exactness
import explore
import files
import guide
import overview_figures
import paper_figures
import robustness
import sections
import tables
import targets_table
import text
import theory_figures
import time_error
from canvas import Picture, picture
from claim_points import ClaimError, Table
from colours import Look, looks, symbol
from limits import limits, threads_said
from load import ONE_OF_EACH_COMMIT, ResultError, Study, load

TEMPLATES = Path(__file__).resolve().parent / "templates"


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns its exit code: 0, or 2 for unusable results."""
    parser = argparse.ArgumentParser(
        prog="report.py",
        description="Turns RESULTS_DIR/results.jsonl into RESULTS_DIR/report.html and RESULTS_DIR/figures/.",
        epilog="example: report.py results --title 'My cloth'",
    )
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl")
    parser.add_argument("--title", default=explore.TITLE, help="heading of the report")
    parser.add_argument(
        "--figures", choices=("main", "all", "paper", "none"), default="main",
        help="figures of one group per scene (default), of every group, only those of the paper and its claims, or none",
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
    page = write(study, options.folder, options.title, options.figures, targets, claims, explorer)
    if explorer:
        title = "" if options.title == explore.TITLE else options.title  # else the plan's question
        explore.write(load(options.folder, ONE_OF_EACH_COMMIT), options.folder, title, claims)
    for note in [*study.notes, *([hint] if hint else [])]:  # last: a report that is not written needs no hint
        print(f"report: {note}", file=sys.stderr)
    if options.printed:
        for scene, group in plain_groups(study):
            print(tables.plain(scene, group) + "\n")
        if targets:
            print(targets_table.markdown(targets))
        print(paper_claims.plain(claims) + "\n")
    print(page)
    return 0


def plain_groups(study: Study) -> list[tuple[str, tables.Group]]:
    """Returns groups with the name of their scene."""
    scenes = [rows["scene_name"].iloc[0] for rows in study.groups()]
    return list(zip(scenes, tables.groups(study, tables.Ratios(study))))


def write(
    study: Study, folder: Path, title: str, which: str, targets: Sequence[targets_table.Target], claims: paper_claims.Claims,
    explorer: str = "",
) -> Path:
    """Writes the report and its figures, with a link to the explorer if there is one; returns the page's path."""
    all_ratios = tables.Ratios(study)
    groups = tables.groups(study, all_ratios)
    unique = study.runs.drop_duplicates("contestant")
    all_looks = looks(zip(unique["contestant"], unique["id"], unique["family"]))
    of_scenes = sections.sections(study, groups, all_looks, folder / "figures", which)
    theory = _theory(folder, which)
    paper = _paper(study, claims, all_looks, folder / "figures", which)
    exactness_rows = exactness.comparisons(study)
    drawn = {one.name for one in theory} | {paper_figures.anchor(figure.number) for figure, *_ in paper}
    glance = tables.glance(study, all_ratios, groups)
    page = render(
        explorer=explorer,
        questions=_questions(study),
        overview=overview_figures.pictures(study, glance, all_looks, folder / "figures") if which in ("main", "all") else [],
        title=title,
        study=study,
        machine=_machine(study),
        made=_made(study),
        glance=glance,
        targets=targets,
        targets_facts=targets_table.facts(list(targets)) if targets else "",
        verdicts=targets_table.VERDICTS,
        times=targets_table.times,
        wanted=targets_table.wanted,
        within=targets_table.within,
        milliseconds=text.milliseconds,
        size=text.size,
        claims=claims,
        tally=_tally(claims),
        claims_decided=any(row.verdict != paper_claims.OPEN for row in claims.rows),
        claim_links=_claim_links(claims, study, groups, drawn),
        **_claim_parts(claims),
        **_break_even(study, claims, all_looks, folder / "figures", which),
        theory=theory,
        paper=paper,
        sections=[section for section in of_scenes if not section.own],
        own_sections=[section for section in of_scenes if section.own],
        every_section=of_scenes,
        strategies=_strategies(study),
        descriptions=_descriptions(study),
        guide_kinds=guide.kinds(study),
        ageing_scenes=ageing.scenes(study),
        choices=choices.choices(study),
        time_error=time_error.shown(study),
        time_error_slow=time_error.SLOW,
        exactness=exactness_rows,
        exactness_says=exactness.paragraph(exactness_rows),
        significant=text.significant,
        stress=robustness.stress(folder),
        ccd=robustness.ccd(folder),
        limits=limits(study),
        symbols={contestant: Markup(symbol(look)) for contestant, look in all_looks.items()},
    )
    path = folder / "report.html"
    files.write_whole(path, page)
    return path


def _questions(study: Study) -> list[tuple[str, str]]:
    """Returns the names and descriptions of the plans, each once."""
    plans = [(str(plan.get("name", "")), str(plan.get("description", ""))) for plan in study.runs["plan"]]
    return [plan for plan in dict.fromkeys(plans) if plan[1]]


def _tally(claims: paper_claims.Claims) -> list[tuple[str, int]]:
    """Counts the claims by verdict."""
    verdicts = (paper_claims.HOLDS, paper_claims.CONDITION, paper_claims.FAILS, paper_claims.OPEN)
    return [(verdict, sum(row.verdict == verdict for row in claims.rows)) for verdict in verdicts]


def _break_even(
    study: Study, claims: paper_claims.Claims, all_looks: dict[str, Look], folder: Path, which: str
) -> dict[str, object]:
    """Returns the break-even points: a figure and tables."""
    names, places, single = break_even.places(Table(study, "float"), claims.baselines)
    reading = (
        "A bar begins at the l from which on a strategy is faster than a baseline, and ends at the largest measured l. An open arrow "
        "marks the largest measured l of a strategy that is slower at every measured l: its break-even point is unknown. A name has only "
        "the setting that tells it from the others of its strategy; the tables have all."
    )
    made = picture(
        folder, "break-even", "From which l on kinetic contestants are faster", reading,
        lambda: break_even.figure(places, names, all_looks),
    ) if which != "none" else None  # fmt: skip
    return {
        "break_even_baselines": names, "break_even_places": places, "break_even_single": single, "break_even_picture": made,
    }  # fmt: skip


def _claim_parts(claims: paper_claims.Claims) -> dict[str, object]:
    """Returns pictures and tables of the claims, by id."""
    return {
        "theory_ids": {row.id for row in claims.rows if not row.looked},
        "several_checks": {row.id: len({corner.check for corner in row.corners}) > 1 for row in claims.rows},
        "claim_pictures": {row.id: Markup(claim_pictures.picture(row.looked, row.checks)) for row in claims.rows},
        "claim_tables": {row.id: claim_tables.tables(row.looked) for row in claims.rows},
        "claim_criteria": {row.id: claim_tables.criteria(row.checks) if not row.looked else [] for row in claims.rows},
    }


def _claim_links(
    claims: paper_claims.Claims, study: Study, groups: list[tables.Group], drawn: set[str]
) -> dict[str, list[tuple[str, str]]]:
    """Returns, for each claim, the fragments of its existing figures and tables, with their texts."""
    names = {rows["group"].iloc[0]: (rows["scene"].iloc[0], group) for rows, group in zip(study.groups(), groups)}
    links: dict[str, list[tuple[str, str]]] = {}
    for row in claims.rows:
        of_figures: dict[str, list[str]] = {}
        for panel in row.figures:
            number, _, place = panel.partition("-")
            of_figures.setdefault(number, []).append(place)
        mine = [(paper_figures.anchor(n), f"fig. {n} {text.listing(places)}") for n, places in of_figures.items()]
        mine += [(name, "figure") for name, _, _, _, ids in theory_figures.FIGURES if row.id in ids]
        mine = [one for one in mine if one[0] in drawn]
        known = [names[group] for group in row.groups if group in names]
        mine += [(group.anchor, f"{scene}, {group.title}") for scene, group in known]
        links[row.id] = mine
    return links


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


def render(**values: object) -> str:
    """Renders the page as a text; all content from results is escaped."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html.j2").render(**values)


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
    """Describes each contestant, once."""
    unique = study.runs.drop_duplicates("contestant").sort_values(["family", "label"])
    result = []
    for row in unique.itertuples():
        facts = {**row.params, **(row.builder or {})}
        result.append(
            {
                "contestant": row.contestant,
                "label": row.label,
                "id": row.id,
                "family": row.family,
                "guarantee": tables.GUARANTEE_NAMES[row.guarantee],
                "tightness": row.tightness or text.MISSING,
                "foresight": row.foresight.replace("_", " ") or text.MISSING,
                "settings": ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in facts.items()) or text.MISSING,
                "citation": row.citation or text.MISSING,
            }
        )
    return result


def _descriptions(study: Study) -> list[dict[str, object]]:
    """Describes each strategy in its own words, with what it did in this study."""
    records = guide.records(study)
    unique = study.runs.sort_values(["family", "id"]).drop_duplicates("id")
    result = []
    for row in unique.itertuples():
        own = [part for part in str(row.about).split("\n") if part]
        result.append({"id": row.id, "title": row.title, "contestant": row.contestant, "family": row.family,
                       "citation": row.citation or text.MISSING, "paragraphs": own, "record": records.get(str(row.id))})  # fmt: skip
    return result


if __name__ == "__main__":
    sys.exit(main())
