"""Builds the wheel of the package kbvh: CMake builds and installs it, setuptools packs what was installed.

KBVH_PYTHON_BUILD   the build folder, such as build/python; a module that is built there is packed as it is
KBVH_CMAKE          further arguments of cmake for a new build folder, such as -DKBVH_UNITY=OFF
"""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = Path(__file__).resolve().parent


class CMakeBuild(build_ext):
    """Leaves the package, as CMake installs it, where setuptools collects it."""

    def run(self) -> None:
        given = os.environ.get("KBVH_PYTHON_BUILD")
        build = Path(given or Path(self.build_temp) / "cmake").resolve()
        jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL") or str(os.cpu_count() or 1)
        if not (build / "CMakeCache.txt").exists():
            options = ["-DCMAKE_BUILD_TYPE=Release", "-DKBVH_PYTHON=ON", "-DKBVH_UNITY=ON"]
            options += ["-DKBVH_BUILD_TESTS=OFF", f"-DKBVH_PYTHON_EXECUTABLE={sys.executable}"]
            options += shlex.split(os.environ.get("KBVH_CMAKE", ""))
            subprocess.run(["cmake", "-S", SOURCE, "-B", build, *options], check=True)
        if not (given and list((build / "python/kbvh").glob("_core.*.so"))):
            subprocess.run(["cmake", "--build", build, "--target", "kbvh_python", "--parallel", jobs], check=True)
        staged = build / "wheel"
        shutil.rmtree(staged, ignore_errors=True)
        subprocess.run(["cmake", "--install", build, "--component", "python", "--prefix", staged], check=True)
        (package,) = staged.rglob("kbvh/__init__.py")
        target = Path(self.build_lib) / "kbvh"
        shutil.rmtree(target, ignore_errors=True)
        self.copy_tree(str(package.parent), str(target))

    def get_outputs(self) -> list:
        return [str(path) for path in (Path(self.build_lib) / "kbvh").rglob("*") if path.is_file()]


(SOURCE / "build").mkdir(exist_ok=True)
setup(
    packages=[],
    ext_modules=[Extension("kbvh._core", [])],
    cmdclass={"build_ext": CMakeBuild},
    # Nothing outside the ignored folder.
    options={"egg_info": {"egg_base": "build"}, "build": {"build_base": "build/wheel"}},
)
