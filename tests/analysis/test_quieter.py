"""Of two runs of a plan, each table is of the quieter one."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths
import synthetic
from results import quieter
from results.files import ResultError


def line(strategy: str, l: int, session: str, disturbed: str = "", **fields: Any) -> dict[str, Any]:
    record = synthetic.record(dict(id=strategy, title=strategy, family="refit", query=1.0), "cloth", 2000, "float", l)
    record["run"], record["times"]["disturbed"] = session, disturbed
    return {**record, **fields}


class TestQuieter(unittest.TestCase):
    def setUp(self) -> None:
        place = tempfile.TemporaryDirectory(prefix="kbvh-analysis-")
        self.addCleanup(place.cleanup)
        self.place = Path(place.name)

    def folder(self, name: str, *lines: dict[str, Any]) -> Path:
        (self.place / name).mkdir()
        synthetic.write(self.place / name, list(lines))
        return self.place / name

    def sessions(self, *folders: Path) -> dict[tuple[str, int], str]:
        lines, _ = quieter.quieter(list(folders))
        records = [synthetic.json.loads(one) for one in lines]
        return {(one["strategy"]["id"], one["scene"]["per_keyframe"]): one["run"] for one in records}

    def test_takes_whole_tables_by_disturbed_contestants(self) -> None:
        first = self.folder("first", line("a", 1, "one", "9 switches"), line("b", 1, "one"), line("a", 10, "one"))
        second = self.folder("second", line("a", 1, "two"), line("b", 1, "two"), line("a", 10, "two"))
        self.assertEqual(self.sessions(first, second), {("a", 1): "two", ("b", 1): "two", ("a", 10): "one"})

    def test_a_table_with_fewer_contestants_is_no_quieter(self) -> None:
        first = self.folder("first", line("a", 1, "one"))
        second = self.folder("second", line("a", 1, "two", "9 switches"), line("b", 1, "two", "9 switches"))
        self.assertEqual(set(self.sessions(first, second).values()), {"two"})

    def test_studies_that_ask_the_same_of_one_contestant_are_tables_of_their_own(self) -> None:
        first = self.folder("first", line("a", 1, "one", "9 switches", study="x"), line("a", 1, "one", study="y"), line("b", 1, "one", study="y"))
        second = self.folder("second", line("a", 1, "two", study="x"))
        lines, _ = quieter.quieter([first, second])
        records = [synthetic.json.loads(one) for one in lines]
        self.assertEqual([(one["study"], one["strategy"]["id"], one["run"]) for one in records], [("x", "a", "two"), ("y", "a", "one"), ("y", "b", "one")])

    def test_commits_are_not_mixed_and_results_not_overwritten(self) -> None:
        first, second = self.folder("first", line("a", 1, "one")), self.folder("second", line("a", 1, "two", commit="f" * 12))
        with self.assertRaisesRegex(ResultError, "one commit"):
            quieter.quieter([first, second])
        command = [sys.executable, str(paths.HERE.parents[1] / "analysis" / "quieter.py"), str(first), "--out", str(second)]
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("exists already", done.stderr)


if __name__ == "__main__":
    unittest.main()
