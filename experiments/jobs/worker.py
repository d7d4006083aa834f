"""Does one job of a study, or prepares one scene, on cores of its own. Snakemake calls it, on any machine.

usage: worker.py KBVH PLAN OUT [--share-cores] (job | scene) ID --threads N

Every attempt has files of its own in OUT/jobs/ID: records (written by kbvh), a log and its provenance. kbvh also writes the
keys of the job's records to `keys`. The file `done`, which repeats them, is written last; jobs without it are done again.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Callable

from cores import hold_cores
from records import COMPLETE


def now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def die_with_parent(number: int) -> Callable[[], None]:
    """Returns the first step of a process that must not outlive its parent: a killed worker leaves no program behind that
    occupies a core, and a killed Snakemake no worker."""
    libc = ctypes.CDLL(None)
    set_parent_death_signal = 1
    return lambda: libc.prctl(set_parent_death_signal, number)


def write(file: Path, content: dict[str, Any]) -> None:
    """Writes a file in one step."""
    temporary = file.with_name(file.name + f".{os.getpid()}")
    temporary.write_text(json.dumps(content, indent=1) + "\n")
    temporary.replace(file)


def scheduler() -> dict[str, str]:
    """Returns what the scheduler says of this job."""
    names = ("SLURM_JOB_ID", "SLURM_NODELIST", "SLURM_CPU_BIND", "SLURM_RESTART_COUNT", "JOB_ID", "PBS_JOBID", "LSB_JOBID")
    return {name: os.environ[name] for name in names if name in os.environ}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("kbvh")
    parser.add_argument("plan")
    parser.add_argument("out", type=Path)
    parser.add_argument("--share-cores", action="store_true")
    parser.add_argument("kind", choices=("job", "scene"))
    parser.add_argument("id")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()

    die_with_parent(signal.SIGTERM)()
    folder = options.out / "jobs" / ("scenes" if options.kind == "scene" else "") / options.id
    folder.mkdir(parents=True, exist_ok=True)
    cores = None if options.share_cores else hold_cores(options.threads)
    command = [options.kbvh, "run", "--plan", options.plan, "--out", str(options.out)]
    command += ["--prepare" if options.kind == "scene" else "--job", options.id]
    about: dict[str, Any] = {
        "kind": options.kind, "id": options.id, "host": socket.gethostname(), "cores": cores, "scheduler": scheduler(),
        "command": command, "begin": now(),
    }  # fmt: skip
    attempt = f"{about['begin'].replace(':', '')}-{about['host']}-{os.getpid()}"
    (folder / "keys").unlink(missing_ok=True)  # of an earlier attempt
    with open(folder / f"{attempt}.log", "wb") as log:
        child = subprocess.Popen(
            command, stdout=log, stderr=subprocess.STDOUT, close_fds=False, preexec_fn=die_with_parent(signal.SIGKILL)
        )
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, lambda received, _: child.send_signal(received))
        about["pid"] = child.pid
        write(folder / f"{attempt}.json", about)
        code = child.wait()
    about |= {"end": now(), "exit": code}
    write(folder / f"{attempt}.json", about)
    if code not in COMPLETE:
        lines = (folder / f"{attempt}.log").read_text(errors="replace").splitlines()
        print(f"sweep: {options.kind} {options.id} ended with {code} on {about['host']}", file=sys.stderr)
        print("\n".join("  " + line for line in lines[-3:]), file=sys.stderr)
        return 3
    done: dict[str, Any] = {"attempt": attempt, "exit": code}
    if options.kind == "job":
        try:
            done["keys"] = (folder / "keys").read_text().split("\n")[:-1]
        except FileNotFoundError:
            print(f"sweep: {options.kbvh} ended with {code}, but has not measured job {options.id}", file=sys.stderr)
            return 3
    write(folder / "done", done)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except OSError as problem:  # a full disk, above all
        print(f"sweep: {problem}", file=sys.stderr)
        sys.exit(3)
