"""The package itself: its examples run, its types are right, its notebooks run, and it can be installed."""

import doctest
import importlib
import json
import os
import pathlib
import pkgutil
import subprocess
import sys
import tempfile
import unittest

import kbvh
from kbvh import _core

SOURCE = pathlib.Path(__file__).resolve().parents[2]
BUILD = os.environ.get("KBVH_BUILD", "")
MODULES = sorted(name for _, name, _ in pkgutil.iter_modules(kbvh.__path__) if name not in ("_core",))


def run(*command, **keys):
    done = subprocess.run([str(word) for word in command], text=True, capture_output=True, **keys)
    return done.returncode, done.stdout + done.stderr


class Documentation(unittest.TestCase):
    def test_examples(self):
        tried = 0
        for name in ["kbvh", *(f"kbvh.{name}" for name in MODULES)]:
            module = importlib.import_module(name)
            found = doctest.testmod(module, extraglobs={"kbvh": kbvh})
            self.assertEqual(found.failed, 0, name)
            tried += found.attempted
        self.assertGreater(tried, 20)

    def test_everything_public_is_explained(self):
        for name in kbvh.__all__:
            thing = getattr(kbvh, name)
            self.assertTrue((thing.__doc__ or "").strip(), name)
            if isinstance(thing, type):
                for member, value in vars(thing).items():
                    if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                        self.assertTrue((value.__doc__ or "").strip(), f"{name}.{member}")
        self.assertEqual(len(kbvh.__all__), len(set(kbvh.__all__)))


class Types(unittest.TestCase):
    def setUp(self):
        if run(sys.executable, "-m", "mypy", "--version")[0] != 0:
            self.skipTest("mypy is not installed (Debian: python3-mypy)")
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.environment = {**os.environ, "MYPYPATH": str(pathlib.Path(kbvh.__path__[0]).parent)}

    def test_the_package_is_typed(self):
        code, said = run(
            sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "--cache-dir", self.folder.name,
            "--allow-any-generics", "--no-warn-return-any", "-m", "kbvh", env=self.environment,
        )  # fmt: skip
        self.assertEqual(code, 0, said)

    def test_the_stubs_are_those_of_the_module(self):
        allowed = pathlib.Path(self.folder.name) / "allowed"
        allowed.write_text("kbvh._core.BroadPhase\nkbvh._core.Motion\nkbvh._core.World\n")  # their metaclass is that of pybind11
        code, said = run(
            sys.executable, "-m", "mypy.stubtest", "kbvh._core", "--allowlist", allowed, env=self.environment,
            cwd=self.folder.name,
        )  # fmt: skip
        self.assertEqual(code, 0, said)
        # Stubtest does not see the arguments of compiled functions; their first line of help does.
        stub = (pathlib.Path(kbvh.__path__[0]) / "_core.pyi").read_text()
        tree = __import__("ast").parse(stub)
        checked = 0
        for item in tree.body:
            functions = item.body if item.__class__.__name__ == "ClassDef" else [item]
            owner = getattr(_core, item.name) if item.__class__.__name__ == "ClassDef" else _core
            for function in functions:
                if function.__class__.__name__ != "FunctionDef" or function.decorator_list:
                    continue
                expected = [one.arg for one in function.args.args if one.arg != "self"]
                line = getattr(owner, function.name).__doc__.split("\n")[0]
                if ") ->" not in line:
                    self.assertEqual((owner, function.name), (_core.Motion, "__init__"))
                    continue
                inside = line[line.index("(") + 1 : line.rindex(") ->")]
                names = [part.split(":")[0].strip() for part in inside.split(", ") if ":" in part]
                self.assertEqual([name for name in names if name != "self"], expected, function.name)
                checked += 1
        self.assertGreater(checked, 35)
        for name in vars(_core):
            if not name.startswith("_"):
                self.assertIn(name, stub)


class Notebooks(unittest.TestCase):
    def test_they_run(self):
        try:
            import nbclient
            import nbformat
        except ImportError:
            self.skipTest("nbclient is not installed (Debian: python3-nbclient, python3-ipykernel)")
        files = sorted((SOURCE / "analysis/kbvh/notebooks").glob("*.ipynb"))
        self.assertEqual(len(files), 4)
        for file in files:
            raw = json.loads(file.read_text())
            for cell in raw["cells"]:
                if cell["cell_type"] == "code":
                    self.assertEqual((cell["outputs"], cell["execution_count"]), ([], None), f"{file.name} has outputs")
            notebook = nbformat.reads(file.read_text(), as_version=4)
            nbformat.validate(notebook)
            with tempfile.TemporaryDirectory() as folder:
                client = nbclient.NotebookClient(
                    notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}}
                )
                client.execute(env={**os.environ, "KBVH_SOURCE": str(SOURCE), "MPLBACKEND": "agg"})


class Installation(unittest.TestCase):
    def try_it(self, python, environment, where):
        code = (
            "import kbvh, kbvh._core as core, kbvh.results\n"
            f"assert core.__file__.startswith({str(where)!r}), core.__file__\n"
            "world = kbvh.World(kbvh.scene('waving_sheet', triangles=200, keyframes=2), 'bottom_up')\n"
            "print(len(world.true_pairs()) == len(world.pairs()), kbvh.results._reader().SCHEMA)"
        )
        self.assertEqual(run(python, "-c", code, env=environment, cwd="/"), (0, "True 2\n"))

    def test_by_cmake(self):
        if not BUILD:
            self.skipTest("KBVH_BUILD names no build")
        with tempfile.TemporaryDirectory() as folder:
            code, said = run("cmake", "--install", BUILD, "--component", "python", "--prefix", folder)
            self.assertEqual(code, 0, said)
            (package,) = pathlib.Path(folder).rglob("kbvh/__init__.py")
            environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
            self.try_it(sys.executable, {**environment, "PYTHONPATH": str(package.parents[1])}, folder)

    def test_by_pip_in_a_clean_environment(self):
        if not BUILD:
            self.skipTest("KBVH_BUILD names no build")
        if run(sys.executable, "-c", "import wheel, venv, ensurepip")[0] != 0:
            self.skipTest("pip cannot build wheels (Debian: python3-pip, python3-venv, python3-wheel)")
        with tempfile.TemporaryDirectory() as folder:
            place = pathlib.Path(folder) / "environment"
            self.assertEqual(run(sys.executable, "-m", "venv", "--system-site-packages", place)[0], 0)
            environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "KBVH"))}
            environment["KBVH_PYTHON_BUILD"] = BUILD  # what is built already need not be built again
            code, said = run(
                place / "bin/python", "-m", "pip", "install", "--no-index", "--no-build-isolation", "--no-deps",
                SOURCE, env=environment, cwd=folder,
            )  # fmt: skip
            self.assertEqual(code, 0, said)
            self.try_it(place / "bin/python", environment, place)
            code, said = run(place / "bin/python", "-m", "pip", "uninstall", "-y", "kbvh", env=environment, cwd=folder)
            self.assertEqual(code, 0, said)
            self.assertEqual(list(place.rglob("kbvh/*")), [])


if __name__ == "__main__":
    unittest.main()
