"""Stress and continuous collision detection in the report: numbers as recorded, failures told, wrong files refused."""

from __future__ import annotations

import json
import unittest
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
import shared

from ratios import robustness
from results.load import ResultError


def row(family: str, strategy: str, **changes: Any) -> dict[str, Any]:
    zeros = dict.fromkeys(("missed", "extra", "events", "hangs", "crashes", "broken", "threw", "refused", "unsuitable"), 0)
    return {"family": family, "strategy": strategy, "approximate": False, "scenes": 6, "frames": 40, "protrusion": 0.0,
            "relative_protrusion": 0.0, "looseness": 0.0, **zeros, **changes}  # fmt: skip


def stress(rows: list[dict[str, Any]], failures: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "schema": "kbvh-stress-1", "commit": "0123456789abcdef", "rows": rows, "failures": failures,
        "options": {"scenes": 2, "seed": 1, "scalars": ["float"], "l": [1, 7], "many_keyframes": 600},
        "families": [{"name": "ties", "meaning": "equal numbers"}, {"name": "slivers", "meaning": "thin triangles"}],
    }  # fmt: skip


class TestRobustness(shared.InFolder):
    def write(self, name: str, content: Any) -> None:
        (self.folder / name).write_text(json.dumps(content))

    def test_nothing_there_is_no_section(self) -> None:
        self.assertIsNone(robustness.stress(self.folder))
        self.assertIsNone(robustness.ccd(self.folder))

    def test_stress_sums_over_families_and_tells_failures(self) -> None:
        rows = [row("ties", "a", missed=2, looseness=0.5), row("slivers", "a", missed=1, hangs=1), row("ties", "b", approximate=True)]
        failure = {"strategy": "a", "scalar": "float", "l": 7, "family": "ties", "seed": 3, "failure": "broken", "file": "repro-1.json"}
        self.write("stress.json", stress(rows, [failure]))
        found = robustness.stress(self.folder)
        assert found is not None
        self.assertEqual(found.strategies[0][:3], ("a", "12", "80"))
        self.assertEqual(found.strategies[0][4:6], ("0.50", "3"))
        self.assertEqual(found.strategies[0][8], "1 hang")
        self.assertIn("promises nothing", found.strategies[1][0])
        self.assertEqual([family[0] for family in found.families], ["ties", "slivers"])
        self.assertIn("repro-1.json", found.failures[0])

    def test_ccd_shows_peers_beside_ours(self) -> None:
        ours = {"positives": 3, "missed": 0, "extra": 0, "passes": 1, "queries_per_second": 1e6}
        file = {**ours, "name": "edge-edge", "queries": 4, "filtered": 3, "peers": {"fcl": {**ours, "missed": 1}}}
        self.write("ccd.json", {"commit": "0123456789abcdef", "files": [file]})
        found = robustness.ccd(self.folder)
        assert found is not None
        self.assertEqual(found.rows[0][:6], ("edge-edge", "4", "3", "0", "0", "75.0 %"))
        self.assertEqual(found.rows[0][7:9], ("1", "0"))

    def test_wrong_files_are_one_sentence(self) -> None:
        self.write("stress.json", {"schema": "kbvh-stress-1"})
        self.write("ccd.json", {"files": [{}]})
        with self.assertRaises(ResultError):
            robustness.stress(self.folder)
        with self.assertRaises(ResultError):
            robustness.ccd(self.folder)


if __name__ == "__main__":
    unittest.main()
