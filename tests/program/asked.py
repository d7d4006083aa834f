"""Measures everything that a study can ask, and leads every record back to its question: by the plan in its `again`, by the
explorer's command, and by its job; scenes that options can name also by a command line. Each way must end at the record's key, and
no two questions may share a key or a job.

usage: asked.py KBVH
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "analysis"))

SCENES = [
    {"builtin": "waving_sheet", "triangles": 200, "keyframes": 3},  # a command line can name it
    {"name": "two shapes", "bodies": [{"shape": "sphere", "triangles": 80, "keyframes": 3, "step": [0.1, 0, 0]},
                                      {"shape": "sphere", "triangles": 60, "centre": [0.5, 0.1, 0]}]},  # only a plan can
]  # fmt: skip
#: Scenes of bodies over the vertices of others: the explorer names them in a plan.
ELEMENTS = [
    {"name": "candidates of a sheet", "radius": 0.05, "pairs": [["corners", "cloth"], ["cloth-edges", "cloth-edges"]],
     "bodies": [{"shape": "waving_sheet", "triangles": 98, "keyframes": 3, "name": "cloth"},
                {"elements": "vertices", "of": "cloth", "name": "corners"}, "elements=edges,of=cloth"]},
    {"name": "edges of a ball", "bodies": [{"shape": "sphere", "triangles": 80, "keyframes": 3, "step": [0.1, 0, 0], "name": "ball"},
                                           {"shape": "sphere", "triangles": 60, "centre": [0.5, 0.1, 0]},
                                           {"elements": "edges", "of": "ball"}]},
]  # fmt: skip
PLAIN = {"scenes": SCENES, "strategies": ["bottom_up"], "l": 2, "repetitions": 2}
#: Plans by what they ask.
ASKED: dict[str, dict[str, Any]] = {
    "pairs": {},
    "pairs within bodies": {"scenes": [{**scene, "self": True} for scene in SCENES]},
    "pairs of elements": {"scenes": ELEMENTS},
    "pairs within a radius": {"scenes": [{**scene, "radius": 0.05} for scene in SCENES]},
    "pairs within a larger radius": {"scenes": [{**scene, "radius": 0.1} for scene in SCENES]},
    "contacts": {"continuous": True},
    "changes of candidates": {"changes": "candidates"},
    "changes of pairs": {"changes": "pairs"},
    "coherent rays": {"rays": "coherent:64"},
    "incoherent rays": {"rays": "incoherent:64"},
    "whether incoherent rays hit anything": {"rays": "incoherent:64:any"},
    "primitives near points": {"within": "64:0.01"},
    "primitives nearer to points": {"within": "64:0.001"},
    "pairs by portable kernels": {"kernels": "portable"},
    "changes by portable kernels": {"changes": "pairs", "kernels": "portable"},
    "rays by portable kernels": {"rays": "coherent:64", "kernels": "portable"},
    "contacts by portable kernels": {"continuous": True, "kernels": "portable"},
    "pairs at other frames": {"l": 3},
    "pairs in double": {"scalars": "double"},
    "pairs at few frames": {"frames_limit": 3},
    "pairs that are seldom compared": {"oracle_every": 3},
    "pairs, more repetitions": {"repetitions": 3},
    "pairs, until intervals are narrower": {"interval_width": 0.01},
    "pairs, with less time for narrow intervals": {"seconds": 0.5},
    "pairs by another tree": {"strategies": [{"id": "bottom_up", "builder": {"width": 4, "leaf_size": 4}}]},
    "pairs with another parameter": {"strategies": [{"id": "bottom_up", "params": {"kernels": "portable"}}]},
    "pairs by another strategy": {"strategies": ["hybrid"]},
    "other vertex orders": {"scenes": [{**SCENES[0], "order": "shuffled", "seed": 5}, {**SCENES[1], "order": "renumbered"}]},
    "other vertex orders of elements": {"scenes": [{**ELEMENTS[0], "order": "renumbered"}, {**ELEMENTS[1], "order": "shuffled"}]},
}
#: Command lines of scenes above, by the question and the place of the scene in it.
SHEET = "--scene waving_sheet --triangles 200 --keyframes 3"
BALL = "--body sphere:triangles=80,keyframes=3,step=0.1:0:0{} --body sphere:triangles=60,centre=0.5:0.1:0{}"
SAID = {
    ("pairs", 0): SHEET,
    ("pairs", 1): "--name 'two shapes' " + BALL.format("", ""),
    ("pairs within bodies", 0): f"{SHEET} --self",
    ("pairs of elements", 0): "--name 'candidates of a sheet' --radius 0.05 --pairs corners:cloth,cloth-edges:cloth-edges "
                              "--body waving_sheet:triangles=98,keyframes=3,name=cloth --body elements=vertices,of=cloth,name=corners "
                              "--body elements=edges,of=cloth",
    ("pairs of elements", 1): "--name 'edges of a ball' " + BALL.format(",name=ball", "") + " --body elements=edges,of=ball",
    ("pairs within a radius", 0): f"{SHEET} --radius 0.05",
    ("pairs within a radius", 1): "--name 'two shapes' --radius 0.05 " + BALL.format("", ""),
    ("pairs within a larger radius", 0): f"{SHEET} --radius=1e-1",
    ("other vertex orders", 0): f"{SHEET} --order shuffled --seed 5",
}  # fmt: skip
#: Options of `kbvh run` that the questions above cover, and others, which choose scenes or do not measure.
COVERED = {"--continuous", "--changes", "--rays", "--within", "--kernels", "--self", "--pairs", "--radius", "--order", "--seed", "--strategies",
           "--param", "--builder", "--width", "--leaf-size", "--l", "--scalar", "--repetitions", "--interval-width", "--seconds", "--frames-limit",
           "--oracle-every"}  # fmt: skip
OTHERS = {"--help", "--scene", "--body", "--clip", "--name", "--triangles", "--obstacle", "--keyframes", "--script", "--out", "--plan",
          "--study", "--print-plan", "--names", "--list-jobs", "--prepare", "--job"}  # fmt: skip


def require(holds: bool, what: str) -> None:
    if not holds:
        raise SystemExit(f"asked.py: {what}")


class Asker:
    def __init__(self, program: str, folder: Path) -> None:
        self.program, self.folder = program, folder
        self.node = shutil.which("node")

    def run(self, command: str, what: str) -> str:
        told = subprocess.run(["sh", "-c", command], cwd=self.folder, capture_output=True, text=True)
        require(told.returncode == 0, f"{what}: {command}: exit code {told.returncode}\n{told.stderr}")
        return told.stdout

    def records(self, *files: Path) -> list[dict[str, Any]]:
        return [json.loads(line) for file in files for line in file.read_text().splitlines()]

    def measure(self, plan: dict[str, Any], out: str, what: str) -> list[dict[str, Any]]:
        file = self.folder / f"{out}.json"
        file.write_text(json.dumps(plan))
        shutil.rmtree(self.folder / out, ignore_errors=True)
        self.run(f"'{self.program}' run --plan {file.name} --out {out}", what)
        return self.records(self.folder / out / "results.jsonl")

    def commands(self, out: str, what: str) -> list[str]:
        """The explorer's commands for the records of a folder, in their order."""
        from explorer import explorer_data
        from results.load import load

        data = json.dumps(explorer_data.data(load(self.folder / out), "", None, self.folder / out))
        src = (ROOT / "analysis" / "explorer" / "src").as_uri()
        text = (
            f'import {{ model }} from "{src}/model.js"; import {{ command }} from "{src}/command.js";'
            f"console.log(JSON.stringify(model({data}).runs.map((run) => command(run))));"
        )
        told = subprocess.run([self.node, "--input-type=module"], input=text, capture_output=True, text=True)
        require(told.returncode == 0, f"{what}: {told.stderr}")
        made = json.loads(told.stdout)
        require(all(one["text"] for one in made), f"{what}: a record has no command: {made}")
        return [one["text"] for one in made]

    def lead_back(self, what: str, plan: dict[str, Any]) -> tuple[list[str], list[str]]:
        """Measures a question; returns the keys of its records and the ids of its jobs."""
        found = self.measure(plan, "out", what)
        require(len(found) == len(SCENES), f"{what}: {len(found)} records")
        for one in found:
            again = self.measure(one["again"], "again", f"{what}: again")
            require([r["key"] for r in again] == [one["key"]], f"{what}: `again` measures something else: {one['again']}")
            require(again[0]["again"] == one["again"], f"{what}: `again` of `again` differs")
        keys = [one["key"] for one in found]
        if self.node:
            for key, text in zip(keys, self.commands("out", what)):
                shutil.rmtree(self.folder / "again", ignore_errors=True)
                self.run(re.sub(r"^kbvh", f"'{self.program}'", text, flags=re.M), what)
                made = self.records(self.folder / "again" / "results.jsonl")
                require([r["key"] for r in made] == [key], f"{what}: the explorer's command measures something else:\n{text}")
        for (_, place), said in ((at, words) for at, words in SAID.items() if at[0] == what):
            shutil.rmtree(self.folder / "said", ignore_errors=True)
            self.run(f"'{self.program}' run {said} --strategies bottom_up --l 2 --repetitions 2 --out said", what)
            made = self.records(self.folder / "said" / "results.jsonl")
            require([r["key"] for r in made] == [keys[place]], f"{what}: the command line measures something else: {said}")
        jobs = [job["id"] for job in json.loads(self.run(f"'{self.program}' run --plan out.json --list-jobs", what))["jobs"]]
        shutil.rmtree(self.folder / "jobs", ignore_errors=True)
        for job in jobs:
            self.run(f"'{self.program}' run --plan out.json --job '{job}' --out jobs", what)
            made = self.records(*(self.folder / "jobs" / "jobs" / job).glob("*.jsonl"))
            require(bool(made) and {r["key"] for r in made} <= set(keys), f"{what}: the job {job} measures something else")
        return keys, jobs


def main() -> int:
    with tempfile.TemporaryDirectory(prefix="kbvh-asked-") as folder:
        asker = Asker(sys.argv[1], Path(folder))
        options = set(re.findall(r"^ +(?:-\w,)?(--[\w-]+)", asker.run(f"'{sys.argv[1]}' run --help", "help"), flags=re.M))
        require(options == COVERED | OTHERS, f"options that no question covers, or that are gone: {options ^ (COVERED | OTHERS)}. "
                "One that says what is measured belongs to COVERED, with a question in ASKED; any other to OTHERS.")
        require({what for what, _ in SAID} <= set(ASKED), f"command lines of no question: {({what for what, _ in SAID} - set(ASKED))}")
        owner: dict[str, str] = {}
        for what, asked in ASKED.items():
            keys, jobs = asker.lead_back(what, {**PLAIN, **asked})
            for one in (*keys, *jobs):
                require(one not in owner, f"{what} and {owner.get(one)} share {one}")
                owner[one] = what
        print(f"{len(ASKED)} questions lead back to themselves by their plans, "
              + ("by the explorer's commands, " if asker.node else "(no node: not by the explorer's commands) ")
              + f"and by their jobs, {len(SAID)} of their scenes by options.")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
