"""What a report makes of damaged input and full disks, and of scenes that share a name: nothing is lost, nothing is mixed up."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import sys
import unittest
from typing import Any, Callable

import paths
import shared
import synthetic

from figures import scene_pictures
from report import report, scene_cards
from results import files, load


def small() -> list[dict[str, Any]]:
    """Two contestants at one size and two l."""
    wanted = [c for c in synthetic.CONTESTANTS if c["id"] in ("bottom_up", "kinetic_aabb")]
    return [synthetic.record(c, "tablecloth", 2000, "float", l) for l in (1, 30) for c in wanted]


class Case(shared.InFolder):
    def setUp(self) -> None:
        super().setUp()
        self.folder = self.folder / "results"

    def run_report(self, figures: str = "none") -> tuple[int, str]:
        code, _, err = shared.said(report.main, self.folder, "--figures", figures, "--print")
        return code, err

    def page(self, figures: str = "none") -> str:
        code, err = self.run_report(figures)
        self.assertEqual(code, 0, err)
        return (self.folder / "report.html").read_text(encoding="utf-8")


class TestResults(Case):
    def test_everybody_was_refused(self) -> None:
        for reason, violation in (("it is too large", ""), ("", "frame 3: lost a pair")):
            with self.subTest(reason or violation):
                synthetic.write(self.folder, [synthetic.refused(line, reason, violation) for line in small()])
                self.assertIn(reason or violation, self.page("main" if reason else "none"))

    def test_a_byte_order_mark_costs_no_result(self) -> None:
        synthetic.write(self.folder, small())
        file = self.folder / "results.jsonl"
        file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
        found = load.load(self.folder)
        self.assertEqual(len(found.runs), len(small()))
        self.assertFalse([note for note in found.notes if "skipped" in note])

    def test_line_separators_of_unicode_end_no_line(self) -> None:
        synthetic.write(self.folder, [dict(line, study="a\u2028b\x85c\x0bd") for line in small()])
        file = self.folder / "results.jsonl"
        file.write_text(file.read_text().replace("\\u2028", "\u2028").replace("\\u0085", "\x85"), encoding="utf-8")
        self.assertEqual(len(load.load(self.folder).runs), len(small()))

    def test_a_line_that_is_no_result_is_skipped_with_a_note(self) -> None:
        good = small()
        wrong: dict[str, str] = {
            "[1, 2]": "it is no result",
            "{}": "it is no result",
            "[" * 100000: "it is not JSON",
            "3": "it is no result",
            json.dumps(good[0]).replace('"primitives": 2000', '"primitives": NaN'): "it is not JSON",
            json.dumps(good[0]).replace('"primitives": 2000', '"primitives": 1e999'): "scene.primitives is too large",
            json.dumps(good[0]).replace('"primitives": 2000', '"primitives": 1' + "0" * 400): "scene.primitives is too large",
        }
        for line, why in wrong.items():
            for at in (0, 2, len(good)):
                with self.subTest(line[:40], at=at):
                    lines = [json.dumps(one) for one in good]
                    lines.insert(at, line)
                    self.folder.mkdir(exist_ok=True)
                    (self.folder / "results.jsonl").write_text("\n".join(lines) + "\n")
                    found = load.load(self.folder)
                    self.assertEqual(len(found.runs), len(good))
                    said = f"Line {at + 1} of results.jsonl was skipped: {why}"
                    self.assertTrue(any(said in note or "breaks off" in note for note in found.notes), found.notes)

    def test_changes_of_geometry_are_part_of_the_times(self) -> None:
        line = synthetic.line("bottom_up", 2.0)
        for repetition in line["times"]["repetitions"]:
            repetition.update(plan_changes=1.0, geometry_changes=4.0)
        synthetic.write(self.folder, [line])
        self.assertEqual(load.load(self.folder).runs["updating"].iloc[0], 7.0)


class TestFilesBeside(Case):
    def test_are_named_where_they_are_damaged(self) -> None:
        damaged = {
            "theory.json": ('{"schema": "kbvh-theory-1"}', '{"schema": "kbvh-theory-1", "claims": [3]}', "[" * 100000, ""),
            "stress.json": ('{"schema": "kbvh-stress-1", "rows": 3}', '{"schema": "kbvh-stress-1"}', '{"sch'),
            "ccd.json": ("{}", "[]", '{"files": [{}], "commit": ""}'),
            "targets.json": ("{}", "[3]", "[" * 100000),
        }
        for name, contents in damaged.items():
            for content in contents:
                with self.subTest(name, content=content[:50]):
                    synthetic.write(self.folder, small())
                    (self.folder / name).write_text(content)
                    code, err = self.run_report("main" if name == "theory.json" else "none")
                    self.assertEqual(code, 2)
                    self.assertRegex(err, rf"^report: [^\n]*{re.escape(name)}[^\n]*\n$")
                    (self.folder / name).unlink()


class TestScenes(Case):
    def write_scene(self, name: str, card: str, colour: float) -> None:
        folder = self.folder / "scenes" / f"{name}-{card}"
        folder.mkdir(parents=True)
        body = {
            "name": f"body of {card}", "keyframes": 2, "nodes": 3, "sides_changed_per_keyframe": colour,
            "sides_changed_at_most": colour, "mean_step_in_edges": 1, "largest_step_in_edges": 1,
        }  # fmt: skip
        (folder / "card.json").write_text(json.dumps({"scene": name, "hash": card, "bodies": [body]}))
        (folder / "0-x.obj").write_text(f"v 0 0 0\nv 1 0 {colour}\nv 0 1 0\nf 1 2 3\n")

    def lines_of(self, name: str, card: str, scene_hash: str, primitives: int = 2000, origin: str = "files") -> list[dict[str, Any]]:
        lines = [line for line in small() if line["scene"]["per_keyframe"] == 1]
        for line in lines:
            line["scene"].update(name=name, card=card, hash=scene_hash, origin=origin, primitives=primitives)
        return lines

    def sections(self) -> dict[str, str]:
        """Each scene's part of the page."""
        parts = re.split(r'<details id="scene-\d+">\n<summary><h3>', self.page())[1:]
        return {part.split("<")[0].strip(): part for part in parts}

    def picture_of(self, scene: str) -> bytes:
        """What is drawn of a scene."""
        runs = load.load(self.folder).runs
        folder = scene_pictures.written_out(self.folder).of(runs[runs["scene"] == scene])
        assert folder is not None
        figure = scene_cards.view(folder, self.folder / "figures", scene)
        return (self.folder / figure.file).read_bytes()

    def test_of_one_name_have_cards_and_pictures_of_their_own(self) -> None:
        self.write_scene("mine", "aaaaaaaaaaaaaaaa", 0.25)
        self.write_scene("mine", "bbbbbbbbbbbbbbbb", 0.5)
        for second in (2000, 2400):
            with self.subTest(second):
                first = self.lines_of("mine", "aaaaaaaaaaaaaaaa", "1111111122222222")
                synthetic.write(self.folder, first + self.lines_of("mine", "bbbbbbbbbbbbbbbb", "3333333344444444", second))
                sections = self.sections()
                self.assertEqual(set(sections), {"mine", "mine (hash 11111111)"})
                self.assertIn("body of bbbbbbbbbbbbbbbb", sections["mine"])
                self.assertNotIn("body of aaaa", sections["mine"])
                self.assertIn("body of aaaaaaaaaaaaaaaa", sections["mine (hash 11111111)"])
                self.assertNotEqual(*[self.picture_of(scene) for scene in sections])

    def test_a_corrected_mesh_takes_over_its_name(self) -> None:
        self.write_scene("mine", "aaaaaaaaaaaaaaaa", 0.25)
        synthetic.write(self.folder, self.lines_of("mine", "aaaaaaaaaaaaaaaa", "1111111122222222"))
        before, drawn = self.sections()["mine"], self.picture_of("mine")
        self.write_scene("mine", "bbbbbbbbbbbbbbbb", 0.5)
        with (self.folder / "results.jsonl").open("a") as out:
            for line in self.lines_of("mine", "bbbbbbbbbbbbbbbb", "3333333344444444"):
                out.write(json.dumps(line) + "\n")
        after = self.sections()
        self.assertIn("body of aaaaaaaaaaaaaaaa", before)
        self.assertIn("body of bbbbbbbbbbbbbbbb", after["mine"])
        self.assertNotEqual(self.picture_of("mine"), drawn)

    def test_sizes_and_scalars_of_one_scene_stay_together(self) -> None:
        lines = []
        for primitives in (2000, 8000):
            for scalar in ("float", "double"):
                of_scene = self.lines_of("mine", f"c{primitives}", f"{scalar}{primitives}", primitives, "built_in")
                for line in of_scene:
                    line["scene"]["scalar"] = scalar
                lines += of_scene
        synthetic.write(self.folder, lines)
        self.assertEqual(set(load.load(self.folder).runs["scene"]), {"mine"})
        for line in lines:  # as written before scenes had cards
            del line["scene"]["card"]
        synthetic.write(self.folder, lines)
        self.assertEqual(set(load.load(self.folder).runs["scene"]), {"mine"})

    def test_damaged_cards_and_meshes_cost_the_picture_only(self) -> None:
        self.write_scene("mine", "aaaaaaaaaaaaaaaa", 0.25)
        folder = self.folder / "scenes" / "mine-aaaaaaaaaaaaaaaa"
        synthetic.write(self.folder, self.lines_of("mine", "aaaaaaaaaaaaaaaa", "1111111122222222"))
        for name, content in (("0-x.obj", "v 0 0\nf 1 2 9\n"), ("card.json", '{"hash": "a'), ("card.json", '{"bodies": [{"name": 1}]}')):
            with self.subTest(name, content=content):
                (folder / name).write_text(content)
                code, err = self.run_report("main")
                self.assertEqual(code, 0, err)
                self.assertIn("picture", err)


class TestFullDisk(Case):
    def test_every_file_stays_as_it_was(self) -> None:
        synthetic.write(self.folder, small())
        self.page("main")
        before = {file: file.read_bytes() for file in self.folder.rglob("*") if file.is_file()}

        def full(size: int) -> Callable[[], None]:
            def limit() -> None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

            return limit

        command = [sys.executable, str(paths.HERE.parents[1] / "analysis" / "report.py"), str(self.folder), "--title", "another"]
        for size in (0, 20000):
            with self.subTest(size):
                run = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=full(size),
                                     env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})  # fmt: skip
                self.assertEqual(run.returncode, 2, run.stderr)
                self.assertRegex(run.stderr, r"report: \S+ cannot be written: File too large\.\n$")
                for file, content in before.items():
                    self.assertEqual(file.read_bytes()[:20], content[:20], file.name)
                    self.assertGreater(file.stat().st_size, 0.5 * len(content), file.name)
                left = {file for file in self.folder.rglob("*") if file.is_file()} - set(before)
                self.assertEqual(left, set(), "temporary files")

    def test_whole_files_only(self) -> None:
        self.folder.mkdir()
        file = self.folder / "x"
        files.write_whole(file, "first")
        with self.assertRaises(OSError) as raised:
            files.write_whole(self.folder / "none" / "x", b"")
        self.assertEqual(raised.exception.filename, str(self.folder / "none" / "x"))
        self.assertEqual([one.name for one in self.folder.iterdir()], ["x"])


if __name__ == "__main__":
    unittest.main()
