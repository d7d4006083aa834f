"""What several tests share: a folder for each case, and what a command says."""

from __future__ import annotations

import contextlib
import io
import tempfile
import unittest
from collections.abc import Callable
from pathlib import Path


class InFolder(unittest.TestCase):
    """A case with a folder of its own."""

    def setUp(self) -> None:
        temporary = tempfile.TemporaryDirectory(prefix="kbvh-analysis-")
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)


def said(main: Callable[[list[str]], int], *arguments: object) -> tuple[int, str, str]:
    """Runs a command; returns its code, and what it wrote to its two streams."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(argument) for argument in arguments])
    return code, out.getvalue(), err.getvalue()
