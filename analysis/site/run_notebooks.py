"""Runs the notebooks of the Python package and keeps them with their outputs.

usage: run_notebooks.py NOTEBOOKS_DIR PACKAGE_DIR OUT_DIR
PACKAGE_DIR holds the folder kbvh of the built package. A notebook is run again when it or the package is newer than its outputs.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import nbclient
import nbformat

ROOT = Path(__file__).resolve().parents[2]


def run(file: Path, package: Path) -> nbformat.NotebookNode:
    """Returns the notebook with outputs. Raises nbclient's error of the first cell that fails."""
    notebook = nbformat.reads(file.read_text(), as_version=4)
    path = os.pathsep.join([str(package), *filter(None, [os.environ.get("PYTHONPATH")])])
    with tempfile.TemporaryDirectory() as folder:
        client = nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": folder}})
        client.execute(env={**os.environ, "PYTHONPATH": path, "KBVH_SOURCE": str(ROOT), "PYDEVD_DISABLE_FILE_VALIDATION": "1"})
    return notebook


def main() -> int:
    notebooks, package, out = map(Path, sys.argv[1:])
    out.mkdir(parents=True, exist_ok=True)
    newest = max(file.stat().st_mtime for file in (package / "kbvh").rglob("*") if file.is_file() and "__pycache__" not in file.parts)
    for file in sorted(notebooks.glob("*.ipynb")):
        kept = out / file.name
        if not kept.exists() or kept.stat().st_mtime < max(newest, file.stat().st_mtime):
            nbformat.write(run(file, package.resolve()), kept)
    return 0


if __name__ == "__main__":
    sys.exit(main())
