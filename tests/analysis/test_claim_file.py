"""The form of claims.json: every mistake in it is one sentence that names the claim and the key."""

from __future__ import annotations

import copy
import json
import tempfile
import unittest
from pathlib import Path
from typing import Any, Iterator

import paths
import synthetic

from claims import claim_file, claim_pictures, claims
from claims.claim_points import ClaimError
from results import load


def objects(said: Any, free: bool = False) -> Iterator[dict[str, Any]]:
    """Every object whose keys are fixed: not those of squares, parameters and quantities, which are names."""
    if isinstance(said, dict):
        if not free:
            yield said
        for key, value in said.items():
            if key not in ("params", "builder", "not_for"):
                yield from objects(value, key == "squares")
    elif isinstance(said, list):
        for one in said:
            yield from objects(one)


def check(said: dict[str, Any]) -> str:
    """The sentence about a file, or ""."""
    try:
        claim_file.check(said, "f")
    except ClaimError as problem:
        return str(problem)
    return ""


class TestForm(unittest.TestCase):
    def setUp(self) -> None:
        self.said = claims.read_claims()

    def test_the_papers_claims_are_well_formed(self) -> None:
        self.assertEqual(check(self.said), "")

    def test_a_misspelt_key_is_refused_wherever_it_is(self) -> None:
        altered = 0
        for one in objects(self.said):
            for key in list(one):
                one[key + "x"] = one.pop(key)
                told = check(self.said)
                self.assertRegex(told, rf"there is no key '{key}x'; did you mean '{key}'\?$")
                one[key] = one.pop(key + "x")
                altered += 1
        self.assertGreater(altered, 500)
        self.assertEqual(check(self.said), "", "each key is back")

    def test_a_needed_key_is_missed_wherever_it_is(self) -> None:
        forms = (claim_file.BASELINE, claim_file.CORNER, claim_file.CHECK, claim_file.CLAIM, claim_file.THEORY, claim_file.NUMBER, claim_file.WHOLE)
        missed = 0
        for one in objects(self.said):
            for form in (form for form in forms if set(form.needed) <= set(one) <= {*form.needed, *form.optional}):
                for key in form.needed:
                    value = one.pop(key)
                    self.assertRegex(check(self.said), rf": {key} is missing$")
                    one[key] = value
                    missed += 1
        self.assertGreater(missed, 400)

    def test_mistakes_name_claim_check_key_and_word(self) -> None:
        of_check: tuple[tuple[dict[str, Any], str, str], ...] = (
            ({"measure": "ration"}, "measure: 'ration' is none of ratio, value, ", "; did you mean 'ratio'?"),
            ({"relation": "=>"}, "relation: '=>' is none of <, <=, >, >=, within a factor of", ""),
            ({"quantities": ["updates"]}, "quantities: 'updates' is none of update, ", "; did you mean 'update'?"),
            ({"quantities": "update"}, "quantities: expected a list", ""),
            ({"quantities": []}, "quantities: the list is empty", ""),
            ({"scenes": "tablecloth"}, "scenes: expected a list", ""),
            ({"scenes": []}, "scenes: the list is empty", ""),
            ({"scenes": [7]}, "scenes[0]: expected the name of a scene, got 7", ""),
            ({"square": "kinetic_abb"}, "square: 'kinetic_abb' is none of kinetic_aabb, ", "; did you mean 'kinetic_aabb'?"),
            ({"bound": "5"}, "bound: expected a number, got '5'", ""),
            ({"tolerance": True}, "tolerance: expected a number, got True", ""),
            ({"size": [16000, 2000]}, "size: expected two numbers of polygons, the smaller first, got [16000, 2000]", ""),
            ({"measure": "exponent"}, "least_sizes is missing, which the measure exponent needs", ""),
            ({"measure": "across"}, "other_scene is missing, which the measure across needs", ""),
            ({"of": "bests"}, "of: baseline: 'bests' is none of period, best, baselines", "; did you mean 'best'?"),
        )
        for change, begin, end in of_check:
            with self.subTest(change):
                said = copy.deepcopy(self.said)
                next(claim for claim in said["claims"] if claim["id"] == "E3")["checks"][0].update(change)
                told = check(said)
                self.assertTrue(told.startswith("f: E3: checks[0]: " + begin), told)
                self.assertTrue(told.endswith(end), told)
        said = copy.deepcopy(self.said)
        said["claims"][0]["checks"].append(3)
        said["claims"][1]["id"] = said["theory"][0]["id"]
        self.assertEqual(check(said), "f: E1: checks[1]: expected an object")
        said["claims"][0]["checks"].pop()
        self.assertEqual(check(said), "f: T1: id: there are two claims of this name")

    def test_the_papers_plan_measures_every_claim(self) -> None:
        plan = json.loads((paths.HERE.parents[1] / "experiments" / "plans" / "paper.json").read_text(encoding="utf-8"))
        studies = [plan, *plan["studies"]]
        scenes = [scene if isinstance(scene, dict) else {"builtin": scene} for study in studies for scene in study.get("scenes", [])]
        scene_names = {scene.get("name") or scene.get("builtin") for scene in scenes}
        ids = {one if isinstance(one, str) else one["id"] for study in studies for one in study.get("strategies", [])}
        for claim in self.said["claims"]:
            needed = f"{claim['id']}: experiments/plans/paper.json needs a study that measures these"
            for one in claim["checks"]:
                self.assertLessEqual({*one["scenes"], *one.get("optional_scenes", [])}, scene_names, needed)
                for corner in self.said["squares"][one["square"]] if "square" in one else [one]:
                    for term in (corner[side] for side in claim_file.SIDES if side in corner):
                        named = {term["strategy"]} if isinstance(term, dict) and "strategy" in term else set()
                        self.assertLessEqual(named, ids, needed)

    def test_every_key_is_documented(self) -> None:
        text = (paths.HERE.parents[1] / "experiments" / "RESULTS.md").read_text(encoding="utf-8")
        section = text[text.index("\n## Claims\n") : text.index("\n## Folders\n")]
        for form in (one for one in vars(claim_file).values() if isinstance(one, claim_file.Form)):
            for key in (*form.needed, *form.optional):
                self.assertIn(f"`{key}`", section)
        for word in (*claim_file.MEASURES, *claim_file.QUANTITIES):
            self.assertIn(f"`{word}`", section)


class TestPages(unittest.TestCase):
    def test_pages_that_count_the_claims_count_those_of_the_file(self) -> None:
        words = "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen seventeen eighteen nineteen twenty".split()
        said = claims.read_claims()
        ids = [one["id"] for one in (*said["claims"], *said["theory"])]
        last = {kind: sum(id.startswith(kind) for id in ids) for kind in "ETC"}
        self.assertEqual(ids, [f"{kind}{i + 1}" for kind, count in last.items() for i in range(count)], "numbered without a gap")
        e, t, c = (f"{kind}1 to {kind}{count}" for kind, count in last.items())
        many = {kind: words[count] for kind, count in last.items()}
        for page, told in (
            ("analysis/guides/results.md", (f"{many['E']} experimental claims, {e} (", f"{many['T']} claims, {t}, each", f"{many['C'].title()} more claims, {c},")),
            ("analysis/lessons/text/4-kinetic-tree.md", (f"theoretical claims from {t};",)),
            ("analysis/advice/summary.py", (f"{e}, then {t}, then {c}",)),
            ("experiments/RESULTS.md", (f"checks the claims {t} of", f"arithmetic, and {c}, what", f"claims {t} and {c} are taken")),
            ("experiments/plans/paper.json", (f"for the claims {e} and",)),
            ("experiments/theory/theory.hpp", (f"{t}, {c}",)),
        ):  # fmt: skip
            text = " ".join((paths.HERE.parents[1] / page).read_text(encoding="utf-8").split())
            for one in told:
                self.assertIn(one, text, page)


class TestNewClaim(unittest.TestCase):
    def test_a_claim_that_something_is_nowhere_above_zero(self) -> None:
        # Its picture would have nothing but zeros on a logarithmic axis.
        check = {
            "what": "looseness of the refit's boxes", "measure": "value", "quantities": ["looseness"], "of": {"strategy": "bottom_up"},
            "relation": "<=", "bound": 0, "tolerance": 0, "size": [1000, 4000], "any_size": True, "scenes": ["tablecloth"], "l_reaches": 1,
        }  # fmt: skip
        said = claims.read_claims()
        said["claims"].append({"id": "E99", "claim": "Boxes are tight", "paper": "0", "citation": "s.5", "figures": [], "checks": [check]})
        with tempfile.TemporaryDirectory(prefix="kbvh-analysis-") as name:
            folder, file = Path(name) / "results", Path(name) / "claims.json"
            file.write_text(json.dumps(said), encoding="utf-8")
            refit = next(c for c in synthetic.CONTESTANTS if c["id"] == "bottom_up")
            for loose, verdict in ((0.0, claims.HOLDS), (0.5, claims.FAILS)):
                line = synthetic.record(refit, "tablecloth", 2000, "float", 1)
                line["verified"]["looseness"] = loose
                synthetic.write(folder, [line])
                row = claims.evaluate(load.load(folder), folder, file).rows[-1]
                self.assertEqual((row.id, row.verdict), ("E99", verdict), row.why)
                self.assertEqual(claim_pictures.picture(row.looked, row.checks) == "", loose == 0)


if __name__ == "__main__":
    unittest.main()
