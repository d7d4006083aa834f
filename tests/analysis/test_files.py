"""Files: the sentences about errors of the system."""

from __future__ import annotations

import errno
import unittest

import paths  # noqa: F401  (finds the modules under test)

from results import files


class TestFiles(unittest.TestCase):
    def test_limits_of_the_process_are_no_fault_of_the_input(self) -> None:
        # Python reports the file that it tried to open last, which need not be one of the report's.
        text, code = files.complaint(OSError(errno.EMFILE, "Too many open files", "utf_32_be.py"))
        self.assertEqual(code, 3)
        self.assertIn("ulimit", text)
        self.assertNotIn("utf_32_be", text)

    def test_other_errors_name_the_file(self) -> None:
        text, code = files.complaint(OSError(errno.ENOSPC, "No space left on device", "report.html"))
        self.assertEqual((text, code), ("report.html cannot be written: No space left on device.", 2))


if __name__ == "__main__":
    unittest.main()
