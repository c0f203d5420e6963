"""Percentage-closer filtering (Reeves, Salesin and Cook 1987) around any other shadow map."""

from collections.abc import Hashable
from dataclasses import KW_ONLY, replace
from typing import Any, ClassVar, Literal, cast, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, LightRays, SurfacePoints
from asmjax.errors import require, unknown_name
from asmjax.footprint import uv_jacobian
from asmjax.geometry import Camera, LightFrame
from asmjax.numerics import scalar
from asmjax.shadow.base import Cost, MapMemory, ShadowAlgorithm, Status, array_bytes
from asmjax.shadow.comparison import Compare, Tested
from asmjax.shadow.filtered.footprint import box_of, stratified_share
from asmjax.shadow.filtered.pixels import pixel_of
from asmjax.shadow.filtered.windows import box, dithered
from asmjax.shadow.neighbourhood import Neighbourhood
from asmjax.shadow.soft.accumulated import AccumulatedShadowMap
from asmjax.shadow.soft.wide_map import WideShadowMap
from asmjax.shadow.uniform import UniformShadowMap

Kernel = Literal["bilinear", "sixteen", "dithered", "area", "original"]
KERNELS: tuple[Kernel, ...] = get_args(Kernel)

WINDOWS = {"bilinear": 1.0, "sixteen": 4.0}
"""Kernels that are the exact average over a window of so many texels a side."""

LEAST_WIDTH, MOST_WIDTH = 1 / 64, 64.0
"""Texels a side of a window that is no single texel: float32 has digits left for its weights, and
its tests, (width + 1)^2 of them, are no more than a few thousand."""

MOST_STRATA = 64


class FilteredState(eqx.Module):
    """The state of the map that is filtered, and what sees the pixels that ask.

    Attributes:
        inner: of the map.
        camera: of the view that it was made or updated for last; its own copy.
        frame: of the light.
    """

    inner: Any
    camera: Camera
    frame: LightFrame


class FilteredShadowMap(ShadowAlgorithm[FilteredState]):
    """Percentage-closer filtering: the share of light over texels around each point, by the shadow
    test of each of them at its own centre.

    All but the answers is the inner map's: what is cast, kept, refined and paid for.

    Attributes:
        kernel: which texels count how much. "bilinear": the hardware's 2 x 2 tests. "sixteen": the
            mean of 16 of those, 4 x 4 texels. "dithered": four of the 16, others in each pixel of a
            2 x 2 block. "area": exactly a window of `width` texels a side. "original": samples over
            the box around the pixel's footprint, as in 1987.
        width: texels a side of the window of "area", 0 or 1/64 to 64, where 0 asks the inner map's
            own texel and nothing else; the least side of the box of "original".
        strata: samples a side of the box of "original", one in each of its equal cells; 1 to 64.
        inner: the map that is filtered, of any other family.
    """

    kernel: Kernel = "sixteen"
    width: float = 4.0
    _: KW_ONLY
    strata: int = 4
    inner: ShadowAlgorithm = UniformShadowMap()

    reference: ClassVar[str] = (
        "Reeves, Salesin, Cook 1987, Rendering Antialiased Shadows with Depth Maps"
    )

    def __check_init__(self):
        if self.kernel not in KERNELS:
            raise unknown_name(
                "kernel", self.kernel, KERNELS, "The map that is filtered is given as inner."
            )
        require(
            self.width == 0 or LEAST_WIDTH <= self.width <= MOST_WIDTH,
            f"a width of {self.width} texels is not possible; allowed: 0, or 1/64 to 64.",
        )
        require(
            1 <= self.strata <= MOST_STRATA,
            f"{self.strata} strata a side are not possible; allowed: 1 to {MOST_STRATA}.",
        )
        require(
            not isinstance(self.inner, FilteredShadowMap),
            "a filter of a filtered map is not possible: filters average shadow tests; name a map "
            "as inner.",
        )

    @property
    def name(self) -> str:
        width = f"{self.width:g}" if self.kernel == "area" else ""
        return f"filtered-{self.kernel}{width}-{self.inner.name}"

    @property
    def compare(self) -> Compare:
        """What the inner map compares."""
        return cast(Tested, self.inner).compare

    @property
    def bias(self) -> float:
        """The inner map's, of each of the tests."""
        return cast(Tested, self.inner).bias

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> FilteredState:
        if isinstance(self.inner, WideShadowMap | AccumulatedShadowMap):
            self.inner.check_filterable(frame)
        return _state(self.inner.build(view, frame, rays), view, frame)

    def update(self, state, view, frame, rays, moved=None) -> FilteredState:
        return _state(self.inner.update(state.inner, view, frame, rays, moved), view, frame)

    def warm_up(self, state: FilteredState, view: EyeBuffer, frame: LightFrame) -> None:
        self.inner.warm_up(state.inner, view, frame)

    def program(self, frame: LightFrame) -> Hashable:
        """A window's width decides how many tests there are; a footprint's least does not."""
        width = self.width if self.kernel == "area" else None
        return self.kernel, width, self.strata, self.inner.program(frame)

    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> FilteredState:
        return _state(self.inner.rehearse(view, frame, rays), view, frame)

    def copied(self, state: FilteredState) -> FilteredState:
        return replace(state, inner=self.inner.copied(state.inner))

    def visibility(self, state: FilteredState, points: SurfacePoints) -> Float[Array, " n"]:
        """From 0 to 1, else as every map."""
        around = self.around(state, points)
        if self.kernel == "dithered":
            return _dithered(around, points, state.camera, _from_eye(state, points))
        if self.kernel == "original":
            return _original(
                around, self.density(state, points), points, state.camera,
                _from_eye(state, points), state.frame, scalar(self.width), self.strata,
            )  # fmt: skip
        return _box(around, WINDOWS.get(self.kernel, self.width))

    def around(self, state: FilteredState, points: SurfacePoints) -> Neighbourhood:
        """The inner map's texels."""
        return self.inner.around(state.inner, points)

    def density(self, state: FilteredState, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        return self.inner.density(state.inner, points)

    def cost(self, state: FilteredState) -> Cost:
        cost = self.inner.cost(state.inner)
        return replace(cost, bytes=cost.bytes + array_bytes(state.camera))

    def memory(self, faces: int) -> MapMemory:
        return self.inner.memory(faces)

    def status(self, state: FilteredState) -> Status:
        return self.inner.status(state.inner)

    def effective_resolution(self, state: FilteredState) -> int:
        return self.inner.effective_resolution(state.inner)


def _state(inner, view: EyeBuffer, frame: LightFrame) -> FilteredState:
    # Copied: the arrays of the view's own camera may be counted as the inner map's.
    camera = jax.tree.map(
        lambda part: part.copy() if isinstance(part, np.ndarray) else part, view.camera
    )
    return FilteredState(inner, camera, frame)


def _from_eye(state: FilteredState, points: SurfacePoints) -> np.ndarray | Array:
    """(3,) the points' origin from the eye, formed in float64 on the host where it is known."""
    parts = points.origin, state.camera.origin
    xp = np if all(isinstance(part, np.ndarray) for part in parts) else jnp
    return xp.asarray(parts[0]) - xp.asarray(parts[1])


def _seen(points: SurfacePoints, from_eye) -> SurfacePoints:
    """The points relative to the eye."""
    shift = jnp.asarray(from_eye, points.position.dtype)
    return eqx.tree_at(lambda p: p.position, points, points.position + shift[:, None])


_box = eqx.filter_jit(box)


@eqx.filter_jit
def _dithered(around: Neighbourhood, points, camera, from_eye):
    return dithered(around, pixel_of(_seen(points, from_eye), camera))


@eqx.filter_jit
def _original(around: Neighbourhood, density, points, camera, from_eye, frame, width, strata: int):
    points = _seen(points, from_eye)
    jacobian = uv_jacobian(points, camera, frame, around.receivers)
    texels = jnp.stack(
        [jnp.stack([d[0] * jacobian[0, i] + d[1] * jacobian[1, i] for i in range(2)])
         for d in density]
    )  # fmt: skip
    half = box_of(texels, jnp.asarray(width, texels.dtype))
    return stratified_share(around, half, pixel_of(points, camera), strata)
