"""Moment shadow maps: filters of any width for the price of one, and soft shadows from them."""

from dataclasses import KW_ONLY
from typing import ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import Receivers, SurfacePoints, double, light_offset, project
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.numerics import scalar
from asmjax.shadow.comparison import BIAS, FLATTEST, depth_tolerance
from asmjax.shadow.soft.hamburger import mean_blocker, shadow_intensity
from asmjax.shadow.soft.light_taps import horizon, seen, share_above, shift_at, taps_of
from asmjax.shadow.soft.summed import BYTES, Sums, scaled, summed, unscaled, window_moments
from asmjax.shadow.soft.wide_map import (
    WideShadowMap,
    WideState,
    WideTexels,
    of_face,
    search_depth,
)

WIDEST_KERNEL = 1024.0
"""Texels a side of the widest filter under a light without size."""

DISK = 0.75**0.5
"""Half side, in radii, of the square that is spread as widely as a disk: second moments agree."""

HORIZON_TAPS = 64
"""Points of a light that are looked for above the plane of a receiver."""


class MomentShadowMap(WideShadowMap):
    """Peters and Klein 2015: four moments of depth, filtered before the test.

    Shadow is the least that any distribution of depths with the moments of a window must have below
    the receiver. With one or two depths that is the true share; with more it is less: light
    leaks, and nothing gets darker than it is. The receiver counts as near as its plane gets within
    the window, so that planes never shade themselves, and what stands on them is lit at its foot.

    Under a light with a size the window is where rays to the light pass at the depth of the
    blockers, as a rectangle along the map; their mean depth comes from the moments of the widest
    such window (Peters and others 2016, "Beyond Hard Shadows"). Under any other it is `kernel`
    texels wide; of one texel it is the uniform map.

    Attributes:
        resolution: texels a side.
        kernel: width of the filter in texels under a light without size, and the least width under
            others.
        compare: what is compared: moments are of depths only.
        bias: relative depth bias of the comparison.
        keep: whether `update` keeps the map while light and casters rest.
    """

    resolution: int = 1024
    _: KW_ONLY
    kernel: float = 1.0
    compare: Literal["depth"] = "depth"
    bias: float = BIAS
    keep: bool = False

    family: ClassVar[str] = "moment"
    reference: ClassVar[str] = "Peters, Klein 2015, Moment Shadow Mapping"
    sum_bytes: ClassVar[int] = BYTES

    def __check_init__(self):
        self._check()
        require(
            self.compare == "depth",
            f"compare='{self.compare}' is not possible with moments; allowed: depth.",
        )
        require(
            1 <= self.kernel <= WIDEST_KERNEL,
            f"a filter of {self.kernel} texels is not possible; allowed: 1 to {WIDEST_KERNEL:g}.",
        )

    @property
    def name(self) -> str:
        return self._named("" if self.kernel == 1 else f"-{self.kernel:g}")

    def is_uniform(self, frame: LightFrame) -> bool:
        return frame.area is None and self.kernel == 1

    def sums_of(self, depth: np.ndarray) -> Sums:
        return summed(depth)

    def visibility(self, state: WideState, points: SurfacePoints) -> Float[Array, " n"]:
        if state.sums is None:
            return self.uniform.visibility(state.flat, points)
        frame = state.flat.frame
        taps = None if frame.area is None else taps_of(frame.area, HORIZON_TAPS).T
        return _visibility(
            self.texels(state), state.sums, points, light_offset(points, frame), taps,
            self.resolution, scalar(self.kernel), scalar(self.bias),
        )  # fmt: skip

    def filter_texels(self, frame: LightFrame) -> float:
        return self.kernel if frame.area is None else 1.0


class _Window(NamedTuple):
    """What is averaged for each receiver, in image coordinates from its own place on: centre and
    half sides, u and v rows (n,)."""

    centre: list
    half: list


@eqx.filter_jit
def _visibility(
    texels: WideTexels, sums: Sums, points, offset, taps, resolution: int, kernel, bias
):  # fmt: skip
    frame = texels.frame
    receivers = project(points, frame, offset)
    dtype = points.position.dtype
    none = jnp.zeros_like(receivers.depth)
    if frame.area is None:
        dark, _ = _asked(texels, sums, receivers, _Window([none] * 2, [none] * 2), resolution,
                         kernel, bias)  # fmt: skip
        return jnp.where(receivers.facing, 1 - dark, 0)
    light, rectangle = seen(frame, frame.area, receivers), frame.area.shape == "rectangle"
    nearest = search_depth(texels, light, receivers, resolution)
    widest = shift_at(light, frame, receivers, nearest)
    search = _Window(widest.centre, widest.half_box(rectangle))
    share, blocker = _asked(texels, sums, receivers, search, resolution, kernel, bias)
    filtered = shift_at(light, frame, receivers, jnp.maximum(blocker, nearest))
    pairs = zip(filtered.axis_u, filtered.axis_v, strict=True)
    spread = [(1.0 if rectangle else DISK) * jnp.hypot(u, v) for u, v in pairs]
    window = _Window(filtered.centre, spread)
    dark, _ = _asked(texels, sums, receivers, window, resolution, kernel, bias)
    # What is below the horizon may be what is blocked, too.
    above = share_above(horizon(light, frame, receivers), jnp.asarray(taps, dtype))
    lit = jnp.minimum(1 - jnp.where(share > 0, dark, 0), above)
    return jnp.where(receivers.facing, lit, 0)


def _asked(
    texels: WideTexels, sums: Sums, receivers: Receivers, window: _Window, resolution: int, kernel,
    bias,
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:  # fmt: skip
    """Share of blockers in each receiver's window, and their mean depth, scene units."""
    dtype = receivers.depth.dtype
    margin = of_face(texels.margin, receivers)
    wide = 1 + 2 * margin
    per_texel = resolution / wide
    place = (receivers.uv + jnp.stack(window.centre) + margin) * per_texel
    centre = jnp.clip(place, 0.5, resolution - 0.5)
    half = jnp.maximum(jnp.stack(window.half) * per_texel, 0.5 * jnp.asarray(kernel, dtype))
    depth = _nearest_of_plane(
        receivers,
        (centre / per_texel - margin) - receivers.uv,
        # A texel that the window cuts is tested by its centre, half a texel further.
        (half + 0.5) / per_texel,
        texels.frame.perspective,
    )
    size = jnp.max(jnp.broadcast_to(wide, receivers.uv.shape), axis=0) / resolution
    depth = depth - depth_tolerance(receivers, size, bias)
    with jax.enable_x64(True):
        low = jnp.maximum(double(centre - half), 0)
        high = jnp.minimum(double(centre + half), resolution)
        moments, alpha = window_moments(sums, receivers.face, low, high, resolution)
        at = scaled(sums, depth)
        share = shadow_intensity(moments, at, alpha)
        blocker = unscaled(sums, mean_blocker(moments, at, alpha))
        found = share.astype(dtype), blocker.astype(dtype)
    return found


def _nearest_of_plane(receivers: Receivers, centre, half, perspective: bool):
    """The least depth of each receiver's tangent plane in a window of the image."""
    slope_u, slope_v = receivers.slope
    along = slope_u * centre[0] + slope_v * centre[1]
    across = jnp.abs(slope_u) * half[0] + jnp.abs(slope_v) * half[1]
    if not perspective:
        return receivers.depth + along - across
    return receivers.depth / jnp.maximum(1 + along + across, FLATTEST)
