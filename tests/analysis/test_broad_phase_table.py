"""The table of kbvh_broad_phase_bench: its rows, the page it is written into, and files that are none of its."""

from __future__ import annotations

import copy
import json
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
import shared

from report import broad_phase_table

RESULT: dict[str, Any] = {
    "program": "kbvh_broad_phase_bench", "time": "2026-01-31T12:00:00Z", "commit": "0123456789abcdef", "dirty": False,
    "machine": {"cpu": "a processor"}, "kernels": "avx2", "frames": "cloth-ball", "repetitions": 5,
    "comparisons": [{"title": "t", "contestants": [{"name": "ours", "median_ms": 0.25}, {"name": "theirs", "median_ms": 123.4}]}],
    "targets": [
        {"what": "one", "ours": "ours", "rival": "theirs", "ratio": 493.6, "at_least": 3, "aim": 10, "verdict": "met, and the aim"},
        {"what": "two", "ours": "theirs", "rival": "ours", "ratio": 0.002, "at_least": 0, "aim": 0, "verdict": "reported"},
    ],
}  # fmt: skip


class TestTable(shared.InFolder):
    def run_main(self, result: Any, *arguments: str) -> tuple[int, str, str]:
        file = self.folder / "bench.json"
        file.write_text(json.dumps(result), encoding="utf-8")
        return shared.said(broad_phase_table.main, file, *arguments)

    def test_a_row_for_each_target(self) -> None:
        code, out, err = self.run_main(RESULT)
        self.assertEqual((code, err), (0, ""))
        self.assertIn("| one | 0.25 | 123 | 493.60x | 3x | 10x | met, and the aim |\n", out)
        self.assertIn("| two | 123 | 0.25 | 0.00x | – | – | reported |\n", out)
        self.assertIn("Measured: 2026-01-31, commit 01234567, a processor, avx2, frames cloth-ball, 5 repetitions", out)
        self.assertIn("01234567 with local changes", self.run_main(dict(RESULT, dirty=True))[1])

    def test_writes_into_a_page(self) -> None:
        page = self.folder / "page.md"
        content = "before\n<!-- broad phase -->\nold\n<!-- /broad phase -->\nafter\n"
        page.write_text(content, encoding="utf-8")
        self.assertEqual(self.run_main(RESULT, "--write", str(page)), (0, "", ""))
        self.assertEqual(page.read_text(encoding="utf-8"), content.replace("old\n", self.run_main(RESULT)[1]))
        for wrong in ("text\n", "<!-- /broad phase -->\n<!-- broad phase -->\n"):
            page.write_text(wrong, encoding="utf-8")
            code, _, err = self.run_main(RESULT, "--write", str(page))
            self.assertEqual((code, err.count("\n")), (2, 1))
            self.assertIn("once, in this order", err)
            self.assertEqual(page.read_text(encoding="utf-8"), wrong)

    def test_other_files_end_in_one_sentence(self) -> None:
        lacking, verdict, rival = (copy.deepcopy(RESULT) for _ in range(3))
        del lacking["targets"][0]["aim"]
        verdict["targets"][1]["verdict"] = "splendid"
        rival["targets"][1]["rival"] = "nobody"
        for value, words in (
            ([3], "was not written by kbvh_broad_phase_bench"), ({"program": "kbvh"}, "was not written by"),
            (lacking, "the field aim is missing"), (verdict, 'verdict is "splendid"'), (rival, "the field nobody is missing"),
        ):  # fmt: skip
            with self.subTest(words):
                code, out, err = self.run_main(value)
                self.assertEqual((code, out, err.count("\n")), (2, "", 1))
                self.assertIn(words, err)

    def test_the_guide_has_the_table_of_the_kept_run(self) -> None:
        root = Path(__file__).resolve().parents[2]
        page = (root / "analysis" / "guides" / "ipc-toolkit.md").read_text(encoding="utf-8")
        kept = broad_phase_table.read(root / "analysis" / "reference" / "broad_phase.json")
        self.assertEqual(broad_phase_table.inserted(page, broad_phase_table.table(kept), "ipc-toolkit.md"), page)


if __name__ == "__main__":
    unittest.main()
