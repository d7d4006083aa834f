"""The reference run: its verdicts follow from its results, by the claims as they are today."""

from __future__ import annotations

import json
import tempfile
import unittest
from pathlib import Path

import paths

from claims import agree, claims
from results.load import load

REFERENCE = paths.HERE.parents[1] / "analysis" / "reference"


class TestReference(unittest.TestCase):
    def test_verdicts_follow_from_the_results(self) -> None:
        found = claims.evaluate(load(REFERENCE), REFERENCE)
        computed = {row.id: row.verdict for row in found.rows}
        self.assertEqual(computed, agree.verdicts(REFERENCE), "after a change of claims on purpose: python3 analysis/claims.py analysis/reference")
        self.assertNotIn(claims.OPEN, computed.values())


class TestAgreement(unittest.TestCase):
    def test_only_verdicts_of_both_can_differ(self) -> None:
        first = {"E1": "holds", "E2": "holds", "E3": agree.OPEN, "E4": agree.OPEN, "E5": "holds"}
        second = {"E1": "holds", "E2": "does not hold", "E3": "holds", "E4": agree.OPEN, "E6": "holds"}
        found = agree.agreement(first, second)
        self.assertEqual((found.same, found.different), (["E1"], [("E2", "holds", "does not hold")]))
        self.assertEqual((found.only_first, found.only_second, found.open), (["E5"], ["E3", "E6"], ["E4"]))

    def test_exit_codes(self) -> None:
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            for folder, verdict in (("a", "holds"), ("b", "holds"), ("c", "does not hold")):
                (Path(name) / folder).mkdir()
                record = {"claims": [{"id": "E1", "verdict": verdict}]}
                (Path(name) / folder / "claims.json").write_text(json.dumps(record))
            at = [str(Path(name) / folder) for folder in "abcd"]
            self.assertEqual([agree.main([at[0], other]) for other in at[1:]], [0, 1, 2])


if __name__ == "__main__":
    unittest.main()
