"""A letter F that floats above a plane, to expose every flip and transpose.

No rotation or mirror image of an F is the F again, the dot beside it breaks what symmetry a
blurred F might keep, and all three lights stand off axis, so that a shadow that is mirrored,
transposed or shifted the wrong way lands where the true one is not.
"""

import numpy as np

from asmjax.scene.mesh_tools import make_mesh
from asmjax.scene.shapes import box
from asmjax.scene.spec import LightSpec, Mesh, Rectangle, SceneSpec, Vector, ViewSpec

# Outline of the F in its own plane, counter-clockwise, with its triangles.
_OUTLINE = (
    (-0.5, -0.8), (-0.2, -0.8), (-0.2, -0.1), (0.2, -0.1), (0.2, 0.15),
    (-0.2, 0.15), (-0.2, 0.55), (0.5, 0.55), (0.5, 0.8), (-0.5, 0.8),
)  # fmt: skip
_INSIDE = (
    (0, 1, 2), (2, 3, 4), (2, 4, 5), (0, 2, 5), (0, 5, 6), (6, 7, 8), (6, 8, 9), (0, 6, 9),
)  # fmt: skip
_LOW, _HIGH = 0.70, 0.82
"""Heights in scene units of the underside and the top of the letter above the plane z = 0."""
TRIANGLES = 2 * len(_INSIDE) + 2 * len(_OUTLINE) + 12


def letter_mesh(reflectance: Vector = (0.80, 0.30, 0.20)) -> Mesh:
    """The solid letter: 36 triangles, closed, x to its right, y to its top when seen from above."""
    outline = np.asarray(_OUTLINE).T
    count = outline.shape[1]
    low = np.concatenate([outline, np.full((1, count), _LOW)])
    high = np.concatenate([outline, np.full((1, count), _HIGH)])
    top = np.asarray(_INSIDE).T + count
    bottom = np.asarray(_INSIDE).T[::-1]
    here = np.arange(count)
    after = np.roll(here, -1)
    sides = [np.stack([here, after, after + count]), np.stack([here, after + count, here + count])]
    return make_mesh(
        "letter",
        np.concatenate([low, high], axis=1),
        np.concatenate([bottom, top, *sides], axis=1),
        reflectance,
    )


def make_letter_f() -> SceneSpec:
    """Plane, letter and dot; a light of each kind; the eye at an angle and straight above."""
    dot = box("dot", (0.62, -0.78, 0.45), (0.80, -0.60, 0.63), (0.20, 0.40, 0.80))
    plane = Rectangle("plane", (0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    views = (
        ViewSpec("angle", origin=(2.2, -4.2, 4.2), target=(0.45, 0.15, 0.25), fov_x_deg=36.0),
        ViewSpec(
            "above",
            origin=(0.35, 0.1, 7.0),
            target=(0.35, 0.1, 0.0),
            up=(0.0, 1.0, 0.0),
            fov_x_deg=32.0,
        ),
    )
    lights = (
        LightSpec("point", "point", position=(-1.7, -0.9, 4.5)),
        LightSpec(
            "spot",
            "spot",
            position=(-2.0, 1.2, 4.0),
            direction=(0.48, -0.25, -0.84),
            cutoff_deg=28.0,
        ),
        LightSpec("directional", "directional", direction=(0.50, 0.28, -0.82)),
    )
    return SceneSpec(
        "letter_f",
        "an asymmetric caster above a plane: shows every flip, transpose and shift",
        (plane, letter_mesh(), dot),
        {view.name: view for view in views},
        {light.name: light for light in lights},
    )
