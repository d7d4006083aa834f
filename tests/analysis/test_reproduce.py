"""experiments/reproduce finds wrong use before it installs or builds anything, and says what is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REPRODUCE = ROOT / "experiments" / "reproduce"
COST = ROOT / "analysis" / "plan_cost.py"


def run(*command: object, cwd: Path = ROOT) -> tuple[int, str, str]:
    done = subprocess.run([str(word) for word in command], text=True, capture_output=True, cwd=cwd, timeout=60)
    return done.returncode, done.stdout, done.stderr


class WrongUse(unittest.TestCase):
    def refused(self, *words: str) -> str:
        code, said, complaint = run(REPRODUCE, *words)
        self.assertEqual((code, said), (2, ""), words)
        self.assertEqual(complaint.count("\n"), 1, complaint)
        self.assertTrue(complaint.startswith("reproduce: "), complaint)
        return complaint

    def test_a_missing_value(self) -> None:
        for option in ("--out", "--plan", "--study", "--piece"):
            self.assertIn(f"{option} needs a value", self.refused(option))
            self.assertIn(f"{option} needs a value", self.refused(option, ""))
            self.assertIn(f"{option} needs a value", self.refused(option, "--paper"))

    def test_an_unknown_argument(self) -> None:
        self.assertIn("unknown argument '--papers'", self.refused("--papers"))

    def test_a_plan_that_is_not_there(self) -> None:
        self.assertIn("there is no plan 'no/plan.json'", self.refused("--plan", "no/plan.json"))


class Presets(unittest.TestCase):
    def test_builds_that_measure_keep_every_kernel(self) -> None:
        # A study that holds kbvh to SSE needs these kernels in the program that is measured.
        presets = {one["name"]: one for one in json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]}
        for name in ("release", "bench"):
            chain = []
            while name:
                chain.append(presets[name])
                name = presets[name].get("inherits")
            values = {key: value for one in reversed(chain) for key, value in one.get("cacheVariables", {}).items()}
            # Said, so that it comes back after experiments/reproduce has built for its machine alone.
            self.assertEqual(values["KBVH_KERNELS_HERE"], "OFF", chain[0]["name"])
            self.assertEqual(values["CMAKE_BUILD_TYPE"], "Release")


class Pieces(unittest.TestCase):
    def test_help_names_every_option(self) -> None:
        code, said, _ = run(REPRODUCE, "--help")
        self.assertEqual(code, 0)
        for option in ("--out", "--plan", "--full", "--paper", "--study", "--pieces", "report.html"):
            self.assertIn(option, said)
        self.assertNotIn("set -e", said)

    def test_pieces_are_listed(self) -> None:
        code, said, _ = run(REPRODUCE, "--pieces")
        self.assertEqual(code, 0)
        self.assertIn("tablecloth               about     1 min\n", said)
        self.assertEqual(said, run(sys.executable, COST, "experiments/plans/default.json")[1])

    def test_a_plan_is_relative_to_the_folder_of_the_caller(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            plan = {"studies": [{"name": "mine", "scenes": [{"builtin": "tablecloth", "triangles": 100}]}]}
            (Path(folder) / "mine.json").write_text(json.dumps(plan), encoding="utf-8")
            code, said, complaint = run(REPRODUCE, "--plan", "mine.json", "--pieces", cwd=Path(folder))
            self.assertEqual((code, complaint), (0, ""))
            self.assertIn("mine ", said)

    def test_studies_and_plans_that_are_not_there(self) -> None:
        plan = "experiments/plans/default.json"
        code, said, complaint = run(sys.executable, COST, plan, "--study", "tablecloth, 3k triangles")
        self.assertEqual((code, said), (2, ""))
        self.assertIn("no study 'tablecloth, 3k triangles'; it has 'tablecloth', ", complaint)
        code, said, complaint = run(sys.executable, COST, "no/plan.json")
        self.assertEqual((code, said), (2, ""))
        self.assertEqual(complaint, "plan_cost: no/plan.json: No such file or directory\n")
        code, said, complaint = run(sys.executable, COST, "README.md")
        self.assertEqual((code, said), (2, ""))
        self.assertTrue(complaint.startswith("plan_cost: README.md: "), complaint)
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "list.json").write_text("[1]", encoding="utf-8")
            self.assertIn("is not a plan", run(sys.executable, COST, Path(folder) / "list.json")[2])


if __name__ == "__main__":
    unittest.main()
