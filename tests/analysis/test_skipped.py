"""What the end of tests/run says of skipped tests, from logs in CTest's form."""

from __future__ import annotations

import importlib.util
import unittest
from pathlib import Path

FILE = Path(__file__).resolve().parents[1] / "skipped.py"
spec = importlib.util.spec_from_file_location("skipped", FILE)
skipped = importlib.util.module_from_spec(spec)
spec.loader.exec_module(skipped)


def entry(number: int, name: str, output: str, end: str = "Test Passed.") -> str:
    return (
        f"{number}/9 Testing: {name}\n{number}/9 Test: {name}\nCommand: \"x\"\nDirectory: /d\n\"{name}\" start time: now\nOutput:\n"
        f"----------------------------------------------------------\n{output}<end of output>\nTest time =   0.01 sec\n"
        f"----------------------------------------------------------\n{end}\n\"{name}\" end time: now\n\n"
    )


class TestSkipped(unittest.TestCase):
    def test_every_kind_is_counted_with_its_reason(self) -> None:
        data = "no data folder at /d; set KBVH_DATA"
        log = "Start testing\n" + "".join([
            entry(1, "Passes", "[ RUN      ] A.B\n[       OK ] A.B\n"),
            entry(2, "Real.A", f"[ RUN      ] Real.A\n/src/a.cpp:65: Skipped\n{data}\n\n[  SKIPPED ] Real.A (0 ms)\n", "Test Skipped."),
            entry(3, "Real.B", f"/src/a.cpp:65: Skipped\n{data}\n", "Test Skipped."),
            entry(4, "browser", "skipped: there is no chromium\n", "Test Skipped."),
            entry(5, "lessons", "npm is missing\nmore\n", "Test Skipped."),
            entry(6, "analysis_x", "test_a (m.T.test_a) ... ok\ntest_b (m.T.test_b) ... skipped 'there is no node'\nOK (skipped=1)\n"),
            entry(7, "silent", "", "Test Skipped."),
            entry(8, "Fails", "it says: Skipped\nnothing\n", "Test Failed."),
        ])  # fmt: skip
        found = skipped.reasons(log)
        self.assertEqual(
            found, [data, data, "there is no chromium", "npm is missing", "there is no node", "no reason was given"]
        )
        lines = skipped.summary(found).splitlines()
        self.assertEqual(lines[0], "6 tests were skipped, and show nothing:")
        self.assertEqual(lines[1], f"     2  {data}")

    def test_none(self) -> None:
        self.assertEqual(skipped.summary(skipped.reasons(entry(1, "Passes", "fine\n"))), "No test was skipped.")


if __name__ == "__main__":
    unittest.main()
