"""Automatic choices in the report: who is compared with whom."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)

from ratios import choices
import synthetic
from results.load import load
from synthetic import line


class TestChoices(unittest.TestCase):
    def found(self, lines: list[dict[str, Any]]) -> list[choices.Choice]:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            synthetic.write(Path(name), lines)
            return choices.choices(load(Path(name)))

    def test_is_held_against_the_best_other_of_one_thread_that_is_exact(self) -> None:
        chooser = line("chooser", 2.0)
        chooser["choice"] = "refit for 190 frames, join for 11 frames (last seen: nothing)"
        lines = [chooser, line("slow", 3.0), line("good", 1.5), line("threaded", 0.1, params={"threads": "2"}),
                 line("wrong", 0.1, guarantee="approximate")]  # fmt: skip
        (row,) = self.found(lines)
        self.assertIn("good", row.best)
        self.assertAlmostEqual(row.ratio, 0.75)
        self.assertEqual((row.chosen, row.seen), ("refit for 190 frames, join for 11 frames", "last seen: nothing"))

    def test_strategies_are_named_by_their_titles_and_sizes_of_what_one_works_with_are_no_choice(self) -> None:
        chooser, modes, good = line("chooser", 2.0), line("modes", 2.0), line("good", 1.5)
        chooser["choice"], modes["choice"] = "good for 190 frames, unknown for 1 frame", "modes of body 0: 6"
        good["strategy"]["title"] = "a good refit"
        (row,) = self.found([chooser, modes, good])
        self.assertEqual((row.chooser, row.chosen), ("chooser", "a good refit for 190 frames, unknown for 1 frame"))

    def test_without_a_choice_there_is_nothing_to_show(self) -> None:
        self.assertEqual(self.found([line("slow", 3.0)]), [])


if __name__ == "__main__":
    unittest.main()
