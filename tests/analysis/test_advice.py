"""Which strategy for what, and the ageing table: what counts, and what does not."""

from __future__ import annotations

import math
import tempfile
import unittest
from pathlib import Path
from typing import Any, Optional

import paths

from advice import advice, cells_file
from ratios import ageing
import synthetic
from results import scene_names
from results.load import ResultError, Study, load
from synthetic import line


def other(identity: str, total: float, scene: str = "cloth", foresight: str = "none", **changes: Any) -> dict[str, Any]:
    """A contestant that is no baseline."""
    made = line(identity, total, scene, **changes)
    made["strategy"].update(family="kinetic", foresight=foresight)
    return made


def study(lines: list[dict[str, Any]]) -> Study:
    with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
        return load(synthetic.write(Path(name), lines))


def taken(lines: list[dict[str, Any]], number: int = 0) -> list[advice.Advice]:
    """The advice of one situation, from the least knowledge to the most."""
    found = [best for _, best in advice.situations(advice.cells(study(lines)))[number].advice]
    assert all(found)
    return found


class TestRule(unittest.TestCase):
    def test_a_strategy_is_recommended_only_to_those_who_know_what_it_must_know(self) -> None:
        found = taken([line("refit", 2.0), other("clip", 0.5, foresight="whole_clip"), other("keyframe", 1.0, foresight="next_keyframe")])
        self.assertEqual([one.id for one in found], ["refit", "keyframe", "clip"])
        self.assertEqual([round(one.speed, 6) for one in found], [1, 2, 4])

    def test_the_geometric_mean_decides_and_the_worst_cell_is_named(self) -> None:
        lines = [line("refit", 2.0, "cloth"), line("refit", 2.0, "ball"), other("moody", 0.5, "cloth"), other("moody", 10.0, "ball"),
                 other("steady", 1.5, "cloth"), other("steady", 1.9, "ball")]  # fmt: skip
        best = taken(lines)[0]
        self.assertEqual(best.id, "steady")
        self.assertAlmostEqual(best.speed, math.sqrt(2 / 1.5 * 2 / 1.9))
        self.assertEqual((round(best.low, 3), round(best.high, 3)), (round(2 / 1.9, 3), round(2 / 1.5, 3)))
        self.assertTrue(best.worst.startswith("ball"), best.worst)
        self.assertEqual(best.says, "1.18 times as fast as the refit on average (faster in 2 of 2 scenes, 1.05 to 1.33)")

    def test_losing_cells_are_counted_and_named(self) -> None:
        lines = [line("refit", 2.0, "cloth"), line("refit", 2.0, "ball"), other("join", 0.5, "cloth"), other("join", 4.0, "ball")]
        best = taken(lines)[0]
        self.assertIn("(faster in 1 of 2 scenes, 0.50 to 4.00; slower on ball, 4k, l = 10: 0.50)", best.says)

    def test_the_losing_cell_that_is_worst_comes_first_and_three_are_named(self) -> None:
        lines = [one for i, total in enumerate((3.0, 5.0, 2.5, 4.0, 0.1)) for one in (line("refit", 2.0, f"s{i}"), other("join", total, f"s{i}"))]
        lines[-1]["times"]["disturbed"] = "9 involuntary switches"
        best = advice.Advice("join", "join", False, 1, 0.4, 20, 5, 5, "", 0, disturbed=True, faster=1, word="scene", doubtful=[("s4", 20.0), ("s3", 0.5)],
                             losses=[("s1", 0.4), ("s3", 0.5), ("s0", 0.67), ("s2", 0.8)])  # fmt: skip
        self.assertEqual(advice.lost(best), "s1: 0.40; s3: 0.50, a doubtful run: the machine was disturbed; s0: 0.67; and 1 more")
        self.assertTrue(best.says.endswith("; and 1 more; doubtful, from a disturbed machine: 20.0 on s4)"), best.says)
        found = advice.advise(advice.cells(study(lines)), "the whole clip is known")
        assert found is not None
        self.assertEqual((found.id, [round(speed, 2) for _, speed in found.losses]), ("join", [0.4, 0.5, 0.67, 0.8]))

    def test_refits_that_no_interval_tells_apart_are_named(self) -> None:
        facts = {id: advice.Facts(id, "none", id != "join") for id in ("best", "close", "far", "few", "join")}
        spans = {"close": (0.95, 1.02, True), "far": (0.93, 0.99, True), "few": (0.9, 1.1, False), "join": (0.9, 1.1, True)}

        def equals(*others: tuple[str, float]) -> list[str]:
            speeds = {"best": 1.0, "close": 0.98, "far": 0.96, "few": 0.97, "join": 0.99}
            own = [
                advice.Cell(f"s{i}, 2k, l = 1", advice.PAIRS, next(iter(advice.FRAMES)), 2000, "best", {**speeds, **dict([one])}, {id: 2.0 for id in speeds},
                            frozenset(), facts, spans.get)
                for i, one in enumerate(others)
            ]  # fmt: skip
            found = advice.advise(own, "nothing is known")
            assert found is not None and found.id == "best"
            return found.equals

        self.assertEqual(equals(("close", 0.98)), ["close"], "neither one that is slower beyond doubt, nor a range of few rounds, nor what is no refit")
        self.assertEqual(equals(("close", 0.98), ("close", 0.5)), [], "in every cell")
        best = advice.Advice("a", "a", True, 1, 1, 1, 1, 1, "", 1, word="scene", equals=["close", "lazy"])
        self.assertEqual(best.says, "the best refit in the only scene (close and lazy are as fast, within the 95\u00a0% interval)")

    def test_several_sizes_have_times_per_triangle(self) -> None:
        facts = {"refit": advice.Facts("refit", "none", True), "join": advice.Facts("join", "none", False)}
        own = [
            advice.Cell(f"{name}, l = 10", advice.PAIRS, list(advice.FRAMES)[-1], primitives, "refit", {"refit": 1.0, "join": 2.0}, {"refit": 2 * ms, "join": ms},
                        frozenset(), facts, lambda id: None)
            for name, primitives, ms in (("cloth, 10k", 10_000, 0.1), ("dress, 80k", 80_000, 0.2))
        ]  # fmt: skip
        both, one = (advice.advise(own[:count], "nothing is known") for count in (2, 1))
        assert both is not None and one is not None
        self.assertEqual((both.rates, one.rates), ("2.5 to 10 ns a triangle", ""))
        self.assertIn("0.100 ms (cloth, 10k) to 0.200 ms (dress, 80k triangles) a frame (2.5 to 10 ns a triangle); 2.00 times", advice.brief(advice.situations(own)[0]))

    def test_cells_of_one_scene_are_not_called_scenes(self) -> None:
        facts = {"refit": advice.Facts("refit", "none", True), "join": advice.Facts("join", "none", False)}
        own = [
            advice.Cell(title, advice.PAIRS, next(iter(advice.FRAMES)), 2000, "refit", {"refit": 1.0, "join": 2.0}, {"refit": 2.0, "join": 1.0},
                        frozenset(), facts, lambda id: None)
            for title in ("cloth, 2k, l = 1", "cloth, 9k, l = 1", "ball, 2k, l = 1")
        ]  # fmt: skip
        words = [found.word for count in (2, 3) if (found := advice.advise(own[-count:], "nothing is known"))]
        self.assertEqual(words, ["scene", "cell"])

    def test_times_name_the_sizes_that_they_were_measured_at(self) -> None:
        best = advice.Advice("a", "a", False, 2, 1, 3, 2, 2, "", 0, times=(0.5, 2.0), sizes=(2000, 16200))
        self.assertEqual(best.costs, "0.500 ms (2k) to 2.00 ms (16k triangles) a frame")
        best.at = ("ball", "cloth")
        self.assertEqual(best.costs, "0.500 ms (ball, 2k) to 2.00 ms (cloth, 16k triangles) a frame")

    def test_positions_without_keyframes_are_the_first_class(self) -> None:
        self.assertEqual([advice.said_of(one) for one in advice.FRAMES][:2], ["positions only (a keyframe at every frame)", "2 to 9 frames a keyframe"])

    def test_a_missing_cell_counts_as_the_slowest(self) -> None:
        cloths = [f"cloth {i}" for i in range(4)]
        lines = [line("refit", 1.0, scene) for scene in cloths] + [other("slow", 9.0, scene) for scene in cloths]
        picky = [other("picky", total, scene) for total, scene in zip((0.5, 0.5, 4.0), cloths)]
        self.assertEqual(taken([*lines, *picky])[0].id, "refit")  # picky: 2, 2, 1/4, and 1/4 for the cell that it left out
        self.assertEqual(taken([*lines, *picky[:2]])[0].id, "picky", "measured in half of the cells")
        self.assertIn("measured in 2", taken([*lines, *picky[:2]])[0].says)
        self.assertEqual(taken([*lines, other("picky", 0.1, cloths[0])])[0].id, "refit")

    def test_wrong_threaded_and_refused_contestants_take_no_part(self) -> None:
        lines = [line("refit", 2.0), other("fine", 1.5), other("wrong", 0.1, guarantee="approximate"),
                 other("threaded", 0.1, params={"threads": "2"}), synthetic.refused(other("lost", 0.1), "", "a pair is lost")]  # fmt: skip
        self.assertEqual(taken(lines)[0].id, "fine")
        self.assertEqual(set(advice.records(advice.cells(study(lines)))), {"refit", "fine"})

    def test_a_refit_is_held_against_the_best_one_and_says_so(self) -> None:
        lines = [line("refit", 1.0, "a"), line("refit", 1.0, "b"), line("refit", 2.0, "c"),
                 line("lazy", 1.1, "a"), line("lazy", 1.1, "b"), line("lazy", 1.0, "c")]  # fmt: skip
        for one in lines:
            one["strategy"].update(baseline=True)
        best = taken(lines)[0]
        self.assertEqual(best.id, "lazy")
        self.assertEqual(best.says, "the best refit in 1 of 3 scenes; in the other 2 at worst 0.91 times as fast")
        for one in lines[3:5]:
            one["times"] = line("lazy", 1.004)["times"]
        self.assertEqual(taken(lines)[0].says, "the best refit in 1 of 3 scenes; in the other 2 less than 1\u00a0% slower")

    def test_doubt_of_a_refit_stands_where_it_is_the_best_one_or_with_the_others(self) -> None:
        lines = [line("refit", 1.0, "a"), line("refit", 2.0, "b"), line("refit", 2.0, "c"),
                 line("lazy", 1.1, "a"), line("lazy", 1.0, "b"), line("lazy", 1.0, "c")]  # fmt: skip
        for one in lines:
            one["strategy"].update(baseline=True)
        self.assertEqual(taken(lines)[0].says, "the best refit in 2 of 3 scenes; in the other one 0.91 times as fast")
        lines[-1]["times"]["disturbed"] = "9 involuntary switches"
        disturbed = "doubtful, from a disturbed machine: "
        self.assertEqual(taken(lines)[0].says, f"the best refit in 2 of 3 scenes ({disturbed}c, 4k, l = 10); in the other one 0.91 times as fast")
        lines[3]["times"]["disturbed"] = "9 involuntary switches"
        self.assertEqual(taken(lines)[0].says, f"the best refit in 2 of 3 scenes ({disturbed}c, 4k, l = 10); in the other one 0.91 times as fast ({disturbed}0.91 on a, 4k, l = 10)")
        self.assertEqual(taken(lines[2:3] + lines[5:])[0].says, "the best refit in the only scene (a doubtful run: the machine was disturbed)")
        picky = [*lines[:3], *lines[4:], *(line(id, 3.0, scene) for id in ("x",) for scene in "abc")]
        self.assertEqual(taken(picky)[0].says, f"the best refit in 2 of 3 scenes, measured in 2 ({disturbed}c, 4k, l = 10)")

    def test_it_says_in_words_whether_a_strategy_is_surely_faster(self) -> None:
        facts = {"refit": advice.Facts("refit", "none", True), "join": advice.Facts("join", "none", False)}

        def best(*cells: tuple[float, Optional[advice.Span], bool]) -> advice.Advice:
            own = [
                advice.Cell(f"s{i}, 2k, l = 1", advice.PAIRS, next(iter(advice.FRAMES)), 2000, "refit", {"refit": 1.0, "join": speed}, {"refit": 2.0, "join": 1.0},
                            frozenset(["join"] if doubtful else []), facts, lambda id, span=span: span)
                for i, (speed, span, doubtful) in enumerate(cells)
            ]  # fmt: skip
            found = advice.advise(own, "nothing is known")
            assert found is not None and found.id == "join"
            return found

        sure, open_ended, single = (2.0, (1.9, 2.1, True), False), (1.5, (0.9, 2.0, True), False), (1.5, (1.5, 1.5, False), False)
        doubtful, slower = (1.5, (1.4, 1.6, True), True), (0.79, (0.7, 0.8, True), True)
        self.assertEqual(best(sure, sure).sure, "surely faster: yes, in all 2 scenes, intervals included")
        for one, why in ((open_ended, "the interval contains 1"), (single, "there is no interval"), (doubtful, "the run is doubtful")):
            self.assertEqual(best(sure, one).sure, f"surely faster: not beyond doubt, in 1 of 2 scenes {why}")
        self.assertEqual(best(sure, slower).sure, "surely faster: no, 1 of 2 scenes is slower")
        self.assertIn("; slower on s1, 2k, l = 1: 0.79, a doubtful run: the machine was disturbed)", best(sure, slower).says)
        self.assertEqual(best(sure).sure, "surely faster: yes, in the only scene, intervals included")
        self.assertEqual(advice.Advice("a", "a", True, 1, 1, 1, 1, 1, "", 1).sure, "", "a refit is what the others are compared with")

    def test_a_scene_is_named_without_the_size_of_one_of_its_bodies(self) -> None:
        for name, said in (("dress 65k", "dress"), ("tablecloth 2k and itself", "tablecloth and itself"), ("mixing swarms 65k (coherent rays)", "mixing swarms (coherent rays)"),
                           ("waving_sheet", "waving sheet"), ("sheet over box", "sheet over box"), ("blender/tablecloth-16k", "blender/tablecloth-16k")):  # fmt: skip
            self.assertEqual(scene_names.short(name), said)

    def test_built_in_scenes_are_named_in_words(self) -> None:
        for name, said in (("waving_sheet", "waving sheet"), ("waving_sheet-800", "waving sheet-800"), ("tablecloth", "tablecloth"),
                           ("my_scene.obj", "my_scene.obj"), ("waving_sheet (coherent rays)", "waving sheet (coherent rays)")):  # fmt: skip
            self.assertEqual(scene_names.words(name), said)

    def test_a_range_of_few_rounds_is_not_called_an_interval(self) -> None:
        for rounds, word in ((5, "95\u00a0% interval"), (3, "range of its rounds")):
            lines = [line("refit", 2.0), other("join", 1.0)]
            for one in lines:
                every = one["times"]["repetitions"] = one["times"]["repetitions"][:rounds]
                for i, repetition in enumerate(every):
                    repetition["update"] *= 1 + 0.1 * i * (one is lines[1])
            with self.subTest(rounds):
                (best,) = {one.id: one for one in taken(lines)}.values()
                self.assertEqual(best.id, "join")
                self.assertIn(f"({word} ", best.says)

    def test_a_cell_that_two_plans_measured_counts_once(self) -> None:
        few = [line("refit", 2.0), other("join", 1.0)]
        many = [line("refit", 2.0), other("join", 4.0), other("tree", 8.0)]
        for one in many:
            one["scene"].update(frames=7)  # of the same scene, size, scalar and l
        elsewhere = [line("refit", 2.0, "ball"), other("join", 1.0, "ball")]
        for lines in (few + many + elsewhere, many + few + elsewhere):
            found = advice.cells(study(lines))
            self.assertEqual(len(found), 3, "both are in the tables")
            (one,) = advice.situations(found)
            self.assertEqual(one.cells, 2)
            best = one.advice[0][1]
            assert best is not None
            self.assertAlmostEqual(best.speed, 1.0, msg="by the measurement with more strategies the join has 1/2 there, and 2 elsewhere")
        later = [line("refit", 2.0), other("join", 0.5)]
        for one in later:
            one["scene"].update(frames=9)
        for lines, speed in ((few + later, 4.0), (later + few, 2.0)):
            best = taken(lines)[0]
            self.assertEqual((best.cells, round(best.speed, 6)), (1, speed), "of equal ones the newest")
        for one in later:
            one["machine"] = {**synthetic.MACHINE, "cpu": "another"}
        self.assertEqual(taken(few + later)[0].cells, 2, "another machine is another cell")

    def test_cells_without_a_refit_count_nowhere(self) -> None:
        alone = [other("one", 1.0, "ball"), other("two", 2.0, "ball")]
        self.assertEqual(len(advice.cells(study([*alone, line("refit", 2.0), other("one", 1.0)]))), 1)
        self.assertEqual(advice.situations(advice.cells(study(alone))), [])

    def test_situations_follow_from_what_was_recorded(self) -> None:
        def both(scene: str, **changes: Any) -> list[dict[str, Any]]:
            made = [line("refit", 2.0, scene), other("fine", 1.0, scene)]
            for one in made:
                one["scene"].update(changes)
            return made

        self_pairs = both("self")
        for one in self_pairs:
            one["scene"]["bodies"][0]["self"] = True
        lines = both("rays", rays="coherent:64") + self_pairs + both("few", per_keyframe=1) + both("more", per_keyframe=9) + both("many", per_keyframe=10)
        found = [(one.asks, one.frames) for one in advice.situations(advice.cells(study(lines)))]
        frames = list(advice.FRAMES)
        self.assertEqual(found[:3], [(advice.PAIRS, name) for name in frames])
        self.assertEqual([asks for asks, _ in found[3:]], [advice.SELF, "rays"])

    def test_the_record_counts_cells(self) -> None:
        lines = [line("refit", 2.0, "cloth"), other("fine", 1.9, "cloth"), line("refit", 1.0, "ball"), other("fine", 4.0, "ball")]
        record = advice.records(advice.cells(study(lines)))["fine"]
        self.assertEqual((record.cells, len(record.fastest), record.near), (2, 1, 1))
        self.assertAlmostEqual(record.worst, 0.25)
        self.assertAlmostEqual(record.share, 0.5)


class TestGuide(unittest.TestCase):
    def test_the_guide_has_what_the_cells_that_come_with_the_project_recommend(self) -> None:
        root = paths.HERE.parents[1]
        page = (root / "analysis" / "guides" / "choosing.md").read_text(encoding="utf-8")
        kept = cells_file.read(root / "analysis" / "reference" / cells_file.FILE)
        self.assertEqual(cells_file.inserted(page, cells_file.table(kept), "choosing.md"), page)
        self.assertLessEqual({advice.PAIRS, advice.SELF}, {cell.asks for cell in kept.cells})

    def test_the_file_of_cells_gives_the_same_advice(self) -> None:
        lines = [line("refit", 2.0, "a"), other("join", 1.0, "a", foresight="next_keyframe"), line("refit", 1.0, "b"), other("join", 1.3, "b")]
        for one in lines[2:]:
            one["scene"].update(per_keyframe=1)
        rays = [line("refit", 2.0, "c"), other("join", 1.0, "c")]
        for one in rays:
            one["scene"].update(rays="coherent:64")
        lines[1]["times"]["disturbed"] = "9 involuntary switches"
        found = cells_file.of_study(study([*lines, *rays]))
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            file = Path(name) / cells_file.FILE
            file.write_text(cells_file.content(found), encoding="utf-8")
            self.assertEqual(cells_file.table(cells_file.read(file)), cells_file.table(found))
            self.assertEqual(cells_file.read(file).told, found.told)
            both = cells_file.gathered([file, file])
            self.assertEqual(len(both.cells), 2 * len(found.cells))
            self.assertEqual(cells_file.markdown(advice.situations(both.cells)), cells_file.markdown(advice.situations(found.cells)), "each cell counts once")
            for old, new, why in (("kbvh-cells-1", "kbvh-cells-0", "schema"), ('"speeds"', '"speed"', "speeds"), ('"join": [', '"join2": [', "belong together")):
                file.write_text(cells_file.content(found).replace(old, new), encoding="utf-8")
                self.assertRaisesRegex(ResultError, why, cells_file.read, file)

    def test_a_page_without_a_place_is_refused(self) -> None:
        with self.assertRaises(ResultError):
            cells_file.inserted("no place", "table", "page.md")


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
