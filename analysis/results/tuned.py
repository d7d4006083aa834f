"""The scenes that `auto` was tuned on, and the mark of its numbers on them.

They are those of the studies "tuned on" of the plan `auto`, which stands in experiments/plans, or in plans next to an installed analysis,
and the fox: the plan left it out of the second version, and the prices of the third were fitted to it.
"""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

from results import scene_names

MARK = "†"
FITTED_LATER = frozenset({"fox running"})
ROOT = Path(__file__).resolve().parents[2]


@lru_cache(maxsize=None)
def scenes(root: Path = ROOT) -> frozenset[str]:
    """Returns the names of the scenes that `auto` was tuned on."""
    in_tree, installed = (root / folder / "auto.json" for folder in ("experiments/plans", "plans"))
    studies = json.loads((installed if installed.exists() else in_tree).read_text(encoding="utf-8"))["studies"]
    return FITTED_LATER | frozenset(scene["name"] for study in studies if study["name"].startswith("tuned on") for scene in study["scenes"])


def mark(strategy: str, scene: str) -> str:
    """Returns a space and the mark for `auto` on a scene that it was tuned on, whatever is asked there; or nothing."""
    return f" {MARK}" if strategy == "auto" and scene_names.ANSWER.sub("", scene) in scenes() else ""
