"""Describes claims in words: where a check is met, under which condition, and why in two sentences."""

from __future__ import annotations

import re
from typing import Any

from claims.claim_points import Corner, CheckResult, Point
from results import text

NOT_MEASURED = "not measured here"


def wanted(check: dict[str, Any]) -> str:
    """Describes the values that a check requires."""
    words = {"<": "below", "<=": "at most", ">": "above", ">=": "at least"}.get(check["relation"], check["relation"])
    room = f", give or take {text.percent(check['tolerance'])}" if check["tolerance"] else ""
    return f"{words} {number(check['bound'])}{room}"


def number(value: float) -> str:
    """Formats a bound without trailing zeros."""
    return text.tick(float(f"{value:.3g}"))


def place(point: Point) -> str:
    """Describes the place of a point."""
    return f"{point.scene} {text.size(point.size)}, l = {point.l:g}"


def where(points: list[Point]) -> str:
    """Describes the points at which the check is met: the simplest rule that separates them exactly, or a count."""
    good = [point for point in points if point.met]
    if len(good) == len(points):
        return "met everywhere"
    if not good:
        return "met nowhere"
    for of, show in (
        (lambda p: p.l, lambda v: f"l = {v:g}"),
        (lambda p: p.size, lambda v: f"{text.size(v)} polygons"),
    ):
        bad = [of(point) for point in points if not point.met]
        if min(of(point) for point in good) > max(bad):
            return f"met from {show(min(of(point) for point in good))} on"
        if max(of(point) for point in good) < min(bad):
            return f"met up to {show(max(of(point) for point in good))}"
    scenes = sorted({point.scene for point in good})
    if not any(point.scene in scenes for point in points if not point.met):
        return f"met on {text.listing(scenes)} only"
    told = "; ".join(place(point) for point in good[:3]) + ("; …" if len(good) > 3 else "")
    return f"met at {len(good)} of {len(points)} points ({told})"


def several(looked: CheckResult) -> bool:
    """Returns whether the check is evaluated with and without motion evaluation."""
    return any(quantity.endswith("with motion") for quantity in looked.check["quantities"])


def motion(looked: CheckResult, quantity: str) -> str:
    """Describes the difference between a quantity and the check's other quantities."""
    if quantity.endswith("with motion"):
        return "with motion evaluation"
    return "without motion evaluation" if several(looked) else ""


def kinds(looked: CheckResult) -> list[tuple[Corner, str, list[Point]]]:
    """Returns corner, quantity and points, for each pair with points."""
    found = []
    for corner in looked.corners:
        for quantity in looked.check["quantities"]:
            mine = [one for one in looked.points if (one.corner, one.quantity) == (corner.id, quantity)]
            if mine:
                found.append((corner, quantity, mine))
    return found


def rule(looked: CheckResult, corner: Corner) -> str:
    """Describes where a corner is met, over its quantities; "not measured here" without points."""
    rules = {quantity: where(mine) for one, quantity, mine in kinds(looked) if one.id == corner.id}
    if not rules:
        return NOT_MEASURED
    if len(set(rules.values())) == 1:
        return next(iter(rules.values()))
    return ", ".join(f"{told} {motion(looked, quantity)}".strip() for quantity, told in rules.items())


def unmeasured(looked: list[CheckResult]) -> list[str]:
    """Names the corners, and parts of corners, that were not measured."""
    found: dict[str, list[str]] = {}  # names by what is said of them
    said_already = {gap for one in looked for gap in one.missing}
    for one in looked:
        absent = one.unmeasured()
        for corner in one.corners:
            if corner in absent:
                whole = all(other in absent for other in one.corners if other.who == corner.who)
                found.setdefault("", []).append(corner.who if whole else corner.name)
            for gap in one.gaps.get(corner.id, []) if corner not in absent else []:
                if gap not in said_already:
                    found.setdefault(f" ({gap})", []).append(corner.who)
    return [f"{text.listing(list(dict.fromkeys(names)))}{said}" for said, names in found.items()]


def details(looked: CheckResult) -> list[str]:
    """Lists the missing data of one check, optional corners included."""
    optional = [f"{corner.name}: {gap}" for corner in looked.corners for gap in looked.gaps.get(corner.id, [])]
    return looked.missing + optional


def as_in_2006(looked: list[CheckResult]) -> list[str]:
    """Names the structures at their best whose points come from the same records as those of an earlier corner."""
    names = []
    for one in looked:
        seen: set[frozenset[Any]] = set()
        for corner in one.corners:
            records = frozenset((p.quantity, p.keys) for p in one.points if p.corner == corner.id)
            if records and records in seen:
                names.append(corner.who)
            seen.add(records)
    return list(dict.fromkeys(names))


def sentence(one: CheckResult) -> str:
    """Describes a check: the measured values, where it is met, and the requirement."""
    parts = []
    for corner, quantity, mine in kinds(one):
        low, high = min(mine, key=lambda p: p.value.middle), max(mine, key=lambda p: p.value.middle)
        told = f"{corner.name} {motion(one, quantity) if corner.id else ''}".strip()
        told = f"{told} " if told else ""
        if len(mine) == 1:
            told += f"{text.factor(low.value.middle)} ({place(low)}): {where(mine)}"
        elif text.factor(low.value.middle) == text.factor(high.value.middle):
            told += f"{text.factor(low.value.middle)} at all {len(mine)} points: {where(mine)}"
        else:
            told += (
                f"{text.factor(low.value.middle)} ({place(low)}) to {text.factor(high.value.middle)} ({place(high)}): "
                f"{where(mine)}"
            )
        close = sum(point.close for point in mine)
        if close:
            told += f" (at {text.plural(close, 'point')} repetitions disagree)"
        parts.append(told)
    return f"{_capital(one.check['what'])} (wanted: {wanted(one.check)}): " + "; ".join(parts) + "."


def condition(looked: list[CheckResult]) -> str:
    """Returns the condition under which all checks are met, one clause for each check that is not met everywhere."""
    clauses = []
    for one in looked:
        if all(point.met for point in one.points):  # or none was measured of an optional one
            continue
        met = [corner for corner in one.corners if any(p.met for p in one.points if p.corner == corner.id)]
        parts = [f"{corner.name} {rule(one, corner)}".strip() for corner in met]
        measured = len(one.corners) - len(one.unmeasured())
        unmet = "; nothing else is met" if len(met) < measured else ""
        clauses.append(f"{one.check['what']}: {'; '.join(parts)}{unmet}")
    return ". ".join(clauses)


def brief(looked: list[CheckResult], missing: list[str]) -> str:
    """Explains the verdict in two sentences: where the checks are met, and the measured range."""
    known = [one for one in looked if one.points]
    if missing:
        more = f" and {text.plural(len(missing) - 2, 'other thing')}" if len(missing) > 2 else ""
        first = f"Missing: {'; '.join(missing[:2])}{more}."
        return f"{first} {_range(known[:1], 'Measured so far')}".strip() if known else first
    open_checks = [one for one in known if not all(point.met for point in one.points)]
    if not open_checks:
        count = sum(len(one.points) for one in known)
        corners = " in every corner measured" if any("square" in one.check for one in known) else ""
        return f"Met at all {text.plural(count, 'point')}{corners}. {_range(_alike(known, known[0]), 'Measured')}"
    refuted = [one for one in open_checks if not any(point.met for point in one.points)]
    told = _capital("; ".join(_rules(one, len(known) > 1) for one in open_checks)) + "."
    deciding = (refuted or open_checks)[0]
    return f"{told} {_range([deciding], 'Measured')}"


def brief_theory(condition_said: str, why: str) -> str:
    """Explains the verdict of theory.json in two sentences."""
    sentences = [_capital(one) for one in re.split(r"(?<=[a-z0-9)%]\.)\s+(?=[A-Za-z0-9])", why)]
    if condition_said:
        return f"Condition: {condition_said}. {sentences[0]}".strip()
    return " ".join(sentences[:2])


def _alike(looked: list[CheckResult], first: CheckResult) -> list[CheckResult]:
    """Returns the checks with the same requirement as the first one."""
    same = ("measure", "relation", "bound")
    return [one for one in looked if all(one.check[name] == first.check[name] for name in same)]


def _rules(one: CheckResult, named: bool) -> str:
    """Describes where one check is met; corners with the same rule share a clause."""
    by_rule: dict[str, list[str]] = {}
    for corner in one.corners:
        told = re.sub(r" \([^()]*; …\)", "", rule(one, corner))
        if told != NOT_MEASURED:
            by_rule.setdefault(told, []).append(corner.name)
    name = f"{one.check.get('short') or one.check['what']}: " if named else ""
    if len(by_rule) == 1:
        told, corners = next(iter(by_rule.items()))
        return name + (f"{told}, in none of {len(corners)} corners" if told == "met nowhere" and len(corners) > 1 else told)
    parts = [f"{text.listing(corners)} {told}" for told, corners in by_rule.items() if told != "met nowhere"]
    return name + "; ".join([*parts, "nowhere else"] if "met nowhere" in by_rule else parts)


def _range(looked: list[CheckResult], word: str) -> str:
    """Compares the measured extremes with the claimed value."""
    points = [(point, one) for one in looked for point in one.points]
    if not points:
        return ""
    shorts = {(id(one), corner.id): corner.short for one in looked for corner in one.corners}

    def shown(point: Point, one: CheckResult) -> str:
        at = [one.check.get("short", "")] if len(looked) > 1 else []
        at += [shorts[(id(one), point.corner)], place(point)]
        return f"{text.factor(point.value.middle)} ({', '.join(part for part in at if part)})"

    low = min(points, key=lambda pair: pair[0].value.middle)
    high = max(points, key=lambda pair: pair[0].value.middle)
    told = shown(*low)
    if text.factor(low[0].value.middle) != text.factor(high[0].value.middle):
        told += f" to {shown(*high)}"
    return f"{word}: {told}; claimed: {wanted(looked[0].check)}."


def _capital(told: str) -> str:
    return told[:1].upper() + told[1:]
