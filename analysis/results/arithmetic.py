"""Finds the compiled arithmetic of times: the program's code, as a library for this interpreter.

An installed analysis has it next to this module. A source tree compiles it when first needed, in a few seconds, and again after
a change of its sources; the library is kept in build/clip_times or, where that cannot be written, in the user's cache.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import subprocess
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from results.files import ResultError

#: Not clip_times.so: Python would take it for the module clip_times.
NAME = "libclip_times.so"
#: Each file of the sources, below the root of the tree.
SOURCES = (
    "analysis/results/clip_times.cpp", "experiments/study/raw_times.cpp", "experiments/study/raw_times.hpp",
    "experiments/study/best_refit.cpp", "experiments/study/best_refit.hpp", "experiments/study/resamples.hpp",
    "experiments/study/chance.hpp", "core/base/median.hpp", "core/judge/phase_times.hpp",
)  # fmt: skip
FLAGS = ("-std=c++20", "-O2", "-ffp-contract=off", "-fPIC", "-shared")


@lru_cache(maxsize=None)
def functions() -> ctypes.CDLL:
    """Returns the library with its functions, declared. Raises ResultError if it is neither here nor can be compiled."""
    installed = Path(__file__).with_name(NAME)
    found = ctypes.CDLL(str(installed if installed.exists() else compiled(Path(__file__).resolve().parents[2])))
    address, number, text = ctypes.c_void_p, ctypes.c_double, ctypes.c_char_p
    for name, result, arguments in (
        ("new", address, (ctypes.c_size_t, ctypes.c_size_t, *[address] * 4, ctypes.c_int64, ctypes.c_int, text)),
        ("delete", None, (address,)),
        ("of", number, (address, text, ctypes.c_int, ctypes.c_int)),
        ("single", None, (address, text, address)),
        ("replicates", None, (address, text, address)),
        ("ratio", ctypes.c_int, (address, address, text, ctypes.c_int, address)),
        ("clip_total", number, (address,)),
        ("doubts", text, (address, text)),
        ("best_refit", ctypes.c_int64, (ctypes.c_size_t, address, ctypes.c_char_p, ctypes.c_char_p)),
        ("paid_from", ctypes.c_int64, (address, number, address, number)),
    ):
        function = getattr(found, f"kbvh_times_{name}")
        function.restype, function.argtypes = result, arguments
    return found


def compiled(root: Path) -> Path:
    """Returns the library of a source tree, compiled by $CXX (c++) unless these sources have been. Raises ResultError."""
    try:
        content = b"\0".join((root / source).read_bytes() for source in SOURCES)
    except OSError as problem:
        raise ResultError(
            f"The arithmetic of times is missing: neither {Path(__file__).with_name(NAME)} nor its source {problem.filename} exists."
        ) from None
    compiler = shlex.split(os.environ.get("CXX") or "c++")
    key = hashlib.sha256(content + "\0".join((*compiler, *FLAGS, *os.uname())).encode()).hexdigest()[:16]
    for folder in _folders(root):
        made = folder / f"{key}.so"
        if made.exists():
            return made
        try:
            folder.mkdir(parents=True, exist_ok=True)
            descriptor, half = tempfile.mkstemp(suffix=".so", dir=folder)
        except OSError:
            continue
        os.close(descriptor)
        units = [str(root / source) for source in SOURCES if source.endswith(".cpp")]
        try:
            done = subprocess.run([*compiler, *FLAGS, f"-I{root}", *units, "-o", half], capture_output=True, text=True)
            problem = done.stderr.strip() if done.returncode else ""
        except OSError as error:
            problem = str(error)
        if problem:
            os.unlink(half)
            raise ResultError(
                f"Ratios are computed by C++, which {shlex.join(compiler)} could not compile: install a compiler of C++20, name one by CXX, "
                f"or use an installed kbvh. {problem}"
            )
        os.replace(half, made)  # complete at once: another process may look for it
        return made
    raise ResultError(f"The arithmetic of times could be kept neither in {' nor in '.join(map(str, _folders(root)))}.")


def _folders(root: Path) -> Iterator[Path]:
    yield root / "build" / "clip_times"
    yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "kbvh"
