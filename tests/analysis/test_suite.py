"""tests/run stops at once, with the reason, where something that runs during a build fails: played with programs that stand for
all those that it calls."""

import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

import paths

#: What each program does unless a case says otherwise.
SOUND = {
    "experiments/setup": "true",
    "experiments/lab": "echo the lab",
    "tests/hash/compare": "echo equal hashes",
    "tests/fuzz/run": "true",
    "tests/skipped.py": "true",
    "tests/suites.py": 'echo "tested $*" >> calls',
    "bin/cmake": 'mkdir -p build/dev build/sanitized; [[ $* != *--build* ]] || echo "built $*" >> calls',
    "bin/ctest": 'echo "tested $*" >> calls',
    "bin/git": "true",
    "bin/clang-format": "true",
}
LONG = "echo $$ > long; sleep 100; echo whole >> calls"


class Run(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="kbvh-suite-")
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)

    def play(self, *options: str, **programs: str) -> "subprocess.CompletedProcess[str]":
        for name, code in {**SOUND, **{name.replace("__", "-"): code for name, code in programs.items()}}.items():
            file = self.root / next((known for known in SOUND if known.endswith("/" + name)), name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.unlink(missing_ok=True)  # the last play may still run it, and such a file cannot be written
            file.write_text(f"#!/bin/bash\n{code}\n")
            file.chmod(0o755)
        shutil.copy(paths.HERE.parents[1] / "tests" / "run", self.root / "tests" / "run")
        environment = {**os.environ, "PATH": f"{self.root / 'bin'}:{os.environ['PATH']}"}
        return subprocess.run([self.root / "tests" / "run", *options], capture_output=True, text=True, env=environment, timeout=90)

    def calls(self) -> str:
        file = self.root / "calls"
        return file.read_text() if file.exists() else ""

    def stopped(self) -> None:
        """The long work was ended, with all of its processes."""
        self.assertNotIn("whole", self.calls())
        group = int((self.root / "long").read_text())
        with self.assertRaises(ProcessLookupError):
            for _ in range(100):  # a process that was killed is there until its parent knows
                os.killpg(group, 0)
                subprocess.run(["sleep", "0.1"], check=True)

    def test_all_is_done(self) -> None:
        run = self.play()
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual(self.calls(), "built --build --preset dev\ntested build/dev -LE slow|sanitized|deep\n")
        self.assertIn("Format: correct.", run.stdout)

    def test_the_rest_is_done(self) -> None:
        run = self.play("--deep")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual(self.calls().count("built"), 2)
        for said in ("build/sanitized --output-on-failure -j 2 -L sanitized\n", "build/dev --output-on-failure -j 4 -L deep\n"):
            self.assertIn("tested --test-dir " + said, self.calls())
        for said in ("the lab", "equal hashes"):
            self.assertIn(said, run.stdout)

    def test_a_suite_or_the_format_that_fails_is_told(self) -> None:
        self.assertEqual(self.play(**{"suites.py": "exit 3"}).returncode, 3)
        run = self.play(**{"clang__format": "echo wrong; exit 1"})
        self.assertEqual(run.returncode, 1)
        self.assertIn("tests/run: format failed\n", run.stderr)

    def test_packages_that_cannot_be_installed_end_the_build(self) -> None:
        run = self.play(setup='[[ $* == --compile ]] && exit 0; sleep 1; echo "E: dpkg was interrupted"; exit 100', cmake=f"mkdir -p build; [[ $* != *--build* ]] || {{ {LONG}; }}")
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertIn("E: dpkg was interrupted\ntests/run: setup failed\n", run.stderr)
        self.stopped()

    def test_packages_are_awaited_and_their_failure_told(self) -> None:
        run = self.play(setup='[[ $* == --compile ]] && exit 0; sleep 2; echo "E: no space left"; exit 100')
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertIn("E: no space left\ntests/run: setup failed\n", run.stderr)
        self.assertEqual(self.calls().count("built"), 1)

    def test_a_failure_beside_ends_the_sanitized_build(self) -> None:
        run = self.play("--deep", setup='[[ $* == --tests ]] && exit 0; sleep 1; echo "no emscripten"; exit 1',
                        cmake=f"mkdir -p build; [[ $* != *--build*sanitized* ]] || {{ {LONG}; }}")
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertIn("no emscripten\ntests/run: setup failed\n", run.stderr)
        self.stopped()

    def test_a_failure_beside_ends_the_sanitized_tests(self) -> None:
        run = self.play("--deep", lab='sleep 1; echo "no engine"; exit 1', ctest=LONG)
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertIn("no engine\ntests/run: lab failed\n", run.stderr)
        self.stopped()

    def test_a_build_that_fails_is_the_end(self) -> None:
        run = self.play(cmake='mkdir -p build; [[ $* != *--build* ]] || { echo "an error" >&2; exit 7; }')
        self.assertEqual(run.returncode, 7, run.stderr)
        self.assertEqual(self.calls(), "")

    def test_an_interruption_ends_the_build(self) -> None:
        run = self.play(cmake=f"mkdir -p build; [[ $* != *--build* ]] || {{ (sleep 1; kill -TERM $(cat runner)) & {LONG}; }}", setup='echo $PPID > runner')
        self.assertEqual(run.returncode, 130, run.stderr)
        self.stopped()


if __name__ == "__main__":
    unittest.main()
