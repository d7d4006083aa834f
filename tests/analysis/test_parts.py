"""tests/parts.py sees cases, shards and frames that no registered test plays: run on a program that lists cases."""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths

sys.path.insert(0, str(paths.HERE.parents[1] / "tests"))
import parts  # noqa: E402

#: Lists cases as GoogleTest does, as far as the patterns below need it.
PROGRAM = """#!/bin/bash
pattern=${2#--gtest_filter=}
echo "Running main() from gtest_main.cc"
if [[ $pattern != one ]]; then echo "Registry/Conformance."; echo "  Keeps/refit_on_sheet  # GetParam() = 1"; fi
if [[ $pattern != two ]]; then echo "Other."; echo "  Case"; fi
"""


class Parts(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="kbvh-parts-")
        self.addCleanup(folder.cleanup)
        self.program = Path(folder.name) / "conformance_test"
        self.program.write_text(PROGRAM)
        self.program.chmod(0o755)

    def part(self, pattern: str = "*", frames: str = "1,7,20", shards: int = 1, index: int = 0, label: str = "unit") -> dict[str, Any]:
        said = [f"GTEST_TOTAL_SHARDS={shards}", f"GTEST_SHARD_INDEX={index}", f"GTEST_FILTER={pattern}", f"KBVH_PER_KEYFRAME={frames}"]
        return {"command": [str(self.program)],
                "properties": [{"name": "ENVIRONMENT", "value": said}, {"name": "LABELS", "value": [label]}]}  # fmt: skip

    def test_whole(self) -> None:
        self.assertEqual(parts.faults([self.part()]), [])
        self.assertEqual(parts.faults([self.part("one"), self.part("two", "1,7"), self.part("two", "20")]), [])
        self.assertEqual(parts.faults([self.part(shards=2), self.part(shards=2, index=1)]), [])

    def test_a_case_is_missing(self) -> None:
        self.assertEqual(parts.faults([self.part("two")]), ["conformance_test: Other.Case is in no test"])
        self.assertEqual(parts.faults([self.part("two"), self.part("one", label="sanitized")]),
                         ["conformance_test: Other.Case is in no test"])  # fmt: skip

    def test_frames_are_missing(self) -> None:
        self.assertEqual(
            parts.faults([self.part(frames="1,7")]),
            ["conformance_test: Registry/Conformance.Keeps/refit_on_sheet is not played with ['20'] frames a keyframe"])  # fmt: skip

    def test_a_shard_is_missing(self) -> None:
        self.assertEqual(parts.faults([self.part(shards=2, index=1)]), ["conformance_test *: shards [1] of 2"])

    def test_nothing_is_registered(self) -> None:
        self.assertEqual(parts.faults([]), ["no test is registered in parts"])

    def test_wrong_use_is_told(self) -> None:
        run = subprocess.run([sys.executable, parts.__file__], capture_output=True, text=True)
        self.assertEqual(run.returncode, 1)
        self.assertIn("usage: parts.py BUILD", run.stderr)


if __name__ == "__main__":
    unittest.main()
