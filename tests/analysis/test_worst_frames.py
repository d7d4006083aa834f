"""The table of worst frames: what it counts as one, and results that have none."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic
from test_headline import line

from report import worst_frames


def framed(id: str, totals: list[list[float]], **strategy: Any) -> dict[str, Any]:
    """A result with the times of every frame (ms) of each repetition, and positions of 1 ms."""
    result = line(id, "a scene", 10, 1.0, 1.0, **strategy)
    result["times"].update(by="frames", steady_from=None, frames=len(totals[0]))
    for repetition, frames in zip(result["times"]["repetitions"], totals):
        mean = sum(frames) / len(frames)
        repetition.update(motion=1.0, update=0.0, traversal=mean, totals=frames, motions=[1.0] * len(frames))
    return result


class TestWorstFrames(unittest.TestCase):
    def run_main(self, records: list[dict[str, Any]], *arguments: str) -> tuple[int, str, str]:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
            source = synthetic.write(Path(folder), records)
            return shared.said(worst_frames.main, source, *arguments)

    def test_a_worst_frame_is_the_median_of_the_longest_of_each_repetition_and_frame_0_counts_but_in_the_last_column(self) -> None:
        refit = framed("leaf_slabs", [[2.0, 2.0, 5.0], [2.0, 7.0, 2.0], [2.0, 2.0, 6.0]])
        ahead = framed("interval_join_ahead", [[9.0, 1.0, 1.5], [9.0, 1.5, 1.0], [8.0, 1.0, 2.0]])
        code, out, _ = self.run_main([refit, ahead])
        self.assertEqual(code, 0)
        cells = [cell.strip() for cell in out.split("\n")[2].strip("|").split("|")]
        self.assertEqual(cells[:2], ["a scene", "10"])
        self.assertEqual([cell.split()[0] for cell in cells[2:]], ["7.00", "–", "10.0", "2.50"])

    def test_a_join_that_another_study_measured_later_does_not_stand_beside_the_one_made_ahead(self) -> None:
        records = [framed(id, [[3.0, 1.0]] * 3) for id in ("leaf_slabs", "interval_join", "interval_join_ahead")]
        later = {**framed("interval_join", [[8.0, 1.0]] * 3), "study": "another"}
        code, out, _ = self.run_main([*records, later])
        self.assertEqual(code, 0)
        self.assertEqual([cell.strip() for cell in out.split("\n")[2].strip("|").split("|")][2:], ["4.00", "4.00", "4.00", "2.00"])

    def test_results_without_the_join_made_ahead_are_refused_with_a_sentence(self) -> None:
        code, _, err = self.run_main([framed("leaf_slabs", [[1.0, 1.0]] * 3)])
        self.assertEqual(code, 2)
        self.assertIn("the results are not those of plan spacetime", err)

    def test_a_page_without_its_lines_stays_as_it_is(self) -> None:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as folder:
            page = Path(folder) / "page.md"
            page.write_text("# No table\n", encoding="utf-8")
            records = [framed("leaf_slabs", [[1.0, 1.0]] * 3), framed("interval_join_ahead", [[1.0, 1.0]] * 3)]
            code, _, err = self.run_main(records, "--write", str(page))
            self.assertEqual(code, 2)
            self.assertIn("worst frames", err)
            self.assertEqual(page.read_text(encoding="utf-8"), "# No table\n")


if __name__ == "__main__":
    unittest.main()
