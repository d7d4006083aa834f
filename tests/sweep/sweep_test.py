"""Runs small plans by experiments/sweep and by `kbvh run`, and compares: the same records except for times.

usage: sweep_test.py KBVH SWEEP PART [TIMES] [SEED]
Parts: local, killed (kills workers at random), disk (a disk that fills up), slurm (a cluster of this machine alone).
A part that is not possible here ends with code 77, which CTest shows as skipped.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Iterator

import slurm

SKIPPED = 77

PLAN = {
    "name": "to be cut",
    "scenes": [{"builtin": "waving_sheet", "triangles": [200, 450], "keyframes": 5}],
    "strategies": ["bottom_up", "rebuild", "kinetic_aabb", "interval_join"],
    "l": [1, 3],
    "repetitions": 2,
    "studies": [{"scalars": ["float", "double"]}, {"name": "again", "strategies": ["bottom_up", "top_down"], "l": 3}],
}
JOBS = 10  # scenes x l x scalars, and the second study's two tables
SCENES = 2


def require(holds: bool, what: str, run: subprocess.CompletedProcess[str] | None = None) -> None:
    if not holds:
        raise SystemExit(f"FAILED: {what}" + (f"\ncode {run.returncode}\n{run.stdout}\n{run.stderr}" if run else ""))


def lines_of(file: Path, torn: bool) -> Iterator[dict[str, Any]]:
    """Yields the records of a file. Lines are whole, but for the beginnings that a full disk leaves (`torn`)."""
    for line in file.read_bytes().split(b"\n"):
        try:
            if line:
                yield json.loads(line)
        except ValueError:
            require(torn and line.startswith(b"{"), f"{file} has a line that is no record: {line[:100]!r}")


def in_two_studies(record: dict[str, Any]) -> bool:
    """Two jobs measure these configurations; the newest record counts, and names its own study."""
    scene = record["scene"]
    return record["strategy"]["id"] == "bottom_up" and scene["scalar"] == "float" and scene["per_keyframe"] == 3


def without_times(file: Path, torn: bool = False) -> dict[str, Any]:
    """Returns by key the content of each record, except times and what depends on when and by which job it was made."""
    found = {}
    for record in lines_of(file, torn):
        times = record.pop("times")
        for name in ("run", "when"):
            record.pop(name)
        if in_two_studies(record):
            record.pop("study")
        record["times"] = {"frames": times["frames"], "repetitions": len(times["repetitions"])}
        require(record["key"] not in found, f"{file} has {record['key']} twice")
        found[record["key"]] = record
    return found


class Study:
    """A plan, its records by `kbvh run`, and folders for sweeps of it."""

    def __init__(self, folder: Path, kbvh: str, sweep: str) -> None:
        self.folder, self.kbvh, self.sweep = folder, kbvh, sweep
        self.plan = folder / "plan.json"
        self.plan.write_text(json.dumps(PLAN))
        # CI: Snakemake then looks at its jobs every second, not every ten.
        self.environment = os.environ | {
            "KBVH_CACHE": str(folder / "cache"), "KBVH_CORES": str(folder / "cores"), "CI": "true",
            "HOME": str(folder / "home"), "XDG_CACHE_HOME": str(folder / "home" / "cache"),
        }  # fmt: skip
        whole = folder / "whole"
        environment = self.environment | {"KBVH_CACHE": str(folder / "cache-of-run")}
        subprocess.run(
            [kbvh, "run", "--plan", str(self.plan), "--out", str(whole)], check=True, capture_output=True, env=environment
        )
        self.truth = without_times(whole / "results.jsonl")
        require(len(self.truth) == 34, f"the plan has {len(self.truth)} configurations")

    def call(self, *words: str, out: Path, kbvh: str | None = None) -> list[str]:
        return [self.sweep, str(self.plan), "--out", str(out), "--kbvh", kbvh or self.kbvh, *words]

    def run(self, *words: str, out: Path, kbvh: str | None = None, **more: Any) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.call(*words, out=out, kbvh=kbvh), capture_output=True, text=True, env=self.environment, timeout=900, **more
        )

    def program(self, name: str, script: str) -> str:
        """Makes a program that stands for kbvh; `$KBVH` is kbvh itself."""
        file = self.folder / name
        file.write_text(f"#!/bin/bash\nKBVH='{self.kbvh}'\nHERE='{self.folder}'\n{script}\n")
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
        return str(file)

    def check(self, out: Path, torn: bool = False) -> None:
        require(without_times(out / "results.jsonl", torn) == self.truth, "the records differ from those of kbvh run")


def attempts(out: Path) -> Iterator[dict[str, Any]]:
    """Yields the provenance of every attempt."""
    for file in sorted([*(out / "jobs").glob("*/*.json"), *(out / "jobs" / "scenes").glob("*/*.json")]):
        try:
            yield json.loads(file.read_text())
        except FileNotFoundError:
            continue  # replaced meanwhile


def check_cores(out: Path, threads: int = 1) -> None:
    """Every job had cores of its own while it ran."""
    jobs = [about for about in attempts(out) if "end" in about]
    require(all(len(about["cores"]) == threads for about in jobs), "a job is not pinned")
    for a in jobs:
        for b in jobs:
            if a is not b and set(a["cores"]) & set(b["cores"]):
                apart = a["end"] <= b["begin"] or b["end"] <= a["begin"]
                require(apart, f"two jobs share a core: {a} {b}")


def local(study: Study) -> None:
    cores = str(min(2, len(os.sched_getaffinity(0))))
    out = study.folder / "local"
    # Says on which cores it really runs, and fails once for one job.
    spy = study.program(
        "spy",
        """
if [[ $* == *--job* || $* == *--prepare* ]]; then
  taskset -p $$ >> "$HERE/masks"
  if [[ $* == *450-double-l1-* ]] && mkdir "$HERE/failed-once" 2>/dev/null; then exit 3; fi
fi
exec "$KBVH" "$@" """,
    )
    run = study.run("--cores", cores, out=out, kbvh=spy)
    require(run.returncode == 0 and f"{JOBS} of {JOBS} jobs are done; 34 new records" in run.stdout, "a sweep", run)
    study.check(out)
    check_cores(out)
    done = list(attempts(out))
    require((study.folder / "failed-once").exists(), "no job has failed")
    require(sorted(about["exit"] for about in done) == [0] * (JOBS + SCENES) + [3], "one job fails once, all others run once")
    masks = [int(line.rpartition(":")[2], 16) for line in (study.folder / "masks").read_text().splitlines()]
    require(all(mask.bit_count() == 1 for mask in masks), f"kbvh is pinned to one core: {masks}")
    # Scenes and their true pairs were made before the jobs: no job has added to them.
    scenes_made = max(about["end"] for about in done if about["kind"] == "scene")
    cache = list((study.folder / "cache").iterdir())
    require(len(list((study.folder / "cache").glob("oracle-*.bin"))) == 4, f"true pairs of two scenes in two scalars: {cache}")
    for file in cache:
        require(file.stat().st_mtime <= time_of(scenes_made) + 0.01, f"{file.name} is younger than the preparation")
    require((out / "jobs" / "sweeps.jsonl").read_text().count("\n") == 2, "the log of the sweep")
    require(len(list((out / "scenes").iterdir())) == SCENES, "the pictures of each scene once")

    same_as_merged(study, out)

    before = (out / "results.jsonl").read_bytes()
    again = study.run("--cores", cores, out=out)
    require(again.returncode == 0 and "; 0 new records" in again.stdout, "again", again)
    require(len(list(attempts(out))) == len(done), "nothing is done again", again)
    require((out / "results.jsonl").read_bytes() == before, "the results are as before")
    damaged(study, out)
    # What is in the results already is not measured again, no matter by which means it was measured.
    over = study.folder / "over"
    shutil.copytree(study.folder / "whole", over)
    whole = (over / "results.jsonl").read_bytes()
    first = whole[: whole.index(b"\n") + 30]  # one record, and half of the next
    (over / "results.jsonl").write_bytes(first)
    broken = study.program("breaks", '"$KBVH" "$@"; code=$?; [[ $* == *--job*200-float-l1-* ]] && exit 1; exit $code')
    run = study.run("--cores", cores, out=over, kbvh=broken)
    require(run.returncode == 1 and "33 new records" in run.stdout, "over results; a broken guarantee is code 1", run)
    require((over / "results.jsonl").read_bytes().startswith(first), "lines of the results stay", run)
    listed = study.run("--list", out=over)
    require(listed.stdout.count(" done\n") == JOBS - 1, "the list says what is done", listed)
    require(listed.stdout.count(" guarantee broken\n") == 1, "the list says what is broken", listed)


def damaged(study: Study, out: Path) -> None:
    """Jobs whose file `done` is damaged, or whose records were deleted, are done once more; all others are not."""
    jobs = sorted(file.parent for file in (out / "jobs").glob("*/done"))
    before, other_records = (out / "results.jsonl").read_bytes(), list(attempts(out))
    (jobs[0] / "done").write_text("")
    (jobs[1] / "done").write_text("{}")
    lost = {record["key"] for file in jobs[2].glob("*.jsonl") for record in lines_of(file, torn=False)}
    for file in jobs[2].glob("*.jsonl"):
        file.unlink()
    listed = study.run("--list", out=out)
    require(listed.stdout.count(" open\n") == 2, "damaged jobs are open; records in the results are there", listed)
    kept = [line for line in before.splitlines(keepends=True) if json.loads(line)["key"] not in lost]
    (out / "results.jsonl").write_bytes(b"".join(kept))
    listed = study.run("--list", out=out)
    require(lost and listed.stdout.count(" open\n") == 3, "deleted records open a job", listed)
    run = study.run("--cores", "1", out=out)
    require(run.returncode == 0 and f"{JOBS} of {JOBS} jobs are done" in run.stdout, "damaged jobs", run)
    require(run.stderr.count("is done once more: ") == 3, "it says which jobs are done once more", run)
    require(len(list(attempts(out))) == len(other_records) + 3, "three jobs are done once more, and no other", run)
    study.check(out)
    # A scene is made once more where a job needs it.
    job = json.loads((out / "jobs" / "list.json").read_text())["jobs"][0]
    scene = out / "jobs" / "scenes" / job["scene"] / "done"
    scene.write_text("")
    (out / "jobs" / job["id"] / "done").unlink()
    run = study.run("--cores", "1", out=out)
    require(run.returncode == 0 and "exit" in json.loads(scene.read_text()), "a scene, too", run)


def same_as_merged(study: Study, out: Path) -> None:
    """`kbvh merge` of the jobs' files lets the same record of each configuration count, in whatever order it reads them."""
    files = sorted((out / "jobs").glob("*/*.jsonl"))
    joined = {record["key"]: record for record in lines_of(out / "results.jsonl", torn=False)}
    shared = [record for record in joined.values() if in_two_studies(record)]
    require(len(shared) == 2, f"two configurations are part of two tables: {len(shared)}")
    for name, inputs in (("forwards", files), ("backwards", files[::-1])):
        merged = study.folder / name
        subprocess.run([study.kbvh, "merge", *inputs, "--out", merged], check=True, capture_output=True)
        counts = {record["key"]: record for record in lines_of(merged / "results.jsonl", torn=False)}
        differing = [key for key in joined if counts[key] != joined[key] and counts[key]["when"] != joined[key]["when"]]
        require(counts.keys() == joined.keys() and not differing, f"merged {name}: other records of {differing} count")


def time_of(text: str) -> float:
    from datetime import datetime

    return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


def wrong_use(study: Study) -> None:
    """One sentence and code 2."""
    out = study.folder / "wrong"
    threads = study.folder / "threads.json"
    threads.write_text(json.dumps(PLAN | {"strategies": [{"id": "bottom_up", "params": {"threads": 2}}]}))
    many = str(len(os.sched_getaffinity(0)) + 1)
    for words, what in (
        (["--cores", "0"], "--cores: expected a whole number from 1, got 0"),
        (["--cores", many], f"--cores {many}: this process may use"),
        (["--cores", "1", "--", "--drmaa"], "go with --jobs N"),
        (["--jobs", "2"], "--jobs N needs the means after --"),
        (["--cores", "1", "--kbvh", "/nowhere"], "/nowhere is no program"),
        (["--cores", "1", "--kbvh", "/bin/true"], "/bin/true is another program"),
        (["--cores", "1", "--kbvh", "/bin/echo"], "/bin/echo is another program"),
        (["--cores", "1", "--study", "none"], "there is no study 'none'"),
    ):
        run = study.run(*words, out=out)
        require(run.returncode == 2 and what in run.stderr, f"{words}: code 2 and '{what}'", run)
    call = [study.sweep, str(threads), "--out", str(out), "--kbvh", study.kbvh, "--cores", "1"]
    if len(os.sched_getaffinity(0)) > 1:
        run = subprocess.run(call, capture_output=True, text=True, env=study.environment)
        require(run.returncode == 2 and "has a contestant of 2 threads" in run.stderr, "threads without cores", run)
    call[1] = str(study.folder / "no-plan.json")
    run = subprocess.run(call, capture_output=True, text=True, env=study.environment)
    require(run.returncode == 2 and "there is no plan" in run.stderr, "no plan", run)
    require(not out.exists(), "wrong use leaves nothing behind")


def broken_and_busy(study: Study) -> None:
    """A job that never works: the others are done. A second sweep of the same folder is refused."""
    out = study.folder / "broken"
    slow = study.program("slow", '[[ $* == *--job*200-float-l1-* ]] && { sleep 3; exit 3; }; exec "$KBVH" "$@"')
    first = subprocess.Popen(
        study.call("--cores", "1", "--retries", "1", out=out, kbvh=slow), env=study.environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    while not list((out / "jobs").glob("*-l*")) and first.poll() is None:
        time.sleep(0.05)
    second = study.run("--cores", "1", out=out)
    require(second.returncode == 2 and "another sweep writes to" in second.stderr, "a second sweep", second)
    stdout, stderr = first.communicate()
    require(first.returncode == 3 and f"{JOBS - 1} of {JOBS} jobs are done" in stdout, f"one job fails: {stdout}\n{stderr}")
    require("not finished: waving-sheet-200-float-l1" in stderr, f"it says which: {stderr}")
    require(len(without_times(out / "results.jsonl")) == 30, "the results of the others are there")
    run = study.run("--cores", "1", out=out)
    require(run.returncode == 0 and "; 4 new records" in run.stdout, "the rest", run)
    study.check(out)


def elsewhere(study: Study) -> None:
    """By a command that passes on no environment, as ssh does to another machine."""
    out = study.folder / "elsewhere"
    run = study.run("--jobs", "2", "--study", "again", "--", "--cluster-sync", "env -i PATH=/usr/bin:/bin sh", out=out)
    require(run.returncode == 0 and "2 of 2 jobs are done; 4 new records" in run.stdout, "by --cluster-sync", run)
    found = without_times(out / "results.jsonl")
    require(all(study.truth[key] == record for key, record in found.items()), "the records of the second study", run)
    check_cores(out)


def killed(study: Study, times: int, seed: int) -> None:
    """Kills kbvh, its worker, or Snakemake at random moments; nothing but the job in progress is lost."""
    chance = random.Random(seed)
    out, kills, sweeps = study.folder / "killed", 0, 0
    kept: dict[Path, bytes] = {}
    while True:
        sweep = subprocess.Popen(
            study.call("--cores", "2" if len(os.sched_getaffinity(0)) > 1 else "1", "--retries", "1", out=out),
            env=study.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        )  # fmt: skip
        while sweep.poll() is None and kills < times:
            time.sleep(chance.uniform(0.1, 1.2))
            victims = [pid for pid, command in descendants(sweep.pid) if any(word in command for word in VICTIMS)]
            if not victims:
                continue
            try:
                os.kill(chance.choice(victims), signal.SIGKILL)
            except ProcessLookupError:
                continue
            kills += 1
        sweeps += 1
        text = sweep.communicate()[0]
        for file, content in kept.items():
            require(file.read_bytes().startswith(content), f"{file} has lost lines")
        kept = {file: file.read_bytes() for file in out.rglob("*.jsonl")}
        if sweep.returncode == 0 and kills >= times:
            break
        require(sweep.returncode in (0, 3), f"a sweep with killed parts ends with {sweep.returncode}:\n{text}")
        if sweep.returncode == 0:  # all is done, and more is to be killed
            study.check(out)
            shutil.rmtree(out)
            kept = {}
    study.check(out)
    lost = sum("end" not in about for about in attempts(out))
    print(f"{kills} processes killed in {sweeps} sweeps; the records are those of kbvh run (in the last: {lost} lost attempts)")


#: Parts of the command lines of processes that are killed.
VICTIMS = ("--job ", "--prepare ", "worker.py", "/snakemake ")


def descendants(root: int) -> Iterator[tuple[int, str]]:
    """Yields the processes below one, with their command lines."""
    parents: dict[int, tuple[int, str]] = {}
    for entry in Path("/proc").iterdir():
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            parents[int(entry.name)] = parent, (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except (OSError, ValueError):
            continue
    found = {root}
    grown = True
    while grown:
        more = {pid for pid, (parent, _) in parents.items() if parent in found} - found
        found |= more
        grown = bool(more)
    for pid in found - {root}:
        yield pid, parents[pid][1]


def disk(study: Study) -> int:
    """The disk with the results is full at several sizes; with room again, the same command finishes."""
    mount = study.folder / "mount"
    mount.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", str(mount)], capture_output=True).returncode != 0:
        print("skipped: a file system of limited size cannot be mounted here")
        return SKIPPED
    try:
        ended = []
        for free in (16, 200, 400):
            out = mount / f"out-{free}"
            filler = mount / "filler"
            usage = os.statvfs(mount)
            filler.write_bytes(bytes(max(0, usage.f_bavail * usage.f_frsize - free * 1024)))
            run = study.run("--cores", "1", "--retries", "0", out=out)
            require(run.returncode in (0, 3), f"{free} KB free", run)
            ended.append(run.returncode)
            before = {file: file.read_bytes() for file in out.rglob("*.jsonl")}
            filler.unlink()
            run = study.run("--cores", "1", out=out)
            require(run.returncode == 0, f"room again, after {free} KB", run)
            study.check(out, torn=True)
            for file, content in before.items():
                require(file.read_bytes().startswith(content), f"{file} has lost lines")
            shutil.rmtree(out)
        require(3 in ended, f"the disk should have been full: {ended}")
        print(f"full disks: ended with {ended}; with room again, the records are those of kbvh run")
    finally:
        subprocess.run(["umount", str(mount)], check=True)
    return 0


def on_slurm(study: Study) -> int:
    """The same records by Slurm; a job that cannot be started or whose node vanishes costs time and nothing else."""
    if why := slurm.why_not():
        print(f"skipped: {why}")
        return SKIPPED
    slots = min(2, len(os.sched_getaffinity(0)))
    with slurm.Cluster(study.folder / "cluster", slots) as cluster:
        study.environment |= {name: cluster.environment[name] for name in ("SLURM_CONF", "PATH")}
        out = study.folder / "vanished"
        # From the fourth job on, jobs last until the node has vanished.
        slow = study.program(
            "slow",
            """
if [[ $* == *--job* && $(ls "$HERE"/vanished/jobs/*/done 2>/dev/null | wc -l) -ge 3 ]]; then
  echo $$ >> "$HERE"/held
  until [[ -e "$HERE"/lost ]]; do sleep 0.1; done
fi
exec "$KBVH" "$@" """,
        )
        cluster.refuse_next()
        sweep = subprocess.Popen(
            study.call("--slurm", out=out, kbvh=slow), env=study.environment, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        cluster.resume_node()
        held = study.folder / "held"

        def jobs_held() -> int:
            pids = held.read_text().split() if held.exists() else []
            return sum("end" not in about and str(about.get("pid")) in pids for about in attempts(out))

        # On every slot one: a job that is about to start when the node vanishes may survive it.
        while sweep.poll() is None and jobs_held() < slots:
            time.sleep(0.1)
        require(sweep.poll() is None, "the sweep has ended too early")
        kept = {file: file.read_bytes() for file in out.rglob("*.jsonl")}
        cluster.vanish_node()
        (study.folder / "lost").touch()
        cluster.wait_for("down")
        cluster.start_node()
        try:
            text = sweep.communicate(timeout=600)[0]
        except subprocess.TimeoutExpired:
            sweep.kill()
            jobs = cluster.ask("scontrol", "--oneliner", "show", "job")
            raise SystemExit(f"FAILED: the sweep does not end:\n{sweep.communicate()[0]}\n{jobs}\n{cluster.logs()}") from None
        require(sweep.returncode == 0, f"after the node was lost:\n{text}\n{cluster.logs()}")
        study.check(out)
        check_cores(out)
        require(all("SLURM_JOB_ID" in about["scheduler"] for about in attempts(out)), "Slurm has run the jobs")
        for file, content in kept.items():
            require(file.read_bytes().startswith(content), f"{file} has lost lines")
        lost = [about for about in attempts(out) if "end" not in about]
        require(len(lost) == slots, f"{slots} jobs were running when the node vanished, and {len(lost)} are lost")
        refused = cluster.ask("scontrol", "--oneliner", "show", "job").count("JobState=CANCELLED")
        require(refused == 1, f"the job that could not be started is cancelled and submitted again: {refused}")
        print(f"a job refused, a node vanished with {len(lost)} running jobs; the records are those of kbvh run")
    return 0


def main() -> int:
    kbvh, sweep = (str(Path(word).resolve()) for word in sys.argv[1:3])
    part = sys.argv[3]
    if shutil.which("snakemake") is None:
        print("skipped: snakemake is not installed (experiments/setup --sweep)")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="kbvh-sweep-") as name:
        study = Study(Path(name), kbvh, sweep)
        if part == "local":
            local(study)
            wrong_use(study)
            broken_and_busy(study)
            elsewhere(study)
            print("swept on this machine; the records are those of kbvh run")
        elif part == "killed":
            killed(study, int(sys.argv[4]) if len(sys.argv) > 4 else 5, int(sys.argv[5]) if len(sys.argv) > 5 else 1)
        elif part == "disk":
            return disk(study)
        elif part == "slurm":
            return on_slurm(study)
        else:
            raise SystemExit(__doc__)
    return 0


if __name__ == "__main__":
    sys.exit(main())
