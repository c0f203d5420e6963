"""The scenes A1 to A9 as data, each with the visibility that is known in closed form.

Geometry and formulas: docs/theory.md, "Scenes known in closed form", with its numbers as
defaults. The scene's light is the *centre* of the area light, so `hard_visibility` is what a
shadow map should converge to; `soft_visibility` is what the whole light gives, for later.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from asmjax.errors import require
from asmjax.scene.closed_forms import (
    Ellipse,
    coaxial_sphere_radii,
    disc_visibility,
    half_plane_disc_visibility,
    rectangle_distance,
    slab_transmittance,
    slanted_edge_coverage,
    sphere_shadow,
    sphere_shadow_directional,
    square_area_visibility,
    square_irradiance_ratio,
    square_shadow_half,
)
from asmjax.scene.spec import (
    Disk,
    LightSpec,
    Rectangle,
    SceneSpec,
    Shape,
    Sphere,
    Vector,
    ViewSpec,
)

PlaneFunction = Callable[[np.ndarray, np.ndarray], np.ndarray]

_RECEIVER_HALF = 10.0
_FAR_AWAY = 60.0
"""Half side of a rectangle that stands for a half-plane: its other edges shade no receiver."""


@dataclass(frozen=True)
class AnalyticScene:
    """A scene over the plane z = 0 and its visibility there, for plane points `x`, `y` (float64).

    `hard_visibility` is 1 or 0 towards the scene's first light; `edge_distance` is the distance in
    scene units to the nearest edge of that shadow (edges hidden in another shadow count too).
    `soft_visibility` is the area light's, or `None` where there is no closed form; `emitter` is the
    area light itself, whose front is towards the receiver, or `None` where there is none.
    """

    spec: SceneSpec
    hard_visibility: PlaneFunction
    edge_distance: PlaneFunction
    soft_visibility: PlaneFunction | None = None
    emitter: Rectangle | Disk | Sphere | None = None

    def soft_light(self) -> LightSpec:
        """The first light with the size of the emitter. Raises `UseError` where there is none."""
        # Here, so that listing scenes does not load JAX.
        from asmjax.scene.lights import area_of

        require(
            self.emitter is not None,
            f"scene '{self.spec.name}' has no area light; take one of A2 to A5 or A7.",
        )
        assert self.emitter is not None
        first = next(iter(self.spec.lights.values()))
        return replace(first, area=area_of(self.emitter))


def a1_square(
    half: float = 1.0, light_height: float = 5.0, occluder_height: float = 2.0
) -> AnalyticScene:
    """A1: square below a point light; the shadow is a square of half side aH / (H - h)."""
    return _square_scene("a1_square", "square below a point light", half, light_height,
                         occluder_height, None)  # fmt: skip


def a2_square_light(
    half: float = 1.0,
    light_half: float = 0.6,
    light_height: float = 5.0,
    occluder_height: float = 2.0,
) -> AnalyticScene:
    """A2: square below a square light; soft visibility is the visible share of its area."""

    def soft(x, y):
        return square_area_visibility(x, y, half, light_half, light_height, occluder_height)

    return _square_scene("a2_square_light", "square below the centre of a square light", half,
                         light_height, occluder_height, soft, light_half)  # fmt: skip


def a3_lambert(
    half: float = 1.0,
    light_half: float = 0.6,
    light_height: float = 5.0,
    occluder_height: float = 2.0,
) -> AnalyticScene:
    """A3: the scene of A2; soft visibility is the irradiance ratio by Lambert's formula."""

    def soft(x, y):
        return square_irradiance_ratio(x, y, half, light_half, light_height, occluder_height)

    return _square_scene("a3_lambert", "square below a square light, as irradiance", half,
                         light_height, occluder_height, soft, light_half)  # fmt: skip


def a4_disc_light(
    half: float = 1.0,
    light_half: float = 0.6,
    light_height: float = 5.0,
    occluder_height: float = 2.0,
) -> AnalyticScene:
    """A4: disc below a disc light; the blocked share is the area of a lens."""
    edge = square_shadow_half(half, light_height, occluder_height)
    return _scene(
        "a4_disc_light",
        "disc below the centre of a disc light",
        [Disk("occluder", (0.0, 0.0, occluder_height), (0.0, 0.0, 1.0), half)],
        _point((0.0, 0.0, light_height)),
        _eye((0.8, -1.0, 12.0), (0.0, 0.0, 0.0), 25.0),
        Ellipse((0.0, 0.0), edge, edge),
        lambda x, y: disc_visibility(x, y, half, light_half, light_height, occluder_height),
        _disc_light(light_half, light_height),
    )


def a5_half_plane(
    light_half: float = 0.6, light_height: float = 5.0, occluder_height: float = 2.0
) -> AnalyticScene:
    """A5: half-plane x < 0 with its edge straight below a disc light; lit for x > 0."""
    scale = light_height / occluder_height - 1.0
    return AnalyticScene(
        _spec(
            "a5_half_plane",
            "straight edge below the centre of a disc light",
            [_half_plane(0.0, 0.0, occluder_height)],
            _point((0.0, 0.0, light_height)),
            _eye((5.0, 0.6, 3.0), (0.0, 0.0, 0.0), 30.0),
        ),
        lambda x, y: _lit(x > 0.0, y),
        lambda x, y: np.abs(x) + 0.0 * y,
        lambda x, y: half_plane_disc_visibility(x * scale / light_half) + 0.0 * y,
        _disc_light(light_half, light_height),
    )


_A6_CENTRE: Vector = (1.5, 0.0, 2.0)
_A6_LIGHT: Vector = (0.0, 0.0, 6.0)
_A6_RADIUS = 0.8


def a6_sphere() -> AnalyticScene:
    """A6: sphere beside a point light; its shadow is an ellipse."""
    return _sphere_scene(
        "a6_sphere",
        "sphere and a point light: an elliptic shadow",
        _point(_A6_LIGHT),
        sphere_shadow(_A6_LIGHT, _A6_CENTRE, _A6_RADIUS),
    )


def a6_sphere_sun() -> AnalyticScene:
    """A6 under a directional light along the same axis: an ellipse of semi-axes R/cos, R."""
    direction = (1.5 / math.sqrt(18.25), 0.0, -4.0 / math.sqrt(18.25))
    return _sphere_scene(
        "a6_sphere_sun",
        "sphere and a directional light: an elliptic shadow",
        LightSpec("sun", "directional", direction=direction),
        sphere_shadow_directional(direction, _A6_CENTRE, _A6_RADIUS),
    )


def a7_sphere_light(
    radius: float = 0.8, light_radius: float = 0.5, distance: float = 4.0, drop: float = 2.0
) -> AnalyticScene:
    """A7: sphere straight below a spherical light. The penumbra has known rims (`closed_forms.
    coaxial_sphere_radii`) but no closed form between them, so there is no soft visibility."""
    if light_radius + radius >= distance:
        raise ValueError("the sphere and its light touch: raise distance above the sum of radii.")
    # The hard shadow of the light's centre is the case of a light without size.
    edge, _ = coaxial_sphere_radii(radius, 0.0, distance, drop)
    return _scene(
        "a7_sphere_light",
        "sphere straight below the centre of a spherical light",
        [Sphere("occluder", (0.0, 0.0, drop), radius)],
        _point((0.0, 0.0, drop + distance)),
        _eye((0.0, -8.0, 5.0), (0.0, 0.0, 0.0), 32.0),
        Ellipse((0.0, 0.0), edge, edge),
        None,
        Sphere("emitter", (0.0, 0.0, drop + distance), light_radius),
    )


def a8_slabs(
    duties: tuple[float, float] = (0.4, 0.25),
    heights: tuple[float, float] = (1.5, 1.2),
    light_height: float = 6.0,
    strips: int = 6,
) -> AnalyticScene:
    """A8: two crossed gratings of thin strips at different heights.

    Each, seen blurred, is a slab of opacity = duty; crossed gratings are independent, so the soft
    visibility below both is the product of 1 - duty.
    """
    period, reach = 0.4, 1.2
    shapes: list[Shape] = []
    shadows = []
    for layer, (duty, height) in enumerate(zip(duties, heights, strict=True)):
        scale = light_height / (light_height - height)
        for k in range(strips):
            middle = (k - 0.5 * (strips - 1)) * period
            low, high = middle - 0.5 * duty * period, middle + 0.5 * duty * period
            bounds = (low, high, -reach, reach) if layer == 0 else (-reach, reach, low, high)
            shapes.append(_flat(f"strip_{layer}_{k}", *bounds, height))
            shadows.append(tuple(scale * b for b in bounds))
    outer = 0.5 * strips * period

    def hard(x, y):
        blocked = np.zeros(np.broadcast(x, y).shape, dtype=bool)
        for low, high, front, back in shadows:
            blocked |= (x >= low) & (x <= high) & (y >= front) & (y <= back)
        return _lit(~blocked, y)

    def soft(x, y):
        lit = np.ones(np.broadcast(x, y).shape)
        for layer, (duty, height) in enumerate(zip(duties, heights, strict=True)):
            shrink = (light_height - height) / light_height
            along, across = (y, x) if layer == 0 else (x, y)
            under = (np.abs(along) * shrink <= reach) & (np.abs(across) * shrink <= outer)
            depth = light_height - height
            lit *= np.where(under, slab_transmittance(light_height, [depth], [duty]), 1.0)
        return lit

    return AnalyticScene(
        _spec(
            "a8_slabs",
            "two crossed gratings of strips below a point light",
            shapes,
            _point((0.0, 0.0, light_height)),
            _eye((0.0, -7.0, 3.2), (0.0, 0.0, 0.0), 36.0),
        ),
        hard,
        lambda x, y: np.min([rectangle_distance(x, y, *s) for s in shadows], axis=0),
        soft,
    )


def a9_slanted_edge(
    angle: float = 0.35,
    offset: float = 0.2,
    pixel: float = 0.25,
    light_height: float = 5.0,
    occluder_height: float = 2.0,
) -> AnalyticScene:
    """A9: a slanted straight edge; lit where x cos(angle) + y sin(angle) + offset >= 0.

    Soft visibility is the lit share of a square of side `pixel` around the point.
    """
    a, b = math.cos(angle), math.sin(angle)
    shrink = (light_height - occluder_height) / light_height

    def side(x, y):
        return a * x + b * y + offset

    return AnalyticScene(
        _spec(
            "a9_slanted_edge",
            "slanted straight edge below a point light",
            [_half_plane(angle, -offset * shrink, occluder_height)],
            _point((0.0, 0.0, light_height)),
            _eye((5.0, 0.6, 3.0), (0.0, 0.0, 0.0), 30.0),
        ),
        lambda x, y: _lit(side(x, y) >= 0.0, y),
        lambda x, y: np.abs(side(x, y)),
        lambda x, y: slanted_edge_coverage(a, b, side(x, y) / pixel),
    )


ANALYTIC_SCENES: dict[str, Callable[[], AnalyticScene]] = {
    factory.__name__: factory
    for factory in (
        a1_square,
        a2_square_light,
        a3_lambert,
        a4_disc_light,
        a5_half_plane,
        a6_sphere,
        a6_sphere_sun,
        a7_sphere_light,
        a8_slabs,
        a9_slanted_edge,
    )
}
"""Factories with round numbers as defaults, by scene name."""


def _lit(lit: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Truth values as visibility, in the shape of the plane points."""
    return np.where(lit, 1.0, 0.0) + 0.0 * np.asarray(like)


def _point(position: Vector) -> LightSpec:
    return LightSpec("centre", "point", position=position)


def _eye(origin: Vector, target: Vector, fov_x_deg: float) -> ViewSpec:
    return ViewSpec("aside", origin, target, fov_x_deg=fov_x_deg)


def _spec(
    name: str, summary: str, occluders: list[Shape], light: LightSpec, view: ViewSpec
) -> SceneSpec:
    receiver = Rectangle(
        "receiver", (0.0, 0.0, 0.0), (_RECEIVER_HALF, 0.0, 0.0), (0.0, _RECEIVER_HALF, 0.0)
    )
    return SceneSpec(name, summary, (receiver, *occluders), {view.name: view}, {light.name: light})


def _scene(
    name, summary, occluders, light, view, shadow: Ellipse, soft, emitter=None
) -> AnalyticScene:
    """A scene whose hard shadow is one ellipse."""
    return AnalyticScene(
        _spec(name, summary, occluders, light, view),
        lambda x, y: _lit(~shadow.contains(x, y), y),
        shadow.distance,
        soft,
        emitter,
    )


def _square_scene(
    name, summary, half, light_height, occluder_height, soft, light_half=None
) -> AnalyticScene:
    """A1 to A3: one square occluder straight below the light."""
    edge = square_shadow_half(half, light_height, occluder_height)
    return AnalyticScene(
        _spec(
            name,
            summary,
            [_flat("occluder", -half, half, -half, half, occluder_height)],
            _point((0.0, 0.0, light_height)),
            _eye((0.8, -1.0, 12.0), (0.0, 0.0, 0.0), 25.0),
        ),
        lambda x, y: _lit((np.abs(x) > edge) | (np.abs(y) > edge), y),
        lambda x, y: rectangle_distance(x, y, -edge, edge, -edge, edge),
        soft,
        None if light_half is None else _square_light(light_half, light_height),
    )


def _square_light(half: float, height: float) -> Rectangle:
    """It emits downwards."""
    return Rectangle("emitter", (0.0, 0.0, height), (half, 0.0, 0.0), (0.0, -half, 0.0))


def _disc_light(radius: float, height: float) -> Disk:
    return Disk("emitter", (0.0, 0.0, height), (0.0, 0.0, -1.0), radius)


def _sphere_scene(name: str, summary: str, light: LightSpec, shadow: Ellipse) -> AnalyticScene:
    occluder = Sphere("occluder", _A6_CENTRE, _A6_RADIUS)
    view = _eye((2.0, -8.0, 5.0), (2.2, 0.0, 0.0), 35.0)
    return _scene(name, summary, [occluder], light, view, shadow, None)


def _flat(
    name: str, x_low: float, x_high: float, y_low: float, y_high: float, height: float
) -> Rectangle:
    """Axis-aligned rectangle parallel to the receiver."""
    return Rectangle(
        name,
        (0.5 * (x_low + x_high), 0.5 * (y_low + y_high), height),
        (0.5 * (x_high - x_low), 0.0, 0.0),
        (0.0, 0.5 * (y_high - y_low), 0.0),
    )


def _half_plane(angle: float, edge: float, height: float) -> Rectangle:
    """The points x cos(angle) + y sin(angle) <= edge at z = height, as far as matters."""
    a, b = math.cos(angle), math.sin(angle)
    reach = edge - _FAR_AWAY
    return Rectangle(
        "occluder",
        (a * reach, b * reach, height),
        (a * _FAR_AWAY, b * _FAR_AWAY, 0.0),
        (-b * _FAR_AWAY, a * _FAR_AWAY, 0.0),
    )
