"""A page for each strategy: what it is, from the registry; how it did, from the results of a study."""

from __future__ import annotations

import html
import math
import re
from pathlib import Path
from typing import Any

from advice import advice
from results import load

#: Cells shown on a page: so many of the best, and of the worst.
SHOWN = 6


def cell(value: object) -> str:
    """Returns a value for a cell of a table."""
    return str(value).replace("|", "\\|").replace("\n", " ")


def table(head: list[str], rows: list[list[object]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(map(cell, row)) + " |" for row in rows] + [""]


def source_of(root: Path, id: str) -> str:
    """Returns the file that registers a strategy: named like it, or with its id, or of its library."""
    for folder in ("strategies", "adapters"):
        if (root / folder / f"{id}.cpp").exists():
            return f"{folder}/{id}.cpp"
    for folder in ("strategies", "adapters"):
        for file in sorted((root / folder).glob("*.cpp")):
            if re.search(rf'\.id = "{re.escape(id)}"', file.read_text()):
                return file.relative_to(root).as_posix()
    library = id.split("_")[0]
    found = sorted(file.relative_to(root).as_posix() for file in (root / "adapters").glob(f"{library}*.cpp"))
    return found[0] if len(found) == 1 else f"adapters/{library}*.cpp" if found else ""


def strip(ratios: list[tuple[str, float]]) -> list[str]:
    """Returns a picture: one mark for each cell, at its speed over the best refit, on a logarithmic axis."""
    low, high = min(0.1, *(ratio for _, ratio in ratios)), max(10.0, *(ratio for _, ratio in ratios))
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    width, height, margin = 680, 64, 20

    def x(ratio: float) -> float:
        return margin + (width - 2 * margin) * (math.log10(ratio) - first) / (last - first)

    marks = [
        f'<circle cx="{x(ratio):.1f}" cy="24" r="5" fill="currentColor" fill-opacity="0.35">'
        f"<title>{html.escape(title)}: {ratio:.2g}x</title></circle>"
        for title, ratio in ratios
    ]
    ticks = []
    for power in range(first, last + 1):
        label = f"{10.0**power:g}x"
        ticks.append(
            f'<line x1="{x(10.0**power):.1f}" x2="{x(10.0**power):.1f}" y1="8" y2="42" stroke="currentColor" '
            f'stroke-opacity="{0.8 if power == 0 else 0.25}"/>'
            f'<text x="{x(10.0**power):.1f}" y="58" font-size="12" text-anchor="middle" fill="currentColor">{label}</text>'
        )
    return [
        "```{raw} html",
        f'<svg viewBox="0 0 {width} {height}" width="100%" role="img" '
        f'aria-label="speed over the best refit in {len(ratios)} scenes">{"".join(ticks)}{"".join(marks)}</svg>',
        "```",
        "",
    ]


def settings(label: str) -> str:
    """Returns the settings in a label, "title (settings)"."""
    found = re.search(r"\((.*)\)", label)
    return found.group(1) if found else "as preferred"


def measured(id: str, cells: list[advice.MeasuredCell], record: advice.Record | None, labels: dict[str, str]) -> list[str]:
    """Returns the part on results."""
    own = [one for one in cells if id in one.speeds]
    if not own or record is None:
        return ["The study behind this site has no time for it, as a strategy with a guarantee on one thread.", ""]
    ratios = sorted(((one.title, one.speeds[id], one) for one in own), key=lambda row: -row[1])
    lines = [
        f"In {record.cells} combinations of scene, size, l and scalar: update and query as fast as anything in "
        f"{len(record.fastest)}, within a tenth of the fastest in {record.near}. Each mark is one of them: how much faster "
        "(right of 1x) than the best refit it is, motion included.",
        "",
        *strip([(title, ratio) for title, ratio, _ in ratios]),
    ]
    shown = ratios if len(ratios) <= 2 * SHOWN else ratios[:SHOWN] + ratios[-SHOWN:]
    if len(shown) < len(ratios):
        lines += [f"The {SHOWN} best and the {SHOWN} worst:", ""]
    rows: list[list[object]] = [
        [title, settings(labels[one.contestants[id]]), f"{ratio:.2g}x", f"{one.share(id):.0%}"] for title, ratio, one in shown
    ]
    return lines + table(["scene", "settings", "over the best refit", "of the fastest"], rows)


def page(
    info: dict[str, Any], root: Path, cells: list[advice.MeasuredCell], record: advice.Record | None, labels: dict[str, str]
) -> str:
    lines = [f"# `{info['id']}`: {info['title']}", "", info["about"] or "Its file has no description.", ""]
    rows: list[list[object]] = [
        ["source", f"`{source_of(root, info['id'])}`"],
        ["publication", info["citation"]],
        ["family", info["family"] + (" (a baseline: ratios are against the one of these with the shortest clip)" if info["baseline"] else "")],
        ["foresight", info["foresight"].replace("_", " ")],
        ["guarantee", info["guarantee"].replace("_", " ")],
        ["bounds", "no declared tightness" if info["tightness"] == "none" else info["tightness"]],
        ["scalars", ", ".join(info["scalars"]) + (f" (keeps bounds in {info['own_scalar']})" if info["own_scalar"] else "")],
        ["can", ", ".join(word.replace("_", " ") for word in info["capabilities"]) or "pairs between bodies at frames"],
        ["primitives", ", ".join(word.replace("_", " ") for word in info["primitives"])],
    ]
    most = info["max_coordinate"]
    rows.append(["coordinates", "every admissible one" if most is None else f"up to {most:g}; scenes that reach beyond are refused"])
    topology = info["topology"]
    if topology:
        own = topology["preferred"]
        rows.append(["tree", f"{own['method']}, width {own['width']}, up to {own['leaf_size']} primitives per leaf"])
    else:
        rows.append(["tree", "builds its own"])
    lines += table(["", ""], rows)
    lines += ["## Measured", "", *measured(info["id"], cells, record, labels)]
    if info["parameters"]:
        lines += ["## Parameters", ""]
        lines += table(
            ["name", "values", "default", "meaning"],
            [
                [
                    f"`{one['name']}`",
                    ", ".join(one["allowed"]) if "allowed" in one else f"from {one['minimum']:g} to {one.get('maximum', math.inf):g}",
                    one["default"],
                    one["meaning"],
                ]
                for one in info["parameters"]
            ],
        )
    scene = "--self --scene waving_sheet" if "self_pairs" in info["capabilities"] else "--scene tablecloth"
    lines += ["## Try it", "", "```", f"kbvh run {scene} --triangles 16000 --l 1,10 --strategies {info['id']},bottom_up,auto", "```", ""]
    return "\n".join(lines)


def write(listed: dict[str, Any], results: Path, root: Path, pages: Path) -> None:
    """Writes a page for each strategy, and the list of all."""
    study = load.load(results)
    cells = advice.cells(study)
    records = advice.records(cells)
    labels = dict(zip(study.runs["contestant"], study.runs["label"]))
    folder = pages / "strategies"
    folder.mkdir(parents=True, exist_ok=True)
    families: dict[str, list[dict[str, Any]]] = {}
    for info in listed["strategies"]:
        families.setdefault(info["family"], []).append(info)
        (folder / f"{info['id']}.md").write_text(page(info, root, cells, records.get(info["id"]), labels))
    lines = [
        "# Strategies", "",
        f"{len(listed['strategies'])} ways to keep bounding volume hierarchies valid, in {len(families)} families. Numbers are from "
        f"the results in `{results.name}`: the geometric mean, over all measured combinations, of the fastest time over the "
        "strategy's own.", "",
    ]  # fmt: skip
    for family, members in sorted(families.items()):
        lines += [f"## {family}", ""]
        rows: list[list[object]] = []
        for info in members:
            record = records.get(info["id"])
            rows.append(
                [
                    f"[`{info['id']}`](strategies/{info['id']}.md)", info["title"], info["foresight"].replace("_", " "),
                    info["guarantee"].replace("_", " "), "" if record is None else f"{record.share:.0%} of the fastest",
                ]  # fmt: skip
            )
        lines += table(["strategy", "idea", "foresight", "guarantee", "on the whole"], rows)
    lines += ["```{toctree}", ":hidden:", "", *(f"strategies/{info['id']}" for info in listed["strategies"]), "```", ""]
    (pages / "strategies.md").write_text("\n".join(lines))


