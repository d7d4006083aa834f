"""The reference run: its verdicts follow from its results, by the claims as they are today."""

from __future__ import annotations

import json
import lzma
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import paths
import synthetic

from claims import agree, claims, reference
from results import keep
from results.files import ResultError
from results.load import load

REFERENCE = paths.HERE.parents[1] / "analysis" / "reference"


class TestReference(unittest.TestCase):
    def test_verdicts_follow_from_the_results(self) -> None:
        found = claims.evaluate(load(REFERENCE), REFERENCE)
        computed = {row.id: row.verdict for row in found.rows}
        self.assertEqual(computed, agree.verdicts(REFERENCE), "after a change of claims on purpose: python3 analysis/claims.py analysis/reference")
        self.assertNotIn(claims.OPEN, computed.values())


class TestKeeping(unittest.TestCase):
    def setUp(self) -> None:
        place = tempfile.TemporaryDirectory(prefix="kbvh-analysis-")
        self.addCleanup(place.cleanup)
        self.place = Path(place.name)
        self.folder = synthetic.write(self.place / "run", [synthetic.add_frames(one) if one["times"] else one for one in synthetic.study()])

    def test_what_is_kept_differs_in_the_fourth_digit_of_frames_only(self) -> None:
        content = keep.packed(self.folder / "results.jsonl")
        self.assertEqual(content, keep.packed(self.folder / "results.jsonl"), "the same bytes at any time")
        kept = [json.loads(line) for line in lzma.decompress(content).decode().splitlines()]
        given = [json.loads(line) for line in (self.folder / "results.jsonl").read_text().splitlines()]
        self.assertEqual(len(kept), len(given))
        frames = 0
        for one, other in zip(kept, given):
            for mine, whole in zip((one["times"] or {}).get("repetitions", []), (other["times"] or {}).get("repetitions", [])):
                for name in keep.OF_FRAMES:
                    for a, b in zip(mine[name], whole[name]):
                        self.assertLessEqual(abs(a - b), 0.5 * 10 ** (1 - keep.DIGITS) * b)
                        frames += 1
                    mine[name] = whole[name]
            self.assertEqual(one, other)
        self.assertGreater(frames, 100)

    def test_packed_results_are_read_where_there_are_no_others(self) -> None:
        whole = load(self.folder)
        packed = self.folder / "results.jsonl.xz"
        packed.write_bytes(lzma.compress((self.folder / "results.jsonl").read_bytes()))
        (self.folder / "results.jsonl").unlink()
        self.assertTrue(load(self.folder).runs.equals(whole.runs))
        packed.write_bytes(packed.read_bytes()[:-20])
        with self.assertRaisesRegex(ResultError, "results.jsonl cannot be read: it is damaged"):
            load(self.folder)
        packed.write_bytes(b"not packed")
        with self.assertRaisesRegex(ResultError, "results.jsonl cannot be read"):
            load(self.folder)

    def test_a_reference_is_of_one_commit_and_its_verdicts_are_of_what_is_kept(self) -> None:
        out = self.place / "reference"
        found = reference.make(self.folder, out)
        self.assertEqual(sorted(one.name for one in out.iterdir()), ["claims.json", "results.jsonl.xz"])
        self.assertEqual({row.id: row.verdict for row in found.rows}, agree.verdicts(out))
        lines = (self.folder / "results.jsonl").read_text().splitlines()
        (self.folder / "results.jsonl").write_text("\n".join([*lines, lines[0].replace(json.loads(lines[0])["commit"], "f" * 12)]) + "\n")
        command = [sys.executable, str(paths.HERE.parents[1] / "analysis" / "keep_reference.py"), str(self.folder), "--out", str(out)]
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("2 commits", done.stderr)


class TestAgreement(unittest.TestCase):
    def test_only_verdicts_of_both_can_differ(self) -> None:
        first = {"E1": "holds", "E2": "holds", "E3": agree.OPEN, "E4": agree.OPEN, "E5": "holds"}
        second = {"E1": "holds", "E2": "does not hold", "E3": "holds", "E4": agree.OPEN, "E6": "holds"}
        found = agree.agreement(first, second)
        self.assertEqual((found.same, found.different), (["E1"], [("E2", "holds", "does not hold")]))
        self.assertEqual((found.only_first, found.only_second, found.open), (["E5"], ["E3", "E6"], ["E4"]))

    def test_exit_codes(self) -> None:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            for folder, verdict in (("a", "holds"), ("b", "holds"), ("c", "does not hold")):
                (Path(name) / folder).mkdir()
                record = {"claims": [{"id": "E1", "verdict": verdict}]}
                (Path(name) / folder / "claims.json").write_text(json.dumps(record))
            at = [str(Path(name) / folder) for folder in "abcd"]
            self.assertEqual([agree.main([at[0], other]) for other in at[1:]], [0, 1, 2])


if __name__ == "__main__":
    unittest.main()
