"""Compare ways to keep bounding volume hierarchies valid while meshes deform.

Scenes are arrays of numpy; strategies are chosen by name; answers are arrays. Times are in seconds, positions in units of
length, ids count from 0.

>>> import kbvh
>>> scene = kbvh.scene("waving_sheet", triangles=200, keyframes=3)
>>> world = kbvh.World(scene, "bottom_up")
>>> for t in world.frames(l=4):
...     world.advance(t)
...     pairs = world.pairs()
>>> pairs.dtype.names
('body_a', 'primitive_a', 'body_b', 'primitive_b')
"""

from ._core import ConfigError, InputError, KbvhError
from . import results
from .broad_phase import BroadPhase
from .conformance import Verdict, check, small_scenes
from .own import BodyView, Parameter, SceneView, Strategy, register
from .scenes import Body, PlanChange, Scene, builtin_scenes, elements, load, scene, shapes
from .strategies import counters, describe, strategies
from .studies import Run, plan, run
from .trees import Tree, overlapping, primitive_bounds, refit
from .world import Audit, Hierarchy, Step, World, padded

__all__ = [
    "Audit", "Body", "BodyView", "BroadPhase", "ConfigError", "Hierarchy", "InputError", "KbvhError", "Parameter", "PlanChange", 
    "Run", "Scene", "SceneView", "Step", "Strategy", "Tree", "Verdict", "World", "builtin_scenes", "check", "counters", "describe",
    "elements", "load", "overlapping", "padded", "plan", "primitive_bounds", "refit", "register", "results", "run", "scene", "shapes",
    "small_scenes", "strategies",
]  # fmt: skip
