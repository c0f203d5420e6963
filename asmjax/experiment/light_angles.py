"""Error against the angle between light and view: measured for any map, and the theory's for some.

A parallel light turns in the plane of the view direction and the image's vertical, from along the
view (gamma = 0) to overhead (90 degrees): the light of `asmjax.theory.light_direction`. Measurement
and theory meet in the storage factor, texels / pixels at which no texel's beam has a larger area
than the pixel's (Lloyd et al. 2006, R_s R_t). With texel edges e_1, e_2 in the light's plane and
square pixels of width z / f at eye depth z,

    S = max over receivers of (abs(e_1 x e_2) f_x f_y / z^2) texels / width^2.

The factor in brackets is the error along the view times that across it, whatever the roll and shear
of the texels, and texels / width^2 makes it independent of resolution. The theory's S is the
largest error along times the largest across, over a whole frustum as high as it is wide, for a map
that is fitted to it with the eye on the map's axis. Under an overhead light both are reached at one
place, and level ground fills the frustum as the light sees it: there S is the same number. A map
here is fitted to what is seen, which makes S smaller, and its axis lies in the middle of that,
which makes it larger where the middle is not in front of the eye.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from asmjax import theory
from asmjax.buffers import EyeBuffer, LightRays
from asmjax.errors import UseError, require
from asmjax.experiment.aliasing import aliasing_maps, aliasing_numbers
from asmjax.geometry import Camera, LightFrame
from asmjax.scene.spec import LightSpec
from asmjax.shadow import (
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    PerspectiveShadowMap,
    ShadowAlgorithm,
    SubdividedShadowMap,
    UniformShadowMap,
)
from asmjax.shadow.warped.strength import half_view, shaped_strength
from asmjax.theory.arguments import NARROWEST, WIDEST

FIRST_DEG = 2.0
"""The first direction: along the view itself there is no axis to warp along."""


@dataclass(frozen=True)
class AngleError:
    """What one map does under one direction of light.

    Attributes:
        family: of the registry.
        angle_deg: gamma, between light and view direction.
        max_perspective, p95_perspective, p95_m: of `AliasingNumbers`.
        storage: S as measured.
        theory: S of the theory, None where it has none.
    """

    family: str
    angle_deg: float
    max_perspective: float
    p95_perspective: float
    p95_m: float
    storage: float
    theory: float | None


@dataclass(frozen=True, eq=False)
class AngleCase:
    """One direction of light: its frame for the view, and its rays."""

    angle_deg: float
    frame: LightFrame
    rays: LightRays


@dataclass(frozen=True)
class ViewRange:
    """What the theory knows of a view.

    Attributes:
        alpha: farthest / nearest eye depth of the visible receivers.
        theta: half the horizontal field of view, radians.
        half_view: half of the larger field of view, radians, by which maps shape their warps.
    """

    alpha: float
    theta: float
    half_view: float


def view_range(eye: EyeBuffer) -> ViewRange:
    """Depth range and field of view of what an eye sees."""
    depth = eye.depth[eye.valid].astype(np.float64)
    half = np.arctan(0.5 * eye.camera.width / eye.camera.focal[0])
    return ViewRange(float(depth.max() / depth.min()), float(half), half_view(eye))


def sweep_angles(count: int) -> list[float]:
    """`count` angles in degrees, evenly from `FIRST_DEG` to 90."""
    return np.linspace(FIRST_DEG, 90.0, count).tolist()


def parallel_light(name: str, camera: Camera, angle_deg: float) -> LightSpec:
    """A parallel light at that angle to the view; it comes from behind the eye, then from above."""
    gamma = np.radians(angle_deg)
    _, down, forward = camera.rotation
    x, y, z = (np.cos(gamma) * forward + np.sin(gamma) * down).tolist()
    return LightSpec(name, "directional", direction=(x, y, z))


def angle_errors(
    cases: Iterable[AngleCase],
    algorithms: Mapping[str, ShadowAlgorithm],
    eye: EyeBuffer,
    left_out: list[str],
) -> Iterator[AngleError]:
    """Each algorithm, by family name, under each direction; truth is not needed.

    What cannot be built under a direction is left out, and `left_out` gets a line that says why.
    """
    seen = view_range(eye)
    for case in cases:
        for family, algorithm in algorithms.items():
            try:
                yield _measured(family, algorithm, case, eye, seen)
            except UseError as problem:
                left_out.append(f"{family} at {case.angle_deg:.0f} degrees is left out: {problem}")


def _measured(
    family: str, algorithm: ShadowAlgorithm, case: AngleCase, eye: EyeBuffer, seen: ViewRange
) -> AngleError:
    state = algorithm.build(eye, case.frame, case.rays)
    texels = algorithm.cost(state).texels
    maps = aliasing_maps(algorithm, state, eye, case.frame)
    numbers = aliasing_numbers(maps, texels)
    expected = theory_storage(algorithm, seen, np.array([case.angle_deg]))
    return AngleError(
        family=family,
        angle_deg=case.angle_deg,
        max_perspective=numbers.max_perspective,
        p95_perspective=numbers.p95_perspective,
        p95_m=numbers.p95_m,
        storage=storage_factor(algorithm, state, eye, case.frame, maps.known),
        theory=None if expected is None or np.isnan(expected[0]) else float(expected[0]),
    )


def storage_factor(
    algorithm: ShadowAlgorithm, state, eye: EyeBuffer, frame: LightFrame, known: np.ndarray
) -> float:
    """S of a map under parallel light, over the `known` (n,) receivers; 0 where there is none.

    Raises:
        UseError: the light's rays are not parallel.
    """
    require(not frame.perspective, "a storage factor is of parallel light; give such a frame.")
    if not known.any():
        return 0.0
    density = np.asarray(algorithm.density(state, eye.points), np.float64)[..., known]
    # Parallel rays have one face, and its plane lies across them.
    texel = frame.extent[0].prod() / np.abs(np.linalg.det(np.moveaxis(density, -1, 0)))
    pixel = eye.depth[known].astype(np.float64) ** 2 / eye.camera.focal.prod()
    texels = algorithm.cost(state).texels
    return float((texel / pixel).max() * texels / eye.camera.width**2)


def theory_storage(
    algorithm: ShadowAlgorithm, seen: ViewRange, angle_deg: np.ndarray
) -> np.ndarray | None:
    """The theory's S at angles (n,); None for settings, or a field of view, that it has none for.

    The warps are those of `asmjax.shadow.warped`, in near distances of the frustum: the eye's own
    perspective has u = 1/n = sin(gamma). Of subdivided maps the theory knows the overhead light
    alone, which sees one side face: NaN at other angles, where it sees up to three and the near
    one.
    """
    if not NARROWEST <= seen.theta <= WIDEST:
        return None
    alpha, theta, gamma = seen.alpha, seen.theta, np.radians(np.asarray(angle_deg, np.float64))
    sine, k, logarithmic, known = np.sin(gamma), 1, False, np.full(gamma.shape, True)
    match algorithm:
        case UniformShadowMap():
            u = np.zeros_like(gamma)
        case PerspectiveShadowMap(slide=0.0):
            u = sine
        case LogarithmicShadowMap(across="perspective", ratio=np.inf):
            u, logarithmic = sine, True
        case LightSpaceShadowMap():
            u = _light_space(algorithm.falloff, seen, gamma)
        case PartitionedShadowMap(blend=1.0, near=None, far=None, warp="none"):
            u, k = np.zeros_like(gamma), algorithm.partitions
        case SubdividedShadowMap() if algorithm.parts > 0:
            k, known = algorithm.parts, gamma == np.pi / 2
            u = np.asarray(theory.u_from_xi(algorithm.strength, alpha ** (1 / k)))
        case _:
            return None
    factors = theory.direction_factors(alpha, theta, gamma, u, logarithmic=logarithmic, k=k)
    return np.where(known, np.asarray(factors.storage, np.float64), np.nan)


def _light_space(falloff: str, seen: ViewRange, gamma: np.ndarray) -> np.ndarray:
    """Strengths u (n,) of light-space maps fitted to the frustum."""
    if falloff == "none":
        return np.zeros_like(gamma)
    if falloff == "sine":
        return np.asarray(theory.lispsm_strength(seen.alpha, seen.theta, gamma))
    sine, spread = np.sin(gamma), np.tan(seen.theta) * np.cos(gamma)
    lower, upper = sine - spread, sine + spread
    extent = seen.alpha * upper - np.minimum(lower, seen.alpha * lower)
    xi = np.array([shaped_strength(angle, seen.half_view) for angle in gamma.tolist()])
    return sine * np.asarray(theory.u_from_xi(xi, 1 + extent * sine))
