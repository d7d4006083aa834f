"""Which strategy for what, and the ageing table: what counts, and what does not."""

from __future__ import annotations

import math
import tempfile
import unittest
from pathlib import Path
from typing import Any

import paths  # noqa: F401  (finds the modules under test)

import ageing
import guide
import synthetic
from load import Study, load
from synthetic import line


def other(identity: str, total: float, scene: str = "cloth", foresight: str = "none", **changes: Any) -> dict[str, Any]:
    """A contestant that is no baseline."""
    made = line(identity, total, scene, **changes)
    made["strategy"].update(family="kinetic", foresight=foresight)
    return made


def study(lines: list[dict[str, Any]]) -> Study:
    with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
        return load(synthetic.write(Path(name), lines))


def advice(lines: list[dict[str, Any]], kind: str = "all") -> dict[str, guide.Advice | None]:
    (found,) = [one for one in guide.kinds(study(lines)) if one.name == kind]
    return dict(found.by_foresight)


class TestGuide(unittest.TestCase):
    def test_a_strategy_is_recommended_only_to_those_who_know_what_it_must_know(self) -> None:
        found = advice([line("refit", 2.0), other("clip", 0.5, foresight="whole_clip"),
                        other("keyframe", 1.0, foresight="next_keyframe")])  # fmt: skip
        self.assertEqual([found[column].id for column in guide.FORESIGHT], ["refit", "keyframe", "clip"])
        best = found["knows the whole clip"]
        self.assertAlmostEqual(best.over_refit, 4.0)
        self.assertAlmostEqual(found["knows the next keyframe"].share, 0.5)

    def test_the_geometric_mean_decides_and_the_worst_cell_is_named(self) -> None:
        lines = [line("steady", 2.0, "cloth"), line("steady", 2.0, "ball"),
                 other("moody", 1.0, "cloth"), other("moody", 8.0, "ball")]  # fmt: skip
        best = advice(lines)["without foresight"]
        self.assertEqual(best.id, "steady")
        self.assertAlmostEqual(best.share, math.sqrt(0.5))
        self.assertTrue(best.worst_cell.startswith("cloth"), best.worst_cell)

    def test_a_missing_cell_counts_as_the_worst(self) -> None:
        cloths = [f"cloth {i}" for i in range(4)]
        lines = [line("refit", 1.0, scene) for scene in cloths] + [other("slow", 9.0, scene) for scene in cloths]
        lines += [other("picky", total, scene) for total, scene in zip((0.5, 0.5, 4.0), cloths)]
        best = advice(lines)["without foresight"]
        self.assertEqual(best.id, "refit")  # picky: 1, 1, 1/4, and 1/4 for the cell that it left out
        self.assertAlmostEqual(best.share, (0.5 * 0.5) ** 0.25)
        few = [*lines[:8], other("picky", 0.1, cloths[0])]
        self.assertEqual(advice(few)["without foresight"].id, "refit")

    def test_wrong_threaded_and_refused_contestants_take_no_part(self) -> None:
        lines = [line("refit", 2.0), other("fine", 1.5), other("wrong", 0.1, guarantee="approximate"),
                 other("threaded", 0.1, params={"threads": "2"}), synthetic.refused(other("lost", 0.1), "", "a pair is lost")]  # fmt: skip
        self.assertEqual(advice(lines)["without foresight"].id, "fine")
        self.assertEqual(set(guide.records(study(lines))), {"refit", "fine"})

    def test_kinds_of_work_follow_from_what_was_recorded(self) -> None:
        aged = [line("refit", 2.0, "swarm"), other("fine", 1.0, "swarm")]
        for one in aged:
            one["verified"]["over_time"] = [{"t": t, "looseness": 0, "sah": 60.0 * (t + 1), "sah_rebuilt": 50.0} for t in (0.0, 2.0)]
            one["scene"]["bodies"][0]["self"] = True
        every = [*aged, line("refit", 2.0), other("fine", 1.0)]
        self.assertEqual(
            {(kind.name, kind.cells) for kind in guide.kinds(study(every))},
            {("all", 2), ("trees age (cost grows 2x or more)", 1), ("trees do not age", 1), ("pairs within a body", 1)},
        )

    def test_the_record_counts_cells(self) -> None:
        lines = [line("refit", 2.0, "cloth"), other("fine", 1.9, "cloth"), line("refit", 1.0, "ball"), other("fine", 4.0, "ball")]
        record = guide.records(study(lines))["fine"]
        self.assertEqual((record.cells, len(record.fastest), record.near), (2, 1, 1))
        self.assertAlmostEqual(record.worst, 0.25)
        self.assertAlmostEqual(record.share, 0.5)


class TestAgeing(unittest.TestCase):
    def test_the_most_aged_comes_first_with_the_fastest_of_each_family(self) -> None:
        lines = []
        for scene, last in (("calm", 60.0), ("swarm", 600.0)):
            for identity, family, total in (("refit", "refit", 4.0), ("slow", "restructuring", 3.0), ("quick", "restructuring", 2.0)):
                one = line(identity, total, scene)
                one["strategy"]["family"] = family
                one["verified"]["over_time"] = [
                    {"t": 0.0, "looseness": 0, "sah": 60.0, "sah_rebuilt": 50.0},
                    {"t": 1.0, "looseness": 0, "sah": last, "sah_rebuilt": 50.0},
                ]
                lines.append(one)
        first, second = ageing.scenes(study(lines))
        self.assertTrue(first.title.startswith("swarm"), first.title)
        self.assertAlmostEqual(first.growth, 10.0)
        self.assertEqual((first.ages_much, second.ages_much), (True, False))
        self.assertEqual([age.family for age in first.ages], ["refit", "restructuring"])
        self.assertIn("quick", first.ages[1].label)
        self.assertAlmostEqual(first.ages[1].over_refit, 2.0)
        self.assertEqual(first.ages[0].quality, (1.2, 12.0))

    def test_a_refit_alone_is_no_comparison(self) -> None:
        self.assertEqual(ageing.scenes(study([line("refit", 1.0)])), [])


if __name__ == "__main__":
    unittest.main()
