"""Checks the form of claims.json before results are looked at: a mistake is one sentence that names the claim and the key.

Without this a misspelt optional key would be ignored, and a wrong relation would be noticed only by results that have points for it.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Any, Iterable

from claims.claim_points import COUNTED, DERIVED, MEASURES, RELATIONS, TIMES, ClaimError

QUANTITIES = (*TIMES, *COUNTED, *DERIVED)
#: The sides of a comparison.
SIDES = ("numerator", "denominator", "of")


@dataclass(frozen=True)
class Form:
    """The keys of an object: those that it must have, and those that it may have."""

    needed: tuple[str, ...]
    optional: tuple[str, ...] = ()


TERM = Form((), ("strategy", "family", "baseline", "builder", "params", "one_of", "except", "not_for"))
BASELINE = Form(("id", "name", "short"), (*TERM.optional, "why"))
CORNER = Form(("id", "name", "short"), ("who", "optional", "needs", *SIDES))
NUMBER = Form(("what", "quantity", "of"))
CHECK = Form(
    ("what", "measure", "quantities", "relation", "bound", "tolerance", "size", "scenes", "l_reaches"),
    ("short", "row", "square", "optional_scenes", "any_size", "least_sizes", "other_scene", "other_size", *SIDES),
)
CLAIM = Form(("id", "claim", "paper", "citation", "figures", "checks"), ("note", "shown", "apart_shown"))
THEORY = Form(("id", "claim"))
WHOLE = Form(("schema", "scalar", "baselines", "claims", "theory"), ("about", "squares"))


def check(said: dict[str, Any], place: str) -> None:
    """Raises ClaimError for the first mistake in the content of claims.json; `place` begins the sentence."""
    _keys(said, WHOLE, place)
    baselines = []
    for at, one in _list(said, "baselines", place):
        _keys(one, BASELINE, at)
        baselines.append(one["id"])
    known_terms = [*baselines, "baselines"]
    squares = said.get("squares", {})
    _keys(squares, Form((), tuple(squares) if isinstance(squares, dict) else ()), f"{place}: squares")
    for name in squares:
        for at, corner in _list(squares, name, f"{place}: squares"):
            _keys(corner, CORNER, at)
            _terms(corner, (*SIDES, "needs"), known_terms, at)
    seen: set[str] = set()
    for list_of, form in (("claims", CLAIM), ("theory", THEORY)):
        for at, claim in _list(said, list_of, place):
            at = f"{place}: {claim['id']}" if isinstance(claim, dict) and "id" in claim else at
            _keys(claim, form, at)
            if claim["id"] in seen:
                raise ClaimError(f"{at}: id: there are two claims of this name")
            seen.add(claim["id"])
            numbers = _list(claim, "shown", at) + ([(f"{at}: apart_shown", claim["apart_shown"])] if "apart_shown" in claim else [])
            for place_of, one in numbers:
                _keys(one, NUMBER, place_of)
                _words([one["quantity"]], QUANTITIES, "quantity", place_of)
                _terms(one, ("of",), known_terms, place_of)
            _list(claim, "figures", at)
            for place_of, one in _list(claim, "checks", at):
                _check(one, known_terms, squares, place_of)


def _check(one: Any, baselines: list[str], squares: dict[str, Any], at: str) -> None:
    _keys(one, CHECK, at)
    _words([one["measure"]], MEASURES, "measure", at)
    _words([one["relation"]], RELATIONS, "relation", at)
    _words([word for _, word in _list(one, "quantities", at)], QUANTITIES, "quantities", at)
    if "square" in one:
        _words([one["square"]], squares, "square", at)
    for name in ("least_sizes",) if one["measure"] == "exponent" else ("other_scene", "other_size") if one["measure"] == "across" else ():
        if name not in one:
            raise ClaimError(f"{at}: {name} is missing, which the measure {one['measure']} needs")
    for name in ("bound", "tolerance", "l_reaches"):
        if not _is_number(one[name]):
            raise ClaimError(f"{at}: {name}: expected a number, got {one[name]!r}")
    for name in ("size", "other_size"):
        ends = one.get(name, [1, 1])
        if not (isinstance(ends, list) and len(ends) == 2 and all(map(_is_number, ends)) and 0 < ends[0] <= ends[1]):
            raise ClaimError(f"{at}: {name}: expected two numbers of polygons, the smaller first, got {ends!r}")
    for name in ("scenes", "optional_scenes"):
        for place_of, scene in _list(one, name, at):
            if not isinstance(scene, str):
                raise ClaimError(f"{place_of}: expected the name of a scene, got {scene!r}")
    for name in ("quantities", "scenes"):
        if not one[name]:
            raise ClaimError(f"{at}: {name}: the list is empty")
    _terms(one, SIDES, baselines, at)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _keys(said: Any, form: Form, at: str) -> None:
    if not isinstance(said, dict):
        raise ClaimError(f"{at}: expected an object")
    known = (*form.needed, *form.optional)
    for key in said:
        if key not in known:
            raise ClaimError(f"{at}: there is no key '{key}'{_meant(key, known)}")
    for key in form.needed:
        if key not in said:
            raise ClaimError(f"{at}: {key} is missing")


def _list(said: dict[str, Any], key: str, at: str) -> list[tuple[str, Any]]:
    """Returns the entries of a list, each with its place; none where the key is absent."""
    found = said.get(key, [])
    if not isinstance(found, list):
        raise ClaimError(f"{at}: {key}: expected a list")
    return [(f"{at}: {key}[{number}]", one) for number, one in enumerate(found)]


def _words(found: Iterable[Any], known: Iterable[str], key: str, at: str) -> None:
    known = list(known)
    for word in found:
        if word not in known:
            raise ClaimError(f"{at}: {key}: '{word}' is none of {', '.join(known)}{_meant(word, known)}")


def _meant(word: Any, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(str(word), list(known), 1)
    return f"; did you mean '{near[0]}'?" if near else ""


def _terms(said: dict[str, Any], names: Iterable[str], baselines: list[str], at: str) -> None:
    for name in names:
        if name in said:
            _term(said[name], baselines, f"{at}: {name}")


def _term(said: Any, baselines: list[str], at: str) -> None:
    if isinstance(said, str):
        _words([said], baselines, "baseline", at)
        return
    _keys(said, TERM, at)
    for place, one in _list(said, "one_of", at):
        _term(one, baselines, place)
