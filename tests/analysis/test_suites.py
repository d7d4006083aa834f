"""tests/suites.py has one process for the cases of a suite, and begins with what takes long."""

import sys
import unittest
from typing import Any

import paths

sys.path.insert(0, str(paths.HERE.parents[1] / "tests"))
import suites  # noqa: E402


def case(program: str, name: str, cost: float = 0) -> dict[str, Any]:
    """A case of a GoogleTest executable, as `ctest --show-only=json-v1` tells it."""
    properties = [{"name": "COST", "value": cost}] if cost else []
    return {"name": name, "command": [f"/b/{program}", f"--gtest_filter={name}", "--also_run_disabled_tests"], "properties": properties}


class Suites(unittest.TestCase):
    TESTS = [
        *(case("core_test", f"Sides.Case{i}") for i in range(3)),
        {"name": "package", "command": ["/usr/bin/python3", "-m", "unittest"], "properties": [{"name": "COST", "value": 100.0}]},
        case("clock_test", "Lists.Float", 50),
        case("clock_test", "Lists.Double", 50),
    ]

    def names(self, before: dict[str, float]) -> list[str]:
        return [batch[0] for batch in suites.in_order(suites.batches(self.TESTS), before)]

    def test_cases_of_a_suite_are_one_process(self) -> None:
        found = {batch[0]: batch[1:3] for batch in suites.batches(self.TESTS)}
        self.assertEqual(set(found), {"core_test Sides", "package", "clock_test Lists"})
        self.assertEqual(
            found["clock_test Lists"], (2, ["/b/clock_test", "--gtest_brief=1", "--gtest_filter=Lists.Float:Lists.Double"])
        )
        self.assertEqual(found["package"], (1, ["/usr/bin/python3", "-m", "unittest"]))

    def test_a_first_run_begins_with_what_costs_most(self) -> None:
        self.assertEqual(self.names({}), ["package", "clock_test Lists", "core_test Sides"])

    def test_times_of_an_earlier_run_decide(self) -> None:
        before = {"core_test Sides": 70.0, "package": 3.0, "clock_test Lists": 9.0}
        self.assertEqual(self.names(before), ["core_test Sides", "clock_test Lists", "package"])


if __name__ == "__main__":
    unittest.main()
