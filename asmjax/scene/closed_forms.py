"""Closed-form shadows A1 to A9 of docs/theory.md.

Receiver plane z = 0; light plane z = H (`light_height`) above it; occluders parallel to both at
z = h (`occluder_height`), 0 < h < H. `half` is the occluder's half side or radius, `light_half`
the light's. Lengths in scene units, angles in radians, visibility 1 lit and 0 dark. Plane points
are arrays `x`, `y` of one shape; everything is float64.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


def square_shadow_half(half: float, light_height: float, occluder_height: float) -> float:
    """A1: half side (or radius) of the hard shadow of a square (or disc) below a point light."""
    return half * light_height / (light_height - occluder_height)


@dataclass(frozen=True)
class Penumbra:
    """A2: half sides of umbra (negative: none) and of the whole shadow, and the penumbra width."""

    umbra: float
    outer: float
    width: float


def square_penumbra(
    half: float, light_half: float, light_height: float, occluder_height: float
) -> Penumbra:
    """A2: square occluder below a square light, both centred."""
    gap = light_height - occluder_height
    lit, spread = half * light_height, light_half * occluder_height
    return Penumbra((lit - spread) / gap, (lit + spread) / gap, 2.0 * spread / gap)


def _blocked_interval(x, half, light_half, light_height, occluder_height):
    """Ends on the light of what the occluder hides from x; empty if low >= high."""
    scale = light_height / occluder_height
    low = np.maximum(-light_half, x + (-half - x) * scale)
    high = np.minimum(light_half, x + (half - x) * scale)
    return low, high


def square_area_visibility(
    x, y, half: float, light_half: float, light_height: float, occluder_height: float
) -> np.ndarray:
    """A2: visible share of the light's area, anywhere on the plane."""
    sides = []
    for coordinate in (np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)):
        low, high = _blocked_interval(coordinate, half, light_half, light_height, occluder_height)
        sides.append(np.maximum(high - low, 0.0))
    return 1.0 - sides[0] * sides[1] / (2.0 * light_half) ** 2


def lambert_rectangle(x, y, x_low, x_high, y_low, y_high, height: float) -> np.ndarray:
    """Lambert's polygon formula E = 1/2 |sum theta_i Gamma_i . n| for a rectangle at z = height.

    Irradiance at plane points facing up, for unit radiance; 0 for an empty rectangle.
    """
    empty = (x_high <= x_low) | (y_high <= y_low)
    x_high, y_high = np.where(empty, x_low + 1.0, x_high), np.where(empty, y_low + 1.0, y_high)
    corners = [(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]
    spokes = [
        np.stack(np.broadcast_arrays(cx - x, cy - y, np.float64(height))) for cx, cy in corners
    ]
    total = np.zeros(np.broadcast(x, y).shape)
    for here, after in zip(spokes, spokes[1:] + spokes[:1], strict=True):
        normal = np.cross(here, after, axis=0)
        sine = np.linalg.norm(normal, axis=0)
        angle = np.arctan2(sine, np.sum(here * after, axis=0))
        total = total + angle * normal[2] / sine
    return np.where(empty, 0.0, 0.5 * np.abs(total))


def square_irradiance_ratio(
    x, y, half: float, light_half: float, light_height: float, occluder_height: float
) -> np.ndarray:
    """A3: irradiance over unoccluded irradiance of the scene of A2 (not its area visibility)."""
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    x_ends = _blocked_interval(x, half, light_half, light_height, occluder_height)
    y_ends = _blocked_interval(y, half, light_half, light_height, occluder_height)
    blocked = lambert_rectangle(x, y, *x_ends, *y_ends, light_height)
    whole = (-light_half, light_half, -light_half, light_half)
    return 1.0 - blocked / lambert_rectangle(x, y, *whole, light_height)


def lens_area(radius_a: float, radius_b: float, distance) -> np.ndarray:
    """Area common to two circles whose centres are `distance` apart."""
    small, big = sorted((radius_a, radius_b))
    d = np.asarray(distance, dtype=np.float64)
    crossing = (d > big - small) & (d < big + small)
    # Any crossing distance will do where the circles do not cross.
    d = np.where(crossing, d, big)
    product = (small + big - d) * (d + small - big) * (d - small + big) * (d + small + big)
    root = np.sqrt(np.maximum(product, 0.0))
    # Half angles by arctan2: arccos would lose half the digits where the circles nearly touch.
    angle_small = np.arctan2(root, d * d + small**2 - big**2)
    angle_big = np.arctan2(root, d * d + big**2 - small**2)
    lens = small**2 * angle_small + big**2 * angle_big - 0.5 * root
    inside = np.asarray(distance) <= big - small
    return np.where(crossing, lens, np.where(inside, math.pi * small**2, 0.0))


def disc_visibility(
    x, y, half: float, light_half: float, light_height: float, occluder_height: float
) -> np.ndarray:
    """A4: visible share of a disc light of radius `light_half` behind a disc of radius `half`."""
    scale = light_height / occluder_height
    distance = np.hypot(x, y) * (scale - 1.0)
    return 1.0 - lens_area(light_half, half * scale, distance) / (math.pi * light_half**2)


def half_plane_disc_visibility(t) -> np.ndarray:
    """A5: disc light cut by a straight edge; t = x (H/h - 1) / s runs from -1 dark to 1 lit."""
    t = np.clip(t, -1.0, 1.0)
    return 0.5 + (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / math.pi


def half_plane_square_visibility(x, penumbra_width: float) -> np.ndarray:
    """A5 with a square light: a linear ramp over the penumbra."""
    return np.clip(0.5 + np.asarray(x) / penumbra_width, 0.0, 1.0)


@dataclass(frozen=True)
class Ellipse:
    """Ellipse in the plane z = 0 with axes along x and y: centre and semi-axes."""

    centre: tuple[float, float]
    semi_x: float
    semi_y: float

    def contains(self, x, y) -> np.ndarray:
        """Whether plane points lie inside or on the ellipse."""
        u = (np.asarray(x) - self.centre[0]) / self.semi_x
        v = (np.asarray(y) - self.centre[1]) / self.semi_y
        return u * u + v * v <= 1.0

    def distance(self, x, y) -> np.ndarray:
        """Distance to the curve: bisection on its Lagrange multiplier (Eberly, "Distance from a
        point to an ellipse"), to about 1e-12 of its size."""
        points = np.abs(
            np.stack(np.broadcast_arrays(x - self.centre[0], y - self.centre[1])).astype(float)
        )
        axes = (self.semi_x, self.semi_y)
        if self.semi_x < self.semi_y:
            points, axes = points[::-1], axes[::-1]
        ratio = (axes[0] / axes[1]) ** 2
        z0, z1 = points[0] / axes[0], np.maximum(points[1] / axes[1], 1e-15)
        low = z1 - 1.0
        high = np.hypot(ratio * z0, z1) - 1.0
        high = np.maximum(high, low)
        for _ in range(80):
            middle = 0.5 * (low + high)
            outside = (ratio * z0 / (middle + ratio)) ** 2 + (z1 / (middle + 1.0)) ** 2 > 1.0
            low, high = np.where(outside, middle, low), np.where(outside, high, middle)
        foot_0 = np.minimum(ratio * points[0] / (0.5 * (low + high) + ratio), axes[0])
        foot_1 = axes[1] * np.sqrt(1.0 - (foot_0 / axes[0]) ** 2)
        return np.hypot(points[0] - foot_0, points[1] - foot_1)


def sphere_shadow(light: Sequence[float], centre: Sequence[float], radius: float) -> Ellipse:
    """A6: hard shadow on z = 0 of a sphere in the half plane y = light y, x >= light x.

    `light` is a point; the cone's axis is tilted by theta and its half angle is alpha. A cone that
    reaches the horizon (theta + alpha >= pi/2) casts no ellipse: `ValueError`.
    """
    across, down = centre[0] - light[0], light[2] - centre[2]
    theta = math.atan2(across, down)
    alpha = math.asin(radius / math.hypot(across, down))
    if theta + alpha >= 0.5 * math.pi:
        raise ValueError(
            f"the shadow is unbounded: axis tilt {theta:.4f} + half angle {alpha:.4f} rad is not "
            "below pi/2; raise the light or move the sphere under it."
        )
    near, far = math.tan(theta - alpha), math.tan(theta + alpha)
    middle, major = 0.5 * light[2] * (far + near), 0.5 * light[2] * (far - near)
    minor = major * math.sqrt(1.0 - (math.sin(theta) / math.cos(alpha)) ** 2)
    return Ellipse((light[0] + middle, light[1]), major, minor)


def sphere_shadow_directional(
    direction: Sequence[float], centre: Sequence[float], radius: float
) -> Ellipse:
    """A6 under parallel light that travels along `direction` (y component 0)."""
    cos = -direction[2] / math.sqrt(sum(d * d for d in direction))
    shift = -centre[2] / direction[2]
    return Ellipse((centre[0] + shift * direction[0], centre[1]), radius / cos, radius)


def coaxial_sphere_radii(
    radius: float, light_radius: float, distance: float, drop: float
) -> tuple[float, float]:
    """A7: umbra and penumbra radius `drop` below a sphere's centre, the spherical light `distance`
    above it. A negative umbra radius means that the umbra ended higher up."""
    psi = math.asin((light_radius - radius) / distance)
    phi = math.asin((light_radius + radius) / distance)
    umbra = radius / math.cos(psi) - drop * math.tan(psi)
    return umbra, radius / math.cos(phi) + drop * math.tan(phi)


def slab_transmittance(depth, slab_depths: Sequence[float], opacities: Sequence[float]):
    """A8: product of 1 - opacity over the slabs nearer to the light than `depth`."""
    depth = np.asarray(depth, dtype=np.float64)
    total = np.ones(depth.shape)
    for slab, opacity in zip(slab_depths, opacities, strict=True):
        total = total * np.where(slab < depth, 1.0 - opacity, 1.0)
    return total


def medium_transmittance(depth, start: float, extinction: float) -> np.ndarray:
    """A8: exp(-sigma (z - z0)) below the top of a homogeneous medium, 1 above it."""
    return np.exp(-extinction * np.maximum(np.asarray(depth) - start, 0.0))


def slanted_edge_coverage(a: float, b: float, c) -> np.ndarray:
    """A9: share of the unit pixel around the origin in which a u + b v + c >= 0."""
    big, small = max(abs(a), abs(b)), min(abs(a), abs(b))
    c = np.asarray(c, dtype=np.float64)
    s = np.abs(c)
    straight = 0.5 + s / big
    corner = np.clip(0.5 * (big + small) - s, 0.0, small)
    # Divided before multiplied: an edge along the pixel grid has small = 0 or denormal.
    cut = 1.0 - corner * (corner / small if small > 0.0 else 0.0) / (2.0 * big)
    lit = np.where(s <= 0.5 * (big - small), straight, cut)
    return np.where(c >= 0.0, lit, 1.0 - lit)


def rectangle_distance(x, y, x_low, x_high, y_low, y_high) -> np.ndarray:
    """Distance to the outline of an axis-aligned rectangle in the plane, from inside or outside."""
    dx = np.maximum(x_low - x, x - x_high)
    dy = np.maximum(y_low - y, y - y_high)
    outside = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0))
    return np.where(outside > 0.0, outside, -np.maximum(dx, dy))
