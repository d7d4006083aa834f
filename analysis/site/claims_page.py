"""The page of the paper's claims, from a results folder's claims.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from claims.claims import in_order

#: The order of verdicts; others come last.
ORDER = ["holds", "holds with a condition", "does not hold", "not decided here"]


def page(results: Path) -> str:
    file = results / "claims.json"
    lines = ["# Claims of the paper", ""]
    if not file.exists():
        return "\n".join([*lines, f"There is no `claims.json` in `{results.name}`; `kbvh report` writes it.", ""])
    claims = sorted(json.loads(file.read_text())["claims"], key=lambda claim: in_order(claim["id"]))
    by_verdict: dict[str, list[dict[str, Any]]] = {}
    for claim in claims:
        by_verdict.setdefault(claim["verdict"], []).append(claim)
    lines += [
        "Each claim of Zachmann & Weller 2006 is compared with measurements (E), or with counts and exact arithmetic (T, and C for the conclusions). "
        "A verdict follows from criteria that are written down as data (`analysis/claims.json`, `experiments/theory`), and from "
        f"nothing else. These are {len(claims)} claims, by the results in `{results.name}`.",
        "",
    ]
    for verdict in sorted(by_verdict, key=lambda word: ORDER.index(word) if word in ORDER else len(ORDER)):
        found = by_verdict[verdict]
        lines += [f"## {verdict[:1].upper()}{verdict[1:]} ({len(found)})", ""]
        for claim in found:
            condition = f" *Condition: {claim['condition']}.*" if claim["condition"] else ""
            lines += [f"**{claim['id']}** {claim['claim']} ({claim['citation']})", f":   {claim['brief'] or claim['why']}{condition}", ""]
    return "\n".join(lines)
