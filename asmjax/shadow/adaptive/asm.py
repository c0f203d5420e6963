"""The adaptive shadow map of Fernando, Fernandez, Bala and Greenberg (2001)."""

import math
import time
from collections.abc import Hashable
from copy import deepcopy
from dataclasses import KW_ONLY, replace
from functools import partial
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, LightRays, SurfacePoints, anchor, light_offset, project
from asmjax.errors import check_choice, require
from asmjax.geometry import LightFrame
from asmjax.memory import Memory
from asmjax.numerics import scalar
from asmjax.shadow.adaptive.address import address_of
from asmjax.shadow.adaptive.around import PagedNeighbourhood, placed
from asmjax.shadow.adaptive.attention import compile_attention
from asmjax.shadow.adaptive.cost_model import TYPICAL, CostModel, calibrate
from asmjax.shadow.adaptive.look import Goals, Measure, compile_looks
from asmjax.shadow.adaptive.motion import touched
from asmjax.shadow.adaptive.page_table import warm_tables
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.refiner import Refiner
from asmjax.shadow.adaptive.shape import TreeShape, shape_for
from asmjax.shadow.adaptive.state import AdaptiveState, BuildLog, HostSide
from asmjax.shadow.adaptive.tree import FIRST_BYTES, Tree, empty_tree, lookup
from asmjax.shadow.base import (
    Cost,
    MapMemory,
    NodeCounts,
    ShadowAlgorithm,
    Status,
    array_bytes,
    isotropic,
)
from asmjax.shadow.comparison import BIAS, Compare, check_test, texel_bytes

LARGEST_PASS = 0.5
"""Part of the memory limit that one pass may cast; see the stages of `Refiner`."""

LOOK = Memory(host=40, device=200)
"""Of a pixel that is looked at: receivers, addresses, ratios and what was found."""


class NodeSquares(NamedTuple):
    """The nodes of a tree that hold texels: face and level (k,), corner nearest to u = v = 0
    (2, k) and side (k,) in image coordinates."""

    face: np.ndarray
    level: np.ndarray
    lo: np.ndarray
    size: np.ndarray


class AdaptiveShadowMap(ShadowAlgorithm[AdaptiveState]):
    """A shadow map refined where the eye can see it, within memory and time limits.

    Attributes:
        memory_bytes: limit on all arrays of the tree, node tables included.
        time_limit: seconds for one build or update; None for no limit.
        node_resolution: R, texels per node side; a power of two, 8 to 512.
        cells: c, cells per node side and resolution factor per level; 2, 4 or 8.
        start_resolution: texels a side (all level-0 nodes together); None takes the paper's 512,
            or less where that would use more than a quarter of the memory.
        ratio_target: texel / pixel size at which a pixel is matched; 1 in the paper.
        measure: what "size" means: "axis" is the worst direction (m), "area" the square root of
            the area ratio; "mipmap" and "mipmap_anisotropic" are the area as the paper measured it.
        pixel_share: looks during motion, and the first ones of a view at rest, take one pixel in
            this many, others in each turn; 1, 2, 4 or 8 (the paper's).
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
        discontinuity: an edge is refined only where its caster is this far off the receiver, along
            the receiver's normal, in parts of the distance to the light; up to `bias` changes
            nothing, nor does any with ids alone. Leaves shadows near their casters coarse.
        least_profit: nodes that serve fewer eye pixels per second of their cost are not made.
        cover: also refine where no edge was seen: finds casters that fell between the first texels.
            First, with a quarter of the memory, until texels are 4 times a pixel's size; in later
            updates fully, with what the edges leave.
        finest_ratio: memory still left is spent on finer texels along the edges down to this
            texel / pixel size; equal to `ratio_target` spends nothing.
        max_passes: passes of one stage of refinement, of which there are two to five.
        cost_model: what casting texels costs. None is `TYPICAL`, and every build is like the other;
            with a time limit `build` calibrates, which takes half a second: keep what
            `asmjax.calibrate` gives for further builds.
    """

    _: KW_ONLY
    memory_bytes: int = 16 * 2**20
    time_limit: float | None = None
    node_resolution: int = 16
    cells: int = 2
    start_resolution: int | None = None
    ratio_target: float = 1.0
    measure: Measure = "axis"
    pixel_share: int = 8
    compare: Compare = "both"
    bias: float = BIAS
    discontinuity: float = 0.0
    least_profit: float = 0.0
    cover: bool = True
    finest_ratio: float = 1 / 16
    max_passes: int = 64
    cost_model: CostModel | None = None

    reference: ClassVar[str] = "Fernando, Fernandez, Bala, Greenberg 2001, Adaptive Shadow Maps"

    def __check_init__(self):
        r, c = self.node_resolution, self.cells
        require(
            r in (8, 16, 32, 64, 128, 256, 512),
            f"a node resolution of {r} is not supported; allowed: powers of two from 8 to 512.",
        )
        require(c in (2, 4, 8), f"{c} cells per side are not supported; allowed: 2, 4, 8.")
        require(
            self.time_limit is None or self.time_limit > 0,
            f"a time limit of {self.time_limit} s leaves no time; give more than 0, or none.",
        )
        start = self.start_resolution
        require(
            start is None or (start >= r and start & (start - 1) == 0 and start <= 2**14),
            f"a starting resolution of {start} is not supported; allowed: powers of two from the "
            f"node resolution ({r}) to 16384.",
        )
        require(
            0 < self.finest_ratio <= self.ratio_target,
            f"finest_ratio {self.finest_ratio} must lie above 0 and not above ratio_target "
            f"{self.ratio_target}.",
        )
        check_choice("measure", self.measure, Measure)
        require(
            self.pixel_share in (1, 2, 4, 8),
            f"a pixel share of {self.pixel_share} is not supported; allowed: 1 (every pixel), 2, "
            "4, 8.",
        )
        for name in ("discontinuity", "least_profit"):
            value = getattr(self, name)
            require(
                math.isfinite(value) and value >= 0,
                f"{name}={value} is not possible; allowed: a finite number, 0 or more.",
            )
        require(self.max_passes >= 1, f"{self.max_passes} passes do nothing; allowed: 1 or more.")
        check_test(self.compare, self.bias)

    @property
    def name(self) -> str:
        return f"adaptive-{self.memory_bytes / 2**20:g}MB"

    @property
    def goals(self) -> Goals:
        """What a look is told: log2 of the ratios to match and to end at, the bias, and by how much
        a caster must be nearer for an edge of its shadow to count, if that is more."""
        apart = self.discontinuity if self.discontinuity > self.bias else None
        return math.log2(self.ratio_target), math.log2(self.finest_ratio), self.bias, apart

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> AdaptiveState:
        """Raises `UseError` where the memory limit does not hold one node per face."""
        cost_model = self._costs(frame, rays)
        start = time.perf_counter()
        shape = self.tree_shape(frame.faces)
        refiner = Refiner(
            self, shape, empty_tree(shape, self.compare), NodePool(shape), cost_model, BuildLog(),
            view, frame, rays, start,
        )  # fmt: skip
        refiner.plant()
        refiner.rest()
        return self._state(refiner)

    def update(
        self, state: AdaptiveState, view: EyeBuffer, frame: LightFrame, rays: LightRays, moved=None
    ) -> AdaptiveState:
        """Refine for the next frame; `state` is taken over.

        A view at rest is refined until nothing is left to gain; a moving one is followed with one
        turn's share of its pixels. Nodes that moving casters touch are cast again if they were used
        lately, else given up. Under a light frame that is not the same, all nodes are; one of
        another number of faces begins with a new tree, as `build` does.
        """
        state.check_owned()
        start, host = time.perf_counter(), state.host
        shape = self.tree_shape(frame.faces)
        host.taken = True
        log = host.log.next()
        same_shape = shape == state.shape
        same_light = same_shape and (state.frame is frame or eqx.tree_equal(state.frame, frame))
        tree = state.tree if same_shape else empty_tree(shape, self.compare)
        pool = host.pool if same_light else NodePool(shape)
        if not same_light:
            log.dropped += host.pool.used_pages
        refiner = Refiner(self, shape, tree, pool, host.cost_model, log, view, frame, rays, start)
        if not same_light:
            refiner.plant()
        elif moved is not None:
            refiner.renew(touched(pool, state.tree, frame, moved))
        at_rest = same_light and moved is None and eqx.tree_equal(host.camera, view.camera)
        if at_rest or not same_shape:
            refiner.rest()
        else:
            refiner.follow()
        return self._state(refiner)

    def warm_up(self, state: AdaptiveState, view: EyeBuffer, frame: LightFrame) -> None:
        """Looks at any number of pixels, changes of few table entries, and what finds the nodes
        that casters touch. New pages of any number can be stored since `build`."""
        state.check_owned()
        warm_tables(state.shape)
        touched(state.pool, state.tree, frame, np.zeros((0, 3, 2)))
        everyone = compile_looks(
            state.tree, view, frame, self.goals,
            shape=state.shape, measure=self.measure, share=self.pixel_share,
        )  # fmt: skip
        compile_attention(state.shape, state.tree, everyone)

    def program(self, frame: LightFrame) -> Hashable:
        """Shapes follow from the tree's, as long as its first memory is enough."""
        shape = self.tree_shape(frame.faces)
        grows = self.memory_bytes > FIRST_BYTES
        looks = self.measure, self.pixel_share, self.goals[-1] is None, self.compare
        return shape, looks, self if grows else None

    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> AdaptiveState:
        """With fine goals, no limit of time, and looks at all, many and few pixels.

        One pass of a stage runs what all of them run, but where a tree grows from pass to pass.
        """
        grows = self.memory_bytes > FIRST_BYTES
        free = replace(
            self,
            time_limit=None, least_profit=0.0, ratio_target=1.0, finest_ratio=1 / 64,
            max_passes=self.max_passes if grows else 1,
        )  # fmt: skip
        state = free.build(view, frame, rays)
        warm_tables(state.shape)
        everyone = compile_looks(
            state.tree, view, frame, self.goals,
            shape=state.shape, measure=self.measure, share=1,
        )  # fmt: skip
        compile_attention(state.shape, state.tree, everyone)
        return state

    def copied(self, state: AdaptiveState) -> AdaptiveState:
        """Tables and texels are copied; raises `UseError` for a state that was taken over."""
        state.check_owned()
        host = HostSide(
            deepcopy(state.pool), state.host.cost_model, replace(state.log), state.host.camera
        )
        tree = jax.tree.map(lambda part: part.copy(), state.tree)
        return AdaptiveState(tree, state.frame, state.shape, host)

    def _costs(self, frame: LightFrame, rays: LightRays) -> CostModel:
        if self.cost_model is not None:
            return self.cost_model
        return TYPICAL if self.time_limit is None else calibrate(rays, frame)

    def _state(self, refiner: Refiner) -> AdaptiveState:
        host = HostSide(refiner.pool, refiner.cost_model, refiner.log, refiner.view.camera)
        return AdaptiveState(refiner.tree, refiner.frame, refiner.shape, host)

    def visibility(self, state: AdaptiveState, points: SurfacePoints) -> Float[Array, " n"]:
        return _visibility(*self._query(state, points), shape=state.shape)

    def around(self, state: AdaptiveState, points: SurfacePoints) -> PagedNeighbourhood:
        *query, bias = self._query(state, points)
        receivers, fraction, address, entry = placed(*query, shape=state.shape)
        return PagedNeighbourhood(
            receivers, fraction, address, entry, state.tree, scalar(bias),
            state.shape, state.frame.perspective,
        )  # fmt: skip

    def lookup(self, state: AdaptiveState, points: SurfacePoints):
        """Visibility (n,), and log2 of the effective resolution (n,) that answered.

        Raises `UseError` for a state that `update` has taken over.
        """
        return _lookup(*self._query(state, points), shape=state.shape)

    def density(self, state: AdaptiveState, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        receivers = project(points, state.frame, light_offset(points, state.frame))
        log2 = self.lookup(state, points)[1].astype(points.position.dtype)
        return isotropic(jnp.where(receivers.facing, jnp.exp2(log2), 0))

    def _query(self, state: AdaptiveState, points: SurfacePoints) -> tuple:
        state.check_owned()
        frame = state.frame
        return (
            state.tree, points, frame,
            light_offset(points, frame), anchor(points, frame), self.bias,
        )  # fmt: skip

    def cost(self, state: AdaptiveState) -> Cost:
        log, held = state.log, state.pool.used_pages
        return Cost(
            texels=held * state.shape.side**2,
            bytes=array_bytes(state.tree, state.serial, state.host.camera, state.host.pyramid)
            + state.pool.bytes,
            rays=log.rays,
            passes=log.passes,
            seconds={"build": log.build, "analysis": log.analysis},
            nodes=NodeCounts(held, log.made, log.evicted, log.recast, log.dropped, log.reused),
        )

    def memory(self, faces: int) -> MapMemory:
        """As of a map that fills its limit, of whatever number of faces."""
        limit, texel = self.memory_bytes, texel_bytes(self.compare)
        cast = limit * LARGEST_PASS / texel * Memory(renderer=8)
        # The arrays that it grew out of are there beside it.
        return MapMemory(Memory(device=limit), Memory(device=2 * limit) + cast, LOOK)

    def status(self, state: AdaptiveState) -> Status:
        return state.log.status

    def effective_resolution(self, state: AdaptiveState) -> int:
        return 1 << state.shape.log2_resolution(self.max_level(state))

    def max_level(self, state: AdaptiveState) -> int:
        """Level of the deepest page."""
        return int(state.pool.squares[1, state.pool.held()].max(initial=0))

    def nodes(self, state: AdaptiveState) -> NodeSquares:
        """Where the nodes lie that hold texels."""
        face, level, column, row = state.pool.squares[:, state.pool.held()].astype(np.int64)
        size = np.ldexp(1.0, -state.shape.log2_nodes_at(level))
        return NodeSquares(face, level, np.stack([column, row]) * size, size)

    def tree_shape(self, faces: int) -> TreeShape:
        """The static sizes that the settings and the memory limit allow; see `shape_for`."""
        return shape_for(
            self.memory_bytes,
            faces,
            node_resolution=self.node_resolution,
            cells=self.cells,
            start_resolution=self.start_resolution,
            compare=self.compare,
        )


@partial(jax.jit, static_argnames="shape")
def _lookup(tree: Tree, points: SurfacePoints, frame, offset, anchor, bias, *, shape):
    receivers = project(points, frame, offset)
    address = address_of(points, anchor, receivers, frame.perspective)
    lit, level = lookup(shape, tree, receivers, address, bias=bias, perspective=frame.perspective)
    return lit.astype(points.position.dtype), shape.log2_resolution(level)


@partial(jax.jit, static_argnames="shape")
def _visibility(*query, shape):
    # Without the levels, which nobody reads then: a fifth less time.
    return _lookup(*query, shape=shape)[0]
