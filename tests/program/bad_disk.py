"""What the program says and does when the disk is full, a folder cannot be written, or caches are damaged: one clear
sentence, and never a wrong result.

usage: bad_disk.py KBVH
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

SCENES = {"tablecloth": {"triangles": 250, "keyframes": 5}, "reversing_spheres": {"triangles": 300, "keyframes": 8}}


def scene_arguments(scene: str) -> list[str]:
    """A study that ends at once, and uses every kind of cache."""
    sizes = [word for key, value in SCENES[scene].items() for word in (f"--{key}", str(value))]
    return ["run", "--scene", scene, *sizes, "--l", "2", "--strategies", "bottom_up,kinetic_aabb", "--repetitions", "1"]


class Disk:
    """Runs the program in a folder of its own."""

    def __init__(self, program: str, folder: Path) -> None:
        self.program, self.folder, self.cases = program, folder, 0

    def run(self, scene: str, out: Path, cache: Path, largest_file: int | None = None) -> subprocess.CompletedProcess[str]:
        """`largest_file`: bytes after which a disk is full."""

        def limit() -> None:
            if largest_file is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

        self.cases += 1
        return subprocess.run([self.program, *scene_arguments(scene), "--out", str(out)], capture_output=True, text=True,
                              preexec_fn=limit, restore_signals=False, check=False, env={**os.environ, "KBVH_CACHE": str(cache)})  # fmt: skip

    def fresh(self, name: str) -> Path:
        """A path at which there is nothing."""
        path = self.folder / name
        shutil.rmtree(path, ignore_errors=True)
        return path


def require(condition: bool, what: str, run: subprocess.CompletedProcess[str] | None = None) -> None:
    """Ends the test with what went wrong."""
    if not condition:
        raise SystemExit(f"{what}" + (f"\nexit {run.returncode}\n{run.stdout}\n{run.stderr}" if run else ""))


def results(out: Path) -> dict[str, Any]:
    """The content of each record except times; half lines are left out."""
    file = out / "results.jsonl"
    found = {}
    for line in file.read_text().split("\n") if file.exists() else []:
        try:
            record = json.loads(line)
        except ValueError:
            continue
        found[record["key"]] = {name: record[name] for name in ("scene", "verified", "counters") if name in record}
    return found


def sentences(run: subprocess.CompletedProcess[str], word: str) -> list[str]:
    """The lines of the program's own that contain a word."""
    return [line for line in run.stderr.split("\n") if line.startswith("kbvh: ") and word in line]


def damages(content: bytes) -> dict[str, bytes]:
    """The damaged forms of a file."""
    middle = len(content) // 2
    return {
        "empty": b"",
        "truncated": content[:-3],
        "half": content[:middle],
        "of another version": bytes([content[0] ^ 1]) + content[1:],
        "with a flipped bit": content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :],
        "with something behind": content + b"more",
        "something else": b"this is no cache\n" * 20,
    }


def damaged_caches(disk: Disk, scene: str) -> None:
    """Each cache file in turn is damaged in each way."""
    cache = disk.fresh("cache")
    first = disk.run(scene, disk.fresh("out"), cache)
    require(first.returncode == 0, f"{scene}: the first run failed", first)
    truth = results(disk.folder / "out")
    require(len(truth) == 2, f"{scene}: there should be two results", first)
    files = sorted(cache.iterdir())
    require(len(files) == 2, f"{scene}: there should be two files in the cache: {files}")
    for file in files:
        content = file.read_bytes()
        for name, damaged in damages(content).items():
            file.write_bytes(damaged)
            run = disk.run(scene, disk.fresh("out"), cache)
            require(run.returncode == 0, f"{file.name} {name}", run)
            require(len(sentences(run, file.name)) == 1, f"{file.name} {name}: there should be one sentence about it", run)
            require(results(disk.folder / "out") == truth, f"{file.name} {name}: other results", run)
            require(file.read_bytes() == content, f"{file.name} {name}: is not as it was made first", run)


def no_cache(disk: Disk, scene: str) -> None:
    """The cache folder is a file, or the disk is full: a warning, and the same results."""
    truth_out = disk.fresh("truth")
    require(disk.run(scene, truth_out, disk.fresh("cache")).returncode == 0, f"{scene}: the first run failed")
    file = disk.folder / "file"
    file.write_text("not a folder")
    run = disk.run(scene, disk.fresh("out"), file)
    require(run.returncode == 0 and len(sentences(run, "warning: the cache folder")) == 1, f"{scene}: cache is a file", run)
    require(results(disk.folder / "out") == results(truth_out), f"{scene}: other results without a cache", run)
    if os.geteuid() != 0:  # nothing is unwritable for root
        cache = disk.fresh("cache")
        cache.mkdir(mode=0o555)
        run = disk.run(scene, disk.fresh("out"), cache)
        require(run.returncode == 0 and len(sentences(run, "warning: the cache folder")) == 1, f"{scene}: unwritable cache", run)


def no_results(disk: Disk, scene: str) -> None:
    """Results that cannot be written anywhere: an error at once, in one sentence."""
    file = disk.folder / "file"
    file.write_text("not a folder")
    occupied = disk.fresh("occupied")
    (occupied / "results.jsonl").mkdir(parents=True)
    outs = [file, file / "below", occupied]
    if os.geteuid() != 0:
        unwritable = disk.fresh("unwritable")
        unwritable.mkdir(mode=0o555)
        outs.append(unwritable)
    for out in outs:
        run = disk.run(scene, out, disk.folder / "cache")
        require(run.returncode == 2 and len(sentences(run, "")) == 1, f"{out}: code 2 and one sentence", run)


def full_disk(disk: Disk, scene: str) -> None:
    """Full at any size: code 2 and a sentence, or everything is written; what is written is right, and the study can continue."""
    truth_out, cache = disk.fresh("truth"), disk.fresh("cache")
    require(disk.run(scene, truth_out, cache).returncode == 0, f"{scene}: the first run failed")
    truth = results(truth_out)
    size = max(file.stat().st_size for file in [*truth_out.rglob("*"), *cache.iterdir()] if file.is_file())
    ended: list[int] = []
    for share in (0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 0.99, 1.1):
        for kept in (cache, disk.fresh("no-cache")):
            out = disk.fresh("out")
            run = disk.run(scene, out, kept, int(share * size))
            require(run.returncode in (0, 2), f"{scene}: disk full at {share} of {size} bytes", run)
            if run.returncode == 2:
                require(len(sentences(run, "cannot be written")) >= 1, f"{scene}: full at {share}: a sentence about it", run)
            elif kept != cache and not any(kept.glob("*.bin")):
                require(len(sentences(run, "warning: ")) >= 1, f"{scene}: full at {share}: a warning about the cache", run)
            found = results(out)
            require(all(truth[key] == found[key] for key in found), f"{scene}: full at {share}: other results", run)
            require(run.returncode == 2 or found == truth, f"{scene}: full at {share}: code 0, and results are missing", run)
            again = disk.run(scene, out, kept)
            require(again.returncode == 0 and results(out) == truth, f"{scene}: does not go on after {share}", again)
            ended.append(run.returncode)
    require(0 in ended and 2 in ended, f"{scene}: the disk should have been full for some: {ended}")


def main() -> int:
    with tempfile.TemporaryDirectory(prefix="kbvh-disk-") as name:
        disk = Disk(sys.argv[1], Path(name))
        for scene in SCENES:
            damaged_caches(disk, scene)
            no_cache(disk, scene)
            no_results(disk, scene)
            full_disk(disk, scene)
        print(f"{disk.cases} runs: a sentence each where something is wrong, results as they should be")
    return 0


if __name__ == "__main__":
    sys.exit(main())
