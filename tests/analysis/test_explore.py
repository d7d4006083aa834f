"""The data of the explorer, its statistics against values worked out by hand or drawn, and its page without a program."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import re
import shutil
import subprocess
import unittest
from pathlib import Path
from typing import Any
from unittest import mock

import paths  # noqa: F401  (finds the modules under test)
import shared
import synthetic

from advice import advice
from claims import claims
from explorer import explore, explorer_data
from figures import colours
from results import clip_times, load
import numpy as np
from ratios import profiles
from report import report


def line(id: str, times: list[float], scene: str = "s", **strategy: Any) -> dict[str, Any]:
    """A result with these update times and nothing else that takes time."""
    result = synthetic.record(dict(id=id, title=id, family=strategy.pop("family", "kinetic"), query=1.0), scene, 2000, "float", 10)
    result["times"]["repetitions"] = [
        {"motion": 0.0, "update": time, "traversal": 0.0, "triangle_tests": 0.0, "plan_changes": 0.0} for time in times
    ]
    result["strategy"].update(strategy)
    return result


class Folder(shared.InFolder):
    def study(self, lines: list[dict[str, Any]], newest_of: tuple[str, ...] = load.ONE_OF_EACH_COMMIT) -> load.Study:
        return load.load(synthetic.write(self.folder, lines), newest_of)


class TestInterval(unittest.TestCase):
    @staticmethod
    def raw(values: np.ndarray, session: str = "s") -> clip_times.RawTimes:
        """Repetitions of one frame each, all of it update."""
        sums = np.column_stack([values, *[np.zeros(len(values))] * 4])
        return clip_times.RawTimes(values[:, None], np.zeros((len(values), 1)), sums, None, None, False, session)

    def test_is_about_the_limit_of_many_draws(self) -> None:
        chance = np.random.default_rng(1)
        for n in (5, 8, 9, 20):
            own, other = chance.lognormal(0, 0.1, n), chance.lognormal(0.2, 0.1, n)
            picks = chance.integers(0, n, (2, 100_000, n))
            drawn = {
                "s": np.median(other[picks[0]], axis=1) / np.median(own[picks[0]], axis=1),
                "t": np.median(other[picks[0]], axis=1) / np.median(own[picks[1]], axis=1),
            }
            for session, values in drawn.items():
                found = clip_times.ratio_of(self.raw(other, session), self.raw(own), "total")
                assert found is not None
                self.assertTrue(found.is_interval)
                # 200 draws: each end has about the share of the distribution beyond it that it should have.
                self.assertLessEqual(np.mean(values < found.low - 1e-12), 0.07, (n, session))
                self.assertGreaterEqual(np.mean(values <= found.low + 1e-12), 0.003, (n, session))
                self.assertLessEqual(np.mean(values > found.high + 1e-12), 0.07, (n, session))
                self.assertGreaterEqual(np.mean(values >= found.high - 1e-12), 0.003, (n, session))

    def test_single_repetitions_have_no_spread(self) -> None:
        found = clip_times.ratio_of(self.raw(np.array([2.0])), self.raw(np.array([1.0])), "total")
        self.assertEqual((found.middle, found.low, found.high, found.is_interval), (2.0, 2.0, 2.0, False))
        self.assertIsNone(clip_times.ratio_of(self.raw(np.array([2.0])), self.raw(np.array([0.0])), "total"))

    def test_few_repetitions_have_their_range(self) -> None:
        found = clip_times.ratio_of(self.raw(np.array([2.0, 4.0, 3.0])), self.raw(np.ones(3)), "total")
        self.assertEqual((found.middle, found.low, found.high, found.is_interval), (3.0, 2.0, 4.0, False))


class TestProfiles(Folder):
    def test_by_hand(self) -> None:
        lines = [
            line("a", [1.0], "one"), line("b", [2.0], "one"), line("c", [3.0], "one"),
            line("a", [4.0], "two"), line("b", [2.0], "two"),
            line("a", [5.0], "three"),  # alone: no cell
            line("bad", [0.1], "one", guarantee="approximate"),
            line("many", [0.1], "one", params={"threads": "4"}),
            line("oracle", [0.1], "one", family="oracle"),
        ]  # fmt: skip
        found = {one.id: one for one in profiles.profiles(self.study(lines))}
        self.assertEqual({id: one.factors for id, one in found.items()}, {"a": [1.0, 2.0], "b": [1.0, 2.0], "c": [3.0]})
        self.assertEqual({one.cells for one in found.values()}, {2})
        self.assertEqual([found["a"].within(factor) for factor in (1, 1.9, 2)], [0.5, 0.5, 1.0])

    def test_of_several_settings_the_fastest_counts(self) -> None:
        lines = [line("a", [4.0], params={"x": "1"}), line("a", [2.0], params={"x": "2"}), line("b", [1.0])]
        self.assertEqual([(one.id, one.factors) for one in profiles.profiles(self.study(lines))], [("b", [1.0]), ("a", [2.0])])


class TestData(Folder):
    def data(self, lines: list[dict[str, Any]]) -> dict[str, Any]:
        return explorer_data.data(self.study(lines), "", None, self.folder)

    def test_every_commit_and_machine_is_a_cell_of_its_own(self) -> None:
        lines = []
        for commit, cpu in (("a", "x"), ("b", "x"), ("b", "y")):
            one = line("bottom_up", [1.0, 2.0])
            one.update(commit=commit, machine={**synthetic.MACHINE, "cpu": cpu})
            lines.append(one)
        data = self.data(lines)
        self.assertEqual([(cell["commit"], cell["machine"]) for cell in data["cells"]], [(0, 0), (1, 0), (1, 1)])
        self.assertEqual([machine["label"] for machine in data["machines"]], ["x", "y"])
        self.assertEqual(len(load.load(self.folder).runs), 2, "the report shows the newest commit of each machine")

    def test_machines_of_one_processor_have_labels_of_their_own(self) -> None:
        lines = []
        for kernels in ("avx2", "portable"):
            one = line("bottom_up", [1.0])
            one["machine"] = {**synthetic.MACHINE, "kernels": kernels}
            lines.append(one)
        labels = [machine["label"] for machine in self.data(lines)["machines"]]
        self.assertEqual([label.split(" · ")[1] for label in labels], ["avx2", "portable"])

    def test_commands(self) -> None:
        built_in, shapes, old = (line("bottom_up", [1.0], scene) for scene in ("x", "y", "waving_sheet"))
        built_in["again"] = {"scenes": [{"builtin": "tablecloth", "triangles": 512, "seed": 3, "order": "shuffled"}], "frames_limit": 7}
        shapes["again"] = {"scenes": [{"bodies": [{"shape": "sphere"}]}]}
        old["scene"]["origin"] = "built_in"
        unknown = line("bottom_up", [1.0], "file")
        unknown["scene"]["origin"] = "files"
        grown = line("bottom_up", [1.0], "z")
        grown["again"] = {"scenes": [{"builtin": "waving_sheet", "triangles": 200, "radius": 0.05, "seed": 1, "order": "given"}]}
        data = self.data([built_in, shapes, old, unknown, grown])
        again = [cell["again"] for cell in data["cells"]]
        self.assertEqual(again[0], {"options": "--scene tablecloth --triangles 512 --order shuffled --seed 3"})
        self.assertEqual(again[1], {"scene": {"bodies": [{"shape": "sphere"}]}})
        self.assertEqual(again[2], {"options": "--scene waving_sheet --triangles 1600 --obstacle 400"})
        self.assertIn("why", again[3])
        self.assertEqual(again[4], {"options": "--scene waving_sheet --triangles 200 --radius 0.05"})
        self.assertEqual(data["runs"]["limit"], [7, 0, 0, 0, 0])

    def test_cells_of_the_project_have_sizes_and_what_the_rule_needs(self) -> None:
        file = explorer_data.summary.REFERENCE / "cells.json"
        kept = explorer_data.kept(file)
        assert kept is not None
        most: dict[tuple[str, str], set[str]] = {}  # strategies of each cell; of a cell that two plans measured, of the measurement with more
        for one in json.loads(file.read_text())["cells"]:
            place = one["title"], one["asks"]
            most[place] = max(most.get(place, set()), set(one["speeds"]), key=len)
        self.assertEqual([(one["title"], one["asks"]) for one in kept["cells"]], list(most), "each cell once")
        for one in kept["cells"]:
            self.assertIn(f", {one['size']}, l = {one['l']:g}", one["title"])
            self.assertEqual(set(one["speeds"]), most[one["title"], one["asks"]])
            self.assertAlmostEqual(one["speeds"][one["refit"]], 1)
        sizes = {one["title"]: one["primitives"] for one in kept["cells"]}
        self.assertEqual((sizes["dress, 85k, l = 1"], sizes["diffcloth t-shirt, 4k, l = 1"]), (84_912, 4_025))
        self.assertIn("commit", kept["told"])
        self.assertLess(len(json.dumps(kept)), 60_000)
        self.assertIsNone(explorer_data.kept(self.folder / "none.json"))

    def test_a_cell_of_the_project_without_a_size_is_refused(self) -> None:
        file = self.folder / "cells.json"
        file.write_text((explorer_data.summary.REFERENCE / "cells.json").read_text().replace("dress, 85k, l = 1", "dress, l = 1", 1))
        with self.assertRaisesRegex(load.ResultError, "has no size"):
            explorer_data.kept(file)

    def test_ranges_of_a_claim_name_their_structures(self) -> None:
        listed = [{"check": check, "id": id, "name": name, "verdict": "holds"}
                  for check, id, name in (("trees", "a", "as then"), ("trees", "b", "best"), ("boxes", "a", "as then"))]  # fmt: skip
        ours = {"a": "trees: 0.1 to 0.5, 0.2 to 0.6 (with motion); boxes: 2 to 3, 4 (with motion)", "b": "trees: 7"}
        self.assertEqual(claims.ranges_of_corners(listed, ours),
                         [["trees: as then", "0.1 to 0.5", "holds"], ["trees: best", "7", "holds"], ["boxes: as then", "2 to 3", "holds"]])  # fmt: skip
        self.assertEqual(claims.ranges_of_corners(listed[:2], {"a": "0.1 to 0.5, 1 (with motion)"}), [["as then", "0.1 to 0.5", "holds"]])

    def test_is_json_without_nan(self) -> None:
        hidden = line("bottom_up", [1.0])
        hidden["verified"]["audited"] = False
        data = self.data([hidden, synthetic.refused(line("k", [1.0]), "too slow")])
        json.dumps(data, allow_nan=False)
        self.assertEqual(data["runs"]["looseness"], [None, 0])
        self.assertEqual(data["runs"]["refused"], ["", "too slow"])
        self.assertEqual(data["runs"]["times"][1], [])


@unittest.skipIf(shutil.which("node") is None, "there is no node (experiments/setup --lab installs it)")
class TestProgram(Folder):
    """The page's own computations, in Node.js; tests/browser has the rest."""

    def answer(self, program: str, newest_of: tuple[str, ...] = load.ONE_OF_ALL_COMMITS) -> Any:
        """Returns what a module prints as JSON; `data` is the data of the page, `src` the folder of the page's modules."""
        src = (Path(explore.__file__).parent / "src").as_uri()
        data = json.dumps(explorer_data.data(load.load(self.folder, newest_of), "", None, self.folder))
        text = f"const data = {data};\n" + program.replace("SRC", src)
        told = subprocess.run(["node", "--input-type=module"], input=text, capture_output=True, text=True)
        self.assertEqual(told.returncode, 0, told.stderr)
        return json.loads(told.stdout)

    def test_the_best_refit_is_that_of_the_program_on_the_same_file(self) -> None:
        # tests/program/results_test.cpp and test_ratios.py read the same two files.
        results = Path(__file__).resolve().parents[1] / "support" / "results"
        shutil.copy(results / "denominators.jsonl", self.folder / "results.jsonl")
        found = self.answer("""
            import { model, reference } from "SRC/model.js";
            const made = model(data);
            const chosen = (cell, measure) => reference(made, { against: "baseline", measure }, cell, null)?.contestant.id ?? null;
            const of = (measure) => Object.fromEntries(made.cells.map((cell) => [cell.l, chosen(cell, measure)]));
            console.log(JSON.stringify([of("with_motion"), of("update"), of("worst")]));""")
        expected = json.loads((results / "denominators.json").read_text())
        self.assertEqual(found, [expected] * 3)

    def test_ratios_are_those_of_the_program_on_the_same_file(self) -> None:
        # tests/program/table_test.cpp and test_ratios.py read the same two files. Times in the page have fewer digits.
        results = Path(__file__).resolve().parents[1] / "support" / "results"
        shutil.copy(results / "ratios.jsonl", self.folder / "results.jsonl")
        found = self.answer("""
            import { compare, model } from "SRC/model.js";
            const made = model(data);
            const refit = made.runs.find((run) => run.contestant.id === "refit");
            const numbers = ({ middle, low, high, isInterval }) => [middle, low, high, isInterval];
            const of = (run) => ["without_motion", "with_motion", "update", "query"].map((scope) => numbers(compare(made, run, refit, scope)));
            console.log(JSON.stringify(Object.fromEntries(made.runs.map((run) => [run.contestant.id, of(run)]))));""")
        expected = json.loads((results / "ratios.json").read_text())
        self.assertEqual(set(found), set(expected))
        for id, phases in expected.items():
            for phase, wanted, got in zip(phases, phases.values(), found[id]):
                with self.subTest(id, phase=phase):
                    for one, other in zip(got[:3], wanted[:3] if len(wanted) > 1 else wanted * 3):
                        self.assertAlmostEqual(one / other, 1, delta=2e-3)
                    self.assertEqual(got[3], len(wanted) > 1 and wanted[3])


    def test_the_recommended_line_is_the_brightest_on_the_dark_page(self) -> None:
        synthetic.write(self.folder, [synthetic.record(one, "s", 2000, "float", 10) for one in synthetic.CONTESTANTS])
        found = self.answer("""
            import { model } from "SRC/model.js";
            import { leading } from "SRC/looks.js";
            const all = model(data).contestants;
            const lists = all.map((one) => leading([one, ...all.filter((other) => other !== one)]));
            console.log(JSON.stringify(lists.map((list) => list.map((one) => [one.look.dark, one.paint ?? ""]))));""")
        self.assertGreater(len(found), 10)
        brightened = 0
        for (own, paint), *others in found:
            share = re.search(r" (\d+)%", paint)
            shown = colours.mix(own, 1 - int(share[1]) / 100) if share else own
            brightened += share is not None
            self.assertEqual({paint for _, paint in others}, {""})
            for other, _ in others:
                self.assertGreaterEqual(colours.contrast(shown, "#000000"), colours.contrast(other, "#000000"), f"{own} among others")
        brightest = max((one[0][0] for one in found), key=lambda one: colours.contrast(one, "#000000"))
        self.assertEqual(brightened, sum(one[0][0] != brightest for one in found), "the brightest one keeps its colour")

    def test_cells_count_as_in_the_report(self) -> None:
        # One scene in clips of two lengths, by two plans: the measurement with more strategies counts, of equal ones the newest. A strategy
        # that was measured again, by a newer program, has its newest run.
        def both(times: dict[str, float], frames: int, commit: str = "a") -> list[dict[str, Any]]:
            made = [line(id, [time], family="refit" if id == "refit" else "kinetic") for id, time in times.items()]
            for one in made:
                one.update(commit=commit)
                one["scene"].update(frames=frames)
            return made

        few, many, later = both({"refit": 2, "join": 0.5}, 9), both({"refit": 2, "join": 1, "tree": 4}, 7), both({"refit": 2, "join": 0.25}, 5)
        for lines in (few, few + many, many + few, few + later, later + few, many + both({"join": 8}, 7, "b"), many + both({"refit": 4, "join": 8}, 7, "b")):
            synthetic.write(self.folder, lines)
            found = self.answer("""
                import { model } from "SRC/model.js";
                import { situations } from "SRC/advice.js";
                const told = (one) => one && [one.id, one.speed, one.own.length];
                console.log(JSON.stringify(situations(model(data)).map((one) => [one.asks, one.cells, one.advice.map(told)])));""", load.ONE_OF_EACH_COMMIT)
            wanted = advice.situations(advice.cells(load.load(self.folder)))
            self.assertEqual([(asks, cells) for asks, cells, _ in found], [(one.asks, one.cells) for one in wanted])
            self.assertEqual([one.cells for one in wanted], [1])
            for (_, _, told), one in zip(found, wanted):
                for own, (_, best) in zip(told, one.advice):
                    assert best is not None
                    self.assertEqual((own[0], own[2]), (best.id, best.measured))
                    self.assertAlmostEqual(own[1] / best.speed, 1)


class TestPage(Folder):
    def test_text_of_results_cannot_end_the_data(self) -> None:
        data = {"plans": [{"name": "</script><b>", "description": ""}], "title": ""}
        page = explore.page(data, "var a = '</script>';", "")
        self.assertEqual(page.count("</script>"), 2)
        self.assertIn("<title>kbvh explorer: &lt;/script&gt;&lt;b&gt; study</title>", page)

    def test_without_a_program_the_report_is_written_and_says_so(self) -> None:
        synthetic.write(self.folder, [line("bottom_up", [1.0], family="refit"), line("k", [2.0])])
        with mock.patch.object(explore, "PROGRAM", self.folder / "nowhere"):
            said = io.StringIO()
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
                self.assertEqual(report.main([str(self.folder), "--figures", "none"]), 0)
            self.assertIn("report: explorer.html is not written: the explorer's program is not built", said.getvalue())
            self.assertNotIn("explorer.html", (self.folder / "report.html").read_text())
            said = io.StringIO()
            with contextlib.redirect_stderr(said):
                self.assertEqual(explore.main([str(self.folder)]), 2)
            self.assertIn("build builds it, with Node.js and npm", said.getvalue())
        self.assertFalse((self.folder / "explorer.html").exists())

    def test_a_program_of_other_sources_is_refused(self) -> None:
        room, program = self.folder / "explorer", self.folder / "explorer" / "dist"
        (room / "src" / "views").mkdir(parents=True)
        program.mkdir()
        for name in ("src/main.js", "src/views/answer.js", "build", "package.json", "package-lock.json", "dist/explorer.js", "dist/explorer.css"):
            (room / name).write_text(name)
        with mock.patch.object(explore, "PROGRAM", program):
            self.assertRaisesRegex(explore.NotBuilt, "built from other sources", explore.program)
            # As `build` does it.
            script = (Path(explore.__file__).parent / "build").read_text()
            command = next(one for one in script.splitlines() if one.startswith("sources="))
            stamp = subprocess.run(["bash", "-c", f'{command}; echo "$sources"'], cwd=room, capture_output=True, text=True, check=True).stdout
            (program / "sources.sha256").write_text(stamp)
            self.assertEqual(explore.program(), ("dist/explorer.js", "dist/explorer.css"))
            (room / "src" / "views" / "answer.js").write_text("newer")
            self.assertRaisesRegex(explore.NotBuilt, "built from other sources", explore.program)
            shutil.rmtree(room / "src")  # as installed: without sources there is nothing to compare with
            self.assertEqual(explore.program(), ("dist/explorer.js", "dist/explorer.css"))

    def test_damaged_results_are_refused(self) -> None:
        program = self.folder / "dist"
        program.mkdir()
        for name in ("explorer.js", "explorer.css"):
            (program / name).write_text("")
        (self.folder / "results.jsonl").write_text('{"schema": 7}\n')
        said = io.StringIO()
        with mock.patch.object(explore, "PROGRAM", program), contextlib.redirect_stderr(said):
            self.assertEqual(explore.main([str(self.folder)]), 2)
        self.assertIn("results.jsonl line 1: schema 7 is not known", said.getvalue())
        self.assertFalse((self.folder / "explorer.html").exists())


class TestColours(unittest.TestCase):
    def test_every_family_is_seen_on_both_pages(self) -> None:
        for colour, _ in [*colours.FAMILIES.values(), *colours.FREE]:
            for shade in colours.SHADES:
                own = colours.mix(colour, shade)
                self.assertGreaterEqual(colours.contrast(colours.on_dark(own), colours.DARK_PAGE), colours.DARK_CONTRAST)
        self.assertAlmostEqual(colours.contrast("#000000", "#FFFFFF"), 21)

    def test_members_of_a_family_differ_on_the_dark_page(self) -> None:
        members = [f"member {i}" for i in range(len(colours.SHADES))]
        for family in colours.FAMILIES:
            found = colours.looks((name, name, family) for name in members)
            dark = [str(colours.for_page(look)["dark"]) for look in found.values()]
            for one, other in itertools.combinations(dark, 2):
                self.assertGreaterEqual(colours.contrast(one, other), 1.15, f"{family}: {one} and {other}")
            for one in dark:
                self.assertGreaterEqual(colours.contrast(one, colours.DARK_PAGE), colours.DARK_CONTRAST)


if __name__ == "__main__":
    unittest.main()
