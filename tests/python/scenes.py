"""Small scenes for the tests of the Python package."""

import numpy as np

import kbvh

TRIANGLE = np.array([[0, 1, 2]], dtype=np.uint32)


def triangle_at(z, dtype="float32"):
    return np.array([[0, 0, z], [1, 0, z], [0, 1, z]], dtype=dtype)


def falling(dtype="float32", frm=1.0, to=-1.0):
    """A triangle that stands across the plane z = 0, and one that falls through it."""
    upright = np.array([[0.2, 0.2, -0.5], [0.2, 0.2, 0.5], [0.3, 0.2, 0.5]], dtype=dtype)
    moving = np.stack([triangle_at(frm, dtype), triangle_at(to, dtype)])
    return [kbvh.Body(TRIANGLE, upright, name="rest"), kbvh.Body(TRIANGLE, moving, times=[0, 1], name="falls")]


def pairs(array):
    return sorted(tuple(pair) for pair in array[["body_a", "primitive_a", "body_b", "primitive_b"]].tolist())
