"""Kills a study at random moments, again and again, and looks at what is left: never more than the run in progress is lost,
and the result file can always be read.

usage: killed_study.py KBVH [TIMES] [SEED]
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PLAN = {
    "name": "to be killed",
    "scenes": [{"builtin": "waving_sheet", "triangles": [200, 800, 1800], "keyframes": 8}],
    "strategies": ["bottom_up", "bottom_up_period", "rebuild", "kinetic_aabb", "interval_join"],
    "l": [1, 3],
    "repetitions": 2,
}


def readable(file: Path) -> list[dict]:
    """All lines as records; half a line is a failure."""
    if not file.exists():
        return []
    *whole, rest = file.read_bytes().split(b"\n")
    records = [json.loads(line) for line in whole if line]
    if rest:
        raise SystemExit(f"{file}: half a line of {len(rest)} bytes: a record is to be written in one piece")
    return records


def main() -> int:
    program, times = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    chance = random.Random(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    with tempfile.TemporaryDirectory(prefix="kbvh-killed-") as name:
        folder = Path(name)
        plan, out = folder / "plan.json", folder / "out"
        plan.write_text(json.dumps(PLAN))
        command = [program, "run", "--plan", str(plan), "--out", str(out)]
        started = time.monotonic()
        subprocess.run(command, check=True, capture_output=True)
        whole = time.monotonic() - started
        wanted = {record["key"] for record in readable(out / "results.jsonl")}

        killed = clips = named = 0
        while killed < times:
            for file in sorted(out.rglob("*"), reverse=True):
                file.unlink() if file.is_file() else file.rmdir()
            before: set[str] = set()
            clips += 1
            for _ in range(1000):
                run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                try:
                    said = run.communicate(timeout=chance.uniform(0.0, 0.5 * whole))[1]
                    named += said.count("an earlier run was ended from outside while ")
                    if run.returncode != 0:
                        raise SystemExit(f"a run that went on where another was killed ended with {run.returncode}")
                    break
                except subprocess.TimeoutExpired:
                    run.send_signal(signal.SIGKILL)
                    said = run.communicate()[1]
                    named += said.count("an earlier run was ended from outside while ")
                    killed += 1
                records = readable(out / "results.jsonl")
                keys = [record["key"] for record in records]
                if len(set(keys)) != len(keys):
                    raise SystemExit("a configuration was measured again, though its record was there")
                if not before <= set(keys):
                    raise SystemExit(f"records were lost: {sorted(before - set(keys))}")
                before = set(keys)
            if {record["key"] for record in readable(out / "results.jsonl")} != wanted:
                raise SystemExit("the study ended, but not with all of its configurations")
            if left := list(out.rglob("*.measuring")):
                raise SystemExit(f"a study that has ended measures nothing, but there is {left}")
    if not 0 < named <= killed:
        raise SystemExit(f"killed {killed} times, and {named} times the next run said what was being measured")
    print(
        f"killed {killed} times in {clips} studies of {len(wanted)} configurations: nothing lost but the run in progress, which the"
        f" next run named {named} times"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
