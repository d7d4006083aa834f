"""Turns a folder of results into report.html and figures/.

usage: report.py RESULTS_DIR [--title TEXT] [--figures main|all|paper|none] [--print]
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional, Sequence

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

import choices
import break_even
import claim_pictures
import claim_tables
import claims as paper_claims
import exactness
import figures
import files
import paper_figures
import ratios
import robustness
import scene_cards
import scene_pictures
import tables
import targets_table
import text
import theory_figures
import tree_figures
from canvas import Picture, picture
from claim_points import ClaimError, Table
from colours import Look, looks, symbol
from limits import limits
from load import ResultError, Study, load

TEMPLATES = Path(__file__).resolve().parent / "templates"


@dataclass
class Section:
    """The part of the report on one scene."""

    title: str
    anchor: str
    bodies: list[dict[str, str]]
    card: list[tuple[str, str]]
    view: Optional[Picture]  #: of the scene itself
    own: bool  #: from files that the user brought
    sizes: str  #: of the smaller versions of the scene
    groups: list[tables.Group]
    pictures: list[Picture] = field(default_factory=list)
    errors: list[Picture] = field(default_factory=list)  #: time against error
    over_l: list[Picture] = field(default_factory=list)  #: time against frames per keyframe
    missing: str = ""  #: reason for a missing figure


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns its exit code: 0, or 2 for unusable results."""
    parser = argparse.ArgumentParser(
        prog="report.py",
        description="Turns RESULTS_DIR/results.jsonl into RESULTS_DIR/report.html and RESULTS_DIR/figures/.",
        epilog="example: report.py results --title 'My cloth'",
    )
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl")
    parser.add_argument("--title", default="BVH update strategies, measured", help="heading of the report")
    parser.add_argument(
        "--figures", choices=("main", "all", "paper", "none"), default="main",
        help="figures of one group per scene (default), of every group, only those of the paper and its claims, or none",
    )  # fmt: skip
    parser.add_argument("--print", dest="printed", action="store_true", help="also print the tables as text")
    options = parser.parse_args(arguments)
    try:
        study = load(options.folder)
        file = options.folder / targets_table.FILE_NAME
        targets = targets_table.load_targets(file) if file.exists() else []
        claims = paper_claims.evaluate(study, options.folder)
        paper_claims.write(claims, options.folder)
        page = write(study, options.folder, options.title, options.figures, targets, claims)
    except (ResultError, ClaimError) as error:
        print(f"report: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        text, code = files.complaint(error)
        print(f"report: {text}", file=sys.stderr)
        return code
    for note in study.notes:
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
    study: Study, folder: Path, title: str, which: str, targets: Sequence[targets_table.Target], claims: paper_claims.Claims
) -> Path:
    """Writes the report and its figures; returns the page's path."""
    all_ratios = tables.Ratios(study)
    groups = tables.groups(study, all_ratios)
    unique = study.runs.drop_duplicates("contestant")
    all_looks = looks(zip(unique["contestant"], unique["id"], unique["family"]))
    sections = _sections(study, groups, all_looks, folder / "figures", which)
    theory = _theory(folder, which)
    paper = _paper(study, claims, all_looks, folder / "figures", which)
    exactness_rows = exactness.comparisons(study)
    drawn = {one.name for one in theory} | {paper_figures.anchor(figure.number) for figure, *_ in paper}
    page = render(
        title=title,
        study=study,
        machine=_machine(study),
        made=_made(study),
        glance=tables.glance(study, all_ratios, groups),
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
        claim_links=_claim_links(claims, study, groups, drawn),
        **_claim_parts(claims),
        **_break_even(study, claims, all_looks, folder / "figures", which),
        theory=theory,
        paper=paper,
        sections=[section for section in sections if not section.own],
        own_sections=[section for section in sections if section.own],
        every_section=sections,
        strategies=_strategies(study),
        choices=choices.choices(study),
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


def _sections(
    study: Study, groups: list[tables.Group], all_looks: dict[str, Look], folder: Path, which: str
) -> list[Section]:
    ordered = pd.concat(study.groups())
    of_group = dict(zip(ordered["group"].unique(), groups))
    written = scene_pictures.written_out(folder.parent)
    of_scenes = which in ("main", "all")
    study.notes += written.notes
    result = []
    for number, (scene, rows) in enumerate(ordered.groupby("scene", sort=False)):
        mine = [of_group[group] for group in rows["group"].unique()]
        smaller = sorted(rows["primitives"].unique())[:-1]
        sizes = text.listing([text.size(value) for value in smaller])
        own = bool((rows["origin"] == "files").any())
        card, view = scene_cards.card(rows), None
        if (shown := written.of(rows.sort_values("primitives"))) is not None:
            card += scene_cards.violence(shown)
            try:
                view = scene_cards.view(shown, folder, str(scene)) if of_scenes else None
            except scene_pictures.MeshError as problem:
                study.notes.append(f"{scene} has no picture: {problem}.")
        section = Section(str(scene), f"scene-{number + 1}", scene_cards.bodies(rows), card, view, own, sizes, mine)
        timed = rows[rows["refused"] == ""]
        slug = re.sub(r"[^a-z0-9]+", "-", str(scene).lower()).strip("-") or f"scene-{number + 1}"
        if len(timed) and of_scenes:
            head = headline(timed)
            section.pictures += _group_pictures(timed[timed["group"] == head], timed, all_looks, folder, slug)
            section.errors = [one for one in section.pictures if one.name == f"{slug}-error"]
            section.pictures = [one for one in section.pictures if one.name != f"{slug}-error"]
            if not section.errors:
                section.missing = (
                    "Time against error is not drawn: all contestants have the same errors here (the table has them)."
                )
            if which == "all":
                for other in timed["group"].unique():
                    if other != head:
                        name = f"{slug}-{of_group[other].anchor}"
                        section.pictures += _group_pictures(
                            timed[timed["group"] == other], timed[:0], all_looks, folder, name
                        )
            over = _trends(timed, head, all_looks, folder, slug)
            section.over_l = [one for one in over if one.name == f"{slug}-l"]
            section.pictures += [one for one in over if one.name != f"{slug}-l"]
        result.append(section)
    return result


def headline(timed: pd.DataFrame) -> str:
    """Returns the group for single-group figures: the largest, in float if available, at the middle l."""
    rows = timed[timed["primitives"] == timed["primitives"].max()]
    if (rows["scalar"] == "float").any():
        rows = rows[rows["scalar"] == "float"]
    depths = sorted(rows["l"].unique())
    rows = rows[rows["l"] == depths[len(depths) // 2]]
    return str(rows["group"].iloc[0])


def _place(row: pd.Series) -> str:
    return f"{row['scene']}, {text.size(row['primitives'])} primitives, {row['scalar']}, l = {row['l']:g}"


def _group_pictures(
    group: pd.DataFrame, timed: pd.DataFrame, all_looks: dict[str, Look], folder: Path, slug: str
) -> list[Picture]:
    """Draws cost split, time against error, counters and latency of one group."""
    first = group.iloc[0]
    place = _place(first)
    sizes = ratios.fastest_configurations(
        timed[(timed["scalar"] == first["scalar"]) & (timed["l"] == first["l"]) & (timed["machine"] == first["machine"])]
        .drop_duplicates(["contestant", "primitives"], keep="last")
    ) if len(timed) else timed  # fmt: skip
    crowd = len(group) > figures.CROWD
    fastest_only = " Of each strategy only the fastest configuration is drawn." if crowd else ""
    left_out = _left_out(group)
    several = len(sizes) and sizes["moving"].nunique() > 1
    counted = f"{first['scene']}, {first['scalar']}, l = {first['l']:g}" if several else place
    made = [
        picture(
            folder, f"{slug}-cost", f"Where the time goes: {place}",
            "Each bar is the mean time of one frame, split into its phases; shorter is better, and the fastest is on "
            "top. A bar with a white zigzag at its end exceeds the picture: its number gives the length."
            + fastest_only,
            lambda: figures.cost_split(group, all_looks),
        ),
        picture(
            folder, f"{slug}-error", f"Time against error: {place}",
            "Lower is faster, further left is more exact, and the grey strip holds contestants without any error. No "
            "contestant beats "
            "those on the dashed line in both at once; one of them beats each contestant above and to the right of the line."
            + (" Small marks are further configurations of a strategy." if crowd else "") + left_out,
            lambda: figures.time_against_error(group, all_looks),
        ),
        picture(
            folder, f"{slug}-counters", f"Machine-independent work: {counted}",
            "An event-driven strategy writes a bound only when an event changes it, while a refit writes all of them in every "
            "frame. This is the work that it saves. Its price is the events, each of which costs more time than writing a value.",
            lambda: figures.counters(group, sizes, all_looks),
        ),
        picture(
            folder, f"{slug}-depth", f"Where in the tree events happen: {place}",
            "Each mark counts the events per frame that begin at nodes of one depth. A line that rises to the right means that "
            "most events are near the leaves, where an event changes few boxes above it and is therefore cheap."
            + fastest_only,
            lambda: tree_figures.events_by_depth(group, all_looks),
        ),
        picture(
            folder, f"{slug}-quality", f"Does the tree age? {place}",
            "A level line is a tree that suits the last frame of the clip as well as its first; a rising line is a structure "
            "that the motion has degraded. The cost is that of a random query by the surface-area heuristic, over that of a "
            "tree built with this heuristic at that time (1), so a line that starts above 1 has fuller leaves, or was split "
            "at medians, from the start." + fastest_only,
            lambda: tree_figures.over_time(group, all_looks),
        ),
        picture(
            folder, f"{slug}-pace", f"Does the query slow down? {place}",
            "Mean times of equal parts of the clip. A rising line is a tree whose age costs time, or a clip with more to find."
            + fastest_only,
            lambda: tree_figures.times_over_time(group, all_looks),
        ),
        picture(
            folder, f"{slug}-latency", f"Distribution of frame times: {place}",
            "The dot is the median frame, the bar the 99th percentile, the cross the worst frame; motion "
            "evaluation is not included. A long line means that work is concentrated in a few frames, which is visible as a "
            "stutter even if the mean is good."
            + fastest_only,
            lambda: figures.latency(group, all_looks),
        ),
        picture(
            folder, f"{slug}-memory", f"Memory: {place}",
            "The memory of a strategy's own structures after the clip, without the shared meshes and their motion. Left "
            "and low is small and fast; a strategy to the right of another is worth its memory only if it lies below."
            + fastest_only,
            lambda: figures.memory(group, all_looks),
        ),
    ]  # fmt: skip
    return [one for one in made if one is not None]


def _left_out(rows: pd.DataFrame) -> str:
    oracles = sorted(set(rows["label"]) - set(ratios.without_oracles(rows)["label"]))
    return f" Only the table has {text.listing(oracles)}, which would compress the others." if oracles else ""


def _trends(
    timed: pd.DataFrame, head: str, all_looks: dict[str, Look], folder: Path, slug: str
) -> list[Picture]:
    """Draws lines over l and over n: at the size with most l and at the l with most sizes, or else those of the headline
    group.
    """
    first = timed[timed["group"] == head].iloc[0]
    same = timed[(timed["scalar"] == first["scalar"]) & (timed["machine"] == first["machine"])]
    same = same.drop_duplicates(["contestant", "primitives", "l"], keep="last")
    left_out = _left_out(same)
    same = ratios.without_oracles(same)
    primitives = _most(same, "primitives", "l", float(first["primitives"]))
    depth = _most(same, "l", "primitives", float(first["l"]))
    depths = ratios.fastest_configurations(same[same["primitives"] == primitives])
    sizes = ratios.fastest_configurations(same[same["l"] == depth])
    where = f"{first['scene']}, {first['scalar']}"
    made = [
        picture(
            folder, f"{slug}-l", f"Frames per keyframe: {where}, {text.size(primitives)} primitives",
            "The number of events depends on the keyframes only, so event-driven strategies gain as more frames are "
            "interpolated between two of them, while a refit (broad bands: blue is the best, grey the one of 2006) pays for every "
            "frame. A ring marks a break-even point with one of them; beyond it the falling line wins."
            + left_out,
            lambda: figures.over_frames_per_keyframe(depths, all_looks),
        ),
        picture(
            folder, f"{slug}-n", f"Size: {where}, l = {depth:g}",
            "Both axes are logarithmic, so a cost proportional to n is a straight line with the slope of the thin grey line. A "
            "steeper line grows faster than the scene; parallel lines differ by a constant factor at every size."
            + left_out,
            lambda: figures.over_size(sizes, all_looks),
        ),
    ]  # fmt: skip
    return [one for one in made if one is not None]


def _most(rows: pd.DataFrame, column: str, counted: str, usual: float) -> float:
    """Returns the value of a column at which most values of another were measured: the usual one if it has as many, else the
    largest.
    """
    numbers = rows.groupby(column)[counted].nunique()
    best = numbers[numbers == numbers.max()].index
    return usual if usual in best else float(best.max())


def _values(column: pd.Series, shorten: Optional[int] = None) -> str:
    values = [str(value)[:shorten] for value in column.unique() if str(value)]
    return ", ".join(values) if values else "not recorded"


def _machine(study: Study) -> list[tuple[str, str]]:
    """Describes the machine of the study, as pairs of a name and a value."""
    runs = study.runs
    memory = _values(runs["memory_gb"])
    return [
        ("Processor", f"{_values(runs['cpu'])}; {_values(runs['cores'])} cores, of which 1 was used"),
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
                     + ("" if every <= 1 else f" (long clips on a sample: every {text.ordinal(every)} frame at the least)")),
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


if __name__ == "__main__":
    sys.exit(main())
