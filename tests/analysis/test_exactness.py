"""What exactness costs: who is compared with whom, and what is said of it."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)

import exactness
import synthetic
from load import load
from synthetic import line


class TestExactness(unittest.TestCase):
    def found(self, lines: list[dict[str, Any]]) -> list[exactness.Comparison]:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            synthetic.write(Path(name), lines)
            return exactness.comparisons(load(Path(name)))

    def test_each_is_held_against_its_own_counterpart(self) -> None:
        wrong = dict(guarantee="approximate", tightness="none", missed=3, extra=1, protrusion=0.5)
        lines = [line("bottom_up", 2.0), line("bottom_up_approximate", 1.0, **wrong), line("kinetic_aabb", 9.0),
                 line("bottom_up", 4.0, "sheet"), line("bottom_up_approximate", 1.0, "sheet", **wrong)]  # fmt: skip
        (row,) = self.found(lines)
        self.assertAlmostEqual(row.ratio, 8**0.5)
        self.assertEqual((row.tables, row.lowest, row.highest), (2, 2.0, 4.0))
        self.assertEqual((row.missed, row.extra), (6, 2))
        says = exactness.paragraph([row])
        self.assertIn("missed 6 and added 2", says)
        self.assertIn("180\u00a0% of speed", says)

    def test_without_an_exact_counterpart_nothing_is_said(self) -> None:
        self.assertEqual(self.found([line("bottom_up_approximate", 1.0, guarantee="approximate")]), [])
        self.assertEqual(exactness.paragraph([]), "")


if __name__ == "__main__":
    unittest.main()
