"""Shapes as plain data: what no renderer could draw as it is meant is refused, in one line."""

import math
from dataclasses import replace

import numpy as np
import pytest

from asmjax.errors import UseError
from asmjax.scene.spec import Disk, Mesh, Rectangle, Sphere

CORNERS = np.array([[0.0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 0]])
FACES = np.array([[0, 0], [1, 2], [2, 3]], np.int32)
MESH = Mesh("sheet", CORNERS, FACES)
RECTANGLE = Rectangle("wall", (0.0, 0.0, 1.0), (2.0, 0.0, 0.0), (0.0, 0.5, 0.0))
DISK = Disk("leaf", (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.5)
SPHERE = Sphere("ball", (0.0, 0.0, 1.0), 0.5)


@pytest.mark.parametrize(
    ("shape", "changes", "says"),
    [
        (MESH, {"vertices": CORNERS.T}, "transpose"),
        (MESH, {"vertices": CORNERS[:, :0]}, "vertices of shape (3, 0)"),
        (MESH, {"faces": np.zeros((2, 3), np.int32)}, "faces of shape (2, 3)"),
        (MESH, {"faces": FACES + 1}, "from 1 to 4; allowed: whole numbers from 0 to 3"),
        (MESH, {"faces": FACES - 1}, "from -1 to 2"),
        (MESH, {"faces": FACES.astype(float)}, "float64"),
        (MESH, {"vertices": np.where(CORNERS == 1, math.nan, CORNERS)}, "not finite"),
        (MESH, {"vertices": np.where(CORNERS == 1, -math.inf, CORNERS)}, "not finite"),
        (RECTANGLE, {"half_v": (0.3, 0.5, 0.0)}, "perpendicular"),
        (RECTANGLE, {"half_u": (0.0, 0.0, 0.0)}, "of some length"),
        (RECTANGLE, {"centre": (0.0, math.nan, 0.0)}, "three finite numbers"),
        (DISK, {"radius": 0.0}, "radius of 0.0"),
        (DISK, {"normal": (0.0, 0.0, 0.0)}, "any direction"),
        (SPHERE, {"radius": -1.0}, "radius of -1.0"),
        (SPHERE, {"radius": math.nan}, "radius of nan"),
        (SPHERE, {"centre": (math.inf, 0.0, 0.0)}, "finite"),
    ],
)
def test_shapes_that_mean_something_else_are_refused(shape, changes, says):
    with pytest.raises(UseError) as refused:
        replace(shape, **changes)
    assert shape.name in str(refused.value) and says in str(refused.value)


def test_a_rectangle_may_be_turned_in_float32():
    turn, _ = np.linalg.qr(np.arange(9.0).reshape(3, 3) ** 2 + np.eye(3))
    half_u, half_v = (
        tuple((s * turn[:, k]).astype(np.float32).tolist()) for k, s in ((0, 3), (1, 2))
    )
    assert replace(RECTANGLE, half_u=half_u, half_v=half_v).half_u == half_u
