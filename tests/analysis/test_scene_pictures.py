"""Scene pictures: what is read, and that the nearer of two bodies is the one that is seen."""

from __future__ import annotations

import struct
import tempfile
import unittest
from pathlib import Path

import paths  # noqa: F401  (finds the modules under test)

import numpy as np
from figures import scene_pictures


def square(x: float) -> np.ndarray:
    """Corners of a unit square that faces the viewer at azimuth 0."""
    return np.array(((x, -0.5, -0.5), (x, 0.5, -0.5), (x, 0.5, 0.5), (x, -0.5, 0.5)))


class ScenePictures(unittest.TestCase):
    def test_reads_obj_and_pc2(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            lines = ["v %g %g %g" % tuple(p) for p in square(0)] + ["f 1 2 3 4"]
            (folder / "0-still.obj").write_text("\n".join(lines))
            (folder / "1-moving.obj").write_text("\n".join(lines))
            frames = np.stack((square(1), square(2))).astype("<f4")
            header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, 4, 0, 1, 2)
            (folder / "1-moving.pc2").write_bytes(header + frames.tobytes())
            still, moving = scene_pictures.read_scene(folder)
        self.assertEqual(still.positions.shape, (1, 4, 3))
        self.assertEqual(still.triangles.tolist(), [[0, 1, 2], [0, 2, 3]])
        self.assertEqual(moving.positions[1, 0].tolist(), [2.0, -0.5, -0.5])

    def test_the_nearer_body_is_seen(self) -> None:
        triangles = np.array(((0, 1, 2), (0, 2, 3)))
        moving = scene_pictures.Mesh("moving", np.stack((square(-1), square(1))), triangles)
        still = scene_pictures.Mesh("still", square(0)[None], triangles)
        for keyframe, nearer in ((0, 1), (1, 0)):
            image = scene_pictures.picture([moving, still], [keyframe], 0.0, 100)
            middle = image[50, image.shape[1] // 2]
            hue = middle / middle.max()
            expected = np.array(scene_pictures.PALETTE[nearer])
            np.testing.assert_allclose(hue, expected / expected.max(), atol=1e-6)
            self.assertTrue((image[0, 0] == 1).all())

    def test_keyframes_stand_side_by_side(self) -> None:
        triangles = np.array(((0, 1, 2), (0, 2, 3)))
        mesh = scene_pictures.Mesh("square", np.stack((square(0), square(0))), triangles)
        one = scene_pictures.picture([mesh], [0], 0.0, 60)
        two = scene_pictures.picture([mesh], [0, 1], 0.0, 60)
        self.assertEqual(two.shape, (60, 2 * one.shape[1], 3))


if __name__ == "__main__":
    unittest.main()
