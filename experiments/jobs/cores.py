"""Cores for timed jobs: each job has its cores to itself, also among the jobs of other studies on this machine.

A core is held by a lock on a file, which the system releases when the last process that holds it ends, however it ends.
"""

from __future__ import annotations

import fcntl
import os
import re
import sys
import time
from pathlib import Path

#: Seconds between two looks for a free core.
PAUSE = 0.2
#: Where Linux lists the processors that share a core with one: "0,8" or "0-1".
SIBLINGS = "/sys/devices/system/cpu/cpu{}/topology/thread_siblings_list"


def lock_folder() -> Path:
    """Returns the folder of the locks: of this machine, for all its users. $KBVH_CORES names another one."""
    folder = Path(os.environ.get("KBVH_CORES", "/tmp/kbvh-cores"))
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o1777)
    return folder


def cores_of(cpus: set[int]) -> dict[int, int]:
    """Returns one processor of each physical core among the given ones, the lowest, with the number of the core: its lowest
    processor, whether given or not. Hyperthreads share a core."""
    chosen: dict[int, int] = {}
    for cpu in sorted(cpus):
        file = Path(SIBLINGS.format(cpu))
        listed = re.match(r"\d+", file.read_text()) if file.exists() else None
        chosen.setdefault(int(listed.group()) if listed else cpu, cpu)
    return {cpu: core for core, cpu in chosen.items()}


def usable_cores() -> dict[int, int]:
    """Returns the physical cores on which this process may run, as `cores_of` does."""
    return cores_of(os.sched_getaffinity(0))


def try_lock(folder: Path, core: int) -> int | None:
    """Returns an open lock on a core that child processes inherit, or None if another process holds it."""
    file = folder / f"core-{core}"
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    try:
        os.fchmod(descriptor, 0o666)
    except PermissionError:
        pass  # made by another user
    os.set_inheritable(descriptor, True)
    return descriptor


def hold_cores(count: int) -> list[int]:
    """Waits until `count` physical cores are free, holds them until this process and its children end, and pins this
    process to them. Ends the program if the machine, or the scheduler's share of it, has fewer cores."""
    usable = usable_cores()
    if len(usable) < count:
        sys.exit(
            f"sweep: this job needs {count} physical cores of its own, and may run on {len(usable)} here"
            " (--share-cores: jobs are not pinned)"
        )
    folder = lock_folder()
    said = False
    while True:
        held: dict[int, int] = {}
        for cpu, core in usable.items():
            descriptor = try_lock(folder, core)
            if descriptor is not None:
                held[cpu] = descriptor
            if len(held) == count:
                os.sched_setaffinity(0, held)
                return sorted(held)
        for descriptor in held.values():
            os.close(descriptor)
        if not said:
            print(f"sweep: waits for a free core (locks in {folder})", file=sys.stderr, flush=True)
            said = True
        time.sleep(PAUSE)
