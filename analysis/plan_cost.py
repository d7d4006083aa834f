"""Estimates roughly how long each study of a plan takes, from costs per frame that were measured once.

usage: plan_cost.py PLAN.json [--study NAME]...

The estimates serve to choose a piece, not as results: the costs are of one machine and grow with the number of polygons; what
a scene's contact and its resting body change is one factor for each. Only the standard library is needed.
"""

from __future__ import annotations

import argparse
import json
import sys
from itertools import product
from pathlib import Path
from typing import Any, Iterator

#: Milliseconds per frame for 1000 moving polygons: update and query, and what a keyframe interval costs besides.
#: Measured on one core of an AMD EPYC (tablecloths of 4k and 16k over tables of 2k triangles).
COSTS: dict[str, tuple[float, float]] = {
    "bottom_up": (0.02, 0), "bottom_up_period": (0.06, 0), "bottom_up_recursive": (0.06, 0), "hybrid": (0.02, 0),
    "leaf_slabs": (0.02, 0), "front": (0.02, 0),
    "inflated_lazy": (0.02, 0), "top_down": (0.07, 0), "rebuild": (0.25, 0), "kinetic_aabb": (0.015, 0.04),
    "kinetic_boxtree": (0.03, 0.03), "kinetic_separation_list": (0.015, 0.15), "kinetic_kdop": (0.06, 0.12),
    "kinetic_aabb avl": (0.06, 1), "kinetic_boxtree avl": (0.4, 0.6), "kinetic_separation_list avl": (0.02, 3.3),
    "fcl_float_bottom_up": (0.12, 0),
    "fcl_float_own_verdict": (0.12, 0), "bullet_bvh": (0.07, 0), "embree_refit": (0.05, 0), "linear_bounds": (0.03, 0.1),
    "interval_join": (0.02, 0.3), "interval_join_ahead": (0.02, 0.3), "auto": (0.03, 0.3), "drift_boxes": (0.03, 0),
    "kinetic_envelope": (0.04, 0.2), "kinetic_envelope_ahead": (0.04, 0.2), "kinetic_calendar": (0.1, 1),
}  # fmt: skip
UNKNOWN = (0.3, 1.5)  #: of strategies that are not listed
#: Measured over estimated minutes of plan `paper`'s studies (geometric means, two studies at a time on an Intel Xeon). Garments touch
#: their body everywhere; reversing spheres are two of the size that is asked for. Plan `spacetime`, whose contestants are mostly fast,
#: took 0.1 to 0.6 of its estimates.
FACTORS = {"shirt": 2.2, "dress": 1.5, "reversing_spheres": 0.8, "file": 0.55}
MOTION = 0.006  #: per frame, for 1000 polygons
CLIPS = 2  #: besides the repetitions: one that is verified, one that is replayed and counted
ORACLE = 0.7  #: true pairs of one frame, once, and looking at all boxes for each contestant, for 1000 polygons
KEYFRAMES, TRIANGLES = 60, 16000  #: where a plan does not say
LONGEST = 45  #: minutes that a piece should take at most


def listed(value: Any) -> list[Any]:
    """Returns a value or a list of values as a list."""
    return value if isinstance(value, list) else [value]


def scenes(study: dict[str, Any]) -> Iterator[tuple[float, int, bool]]:
    """Returns thousands of polygons (times the scene's factor) and keyframes of each scene, and whether it defines its own frames."""
    for scene in listed(study.get("scenes", [])):
        scene = {"builtin": scene} if isinstance(scene, str) else scene
        versions = len(listed(scene.get("seed", 1))) * len(listed(scene.get("order", "given")))
        own = scene.get("builtin") == "reversing_spheres"
        factor = FACTORS.get(scene.get("builtin", "file"), 1)
        for triangles in listed(scene.get("triangles", TRIANGLES)) * versions:
            yield triangles * factor / 1000, scene.get("keyframes", KEYFRAMES if "builtin" in scene else 150), own


def configurations(strategy: Any) -> tuple[str, int]:
    """Returns a strategy's key in COSTS (" avl": as in 2006), and the number of its configurations."""
    if isinstance(strategy, str):
        return strategy, 1
    params = strategy.get("params", {})
    sweeps = [*params.values(), *strategy.get("builder", {}).values()]
    kind = " avl" if "avl" in listed(params.get("queue")) else ""
    return strategy["id"] + kind, len(list(product(*map(listed, sweeps))))


def contestants(study: dict[str, Any]) -> Iterator[tuple[str, int]]:
    """Returns ids and configurations of all strategies; a group ("default", "family:...") counts as all known ones."""
    asked = [configurations(strategy) for strategy in study.get("strategies", ["default"])]
    groups = [name in ("default", "all") or name.startswith("family:") for name, _ in asked]
    if any(groups):
        yield from ((name, 1) for name in COSTS if " " not in name)
    yield from (pair for pair, group in zip(asked, groups) if not group and not pair[0].startswith("!"))


def minutes(study: dict[str, Any]) -> float:
    """Estimates one study, with the plan's own keys filled in."""
    total = 0.0
    for thousands, keyframes, own in scenes(study):
        for l in [1] if own else listed(study.get("l", 10)):
            frames = keyframes if own else (keyframes - 1) * l + 1
            frames = min(frames, study.get("frames_limit") or frames)
            checked = frames / study.get("oracle_every", 1)
            total += checked * ORACLE * thousands
            for name, count in contestants(study):
                per_frame, per_interval = COSTS.get(name, UNKNOWN)
                clip = frames * (per_frame + MOTION) + (frames / l) * per_interval
                once = clip * (study.get("repetitions", 5) + CLIPS) + checked * ORACLE
                total += count * once * thousands
    return total / 60000


def pieces(plan: dict[str, Any]) -> dict[str, float]:
    """Returns the minutes of each study by name; studies of one name are one piece."""
    common = {name: value for name, value in plan.items() if name != "studies"}
    result: dict[str, float] = {}
    for study in plan.get("studies", [{}]):
        whole = {**common, **study}
        name = whole.get("name", "")
        result[name] = result.get(name, 0.0) + minutes(whole)
    return result


def about(length: float) -> str:
    """Returns a duration in minutes as text."""
    if length < 1:
        return "   under 1 min"
    return f"about {length:5.0f} min" if length < 90 else f"about {length / 60:5.1f} h"


def main() -> int:
    """Prints a line per study; all of them, or those asked for."""
    parser = argparse.ArgumentParser(prog="plan_cost.py", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("plan", metavar="PLAN.json")
    parser.add_argument("--study", action="append", default=[], metavar="NAME", help="only this study; may be repeated")
    asked = parser.parse_args()
    try:
        found = pieces(json.loads(Path(asked.plan).read_text(encoding="utf-8")))
    except (OSError, ValueError) as reason:
        print(f"plan_cost: {asked.plan}: {getattr(reason, 'strerror', None) or reason}", file=sys.stderr)
        return 2
    except (AttributeError, KeyError, TypeError):
        print(f"plan_cost: {asked.plan} is not a plan (experiments/RESULTS.md describes plans)", file=sys.stderr)
        return 2
    for name in asked.study:
        if name not in found:
            known = ", ".join(f"'{one}'" for one in found)
            print(f"plan_cost: {asked.plan} has no study '{name}'; it has {known}", file=sys.stderr)
            return 2
    kept = {name: length for name, length in found.items() if not asked.study or name in asked.study}
    for name, length in kept.items():
        print(f"{name:<24} {about(length)}")
    print(f"{'all':<24} {about(sum(kept.values()))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
