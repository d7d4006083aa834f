"""The compiled arithmetic of times: where it comes from, and what is said where it cannot be had."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import paths
import numpy as np
from results import arithmetic, clip_times
from results.files import ResultError

ROOT = paths.HERE.parents[1]


def times(totals: list[list[float]], session: str = "s", columns: int = 5) -> clip_times.RawTimes:
    """Repetitions whose time is update alone."""
    table = np.array(totals)
    sums = np.zeros((len(table), columns))
    sums[:, 0] = table.sum(axis=1)
    return clip_times.RawTimes(table, np.ones_like(table), sums, None, None, False, session)


class TestCompiled(unittest.TestCase):
    def setUp(self) -> None:
        place = tempfile.TemporaryDirectory(prefix="kbvh-analysis-")
        self.addCleanup(place.cleanup)
        self.root = Path(place.name)
        for source in arithmetic.SOURCES:  # stand-ins, which compile at once
            (self.root / source).parent.mkdir(parents=True, exist_ok=True)
            (self.root / source).write_text(f"int {Path(source).stem}_;\n" if source.endswith(".cpp") else "")

    def test_is_kept_until_a_source_changes(self) -> None:
        first = arithmetic.compiled(self.root)
        self.assertEqual(first.parent, self.root / "build" / "clip_times")
        with mock.patch.object(subprocess, "run", side_effect=AssertionError("compiled again")):
            self.assertEqual(arithmetic.compiled(self.root), first)
        (self.root / arithmetic.SOURCES[0]).write_text("#error changed\n")
        with self.assertRaisesRegex(ResultError, "could not compile(.|\n)*changed"):
            arithmetic.compiled(self.root)
        self.assertEqual(list(first.parent.iterdir()), [first], "nothing half done is left")

    def test_every_source_is_named(self) -> None:
        # The folder holds these files alone, so a further #include would not be found.
        for source in arithmetic.SOURCES:
            shutil.copy(ROOT / source, self.root / source)
        self.assertTrue(arithmetic.compiled(self.root).exists())

    def test_lies_in_the_cache_of_the_user_if_the_tree_cannot_be_written(self) -> None:
        (self.root / "build").write_text("a file, so that no folder can be made")
        with mock.patch.dict(os.environ, XDG_CACHE_HOME=str(self.root / "cache")):
            self.assertEqual(arithmetic.compiled(self.root).parent, self.root / "cache" / "kbvh")
            (self.root / "cache").rename(self.root / "other")
            (self.root / "cache").write_text("")
            with self.assertRaisesRegex(ResultError, "neither in .*clip_times nor in .*kbvh"):
                arithmetic.compiled(self.root)

    def test_says_what_is_missing(self) -> None:
        with mock.patch.dict(os.environ, CXX="no_such_compiler"), self.assertRaisesRegex(ResultError, "no_such_compiler could not .*CXX"):
            arithmetic.compiled(self.root)
        (self.root / arithmetic.SOURCES[0]).unlink()
        with self.assertRaisesRegex(ResultError, f"neither .*{arithmetic.NAME} nor its source .*clip_times.cpp"):
            arithmetic.compiled(self.root)


class TestInstalled(unittest.TestCase):
    def test_the_library_next_to_the_modules_is_used_and_hides_none_of_them(self) -> None:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as place:
            shutil.copytree(ROOT / "analysis" / "results", Path(place) / "results")
            made = Path(place) / "results" / arithmetic.NAME
            shutil.copy(arithmetic.functions()._name, made)
            said = subprocess.run(
                [sys.executable, "-c", "from results import arithmetic, clip_times; print(arithmetic.functions()._name, clip_times.DRAWS)"],
                cwd=place, capture_output=True, text=True, check=True,
            ).stdout  # fmt: skip
            self.assertEqual(said.split(), [str(made), "200"])


class TestTables(unittest.TestCase):
    def test_of_other_shapes_are_refused(self) -> None:
        with self.assertRaisesRegex(ValueError, r"shape \(2, 4\), but should have \(2, 5\)"):
            clip_times.time_of(times([[1.0], [2.0]], columns=4), "total")

    def test_need_not_be_contiguous(self) -> None:
        one = times([[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]])
        one.totals = np.asfortranarray(one.totals)[:, ::-1]
        self.assertFalse(one.totals.flags.c_contiguous)
        self.assertEqual(clip_times.single_times(one, "total").tolist(), [7 / 3, 56 / 3])

    def test_are_freed_with_their_run(self) -> None:
        freed = []
        with mock.patch.object(arithmetic.functions(), "kbvh_times_delete", freed.append):
            run = times([[1.0], [2.0]])
            handle = run.handle
            self.assertEqual(run.handle, handle, "made once")
            del run
        self.assertEqual(freed, [handle])


if __name__ == "__main__":
    unittest.main()
