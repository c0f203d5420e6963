"""A flat map for a light that has a size, and all that its siblings share but the query.

Rays from a receiver to such a light leave the light's image where it ends, so the map goes on
beyond it: as far as they do at the nearest caster, which a few rays find before. Of a light without
size it is the uniform map, bit by bit.
"""

import abc
import time
from collections.abc import Hashable
from dataclasses import replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree, UInt16

from asmjax.buffers import (
    EyeBuffer,
    LightRays,
    Receivers,
    SurfacePoints,
    TexelWindows,
    light_offset,
    project,
)
from asmjax.errors import require
from asmjax.geometry import LightFrame
from asmjax.memory import Memory
from asmjax.numerics import scalar
from asmjax.shadow.base import Cost, MapMemory, ShadowAlgorithm, Status, array_bytes
from asmjax.shadow.comparison import (
    BIAS,
    Compare,
    check_test,
    lit_by_texel,
    pack_prim,
    texel_bytes,
)
from asmjax.shadow.neighbourhood import Neighbourhood
from asmjax.shadow.soft.light_taps import SeenLight, shift_at
from asmjax.shadow.soft.nearest import least_depths, least_in, sides
from asmjax.shadow.uniform import LARGEST, UniformShadowMap, UniformState

WIDEST_MARGIN = 0.5
"""Parts of the image that a map goes on for on each side, at most: its texels are twice as wide
then. What casts from still further away is taken for what lies at the border, and the status says
so."""

NARROWINGS = 3
"""How often a search for blockers looks how near the nearest one of its window is."""

PROBE = 64
"""Rays a side that look for the nearest caster."""


class WideState(eqx.Module):
    """Texels of all faces, row by row, over the light's image and what lies beside it.

    Attributes:
        flat: the texels; those of a uniform map where the rest is None.
        margin: (faces, 2) float64, in parts of the image, on each side in u and v.
        needed: (faces, 2) float64, what it would be without a limit.
        nearest: () float64 axial depth of the nearest caster, scene units.
        least: least depths of windows (`nearest.least_depths`), scene units.
        sums: what the family keeps of the depths besides, as arrays.
    """

    flat: UniformState
    margin: np.ndarray | None = None
    needed: np.ndarray | None = None
    nearest: np.ndarray | None = None
    least: Float[Array, " cells"] | None = None
    sums: PyTree = None


class WideTexels(NamedTuple):
    """What a query reads: see `WideState`."""

    frame: LightFrame
    depth: Float[Array, " texels"] | None
    prim: UInt16[Array, " texels"] | None
    margin: np.ndarray | Array
    nearest: np.ndarray | Array
    least: Float[Array, " cells"] | None


class WideShadowMap(ShadowAlgorithm[WideState]):
    """A flat map, `resolution` texels a side per light face, that a query averages over."""

    resolution: eqx.AbstractVar[int]
    compare: eqx.AbstractVar[Compare]
    bias: eqx.AbstractVar[float]
    keep: eqx.AbstractVar[bool]
    family: eqx.AbstractClassVar[str]
    """What its names begin with."""

    sum_bytes: ClassVar[int] = 0
    """Bytes a texel of what `sums_of` makes."""

    def _named(self, detail: str = "") -> str:
        suffix = "" if self.compare == "depth" else f"-{self.compare}"
        kept = "-kept" if self.keep else ""
        return f"{self.family}-{self.resolution}{detail}{suffix}{kept}"

    def _check(self) -> None:
        require(
            1 <= self.resolution <= LARGEST,
            f"a map of {self.resolution} texels a side is not possible; allowed: 1 to {LARGEST}.",
        )
        check_test(self.compare, self.bias)

    @abc.abstractmethod
    def is_uniform(self, frame: LightFrame) -> bool:
        """Whether under this light nothing is averaged: it is the uniform map then."""

    @abc.abstractmethod
    def sums_of(self, depth: np.ndarray) -> PyTree:
        """What is kept besides, of the depths (faces, N, N) float32, +inf where nothing is hit."""

    @abc.abstractmethod
    def filter_texels(self, frame: LightFrame) -> float:
        """Texels a side that answer as one, as the filter of a light without size has them; 1 where
        only the size of the light decides."""

    @property
    def uniform(self) -> UniformShadowMap:
        return UniformShadowMap(
            self.resolution, compare=self.compare, bias=self.bias, keep=self.keep
        )

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> WideState:
        if self.is_uniform(frame):
            return WideState(self.uniform.build(view, frame, rays))
        # Summed tables have a row and a column more.
        require(
            frame.faces * (self.resolution + 1) ** 2 < 2**31,
            f"{self.name} for each of {frame.faces} light faces is not possible; allowed are 2^31 "
            "texels in all: lower the resolution.",
        )
        start = time.perf_counter()
        needed, probes = np.zeros((frame.faces, 2)), 0
        if frame.area is not None:
            needed, probes = margins(frame, rays), frame.faces * PROBE**2
        margin = np.minimum(needed, WIDEST_MARGIN)
        texel = (1 + 2 * margin.T) / self.resolution
        windows = TexelWindows(np.arange(frame.faces), -margin.T, texel, self.resolution)
        buffer = rays.light_buffer(frame, windows)
        texels = buffer.depth
        if frame.area is not None:
            texels = np.where(behind_emitter(frame, windows), np.float32(np.inf), texels)
        hit = np.isfinite(texels)
        sums = self.sums_of(texels)
        least = None if frame.area is None else jax.device_put(least_depths(texels))
        # Sums of depths stand for the depths.
        depth = None if sums is not None else jax.device_put(texels.reshape(-1))
        prim = None
        if self.compare != "depth":
            prim = pack_prim(jax.device_put(buffer.prim.reshape(-1)))
        jax.block_until_ready((depth, prim, sums, least))
        seconds = time.perf_counter() - start
        flat = UniformState(frame, depth, prim, seconds, windows.texels + probes)
        nearest = max(float(texels.min(where=hit, initial=np.inf)), frame.near)
        nearest = np.asarray(nearest if hit.any() else 1.0)
        return WideState(flat, margin, needed, nearest, least, sums)

    def update(self, state, view, frame, rays, moved=None) -> WideState:
        """Drawn anew, or kept (`keep`); a kept map's build took no time and no rays."""
        if self.keep and moved is None and eqx.tree_equal(state.flat.frame, frame):
            rested = UniformState(frame, state.flat.depth, state.flat.prim, 0.0, 0)
            return replace(state, flat=rested)
        return self.build(view, frame, rays)

    def warm_up(self, state: WideState, view: EyeBuffer, frame: LightFrame) -> None:
        """Nothing: every update calls the same."""

    def program(self, frame: LightFrame) -> Hashable:
        """Shapes follow from all settings but the bias, and from whether the light has a size."""
        return replace(self, bias=BIAS, keep=False), self.is_uniform(frame)

    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> WideState:
        """What every build calls."""
        return self.build(view, frame, rays)

    def copied(self, state: WideState) -> WideState:
        """`state` itself: nothing takes it over."""
        return state

    def check_filterable(self, frame: LightFrame) -> None:
        """Raise `UseError` where there is nothing to filter under a light."""
        require(
            self.is_uniform(frame),
            f"{self.name} filters by the size of the light already; filter a uniform map instead.",
        )

    def around(self, state: WideState, points: SurfacePoints) -> Neighbourhood:
        """Of the uniform map; a light with a size needs no filter besides."""
        self.check_filterable(state.flat.frame)
        return self.uniform.around(state.flat, points)

    def density(self, state: WideState, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        if state.margin is None:
            return self.uniform.density(state.flat, points)
        frame = state.flat.frame
        return _density(
            frame, state.margin, points, light_offset(points, frame),
            scalar(self.resolution / self.filter_texels(frame)),
        )  # fmt: skip

    def cost(self, state: WideState) -> Cost:
        probed = state.margin is not None and state.flat.frame.area is not None
        kept = state.flat.rays == 0
        return Cost(
            texels=self.resolution**2 * state.flat.frame.faces,
            bytes=array_bytes(
                state.flat.depth,
                state.flat.prim,
                state.margin,
                state.needed,
                state.nearest,
                state.least,
                state.sums,
            ),  # fmt: skip
            rays=state.flat.rays,
            passes=0 if kept else 2 if probed else 1,
            seconds={"build": state.flat.seconds, "analysis": 0.0},
        )

    def memory(self, faces: int) -> MapMemory:
        """Of a light with a size, which takes the most: depths are kept whatever is compared, or
        their sums."""
        texels = faces * self.resolution**2
        kept = texel_bytes("depth" if self.compare == "depth" else "both")
        if self.sum_bytes:
            texels, kept = faces * (self.resolution + 1) ** 2, self.sum_bytes
        cells = faces * sum(side**2 for side in sides(self.resolution))
        state = texels * Memory(device=kept) + Memory(host=32 * faces + 16, device=4 * cells)
        return MapMemory(state, state + texels * Memory(8 + 2 * self.sum_bytes, 8, 8))

    def status(self, state: WideState) -> Status:
        short = state.needed is not None and bool((state.needed > WIDEST_MARGIN).any())
        return Status.MARGIN_LIMIT if short else Status.COMPLETE

    def effective_resolution(self, state: WideState) -> int:
        if state.margin is None:
            return self.resolution
        wide = (1 + 2 * float(state.margin.min())) * self.filter_texels(state.flat.frame)
        return max(round(self.resolution / wide), 1)

    def texels(self, state: WideState) -> WideTexels:
        """Of a state that is no uniform map."""
        flat = state.flat
        assert state.margin is not None and state.nearest is not None
        return WideTexels(
            flat.frame, flat.depth, flat.prim, state.margin, state.nearest, state.least
        )


def margins(frame: LightFrame, rays: LightRays) -> np.ndarray:
    """(faces, 2) by how much of its image, on each side in u and v, a map would have to go on for
    the rays from its receivers to a light with a size.

    Between the nearest and the farthest surface that `PROBE`^2 rays a face meet, all over the
    largest map there may be. Casters that they miss may reach in from beyond the margin.
    """
    assert frame.area is not None
    texel = np.full((2, frame.faces), (1 + 2 * WIDEST_MARGIN) / PROBE)
    corner = np.full((2, frame.faces), -WIDEST_MARGIN)
    windows = TexelWindows(np.arange(frame.faces), corner, texel, PROBE)
    depth = rays.light_buffer(frame, windows).depth
    met = depth[np.isfinite(depth) & ~behind_emitter(frame, windows)].astype(np.float64)
    if met.size == 0:
        return np.zeros((frame.faces, 2))
    # A light that is tilted to the face is nearer to its receivers on one side, by its radius.
    nearest, farthest = max(met.min(), frame.near), met.max()
    reach = farthest - nearest
    if frame.perspective:
        reach /= nearest * max(farthest - frame.area.radius, nearest)
    axes = frame.rotation[:, :2].reshape(-1, 3).T
    across = frame.area.extent_along(axes).reshape(frame.faces, 2)
    if frame.perspective:
        outermost = np.maximum(np.abs(frame.corner), np.abs(frame.corner + frame.extent))
        across = across + outermost * frame.area.extent_along(frame.rotation[:, 2].T)[:, None]
    return across * reach / frame.extent


def behind_emitter(frame: LightFrame, windows: TexelWindows) -> np.ndarray:
    """(faces, N, N) texels whose rays leave a flat light on the side that does not emit: what they
    meet, such as the ceiling that a lamp is set in, is before no receiver."""
    area = frame.area
    assert area is not None
    if not area.is_flat:
        return np.zeros((windows.count, windows.side, windows.side), bool)
    start, step = windows.plane(frame)
    at = np.arange(windows.side)
    x, y = (start[k][:, None] + at * step[k][:, None] for k in range(2))
    normal = frame.rotation @ area.normal
    across = normal[:, 0, None] * x + normal[:, 2, None]
    return across[:, None, :] + (normal[:, 1, None] * y)[:, :, None] <= 0


def search_depth(
    texels: WideTexels, light: SeenLight, receivers: Receivers, resolution: int
) -> Float[Array, " n"]:
    """A depth (n,) before which no caster stands between each receiver and the light; that of the
    receiver where none does at all."""
    frame = texels.frame
    assert texels.least is not None and frame.area is not None
    rectangle = frame.area.shape == "rectangle"
    margin = of_face(texels.margin, receivers)
    per_texel = resolution / (1 + 2 * margin)
    depth = jnp.minimum(jnp.asarray(texels.nearest, receivers.depth.dtype), receivers.depth)
    for _ in range(NARROWINGS):
        shift = shift_at(light, frame, receivers, depth)
        centre = (receivers.uv + jnp.stack(shift.centre) + margin) * per_texel
        half = jnp.stack(shift.half_box(rectangle)) * per_texel
        least = least_in(
            texels.least, receivers.face, centre - half, centre + half, resolution, frame.faces
        )
        depth = jnp.maximum(depth, jnp.minimum(least, receivers.depth))
    return depth


class Tapped(NamedTuple):
    """One texel for each receiver.

    Attributes:
        lit: (n,) whether it lets light through, by its own centre.
        depth: (n,) what it holds.
    """

    lit: Bool[Array, " n"]
    depth: Float[Array, " n"]


def tapped(
    texels: WideTexels,
    receivers: Receivers,
    shift: Float[Array, "2 n"],
    resolution: int,
    bias,
    by_depth: bool,
) -> Tapped:
    """The texel at an image offset `shift` from each receiver; the last one beyond the border."""
    margin = of_face(texels.margin, receivers)
    wide = 1 + 2 * margin
    at = (receivers.uv + shift + margin) / wide * resolution
    index = jnp.clip(at, 0, resolution - 1).astype(jnp.int32)
    centre = (index + 0.5) / resolution * wide - margin
    flat = (receivers.face * resolution + index[1]) * resolution + index[0]
    assert texels.depth is not None
    depth = texels.depth[flat]
    lit = lit_by_texel(
        receivers,
        centre - receivers.uv,
        jnp.maximum(wide[0], wide[1]) / resolution,
        depth if by_depth else None,
        None if texels.prim is None else texels.prim[flat],
        bias=bias,
        perspective=texels.frame.perspective,
    )
    return Tapped(lit, depth)


def of_face(margin, receivers: Receivers) -> Float[Array, "2 k"]:
    """The margin of each receiver's face: (2, n), or (2, 1) of the only one."""
    table = jnp.asarray(margin, receivers.depth.dtype).T
    return table if table.shape[1] == 1 else table[:, receivers.face]


@eqx.filter_jit
def _density(frame, margin, points, offset, resolution):
    receivers = project(points, frame, offset)
    resolution = jnp.asarray(resolution, receivers.depth.dtype)
    texels = jnp.where(receivers.facing, resolution / (1 + 2 * of_face(margin, receivers)), 0)
    none = jnp.zeros_like(texels[0])
    return jnp.stack([jnp.stack([texels[0], none]), jnp.stack([none, texels[1]])])
