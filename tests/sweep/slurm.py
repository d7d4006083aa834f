"""A Slurm cluster of this machine alone, in a temporary folder: munged, slurmctld, and a slurmd with some slots."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from types import TracebackType

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "scontrol", "sinfo")


def why_not() -> str:
    """Returns why there can be no cluster here, or an empty text."""
    if os.geteuid() != 0:
        return "only root can start slurmd"
    missing = [name for name in PROGRAMS if shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin") is None]
    return f"{', '.join(missing)} not installed (experiments/setup --tests)" if missing else ""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Cluster:
    """Running while it is entered. `environment` makes the commands of Slurm find it."""

    def __init__(self, folder: Path, slots: int) -> None:
        self.folder, self.slots = folder, slots
        self.node = socket.gethostname().split(".")[0]
        self.environment = dict(os.environ, SLURM_CONF=str(folder / "slurm.conf"), PATH=os.environ["PATH"] + ":/usr/sbin")
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, *words: str) -> None:
        log = open(self.folder / f"{name}.out", "ab")
        self.processes[name] = subprocess.Popen(
            [name, *words], env=self.environment, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )

    def refuse_next(self) -> None:
        """The node fails to start its next job, and takes no further ones until it is resumed."""
        (self.folder / "refuse").touch()

    def resume_node(self) -> None:
        self.wait_for("drained")
        self.ask("scontrol", "update", f"nodename={self.node}", "state=resume")

    def start_node(self) -> None:
        self.start("slurmd", "-D", "-f", str(self.folder / "slurm.conf"), "-N", self.node)

    def vanish_node(self) -> None:
        """As if the node lost its power: slurmd and everything that it has started is killed at once."""
        # All are stopped first: a worker whose child dies would write that its job has ended. Then children are killed
        # before their parents: the kernel continues a stopped process group (SIGHUP, SIGCONT) whose last parent dies.
        below = self.below(self.processes["slurmd"].pid)
        for number, processes in ((signal.SIGSTOP, below), (signal.SIGKILL, below[::-1])):
            for process in processes:
                try:
                    os.kill(process, number)
                except ProcessLookupError:
                    pass
        self.processes.pop("slurmd").wait()

    def below(self, root: int) -> list[int]:
        """Returns slurmd, the step daemons of this cluster, and all their descendants."""
        parents: dict[int, int] = {}
        roots = {root}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                stat = (entry / "stat").read_text()
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            pid = int(entry.name)
            parents[pid] = int(stat.rpartition(")")[2].split()[1])
            if "slurmstepd" in command and str(self.folder).encode() in environment:
                roots.add(pid)
        found = list(roots)
        for pid in found:
            found += [child for child, parent in parents.items() if parent == pid and child not in found]
        return found

    def ask(self, *words: str) -> str:
        return subprocess.run(words, env=self.environment, capture_output=True, text=True).stdout

    def wait_for(self, state: str, seconds: float = 60) -> None:
        deadline = time.monotonic() + seconds
        while state not in self.ask("sinfo", "--noheader", "--format=%T"):
            if time.monotonic() > deadline:
                raise SystemExit(f"the node is not {state}:\n{self.ask('scontrol', 'show', 'node')}\n{self.logs()}")
            time.sleep(0.2)

    def logs(self) -> str:
        return "\n".join(
            f"== {file.name}\n" + "\n".join(file.read_text(errors="replace").splitlines()[-25:])
            for file in sorted([*self.folder.glob("*.log"), *self.folder.glob("*.out")])
        )

    def __enter__(self) -> Cluster:
        folder = self.folder
        for name in ("state", "spool", "munge"):
            (folder / name).mkdir(parents=True)
        folder.chmod(0o755)
        (folder / "munge").chmod(0o755)
        key = folder / "munge" / "key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o400)
        munge = folder / "munge"
        (folder / "slurm.conf").write_text(f"""\
ClusterName=kbvh-test
SlurmctldHost={self.node}(127.0.0.1)
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={munge}/socket,cred_expire=10
Prolog={folder}/prolog
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/affinity
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=batch_sched_delay=0,sched_interval=2,default_queue_depth=1000
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SlurmdTimeout=5
InactiveLimit=0
KillWait=2
MinJobAge=300
ReturnToService=2
MpiDefault=none
NodeName={self.node} NodeAddr=127.0.0.1 CPUs={self.slots} State=UNKNOWN
PartitionName=all Nodes={self.node} Default=YES MaxTime=INFINITE State=UP OverSubscribe=NO
""")
        (folder / "prolog").write_text(f"#!/bin/sh\n! rm '{folder}/refuse' 2>/dev/null\n")
        (folder / "prolog").chmod(0o755)
        (folder / "cgroup.conf").write_text("CgroupAutomount=no\nIgnoreSystemd=yes\n")
        self.start(
            "munged", "--foreground", "--force", f"--key-file={key}", f"--socket={munge}/socket", f"--pid-file={munge}/pid",
            f"--log-file={munge}/log", f"--seed-file={munge}/seed", "--num-threads=2",
        )  # fmt: skip
        deadline = time.monotonic() + 10
        while not (munge / "socket").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        self.start("slurmctld", "-D", "-f", str(folder / "slurm.conf"))
        self.start_node()
        self.wait_for("idle")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for name in ("slurmd", "slurmctld", "munged"):
            process = self.processes.get(name)
            if process is None:
                continue
            if name == "slurmd":
                for pid in self.below(process.pid):
                    try:
                        os.kill(pid, signal.SIGTERM if pid == process.pid else signal.SIGKILL)
                    except ProcessLookupError:
                        pass
            process.terminate()
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
