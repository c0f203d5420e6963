"""The sculpture of the paper room: a woven bulb of thin wires on a narrow stem.

Wires wind both ways around a profile whose radius runs from three centimetres to half a metre, and
taper with it, so its shadow holds the same pattern at every scale from centimetres down to less
than a millimetre: the "sculpture with a fine mesh" of the 2001 paper, section 5.
"""

import math

import numpy as np

from asmjax.scene.mesh_tools import merge, rotation, transform
from asmjax.scene.shapes import torus_knot, tube
from asmjax.scene.spec import Mesh, Vector

_STRANDS = 12
"""Wires of each handedness."""
_SEGMENTS = 30
_SIDES = 5
_HEIGHTS = (0.00, 0.06, 0.14, 0.24, 0.38, 0.58, 0.82, 1.05, 1.24, 1.38, 1.47)
_RADII = (0.034, 0.031, 0.034, 0.050, 0.120, 0.275, 0.385, 0.365, 0.250, 0.115, 0.035)


def make_lattice(reflectance: Vector = (0.72, 0.50, 0.24)) -> Mesh:
    """The sculpture, 1.47 units tall around the z axis, its wires ending 4 mm below z = 0.

    Right-handed wires, left-handed wires, and two hoops at the widest part.
    """
    path, thickness = _strand()
    strand = tube("wire", path, thickness, _SIDES)
    mirror = np.diag([1.0, -1.0, 1.0])
    wires = []
    for k in range(_STRANDS):
        turn = rotation((0.0, 0.0, 1.0), 2.0 * math.pi * k / _STRANDS)
        wires += [transform(strand, turn), transform(strand, turn @ mirror)]
    hoops = [
        transform(torus_knot("hoop", (1, 0), (radius, 0.0, 0.007), 40, 4), np.eye(3), (0, 0, z))
        for z, radius in ((0.78, 0.376), (0.94, 0.386))
    ]
    return merge("lattice", [*wires, *hoops], reflectance)


def _strand() -> tuple[np.ndarray, np.ndarray]:
    """One right-handed wire: its path (3, n) and its radius at each point.

    Going up by ds the wire turns by `ds / (slope * r)`: the same angle to the axis at every radius,
    so the weave looks the same at every scale.
    """
    fine = np.linspace(0.0, _HEIGHTS[-1], 2001)
    radius = _smooth(fine)
    steps = np.hypot(np.diff(fine), np.diff(radius))
    turning = steps / (1.55 * 0.5 * (radius[1:] + radius[:-1]))
    angle = np.concatenate([[0.0], np.cumsum(turning)])
    # Points are dense where the wire curves tightly, but not only there.
    pace = np.concatenate([[0.0], np.cumsum(turning + steps / 0.25)])
    at = np.linspace(0.0, pace[-1], _SEGMENTS + 1)
    z = np.interp(at, pace, fine)
    r, phi = np.interp(z, fine, radius), np.interp(z, fine, angle)
    z[0] = -0.004
    path = np.stack([r * np.cos(phi), r * np.sin(phi), z])
    return path, 0.0007 + 0.0175 * r


def _smooth(z: np.ndarray) -> np.ndarray:
    """The profile radius: a monotone-free cubic (Catmull-Rom) through the table."""
    heights, radii = np.asarray(_HEIGHTS), np.asarray(_RADII)
    slope = np.gradient(radii, heights)
    i = np.clip(np.searchsorted(heights, z, side="right") - 1, 0, heights.size - 2)
    width = heights[i + 1] - heights[i]
    t = (z - heights[i]) / width
    h00, h10 = (1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2
    h01, h11 = t * t * (3 - 2 * t), t * t * (t - 1)
    bend = width * (h10 * slope[i] + h11 * slope[i + 1])
    return h00 * radii[i] + h01 * radii[i + 1] + bend
