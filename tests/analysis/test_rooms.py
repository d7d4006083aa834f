"""The rooms of analysis/: each has a sentence at its door, and uses rooms below it only."""

from __future__ import annotations

import ast
import unittest
from pathlib import Path

import paths

ANALYSIS = paths.HERE.parents[1] / "analysis"
#: From the lowest floor to the highest.
ROOMS = ("results", "ratios", "claims", "figures", "advice", "explorer", "report")


def uses(file: Path) -> set[str]:
    """Returns the first words of all imports of a file, also of those inside of functions."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name.split(".")[0] for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
    return found


class Rooms(unittest.TestCase):
    def test_every_door_has_a_sentence(self) -> None:
        for room in ROOMS:
            said = ast.get_docstring(ast.parse((ANALYSIS / room / "__init__.py").read_text(encoding="utf-8"))) or ""
            self.assertRegex(said, r"^[A-Z][^.]{20,}\.$", room)

    def test_no_room_uses_one_above_it(self) -> None:
        for floor, room in enumerate(ROOMS):
            for file in (ANALYSIS / room).glob("*.py"):
                self.assertEqual(uses(file) & set(ROOMS[floor + 1 :]), set(), file)

    def test_commands_have_a_room(self) -> None:
        # A command is the door to one function; what it does stands in its room. plan_cost.py needs nothing of the rooms.
        for file in ANALYSIS.glob("*.py"):
            found = uses(file)
            self.assertLessEqual(len(found & set(ROOMS)), 1, file)
            if file.name != "plan_cost.py":
                self.assertLess(file.read_text(encoding="utf-8").count("\n"), 16, file)
        self.assertFalse(any(file.name == "load.py" for file in ANALYSIS.glob("*.py")))


if __name__ == "__main__":
    unittest.main()
