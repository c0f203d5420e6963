"""The conventional shadow map: one resolution everywhere."""

import time
from collections.abc import Hashable
from dataclasses import KW_ONLY, replace
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt16

from asmjax.buffers import (
    EyeBuffer,
    LightRays,
    Receivers,
    SurfacePoints,
    light_offset,
    project,
    whole_image,
)
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.memory import Memory
from asmjax.numerics import scalar
from asmjax.shadow.base import (
    Cost,
    MapMemory,
    ShadowAlgorithm,
    Status,
    array_bytes,
    isotropic,
)
from asmjax.shadow.comparison import (
    BIAS,
    Compare,
    check_test,
    lit_by_texel,
    stored,
    texel_bytes,
)
from asmjax.shadow.neighbourhood import Neighbourhood, Step, beside, is_own

LARGEST = 2**15
"""Texels a side of the largest flat map."""

ONE_LAUNCH = 2**24
"""Texels that the renderer casts at once (`asmjax.render.caster.LANES`); what is cast in parts is
copied together and onto the device."""


class UniformState(eqx.Module):
    """Flat maps of all faces, row by row: entry face * N * N + row * N + column."""

    frame: LightFrame
    depth: Float[Array, " texels"] | None
    prim: UInt16[Array, " texels"] | None
    seconds: float
    rays: int


class UniformShadowMap(ShadowAlgorithm[UniformState]):
    """Williams' shadow map (1978), `resolution` texels a side per light face.

    Attributes:
        resolution: texels a side.
        compare: what is stored and compared: "depth", "id", or "both".
        bias: relative depth bias of the comparison.
        keep: whether `update` keeps the map while light and casters rest, which a map fitted to
            one view only may do if the frame it is given still is the same.
    """

    resolution: int = 2048
    _: KW_ONLY
    compare: Compare = "depth"
    bias: float = BIAS
    keep: bool = False

    reference: ClassVar[str] = "Williams 1978, Casting Curved Shadows on Curved Surfaces"

    def __check_init__(self):
        require(
            1 <= self.resolution <= LARGEST,
            f"a flat map of {self.resolution} texels a side is not possible; allowed: 1 to 32768.",
        )
        check_test(self.compare, self.bias)

    @property
    def name(self) -> str:
        suffix = "" if self.compare == "depth" else f"-{self.compare}"
        return f"uniform-{self.resolution}{suffix}{'-kept' if self.keep else ''}"

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> UniformState:
        # Texels are addressed by one int32: entry face * N * N + row * N + column.
        require(
            frame.faces * self.resolution**2 < 2**31,
            f"a flat map of {self.resolution} texels a side for each of {frame.faces} light faces "
            "is not possible; allowed are 2^31 texels in all: lower the resolution (32768 "
            "for one face), or `memory_mb` where it follows from that.",
        )
        start = time.perf_counter()
        windows = whole_image(frame, self.resolution)
        buffer = rays.light_buffer(frame, windows)
        texels = (jax.device_put(part.reshape(-1)) for part in buffer)
        depth, prim = stored(self.compare, *texels)
        jax.block_until_ready((depth, prim))
        seconds = time.perf_counter() - start
        return UniformState(frame, depth, prim, seconds, windows.texels)

    def update(self, state, view, frame, rays, moved=None) -> UniformState:
        """Drawn anew, or kept (`keep`); a kept map's build took no time and no rays."""
        if self.keep and moved is None and eqx.tree_equal(state.frame, frame):
            return replace(state, seconds=0.0, rays=0)
        return self.build(view, frame, rays)

    def warm_up(self, state: UniformState, view: EyeBuffer, frame: LightFrame) -> None:
        """Nothing: every update calls the same."""

    def program(self, frame: LightFrame) -> Hashable:
        """Shapes follow from the resolution."""
        return replace(self, bias=BIAS, keep=False)

    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> UniformState:
        """What every build calls."""
        return self.build(view, frame, rays)

    def copied(self, state: UniformState) -> UniformState:
        """`state` itself: nothing takes it over."""
        return state

    def visibility(self, state: UniformState, points: SurfacePoints) -> Float[Array, " n"]:
        offset = light_offset(points, state.frame)
        return _visibility(
            state.frame, state.depth, state.prim, points, offset,
            self.resolution, scalar(self.bias),
        )  # fmt: skip

    def around(self, state: UniformState, points: SurfacePoints) -> "FlatNeighbourhood":
        offset = light_offset(points, state.frame)
        place = _placed(points, state.frame, offset, self.resolution)
        texels = state.depth, state.prim, scalar(self.bias)
        return FlatNeighbourhood(*place, *texels, self.resolution, state.frame.perspective)

    def density(self, state: UniformState, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        receivers = project(points, state.frame, light_offset(points, state.frame))
        texels = jnp.where(receivers.facing, self.resolution, 0)
        return isotropic(texels.astype(points.position.dtype))

    def cost(self, state: UniformState) -> Cost:
        return Cost(
            texels=self.resolution**2 * state.frame.faces,
            bytes=array_bytes(state.depth, state.prim),
            rays=state.rays,
            passes=1 if state.rays else 0,
            seconds={"build": state.seconds, "analysis": 0.0},
        )

    def memory(self, faces: int) -> MapMemory:
        texels, kept = faces * self.resolution**2, texel_bytes(self.compare)
        if texels <= ONE_LAUNCH:
            # Depth and primitive as the renderer gives them are the device's arrays.
            return MapMemory(texels * Memory(renderer=kept), texels * Memory(renderer=8))
        return MapMemory(texels * Memory(device=kept), texels * Memory(8, 8, 8))

    def status(self, state: UniformState) -> Status:
        return Status.COMPLETE

    def effective_resolution(self, state: UniformState) -> int:
        return self.resolution

    def straddling(self, state: UniformState, receivers: Receivers) -> Bool[Array, " n"]:
        """Receivers whose 2 x 2 nearest texels disagree about them."""
        return _straddling(
            state.frame.perspective, state.depth, state.prim, receivers,
            self.resolution, scalar(self.bias),
        )  # fmt: skip


def resolution_for(bytes_limit: int, faces: int, compare: Compare = "depth") -> int:
    """The largest flat map per face whose arrays fit into `bytes_limit` bytes in all."""
    side = int(np.sqrt(bytes_limit / (texel_bytes(compare) * faces)))
    require(side >= 1, f"{bytes_limit} bytes hold no flat map; raise `bytes_limit`.")
    require(
        side <= LARGEST,
        f"a flat map of {bytes_limit / 2**20:g} MB would have {side} texels a side; allowed: "
        f"{LARGEST}: lower `bytes_limit`.",
    )
    return side


def _texel(uv, resolution):
    """Fractions (2, n) of their texels that image coordinates lie at, and those integer texels."""
    at = uv * resolution
    index = jnp.clip(at.astype(jnp.int32), 0, resolution - 1)
    return at - index, index


class FlatNeighbourhood(Neighbourhood):
    """Texels of a flat map; what is beyond a face's border is its last texel.

    Attributes:
        texel: (2, n) int32 column and row of the texel that each point lies in.
        depth, prim: of all texels, as `UniformState` has them.
    """

    receivers: Receivers
    fraction: Float[Array, "2 n"]
    texel: Int[Array, "2 n"]
    depth: Float[Array, " texels"] | None
    prim: UInt16[Array, " texels"] | None
    bias: np.ndarray | Array
    resolution: int = eqx.field(static=True)
    perspective: bool = eqx.field(static=True)

    def lit(
        self, columns: Step = 0, rows: Step = 0, *, most: int | None = None
    ) -> Bool[Array, " n"]:
        n, (column, row), offset = self.resolution, self.texel, 0.5 - self.fraction
        if not is_own(columns, rows):
            column, row = beside(column, columns, n - 1), beside(row, rows, n - 1)
            offset = (jnp.stack([column, row]) - self.texel) + offset
        flat = (self.receivers.face * n + row) * n + column
        return lit_by_texel(
            self.receivers,
            offset / n,
            1 / n,
            None if self.depth is None else self.depth[flat],
            None if self.prim is None else self.prim[flat],
            bias=self.bias,
            perspective=self.perspective,
        )


def _place(points, frame, offset, resolution: int):
    """What `FlatNeighbourhood` begins with: receivers, fraction and texel."""
    receivers = project(points, frame, offset)
    return receivers, *_texel(receivers.uv, resolution)


_placed = eqx.filter_jit(_place)


@eqx.filter_jit
def _visibility(frame, depth, prim, points, offset, resolution: int, bias):
    place = _place(points, frame, offset, resolution)
    around = FlatNeighbourhood(*place, depth, prim, bias, resolution, frame.perspective)
    return around.lit().astype(points.position.dtype)


@eqx.filter_jit
def _straddling(perspective: bool, depth, prim, receivers, resolution: int, bias):
    place = receivers, *_texel(receivers.uv, resolution)
    return FlatNeighbourhood(*place, depth, prim, bias, resolution, perspective).straddles()
