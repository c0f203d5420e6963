"""The smooth model of the paper room: a sitting rabbit of exactly 20,000 small triangles.

Stands in for the 20,000-polygon bunny of the 2001 paper, section 5: small triangles, so that the
primitive seen changes from pixel to pixel, and smooth self-shadowing everywhere.
"""

import numpy as np

from asmjax.scene.isosurface import Blob, surface_net
from asmjax.scene.mesh_tools import move, rotation, split_to_count
from asmjax.scene.spec import Mesh, Vector

TRIANGLES = 20_000
_SPACING = 0.01665
"""Grid step that gives a little under `TRIANGLES`; splitting long edges supplies the rest."""


def make_bunny(reflectance: Vector = (0.82, 0.78, 0.72)) -> Mesh:
    """The rabbit, about 1.05 units tall, looking along +x, lowest point at z = 0."""
    mesh = surface_net(
        "bunny",
        _blobs(),
        low=(-0.50, -0.38, -0.06),
        high=(0.52, 0.38, 1.14),
        spacing=_SPACING,
        reflectance=reflectance,
    )
    mesh = split_to_count(mesh, TRIANGLES)
    return move(mesh, (0.0, 0.0, -float(mesh.vertices[2].min())))


def _blobs() -> list[Blob]:
    """Body parts from big to small; the head is turned and one ear bends, so nothing mirrors."""
    head_turn = rotation((0.0, 0.0, 1.0), 0.35)
    neck = np.array([0.20, 0.0, 0.60])

    def in_head(x: float, y: float, z: float) -> Vector:
        px, py, pz = neck + head_turn @ np.array([x, y, z])
        return (float(px), float(py), float(pz))

    def tilted(about_x: float, about_y: float) -> np.ndarray:
        roll = rotation((1.0, 0.0, 0.0), about_x)
        pitch = rotation((0.0, 1.0, 0.0), about_y)
        return head_turn @ roll @ pitch

    lean = rotation((0.0, 1.0, 0.0), 0.45)
    parts = [
        Blob((-0.07, 0.0, 0.29), (0.30, 0.235, 0.265), lean),
        Blob((0.14, 0.0, 0.34), (0.15, 0.165, 0.22), rotation((0.0, 1.0, 0.0), 0.25), 0.12),
        Blob((-0.39, 0.01, 0.20), (0.085, 0.09, 0.09), None, 0.05),
    ]
    for side in (-1.0, 1.0):
        stride = 0.035 * side
        parts += [
            Blob((-0.11, 0.20 * side, 0.21), (0.19, 0.10, 0.19), lean, 0.09),
            Blob((0.02 + stride, 0.215 * side, 0.045), (0.17, 0.065, 0.048), None, 0.06),
            Blob(
                (0.215 + stride, 0.095 * side, 0.20),
                (0.062, 0.06, 0.20),
                rotation((0.0, 1.0, 0.0), -0.22),
                0.05,
            ),
            Blob((0.275 + stride, 0.10 * side, 0.042), (0.088, 0.055, 0.043), None, 0.045),
        ]
    parts += [
        Blob(in_head(0.02, 0.0, 0.02), (0.165, 0.135, 0.140), head_turn, 0.10),
        Blob(in_head(0.14, 0.0, -0.025), (0.085, 0.080, 0.070), head_turn, 0.07),
        Blob(in_head(0.10, 0.065, -0.05), (0.07, 0.06, 0.06), head_turn, 0.05),
        Blob(in_head(0.10, -0.065, -0.05), (0.07, 0.06, 0.06), head_turn, 0.05),
        # The right ear stands, the left one folds over half way up.
        Blob(in_head(-0.085, -0.085, 0.285), (0.032, 0.062, 0.215), tilted(0.22, -0.30), 0.05),
        Blob(in_head(-0.060, 0.090, 0.215), (0.034, 0.060, 0.140), tilted(-0.30, -0.15), 0.05),
        Blob(in_head(-0.040, 0.185, 0.315), (0.032, 0.056, 0.125), tilted(-1.15, 0.25), 0.04),
        Blob(in_head(0.100, 0.098, 0.060), (0.030, 0.026, 0.036), head_turn, 0.02),
        Blob(in_head(0.100, -0.098, 0.060), (0.030, 0.026, 0.036), head_turn, 0.02),
        Blob(in_head(0.222, 0.0, -0.005), (0.018, 0.024, 0.016), head_turn, 0.02),
    ]
    return parts
