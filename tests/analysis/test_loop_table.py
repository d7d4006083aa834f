"""The table of simulations: a row for each finder or for each scene, the page it is written into, and unusable folders."""

from __future__ import annotations

import json
import unittest
from pathlib import Path
from typing import Any, Optional

import paths  # noqa: F401  (finds the modules under test)
import shared

from report import loop_table
from test_loop_pictures import header, step


class TestTable(shared.InFolder):
    def write(self, place: str, strategy: Optional[str], detect_ms: list[float], scene: str = "sphere", **others: Any) -> None:
        """Writes a simulation with a step for each time of detection; `others` are keys of its last step."""
        head = header(scene)
        if strategy:
            head["options"] |= {"detection": "strategy", "strategy": strategy, "params": {}}
            head |= {"baseline": strategy.endswith("refit"), "exact": strategy != "lossy"}
        steps = [step(number, 0) | {"detect_ms": ms} for number, ms in enumerate(detect_ms, 1)]
        steps[-1] |= others
        folder = self.folder / place
        folder.mkdir(parents=True)
        (folder / "loop.jsonl").write_text("".join(json.dumps(line) + "\n" for line in [head, *steps]), encoding="utf-8")

    def table(self) -> list[list[str]]:
        code, out, err = shared.said(loop_table.main, self.folder)
        self.assertEqual((code, err), (0, ""))
        return [[cell.strip() for cell in line.strip("|").split("|")] for line in out.splitlines() if line.startswith("|")]

    def test_of_one_scene_a_row_for_each_finder(self) -> None:
        self.write("c", "a_refit", [4, 2, 2, 100])
        self.write("b", None, [1, 1, 3])
        self.write("a", "b_refit", [5, 9, 9])
        self.write("d", "lossy", [1, 1, 1], penetrations=2, state="00000000000000ff", resident_bytes=3e7)
        head, _, *rows = self.table()
        self.assertEqual(tuple(head), loop_table.FINDER_HEAD)
        self.assertEqual([row[0] for row in rows], ["broad_phase", "a_refit", "b_refit", "lossy"])
        named = {row[0]: dict(zip(head, row)) for row in rows}
        self.assertEqual([row["steps"] for row in named.values()], ["3", "4", "3", "3"])
        # Of the three steps that all made.
        refit = named["a_refit"]
        self.assertEqual((refit["detection, ms"], refit["worst"], refit["over the best refit"]), ("2.00", "4.00", "1.00x"))
        self.assertEqual((refit["all but detection, ms"], refit["worst step, ms"]), ("4.50", "7.50"))
        self.assertEqual(named["broad_phase"]["over the best refit"], "1.60x")
        self.assertEqual(named["b_refit"]["over the best refit"], "0.35x")
        self.assertEqual([row["penetrations"] for row in named.values()], ["0", "0", "0", "2"])
        self.assertEqual([row["states"] for row in named.values()], ["–", "equal", "equal", "differ at 3"])
        self.assertEqual(named["lossy"]["memory, MB"], "20.0, 30.0")

    def test_of_several_scenes_a_row_for_each(self) -> None:
        self.write("sphere/a_refit", "a_refit", [2, 2])
        self.write("sphere/sweep", "sweep", [1, 4, 1], resident_bytes=2.5e7)
        self.write("sphere/slow", "slow", [9, 9])
        self.write("knot/broad_phase", None, [1, 2], scene="knot", penetrations=3)
        head, _, *rows = self.table()
        self.assertEqual(tuple(head), loop_table.SCENE_HEAD)
        knot, sphere = (dict(zip(head, row)) for row in rows)
        self.assertEqual((knot["scene"], knot["finders"], knot["best refit, ms"], knot["fastest other"]), ("knot", "1", "–", "broad_phase –"))
        self.assertEqual(knot["penetrations"], "3")
        self.assertEqual((sphere["steps of each, at least"], sphere["steps in all"], sphere["penetrations"]), ("2", "7", "0"))
        self.assertEqual((sphere["best refit, ms"], sphere["fastest other"]), ("a_refit 2.00", "sweep 0.80x"))
        self.assertEqual((sphere["other states"], sphere["memory grew by, MB"]), ("0", "5.0"))

    def test_says_what_was_measured_where(self) -> None:
        self.write("a", None, [1])
        self.write("b", "sweep", [1])
        out = shared.said(loop_table.main, self.folder)[1]
        self.assertIn("Measured: 2026-01-31, commit 01234567, a processor, one thread. Scene sphere with 3 triangles.", out)
        self.assertIn("the first 1 step, which all made", out)

    def test_writes_into_a_page(self) -> None:
        self.write("small/sphere", None, [1])
        begin, end = loop_table.markers(self.folder / "small")
        self.assertIn("small", begin)
        page = self.folder / "page.md"
        content = f"before\n{begin}\nold\n{end}\nafter\n"
        page.write_text(content, encoding="utf-8")
        self.assertEqual(shared.said(loop_table.main, self.folder / "small", "--write", page), (0, "", ""))
        table = shared.said(loop_table.main, self.folder / "small")[1]
        self.assertEqual(page.read_text(encoding="utf-8"), content.replace("old\n", table))
        page.write_text("none\n", encoding="utf-8")
        code, _, err = shared.said(loop_table.main, self.folder / "small", "--write", page)
        self.assertEqual((code, err.count("\n")), (2, 1))

    def test_a_folder_without_simulations_is_refused(self) -> None:
        code, out, err = shared.said(loop_table.main, self.folder)
        self.assertEqual((code, out, err.count("\n")), (2, "", 1))
        self.assertIn("has no simulations", err)

    def test_the_guide_has_a_place_for_the_folders_it_names(self) -> None:
        root = Path(__file__).resolve().parents[2]
        page = (root / "analysis" / "guides" / "simulator.md").read_text(encoding="utf-8")
        for name in ("small", "cloth-16k-on-a-sphere"):
            self.assertIn(f"results/live/{name} ", page)
            for marker in loop_table.markers(Path(name)):
                self.assertEqual(page.count(marker + "\n"), 1, marker)


if __name__ == "__main__":
    unittest.main()
