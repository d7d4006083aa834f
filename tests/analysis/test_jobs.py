"""Parts of experiments/sweep: cores and their locks, and records that are joined."""

import json
import os
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import paths

sys.path.insert(0, str(paths.HERE.parents[1] / "experiments" / "jobs"))
import cores  # noqa: E402
import records  # noqa: E402


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name)


class Cores(Folder):
    def listed(self, **siblings):
        for cpu, text in siblings.items():
            (self.path / cpu).write_text(text + "\n")
        return mock.patch.object(cores, "SIBLINGS", str(self.path / "cpu{}"))

    def test_hyperthreads_are_one_core(self):
        with self.listed(cpu0="0,2", cpu1="1,3", cpu2="0,2", cpu3="1,3"):
            self.assertEqual(cores.cores_of({0, 1, 2, 3}), {0: 0, 1: 1})
            # A scheduler's share of a core has the core's number, so that two shares of one core exclude each other.
            self.assertEqual(cores.cores_of({2, 3}), {2: 0, 3: 1})
        with self.listed(cpu0="0-1", cpu1="0-1", cpu2="2-3"):
            self.assertEqual(cores.cores_of({0, 1, 2}), {0: 0, 2: 2})
        with self.listed():
            self.assertEqual(cores.cores_of({900, 901}), {900: 900, 901: 901})

    def test_a_core_is_held_once(self):
        first = cores.try_lock(self.path, 3)
        self.assertIsNotNone(first)
        self.assertIsNone(cores.try_lock(self.path, 3))
        second = cores.try_lock(self.path, 4)
        self.assertIsNotNone(second)
        os.close(first)
        third = cores.try_lock(self.path, 3)
        self.assertIsNotNone(third)
        os.close(second)
        os.close(third)

    def test_more_cores_than_there_are(self):
        with self.assertRaises(SystemExit) as ended:
            cores.hold_cores(len(cores.usable_cores()) + 1)
        self.assertIn("physical cores of its own", str(ended.exception))


class Records(Folder):
    def file(self, name, *lines):
        file = self.path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"".join(line if isinstance(line, bytes) else (json.dumps(line) + "\n").encode() for line in lines))

    def joined(self, *jobs):
        added = records.join(self.path, list(jobs))
        return added, [record for _, record in records.read(self.path / "results.jsonl")]

    def test_in_the_order_of_jobs_and_once(self):
        a, b, c = {"key": "a", "n": 1}, {"key": "b", "n": 1}, {"key": "c", "n": 1}
        self.file("jobs/one/1.jsonl", b)
        self.file("jobs/two/1.jsonl", c)
        self.file("jobs/other/1.jsonl", {"key": "d"})  # of another plan
        self.file("results.jsonl", a)
        before = (self.path / "results.jsonl").read_bytes()
        self.assertEqual(self.joined("one", "two"), (2, [a, b, c]))
        self.assertTrue((self.path / "results.jsonl").read_bytes().startswith(before))
        self.assertEqual(self.joined("one", "two")[0], 0)

    def test_the_newest_finished_record_of_a_key_counts(self):
        """The cases of tests/program/merge_test.cpp: `kbvh merge` has the same rule."""

        def record(run, day, **more):
            return {"key": "k", "run": run, "when": f"2026-01-0{day}T00:00:00Z", **more}

        first, second, failed = record("r1", 1), record("r2", 2), record("r3", 3, unfinished=True)
        self.file("jobs/one/1.jsonl", failed, second)
        self.file("jobs/two/1.jsonl", first)
        self.assertEqual(self.joined("one", "two"), (1, [second]))
        self.assertEqual(self.joined("two", "one")[0], 0)
        self.file("jobs/three/1.jsonl", record("r4", 2))  # as new: the one that stands later
        self.assertEqual(self.joined("three")[1][-1]["run"], "r4")
        self.file("jobs/three/2.jsonl", record("r5", 4, unfinished=True))
        self.assertEqual(self.joined("one", "two", "three")[0], 0)
        self.assertEqual(self.joined("three", "two", "one")[0], 1)  # r2 and r4 have changed places
        self.assertEqual(self.joined("three", "two", "one")[0], 0)

    def test_a_day_that_does_not_exist_is_not_the_newest(self):
        """The cases of tests/program/merge_test.cpp."""
        for wrong in ("2999-13-45", "2999-13-45T00:00:00Z", "2999-02-29T00:00:00Z", "2999-01-01T24:00:00Z", "2999-1-1T0:00:00Z", "", 7):
            with self.subTest(wrong):
                self.assertEqual(records.rank({"when": wrong}), (True, ""))
        self.assertEqual(records.rank({"when": "2026-01-31T23:59:59Z"}), (True, "2026-01-31T23:59:59Z"))
        good, bad = {"key": "k", "run": "1", "when": "2026-01-01T00:00:00Z"}, {"key": "k", "run": "2", "when": "2999-13-45T00:00:00Z"}
        self.file("jobs/one/1.jsonl", good, bad)
        self.assertEqual(self.joined("one"), (1, [good]))

    def test_a_job_is_done_if_its_records_are_there(self):
        def code():
            return records.done_code(self.path, "one", records.keys(self.path / "results.jsonl"))

        done = {"attempt": "a", "exit": 0, "keys": ["a", "b"]}
        self.file("jobs/one/1.jsonl", {"key": "a"})
        self.assertIsNone(code())
        self.file("jobs/one/done", done)
        self.assertIsNone(code())  # b is nowhere
        self.file("jobs/one/2.jsonl", {"key": "b"})
        self.assertEqual(code(), 0)
        self.file("jobs/one/2.jsonl")
        self.assertIsNone(code())
        self.file("results.jsonl", {"key": "b"}, {"key": "c"})
        self.assertEqual(code(), 0)
        for damaged in (b"", b"{", b"[1]", b"3", b'{"exit": 0}', {**done, "exit": 3}, {**done, "exit": "x"}, {**done, "keys": 3}):
            self.file("jobs/one/done", damaged)
            self.assertIsNone(code(), damaged)

    def test_lines_stay_as_they_are(self):
        line = b'{"key": "a",   "t": 1.000, "n": 18446744073709551615}\n'
        self.file("jobs/one/1.jsonl", line)
        self.joined("one")
        self.assertEqual((self.path / "results.jsonl").read_bytes(), line)

    def test_unfinished_ones_give_way(self):
        short, whole = {"key": "a", "unfinished": True}, {"key": "a", "n": 1}
        self.file("jobs/one/1.jsonl", short)
        self.assertEqual(self.joined("one"), (1, [short]))
        self.assertEqual(self.joined("one")[0], 0)
        self.file("jobs/one/2.jsonl", whole)
        self.assertEqual(self.joined("one"), (1, [short, whole]))
        self.assertEqual(self.joined("one")[0], 0)

    def test_half_lines(self):
        a, b = {"key": "a"}, {"key": "b"}
        self.file("results.jsonl", a, b'{"key": "x')
        self.file("jobs/one/1.jsonl", b, b'{"key": "c')
        self.file("jobs/one/2.jsonl", b"[1]\n", b'{"key": 3}\n', b"\xff\n")
        self.assertEqual(self.joined("one"), (1, [a, b]))
        self.assertIn(b'{"key": "x\n', (self.path / "results.jsonl").read_bytes())

    def test_a_full_disk_is_an_error(self):
        with mock.patch.object(records.os, "write", return_value=3):
            self.file("jobs/one/1.jsonl", {"key": "a"})
            with self.assertRaises(OSError) as raised:
                records.join(self.path, ["one"])
        self.assertIn("No space left", str(raised.exception))


if __name__ == "__main__":
    unittest.main()
