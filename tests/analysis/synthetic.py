"""Results that look like a study, for tests and for looking at the report. Invented numbers, never shipped as data.

usage: synthetic.py FOLDER [small]
"""

from __future__ import annotations

import json
import math
import random
import sys
import zlib
from pathlib import Path
from typing import Any, Optional

MACHINE = {
    "cpu": "Invented CPU @ 2.5 GHz", "cores": 2, "memory_gb": 16, "os": "Debian GNU/Linux 12", "compiler": "GCC 12.2.0",
    "flags": "-O2 -ffp-contract=off", "build_type": "Release", "simd": "sse2",
}  # fmt: skip

#: id, title, family, guarantee, tightness, own scalar, builder, params,
#: update ns per primitive and frame, event-driven update us per primitive and keyframe, query factor, looseness
CONTESTANTS: list[dict[str, Any]] = [
    dict(id="bottom_up", title="Bottom-up refit", family="refit", update=6.0, query=1.0, builder=(2, 1)),
    dict(id="bottom_up", title="Bottom-up refit", family="refit", update=1.9, query=1.05, builder=(8, 4), loose=0.02),
    dict(id="bottom_up_period", title="Bottom-up refit as in 2006", family="refit", update=13.0, query=1.9, builder=(2, 1)),
    dict(id="top_down", title="Top-down refit", family="rebuild", update=60.0, query=1.1, builder=(2, 1)),
    dict(id="rebuild", title="Rebuild every frame", family="rebuild", update=110.0, query=0.9, builder=(2, 4)),
    dict(id="kinetic_aabb", title="Kinetic AABB tree", family="kinetic", event=150.0, query=1.3, builder=(2, 1),
         params={"queue": "avl"}),
    dict(id="kinetic_aabb", title="Kinetic AABB tree", family="kinetic", event=45.0, query=1.3, builder=(2, 1),
         params={"queue": "binary_heap"}),
    dict(id="brute_force", title="Brute force", family="oracle", update=0.0, query=400.0, builder=None),
    dict(id="fcl_bottom_up", title="FCL bottom-up refit", family="fcl", update=24.0, query=2.5,
         guarantee="candidate_superset", tightness="none", builder=None, hidden=True),
    dict(id="fcl_own_verdict", title="FCL with its own triangle test", family="fcl", update=24.0, query=2.4,
         guarantee="approximate", tightness="none", builder=None, hidden=True, missed=3, extra=41),
    dict(id="bullet_quantised", title="Bullet quantised BVH refit", family="bullet", update=13.0, query=1.4,
         guarantee="candidate_superset", own_scalar="float", builder=None, loose=0.31),
    dict(id="bullet_dbvt", title="Bullet btDbvt", family="bullet", update=31.0, query=1.5,
         guarantee="candidate_superset", own_scalar="float", builder=None, loose=0.0),
    dict(id="embree_refit", title="Embree refit, compact", family="embree", update=3.4, query=0.8,
         guarantee="candidate_superset", own_scalar="float", builder=None, hidden=True),
    dict(id="linear_bounds", title="Linear bounds", family="linear", update=0.4, query=1.05, builder=(8, 4), loose=0.004,
         tightness="conservative"),
    dict(id="student_margin", title="A student's fat boxes", family="out_of_tree", update=0.9, query=1.6, builder=(8, 4),
         params={"margin": 0.01}, guarantee="approximate", tightness="none", loose=0.45, missed=12, extra=0,
         protrusion=3.1e-5),
]  # fmt: skip


def record(
    contestant: dict[str, Any], scene: str, primitives: int, scalar: str, l: int, repetitions: int = 5, seed: int = 1
) -> dict[str, Any]:
    """One line of results.jsonl, of schema 1."""
    rng = random.Random(json.dumps([contestant, scene, primitives, scalar, l, seed], sort_keys=True))
    keyframes = 20
    frames = keyframes * l + 1
    wide = 1.25 if scalar == "double" else 1.0
    event = contestant.get("event")
    events = 0.9 * primitives * math.log2(primitives) * keyframes / 8 if event else 0
    update = contestant.get("update", 0.0) * primitives * 1e-6 * wide
    if event:
        update = event * 1e-6 * events / frames + 0.002
    traversal = contestant["query"] * primitives**0.75 * 2.4e-4 * wide
    tests = 0.02 + 3e-6 * primitives
    motion = primitives * 0.5e-6 * wide
    rows = []
    for _ in range(repetitions):
        drift = 1 + rng.gauss(0, 0.015)
        rows.append(
            {
                "motion": motion * drift, "update": update * drift, "traversal": traversal * drift,
                "triangle_tests": tests * drift, "plan_changes": 0.0,
            }  # fmt: skip
        )
    total = motion + update + traversal + tests
    pairs = frames * int(primitives**0.5)
    builder = contestant.get("builder")
    loose = contestant.get("loose", 0.0)
    missed, extra = contestant.get("missed", 0), contestant.get("extra", 0)
    candidates = int(pairs * (1 + 2.2 * contestant["query"] ** 0.5 + loose)) if contestant["query"] < 100 else pairs * 400
    return {
        "schema": 1, "key": f"{contestant['id']}/{scene}/{primitives}/{scalar}/{l}", "kind": "bench", "run": "session 1",
        "when": "2026-11-21T05:00:00Z", "commit": "0123456789abcdef", "dirty": False, "machine": MACHINE, "seed": seed,
        "scene": {
            "name": f"{scene}-{primitives - 400}-400", "hash": f"{zlib.crc32(f'{scene}{primitives}'.encode()):08x}", "scalar": scalar, "per_keyframe": l,
            "keyframes": keyframes, "frames": frames, "primitives": primitives,
            "bodies": [
                {"name": "cloth", "primitives": primitives - 400, "vertices": primitives // 2, "keyframes": keyframes,
                 "moving": True, "degenerate": 0},
                {"name": "table", "primitives": 400, "vertices": 202, "keyframes": 1, "moving": False, "degenerate": 2},
            ],
        },
        "strategy": {
            "id": contestant["id"], "title": contestant["title"], "family": contestant["family"],
            "guarantee": contestant.get("guarantee", "exact"), "tightness": contestant.get("tightness", "tight"),
            "foresight": "whole_clip" if event else "none", "citation": "Somebody and Other, A Paper, 2006",
            "own_scalar": contestant.get("own_scalar", ""), "params": contestant.get("params", {}),
            "builder": {"method": "median", "width": builder[0], "leaf_size": builder[1]} if builder else None,
        },
        "verified": {
            "holds": True, "first_violation": "", "frames": frames, "pairs": pairs, "candidates": candidates,
            "missed_candidates": missed, "missed": missed, "extra": extra, "repeated": 0, "malformed": 0,
            "audited": not contestant.get("hidden", False), "protrusion": contestant.get("protrusion", 0.0),
            "looseness": loose, "invalid": 0, "not_tight": 0, "sampled_every": 1 if l <= 10 else 3,
            "over_time": [] if contestant.get("hidden", False) else [
                {"t": float(t), "looseness": loose, "sah": 60.0 + t * contestant["query"], "sah_rebuilt": 50.0}
                for t in range(0, keyframes, 4)
            ],
        },
        "times": {
            "unit": "ms", "repetitions": rows, "total_p50": total * 0.97, "total_p99": total * (2.6 if event else 1.15),
            "total_worst": total * (5.1 if event else 1.4), "build_ms": primitives * 1e-4,
            "over_time": [
                {"begin": part / 8, "update": 0.6 * total, "query": total * (0.4 + 0.1 * part)} for part in range(8)
            ],
        },
        "counters": {
            "nodes_visited": 2 * primitives * frames, "values_written": int(2.4 * events) if event else 12 * primitives * frames,
            "vertex_reads": 3 * primitives * frames, "positions_fetched": 0, "certificates_made": int(events * 3),
            "certificates_failed": int(events), "certificates_discarded": int(events), "internal_events": int(events * 0.4),
            "overlap_events": 0, "parents_apart_events": 0, "leaves_apart_events": 0, "bound_change_events": 0, "list_peak": 0,
            "queue_operations": int(events * 4), "queue_steps": int(events * 40), "queue_peak": primitives if event else 0,
            "box_tests": 40 * candidates, "triangle_tests": candidates, "triangle_tests_exact": pairs // 50, "bytes": 0,
        },
        "events_at_depth": [int(events * 2.0 ** (depth - 12)) for depth in range(12)] if event else [],
        "bytes": primitives * (200 if event else 48),
    }  # fmt: skip


def add_frames(line: dict[str, Any], seed: int = 1) -> dict[str, Any]:
    """Makes a result one of schema 2: with times of 40 frames, of which some were disturbed."""
    rng = random.Random(f"{line['key']} {seed}")
    frames = 40
    for one in line["times"]["repetitions"]:
        total = sum(one[name] for name in ("update", "traversal", "triangle_tests", "plan_changes"))
        weights = [1 + 0.5 * math.sin(f) for f in range(frames)]
        totals = [total * w * rng.choice([1, 1, 1, 1, 3]) for w in weights]
        scale = sum(totals) / frames / total if total > 0 else 1
        for name in ("update", "traversal", "triangle_tests", "plan_changes"):
            one[name] *= scale
        one.update(totals=totals, motions=[one["motion"]] * frames)
    line["schema"] = 2
    line["times"].update(frames=frames, by="frames", steady_from=None, disturbed="")
    return line


def refused(line: dict[str, Any], reason: str, violation: str = "") -> dict[str, Any]:
    """The same result without a time."""
    line["times"] = None
    line["refused"] = reason
    if violation:
        line["verified"].update(holds=False, first_violation=violation)
    return line


def study() -> list[dict[str, Any]]:
    """Two scenes, several sizes, scalars and l, every contestant, some refused."""
    lines = []
    for scene, sizes, scalars, depths in (
        ("tablecloth", (2000, 8000, 16000), ("float",), (1, 10, 30, 100)),
        ("sphere cuts through horse", (32000,), ("float", "double"), (7,)),
    ):
        for primitives in sizes:
            for scalar in scalars:
                for l in depths:
                    if primitives != sizes[-1] and l != depths[len(depths) // 2]:
                        continue
                    for contestant in CONTESTANTS:
                        line = record(contestant, scene, primitives, scalar, l)
                        if contestant["id"] == "brute_force" and primitives > 4000:
                            refused(line, f"{primitives * 400} primitive pairs are more than the 1000000 that it is offered")
                        if contestant["id"] == "embree_refit" and scalar == "double":
                            refused(line, "", "frame 12: 3 pairs of the oracle are not among its candidates")
                        lines.append(line)
    return lines


def line(identity: str, total: float, scene: str = "cloth", **changes: Any) -> dict[str, Any]:
    """A run that takes `total` ms for everything, all of it update."""
    contestant = dict(id=identity, title=identity, family="refit", update=1.0, query=1.0, builder=(8, 4), **changes)
    made = record(contestant, scene, 4000, "float", 10)
    for repetition in made["times"]["repetitions"]:
        repetition.update(motion=0.0, update=total, traversal=0.0, triangle_tests=0.0)
    return made


def write(folder: Path, lines: list[dict[str, Any]], tail: Optional[str] = None) -> Path:
    """Writes results.jsonl, with `tail` as an unfinished last line."""
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(json.dumps(line) + "\n" for line in lines) + (tail or "")
    (folder / "results.jsonl").write_text(text, encoding="utf-8")
    return folder


if __name__ == "__main__":
    listed = study()
    if "small" in sys.argv[2:]:
        listed = [line for line in listed if line["scene"]["primitives"] == 2000]
    write(Path(sys.argv[1]), listed)
