"""The adaptive shadow map of Fernando, Fernandez, Bala and Greenberg (2001)."""

import time
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, NamedTuple, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.buffers import EyeBuffer, LightRays, Receivers, SurfacePoints, light_offset, project
from asmjax.errors import require
from asmjax.footprint import log2_linear_ratio, log2_m, uv_jacobian
from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.address import DEEPEST_LOG2
from asmjax.shadow.adaptive.cost_model import CostModel, calibrate
from asmjax.shadow.adaptive.pool import SQUARE_BYTES, NodePool, Requests
from asmjax.shadow.adaptive.refine import (
    Wish,
    analyse,
    audience,
    most_profitable_first,
    requests_of,
)
from asmjax.shadow.adaptive.tree import (
    GUARD,
    Tree,
    TreeShape,
    empty_tree,
    lookup,
    page_windows,
    store_pages,
)
from asmjax.shadow.base import Cost, ShadowAlgorithm, Status, array_bytes
from asmjax.shadow.comparison import BIAS, Compare, check_test, texel_bytes

Measure = Literal["axis", "area"]

BUCKETS = (16, 128, 1024)
"""Numbers of pages that are stored in one call: others are padded, so that nothing retraces."""

NODES_PER_PAGE = 4
"""Room in the node table: nodes on the way to deep pages own no texels but need an entry."""

LEAST_SHARE = 12
"""A pass may always take this part of all pages, so that the last ones do not take many passes."""

START_LOG2 = 9
"""log2 of the starting resolution of the 2001 paper, 512 x 512."""


@dataclass
class BuildLog:
    """What building took so far: seconds by stage, light rays, passes, and how it ended."""

    build: float = 0.0
    analysis: float = 0.0
    rays: int = 0
    passes: int = 0
    status: Status = Status.COMPLETE


class HostSide:
    """What a state keeps on the host: tables, costs and log; and whether `update` took it over.

    All are equal: a jitted function of a state depends on its arrays and shapes alone.
    """

    def __init__(self, pool: NodePool, cost_model: CostModel, log: BuildLog):
        self.pool, self.cost_model, self.log, self.taken = pool, cost_model, log, False

    def __eq__(self, other):
        return isinstance(other, HostSide)

    def __hash__(self):
        return hash(HostSide)


class AdaptiveState(eqx.Module):
    """A tree on the device, its tables on the host, and the light frame that it was built for."""

    shape: TreeShape
    tree: Tree
    frame: LightFrame
    host: HostSide = eqx.field(static=True)

    @property
    def pool(self) -> NodePool:
        self.check_owned()
        return self.host.pool

    @property
    def log(self) -> BuildLog:
        self.check_owned()
        return self.host.log

    def check_owned(self) -> None:
        """Raise `UseError` if `update` has taken this state over."""
        require(
            not self.host.taken,
            "this state was handed to update, which reuses its arrays; go on with the state that "
            "update returned.",
        )


class Stage(NamedTuple):
    """One stage of refinement: what to look for, the share of the free pages that a pass may take,
    the most passes, and whether it is for what an earlier coverage could not afford."""

    wish: Wish
    share: float
    passes: int
    if_uncovered: bool = False


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
            the area ratio (the paper's).
        compare, bias: the shadow test; see `asmjax.shadow.comparison`.
        cover: also refine where no edge was seen, with a quarter of the free memory before the
            edges and another after them: finds casters that fell between the first texels.
        finest_ratio: memory still left is spent on finer texels along the edges down to this
            texel / pixel size; equal to `ratio_target` spends nothing.
        max_passes: passes of one build or update.
        cost_model: calibrated costs; None calibrates in `build`.
    """

    memory_bytes: int = 16 * 2**20
    time_limit: float | None = None
    node_resolution: int = 16
    cells: int = 2
    start_resolution: int | None = None
    ratio_target: float = 1.0
    measure: Measure = "axis"
    compare: Compare = "both"
    bias: float = BIAS
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
        require(
            self.measure in get_args(Measure),
            f"measure='{self.measure}' is not known; allowed: {', '.join(get_args(Measure))}.",
        )
        require(self.max_passes >= 1, f"{self.max_passes} passes do nothing; allowed: 1 or more.")
        check_test(self.compare, self.bias)

    @property
    def name(self) -> str:
        return f"adaptive-{self.memory_bytes / 2**20:g}MB"

    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> AdaptiveState:
        """Raises `UseError` where the memory limit does not hold one node per face."""
        cost_model = self.cost_model or calibrate(rays, frame)
        start = time.perf_counter()
        shape = self.tree_shape(frame.faces)
        pool = NodePool(shape)
        log = BuildLog()
        tree = _add_pages(
            shape, empty_tree(shape, self.compare), pool, pool.roots(), frame, rays, log
        )
        log.build = time.perf_counter() - start
        host = HostSide(pool, cost_model, log)
        return self._refine(AdaptiveState(shape, tree, frame, host), view, rays, start)

    def update(
        self, state: AdaptiveState, view: EyeBuffer, frame: LightFrame, rays: LightRays, moved=None
    ) -> AdaptiveState:
        """Refine for a new view; the tree is kept while the light frame is the same.

        That is so for a light with a field of view of its own; a frame that is fitted to the
        receivers changes with the view, and the map is built anew. `state` is taken over.
        """
        if not eqx.tree_equal(state.frame, frame):
            known = replace(self, cost_model=state.host.cost_model)
            return known.build(view, frame, rays)
        return self._refine(state, view, rays, time.perf_counter())

    def visibility(self, state: AdaptiveState, points: SurfacePoints) -> Float[Array, " n"]:
        lit, _ = self.lookup(state, points)
        return lit

    def lookup(self, state: AdaptiveState, points: SurfacePoints):
        """Visibility (n,), and log2 of the effective resolution (n,) that answered.

        Raises `UseError` for a state that `update` has taken over.
        """
        state.check_owned()
        offset = light_offset(points, state.frame)
        return _visibility(state.shape, state.tree, state.frame, points, offset, self.bias)

    def cost(self, state: AdaptiveState) -> Cost:
        log = state.log
        return Cost(
            texels=state.pool.used_pages * state.shape.side**2,
            bytes=array_bytes(state.tree) + state.pool.bytes,
            rays=log.rays,
            passes=log.passes,
            seconds={"build": log.build, "analysis": log.analysis},
        )

    def status(self, state: AdaptiveState) -> Status:
        return state.log.status

    def effective_resolution(self, state: AdaptiveState) -> int:
        return 1 << state.shape.log2_resolution(self.max_level(state))

    def max_level(self, state: AdaptiveState) -> int:
        """Level of the deepest page."""
        return int(state.pool.squares[1, : state.pool.used_pages].max(initial=0))

    def nodes(self, state: AdaptiveState) -> NodeSquares:
        """Where the nodes lie that hold texels."""
        face, level, column, row = state.pool.squares[:, : state.pool.used_pages]
        size = np.ldexp(1.0, -state.shape.log2_nodes_at(level))
        return NodeSquares(face, level, np.stack([column, row]) * size, size)

    def tree_shape(self, faces: int) -> TreeShape:
        """The static sizes that the settings and the memory limit allow."""
        log2_node = self.node_resolution.bit_length() - 1
        log2_cells = self.cells.bit_length() - 1
        side = self.node_resolution + 2 * GUARD
        page_bytes = side**2 * texel_bytes(self.compare) + 4
        # Node tables exist twice, on the device and on the host, and each page's square once.
        node_bytes = 2 * (4 * self.cells**2 + 4)
        per_page = page_bytes + SQUARE_BYTES + NODES_PER_PAGE * node_bytes
        # One page more than is used takes the padding of `store_pages`.
        pages = (self.memory_bytes - page_bytes) // per_page
        require(
            pages >= faces,
            f"a memory limit of {self.memory_bytes / 2**20:g} MB is below one node of "
            f"{self.node_resolution} x {self.node_resolution} texels for each of {faces} light "
            f"face(s); allowed is {(page_bytes + faces * per_page) / 2**20:.3g} MB or more: raise "
            "--memory-mb or lower --node-resolution.",
        )
        # Texels and cells are addressed by one int32 each: entry page * side^2 + local.
        per_page = max(side**2, NODES_PER_PAGE * self.cells**2)
        require(
            (pages + 1) * per_page < 2**31,
            f"a memory limit of {self.memory_bytes / 2**20:g} MB holds more texels or cells than "
            f"can be addressed; allowed are 2^31, which {self.node_resolution} x "
            f"{self.node_resolution} nodes of {self.cells} x {self.cells} cells reach with "
            f"{(2**31 // per_page) * page_bytes / 2**20:.0f} MB of texels: lower --memory-mb.",
        )
        if self.start_resolution is None:
            log2_roots = max(START_LOG2 - log2_node, 0)
            while log2_roots > 0 and 4 * (faces << 2 * log2_roots) > pages:
                log2_roots -= 1
        else:
            log2_roots = self.start_resolution.bit_length() - 1 - log2_node
            require(
                faces << 2 * log2_roots <= pages,
                f"a starting resolution of {self.start_resolution} needs "
                f"{faces << 2 * log2_roots} nodes, but {self.memory_bytes / 2**20:g} MB hold "
                f"{pages}: raise --memory-mb or lower the starting resolution.",
            )
        return TreeShape(
            log2_node=log2_node,
            log2_cells=log2_cells,
            log2_roots=log2_roots,
            levels=(DEEPEST_LOG2 - log2_node - log2_roots) // log2_cells,
            faces=faces,
            pages=int(pages),
            nodes=int(NODES_PER_PAGE * pages),
        )

    def _stages(self):
        """What to look for, in order (see `Stage`).

        Finer edges are found pass by pass, so each takes half of what is left: the last pages go
        where the last look says they help most.
        """
        modern = self.finest_ratio < self.ratio_target
        if not self.cover and not modern:
            yield Stage(Wish.EDGES, 1.0, self.max_passes)
            return
        if self.cover:
            yield Stage(Wish.COARSE_COVERAGE, 0.25, 1)
        yield Stage(Wish.EDGES, 0.5, self.max_passes)
        last = Wish.FINER_EDGES if modern else Wish.EDGES
        if self.cover:
            yield Stage(Wish.COVERAGE, 0.25, 1)
        yield Stage(last, 0.5, self.max_passes)
        if self.cover:
            # What the first coverage could not afford, and the edges that it brings to light.
            yield Stage(Wish.COVERAGE, 1.0, self.max_passes, if_uncovered=True)
            yield Stage(last, 1.0, self.max_passes, if_uncovered=True)

    def _refine(self, state, view: EyeBuffer, rays: LightRays, start: float) -> AdaptiveState:
        """Passes of analysis and node creation until nothing is left to gain or a limit ends it."""
        shape, pool, frame, log = state.shape, state.pool, state.frame, replace(state.log)
        cost_model, tree = state.host.cost_model, state.tree
        state.host.taken = True
        began = time.perf_counter()
        everyone = audience(
            *_seen_by_light(
                view.points, view.camera, frame, light_offset(view.points, frame), self.measure
            )
        )
        log.analysis += time.perf_counter() - began
        covered = True
        for wish, share, most, if_uncovered in self._stages():
            if if_uncovered and covered:
                continue
            # A stage's first pass looks at everyone, later ones at those near an edge then: only
            # they can have anything left to gain.
            looking = everyone
            for _ in range(most):
                log.status = Status.COMPLETE
                began = time.perf_counter()
                analysis = analyse(
                    shape, tree, looking.receivers, looking.log2_ratio,
                    float(np.log2(self.ratio_target)), float(np.log2(self.finest_ratio)),
                    self.bias, frame.perspective,
                )  # fmt: skip
                wanted = requests_of(shape, analysis, looking, wish)
                chosen = most_profitable_first(wanted, cost_model)
                if wish is Wish.COVERAGE and not if_uncovered:
                    covered = wanted.count <= int(share * pool.free_pages)
                allowed = max(int(share * pool.free_pages), shape.pages // LEAST_SHARE, 1)
                chosen = self._affordable(chosen.take(slice(allowed)), cost_model, start, log)
                looking = looking.only(np.asarray(analysis.straddles))
                log.analysis += time.perf_counter() - began
                if wanted.count and pool.free_pages == 0:
                    log.status = Status.MEMORY_LIMIT
                if chosen.count == 0 or pool.free_pages == 0:
                    break
                began = time.perf_counter()
                tree = _add_pages(shape, tree, pool, chosen, frame, rays, log)
                log.build += time.perf_counter() - began
                if log.status is Status.NODE_CAPACITY:
                    break
            else:
                if wish in (Wish.EDGES, Wish.FINER_EDGES):
                    log.status = Status.PASS_LIMIT
            if log.status.is_limit:
                break
        host = HostSide(pool, cost_model, log)
        return AdaptiveState(shape, tree, frame, host)

    def _affordable(self, requests: Requests, cost: CostModel, start: float, log: BuildLog):
        """The first requests whose predicted casting ends within the time limit."""
        if self.time_limit is None or requests.count == 0:
            return requests
        left = self.time_limit - (time.perf_counter() - start)
        texels = (self.node_resolution + 2 * GUARD) ** 2
        per_page = max(cost.a_seconds_per_texel * texels, 1e-12)
        fits = int(np.clip((left - cost.b_seconds) / per_page, 0, requests.count))
        if fits < requests.count:
            log.status = Status.TIME_LIMIT
        return requests.take(slice(fits))


def _add_pages(shape, tree: Tree, pool: NodePool, requests, frame, rays, log: BuildLog) -> Tree:
    """Cast the pages of `requests` in one launch and store them; counts into `log`."""
    pages, left_over = pool.insert(requests)
    if left_over:
        log.status = Status.NODE_CAPACITY
    if pages.size == 0:
        return tree
    windows = page_windows(shape, *pool.squares[:, pages])
    buffer = rays.light_buffer(frame, windows)
    log.rays += windows.texels
    log.passes += 1
    level, depth, prim = tree.level, tree.depth, tree.prim
    for start in range(0, pages.size, BUCKETS[-1]):
        some = slice(start, min(start + BUCKETS[-1], pages.size))
        count = some.stop - some.start
        bucket = next(b for b in BUCKETS if b >= count)
        level, depth, prim = store_pages(
            level, depth, prim,
            _padded(pages[some].astype(np.int32), bucket, shape.pages),
            _padded(pool.squares[1, pages[some]].astype(np.int32), bucket),
            None if depth is None else _padded(np.asarray(buffer.depth)[some], bucket),
            None if prim is None else _padded(np.asarray(buffer.prim)[some], bucket),
        )  # fmt: skip
    # Copies: an aliased table would change under the device's hands at the next insert.
    child, page = jnp.array(pool.child, copy=True), jnp.array(pool.page, copy=True)
    tree = Tree(child, page, level, depth, prim)
    return jax.block_until_ready(tree)


def _padded(a: np.ndarray, count: int, fill=0) -> np.ndarray:
    """`a` with its first axis filled up to `count` entries."""
    result = np.full((count, *a.shape[1:]), fill, a.dtype)
    result[: a.shape[0]] = a
    return result


@eqx.filter_jit
def _seen_by_light(points, camera, frame, offset, measure) -> tuple[Receivers, Float[Array, " n"]]:
    receivers = project(points, frame, offset)
    jacobian = uv_jacobian(points, camera, frame, receivers)
    size = log2_m if measure == "axis" else log2_linear_ratio
    return receivers, size(jacobian, 1)


@eqx.filter_jit
def _visibility(shape: TreeShape, tree: Tree, frame, points, offset, bias):
    receivers = project(points, frame, offset)
    lit, level = lookup(shape, tree, receivers, bias=bias, perspective=frame.perspective)
    return lit.astype(points.position.dtype), shape.log2_resolution(level)
