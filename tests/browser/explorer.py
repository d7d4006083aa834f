"""Tests of explorer.html and report.html in a headless Chromium, against values of the Python analysis.

usage: explorer.py KBVH_PROGRAM [--keep FOLDER]

Makes pages of the reference run, of a merged study, of one with wrong contestants and of more than 10 MB of results, computes what they should show, and lets
explorer.mjs look. Exit code 77 (skipped) where a tool is missing.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Optional

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ANALYSIS = ROOT / "analysis"
sys.path[:0] = [str(ANALYSIS), str(ROOT / "tests" / "analysis")]
SKIPPED = 77


def skip(why: str) -> int:
    print(f"skipped: {why}")
    return SKIPPED


def main() -> int:
    program = sys.argv[1]
    for tool in ("node", "npm"):
        if shutil.which(tool) is None:
            return skip(f"there is no {tool} (experiments/setup installs it)")
    browser = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)
    if browser is None:
        return skip("there is no chromium (experiments/setup --browser installs it)")
    built = subprocess.run([ANALYSIS / "explorer" / "build", "--tests"], capture_output=True, text=True)
    if built.returncode == 1:
        return skip(built.stderr.strip())
    if built.returncode:
        print(built.stdout + built.stderr)
        return 1
    with tempfile.TemporaryDirectory(prefix="kbvh-explorer-") as folder:
        place = Path(sys.argv[3]) if sys.argv[2:3] == ["--keep"] else Path(folder)
        pages = {"reference": reference(place), "merged": merged(place, program), "erring": erring(place), "large": large(place)}
        expected = place / "expected.json"
        expected.write_text(json.dumps(pages))
        environment = {**os.environ, "KBVH_BROWSER": browser, "KBVH_EXPLORER": str(ANALYSIS / "explorer"), "KBVH_PROGRAM": program}
        return subprocess.run(["node", HERE / "explorer.mjs", expected], env=environment).returncode


def write(folder: Path, with_claims: bool = True) -> Any:
    """Writes the pages of a folder, its report included unless without claims; returns its study."""
    from explorer import explore, explorer_data
    from report import report
    from results.load import ONE_OF_EACH_COMMIT, load

    study = load(folder, ONE_OF_EACH_COMMIT)
    if with_claims:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            report.main([str(folder)])
    else:  # judging claims takes longer than the page
        (folder / explore.PAGE).write_text(explore.page(explorer_data.data(study, "", None, folder), *explore.program()), encoding="utf-8")
    return study


def number(value: float) -> Optional[float]:
    return float(value) if value == value else None


def described(found: Any) -> Optional[list[Any]]:
    """Returns a ratio as the page should have it."""
    return None if found is None else [found.middle, found.low, found.high, found.paired, found.is_interval]


def expectations(folder: Path, study: Any) -> dict[str, Any]:
    """Returns what the page should compute."""
    from advice import advice
    from ratios import profiles, ratios
    from results import clip_times
    from results.load import load

    runs = study.runs
    usual = set(profiles.contestants(runs)["run"])
    place = {run: index for index, run in enumerate(runs["run"])}
    against_refit: dict[str, list[Any]] = {}
    for scope in ratios.SCOPES:
        row: list[Any] = [None] * len(runs)
        for run, found in ratios.ratios(study, scope).items():
            row[place[run]] = described(found)
        against_refit[scope] = row
    spans: list[Any] = [None] * len(runs)  # of times, in ms per frame
    for run, times in study.raw.items():
        if times.repetitions < clip_times.FEWEST_OF_AN_INTERVAL:
            ends = sorted(clip_times.single_times(times, ratios.SCOPES["with_motion"]))
            spans[place[run]] = [ends[0], ends[-1], False]
        elif not times.by_clips:
            ends = sorted(clip_times.replicates(times, ratios.SCOPES["with_motion"]))
            cut = clip_times.DRAWS // 40
            spans[place[run]] = [ends[cut], ends[-1 - cut], True]
    chosen = "kinetic_aabb"
    pairwise: list[Any] = [None] * len(runs)
    for _, group in study.timed.groupby(["group", "commit", "dirty"]):
        mine = group[group["id"] == chosen]
        if mine.empty:
            continue
        base = int(mine["run"].loc[mine["total_motion"].idxmin()])
        for run in group["run"]:
            found = ratios.ratio(study, int(run), base, "with_motion")
            pairwise[place[run]] = described(found)
    return {
        "page": str(folder / "explorer.html"),
        "report": str(folder / "report.html"),
        "results": str(folder / "results.jsonl"),
        "situations": [
            [one.asks, one.frames, one.cells, [best and [best.id, best.speed, best.low, best.high, best.measured, best.best_in] for _, best in one.advice]]
            for one in advice.situations(advice.cells(load(folder)))
        ],
        "runs": len(runs),
        "usual": len(usual),
        "scenes": {scene: int(rows["run"].isin(usual).sum()) for scene, rows in runs.groupby("scene")},
        "strategies": {id: int(rows["run"].isin(usual).sum()) for id, rows in runs.groupby("id")},
        "profiles": {
            measure: [[one.id, one.factors, one.cells] for one in profiles.profiles(study, column)]
            for measure, column in (("with_motion", "total_motion"), ("without_motion", "total"), ("update", "updating"),
                                    ("query", "query"), ("worst", "worst"))
        },
        "against_refit": against_refit,
        "spans": spans,
        "chosen": chosen,
        "pairwise": pairwise,
    }  # fmt: skip


def reference(place: Path) -> dict[str, Any]:
    from results import files

    folder = place / "reference"
    folder.mkdir(parents=True)
    shutil.copy(ANALYSIS / "reference" / "theory.json", folder)
    (folder / "results.jsonl").write_bytes(files.read_packed(ANALYSIS / "reference" / "results.jsonl"))
    study = write(folder)
    return expectations(folder, study)


def merged(place: Path, program: str) -> dict[str, Any]:
    """Two commits on one machine, and one of them on another machine, added up by `kbvh merge`."""
    from ratios import ratios
    import synthetic

    sources = [("one", "a" * 40, "Invented CPU", 0), ("two", "b" * 40, "Invented CPU", 1), ("three", "b" * 40, "Another CPU", 2)]
    for name, commit, cpu, seed in sources:
        lines = []
        for contestant in synthetic.CONTESTANTS[:9]:
            for scene, size in (("cloth", 2000), ("cloth", 8000), ("<b>&\"scene\"", 4000)):
                for l in (1, 10):
                    line = synthetic.record(contestant, scene, size, "float", l, repetitions=8 if seed else 9, seed=seed)
                    line.update(commit=commit, run=f"session {name}", key=f"{name}/{len(lines)}", when=f"2026-11-2{seed + 1}T05:00:00Z")
                    line["machine"] = {**synthetic.MACHINE, "cpu": cpu}
                    line["plan"] = {"name": "is it faster?", "description": "Two commits and two machines, <script>alert(1)</script> included."}
                    line["again"] = {"scenes": [{"bodies": [{"shape": "sphere", "triangles": size}]}], "repetitions": 8}
                    if contestant["id"] == "rebuild":  # an outlier that no axis should be stretched by
                        for repetition in line["times"]["repetitions"]:
                            repetition["update"] *= 1e5 if seed == 1 and (scene, size, l) == ("cloth", 8000, 10) else 1
                    if scene == "cloth":  # of schema 2, with times of frames; the others count by clips
                        synthetic.add_frames(line, seed)
                    lines.append(line)
        synthetic.write(place / name, lines)
    few = [json.loads(line) for line in (place / "one" / "results.jsonl").read_text().splitlines()]
    for record in few:
        record["times"]["repetitions"] = record["times"]["repetitions"][:3]
    synthetic.write(place / "few", few)
    folder = place / "merged"
    subprocess.run([program, "merge", *(place / name for name, *_ in sources), "--out", folder], check=True, stdout=subprocess.DEVNULL)
    study = write(folder)
    expected = expectations(folder, study)
    runs = study.runs
    problem = ["scene_name", "hash", "primitives", "scalar", "l", "frames", "contestant"]
    a, b = (runs[(runs["commit"] == commit) & (runs["cpu"] == "Invented CPU")] for commit in ("a" * 40, "b" * 40))
    both = a.merge(b, on=problem, suffixes=("_a", "_b"))
    expected["versus"] = []
    for row in both.itertuples():
        found = ratios.ratio(study, int(row.run_b), int(row.run_a), "with_motion")
        expected["versus"].append(described(found))
    expected["one"] = {"results": str(place / "one" / "results.jsonl"), "scene": "<b>&\"scene\"", "runs": 54}
    expected["few"] = {"results": str(place / "few" / "results.jsonl")}
    expected["records"] = sum(1 for _ in (folder / "results.jsonl").open())
    return expected


def erring(place: Path) -> dict[str, Any]:
    """A study in which contestants answer wrongly: its report has time against error."""
    import synthetic

    folder = place / "erring"
    wanted = ("bottom_up", "kinetic_aabb", "fcl_own_verdict", "student_margin")
    lines = [synthetic.record(one, "tablecloth", 2000, "float", l) for l in (1, 10) for one in synthetic.CONTESTANTS if one["id"] in wanted]
    synthetic.write(folder, lines)
    write(folder)
    return {"page": str(folder / "explorer.html"), "report": str(folder / "report.html")}


def large(place: Path) -> dict[str, Any]:
    """The first results of the reference run three times over: more than 10 MB."""
    from results import files

    folder = place / "large"
    folder.mkdir(parents=True)
    whole = files.read_packed(ANALYSIS / "reference" / "results.jsonl").decode()
    text = whole[: whole.index("\n", 4_000_000) + 1]
    commit = json.loads(text.split("\n", 1)[0])["commit"]
    lines = [text.replace(commit, letter * 40) for letter in "abc"]
    (folder / "results.jsonl").write_text("".join(lines))
    study = write(folder, with_claims=False)
    return {"page": str(folder / "explorer.html"), "results": str(folder / "results.jsonl"), "runs": len(study.runs), "megabytes": (folder / "results.jsonl").stat().st_size / 1e6}


if __name__ == "__main__":
    sys.exit(main())
