"""The adaptive shadow map in plain NumPy: the slow, obvious twin of `AdaptiveShadowMap`.

A tree of `Node` objects with c x c cells, found by recursion; loops over pixels; float64. It takes
sizes and settings from the package, and the receivers in the light's image, which are tested on
their own, so that both see the same input. The policy is written out once more.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import equinox as eqx
import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.footprint import log2_linear_ratio, log2_m, uv_jacobian
from asmjax.geometry import Camera, LightFrame
from asmjax.shadow import AdaptiveShadowMap, NodeCounts, Status
from asmjax.shadow.adaptive.look import COARSE, padded_size
from asmjax.shadow.adaptive.pool import RESERVE_SHARE
from asmjax.shadow.adaptive.refine import FINER_LEVELS
from asmjax.shadow.adaptive.refiner import (
    BUSY_SHARE,
    FOLLOW_PASSES,
    LEAST_SHARE,
    LONGEST_WAIT,
    WORTH_SHARE,
)
from asmjax.shadow.adaptive.shape import GUARD
from asmjax.shadow.comparison import CURVATURE_BIAS, FLATTEST
from helpers.poses import projected

Square = tuple[int, int, int, int]
"""face, level, column, row."""


@dataclass(eq=False)
class Node:
    """A square of a face in c x c cells, each empty or with the one child that covers it.

    A node without texels is only on the way to deeper ones.
    """

    square: Square
    cells: dict[tuple[int, int], "Node"] = field(default_factory=dict)
    depth: np.ndarray | None = None
    prim: np.ndarray | None = None
    stamp: int = 0
    made: int = 0
    benefit: float = 0.0

    @property
    def level(self) -> int:
        return self.square[1]

    def cell(self, x: float, y: float, c: int) -> tuple[tuple[int, int], float, float]:
        """The cell at a place x, y in [0, 1) of this node, and the place within it."""
        column, row = int(x * c), int(y * c)
        return (column, row), x * c - column, y * c - row

    def deepest(self, x: float, y: float, c: int) -> "Node | None":
        """The deepest node with texels over a place of this one."""
        at, x, y = self.cell(x, y, c)
        below = self.cells[at].deepest(x, y, c) if at in self.cells else None
        return below or (self if self.depth is not None else None)

    def walk(self) -> "Iterator[Node]":
        """The nodes with texels, depth first, parents before children, cells along a Z-curve."""
        if self.depth is not None:
            yield self
        for at in sorted(self.cells, key=z_order):
            yield from self.cells[at].walk()

    def last_use(self) -> int:
        """The latest look that it, or a node below it, answered in."""
        return max(node.stamp for node in self.walk())

    def prune(self) -> bool:
        """Cut off what leads to no texels; whether nothing is left."""
        self.cells = {at: child for at, child in self.cells.items() if not child.prune()}
        return self.depth is None and not self.cells


def z_order(at: tuple[int, int]) -> int:
    column, row = at
    return sum(
        ((column >> bit & 1) << 2 * bit) + ((row >> bit & 1) << 2 * bit + 1) for bit in range(16)
    )


@dataclass(frozen=True)
class Pixel:
    """What one eye pixel sees, where the light shines on it."""

    index: int
    face: int
    u: float
    v: float
    depth: float
    slope: tuple[float, float]
    secant: float
    reach: float
    prim: int
    log2_ratio: float


@dataclass
class Request:
    """A node that pixels ask for."""

    square: Square
    benefit: int = 0
    n_required: float = 0.0


class SlowASM:
    """One tree, refined for one view after another under one light.

    Attributes:
        roots: level-0 nodes by face, column and row.
        frame: number of builds and updates so far.
        made, evicted, passes: of the last one.
    """

    def __init__(self, settings: AdaptiveShadowMap, light: LightFrame, rays: LightRays):
        assert settings.time_limit is None and settings.cost_model is not None
        self.settings, self.light, self.rays = settings, light, rays
        self.cost = settings.cost_model
        self.shape = settings.tree_shape(light.faces)
        self.log2_resolution = list(map(self.shape.log2_resolution, range(self.shape.levels + 1)))
        self.c, self.texels = 1 << self.shape.log2_cells, 1 << self.shape.log2_node
        self.roots: dict[tuple[int, int, int], Node] = {}
        self.frame = self.made = self.evicted = self.passes = 0
        self.status = Status.COMPLETE
        self.camera: Camera | None = None
        self.waiting: list[Request] = []
        self.waited = 0
        self.seen: tuple[EyeBuffer | None, list[Pixel]] = None, []

    # What may be asked

    def build(self, view: EyeBuffer) -> None:
        self.frame += 1
        side = range(1 << self.shape.log2_roots)
        for face in range(self.light.faces):
            for row in side:
                for column in side:
                    root = Node((face, 0, column, row), benefit=np.inf)
                    self.roots[face, column, row] = root
                    self._cast(root)
        self.passes += 1
        self._rest(view)

    def update(self, view: EyeBuffer) -> None:
        self.frame += 1
        self.made = self.evicted = self.passes = 0
        if eqx.tree_equal(self.camera, view.camera):
            self._rest(view)
        else:
            self._follow(view)

    def visibility(self, view: EyeBuffer) -> np.ndarray:
        lit = np.zeros(view.points.count)
        for pixel in self._pixels(view):
            lit[pixel.index] = self._lit(self._serving(pixel), pixel, 0, 0)
        return lit

    def nodes(self) -> list[Node]:
        """All nodes with texels, in the order of the walk."""
        places = sorted(self.roots, key=lambda at: (at[0], z_order(at[1:])))
        return [node for at in places for node in self.roots[at].walk()]

    def counts(self) -> NodeCounts:
        nodes = self.nodes()
        reused = sum(n.stamp == self.frame and n.made < self.frame for n in nodes)
        return NodeCounts(len(nodes), self.made, self.evicted, reused=reused)

    # Pixels

    def _pixels(self, view: EyeBuffer, share: int = 1, turn: int = 0) -> list[Pixel]:
        """Pixels that the light shines on: every `share`-th of a row, 3 further on in the next."""
        if view is not self.seen[0]:
            self.seen = view, self._seen(view)
        width = view.camera.width
        return [
            pixel
            for pixel in self.seen[1]
            if (pixel.index % width + 3 * (pixel.index // width) + turn) % share == 0
        ]

    def _seen(self, view: EyeBuffer) -> list[Pixel]:
        points = view.points
        seen = projected(points, self.light)
        measure = {"axis": log2_m, "area": log2_linear_ratio}[self.settings.measure]
        ratio = measure(uv_jacobian(points, view.camera, self.light, seen), 1)
        columns = (
            seen.face, *seen.uv, seen.depth, *seen.slope, seen.secant, seen.reach, seen.prim, ratio,
        )  # fmt: skip
        rows = zip(*(np.asarray(a).tolist() for a in columns), strict=True)
        pixels = []
        for k, (facing, row) in enumerate(zip(np.asarray(seen.facing), rows, strict=True)):
            if facing:
                face, u, v, depth, slope_u, slope_v, *rest = row
                pixels.append(Pixel(k, face, u, v, depth, (slope_u, slope_v), *rest))
        return pixels

    def _serving(self, pixel: Pixel) -> Node:
        side = 1 << self.shape.log2_roots
        column, row = int(pixel.u * side), int(pixel.v * side)
        root = self.roots[pixel.face, column, row]
        node = root.deepest(pixel.u * side - column, pixel.v * side - row, self.c)
        assert node is not None, "level 0 stays"
        return node

    def _plane(self, pixel: Pixel, du: float, dv: float) -> tuple[float, bool]:
        """Depth of the pixel's tangent plane (du, dv) away, and whether it is trusted there."""
        along = pixel.slope[0] * du + pixel.slope[1] * dv
        if not self.light.perspective:
            return pixel.depth + along, True
        if FLATTEST < 1 + along < 1 / FLATTEST:
            return pixel.depth / (1 + along), True
        return pixel.depth, False

    def _tap(self, node: Node, pixel: Pixel, dx: int, dy: int, bias: float) -> tuple[bool, bool]:
        """Whether the texel (dx, dy) from the pixel's own lets light through, and can decide."""
        resolution = 2.0 ** self.log2_resolution[node.level]
        column, row = int(pixel.u * resolution), int(pixel.v * resolution)
        du, dv = (column + dx + 0.5) / resolution - pixel.u, (row + dy + 0.5) / resolution - pixel.v
        x = column - node.square[2] * self.texels + dx + GUARD
        y = row - node.square[3] * self.texels + dy + GUARD
        plane, trusted = self._plane(pixel, du, dv)
        reach = bias * pixel.depth + CURVATURE_BIAS * pixel.reach / resolution
        assert node.depth is not None and node.prim is not None
        by_depth = node.depth[y, x] >= plane - pixel.secant * reach
        by_prim = pixel.prim >= 0 and node.prim[y, x] % 65536 == pixel.prim % 65536
        compare = self.settings.compare
        lit = (compare != "id" and by_depth) or (compare != "depth" and by_prim)
        return bool(lit), trusted

    def _lit(self, node: Node, pixel: Pixel, dx: int, dy: int) -> bool:
        return self._tap(node, pixel, dx, dy, self.settings.bias)[0]

    def _straddles(self, node: Node, pixel: Pixel) -> bool:
        """Whether the 2 x 2 nearest texels disagree, one of them because of a caster that is far
        enough off; or one of them cannot decide."""
        resolution = 2.0 ** self.log2_resolution[node.level]
        x, y = (1 if (at * resolution) % 1 >= 0.5 else -1 for at in (pixel.u, pixel.v))
        bias = self.settings.bias
        far = max(bias, self.settings.discontinuity)
        places = [(dx, dy) for dy in (0, y) for dx in (0, x)]
        taps = [self._tap(node, pixel, *place, bias) for place in places]
        lit = [lit for lit, _ in taps]
        edge = any(lit) and not all(lit)
        edge = edge and not all(self._tap(node, pixel, *place, far)[0] for place in places)
        return edge or not all(trusted for _, trusted in taps)

    def _level_for(self, pixel: Pixel, ratio: float) -> int:
        """The first level whose texels are at most `ratio` pixels large."""
        level, goal = 0, np.log2(ratio)
        while level < self.shape.levels and pixel.log2_ratio - self.log2_resolution[level] > goal:
            level += 1
        return level

    # Looking

    def _look(
        self, pixels: list[Pixel], share: int, wish: str, note: bool = True
    ) -> tuple[list[Request], list[Pixel]]:
        """What the pixels ask for, most profitable first; and which of them ask.

        A first look at pixels notes which nodes they use.
        """
        settings, requests, asking = self.settings, {}, []
        self.status = Status.COMPLETE
        served: dict[int, int] = {}
        for pixel in pixels:
            node = self._serving(pixel)
            if note:
                node.stamp = self.frame
                served[id(node)] = served.get(id(node), 0) + share
                node.benefit = max(node.benefit, served[id(node)])
            edge = self._straddles(node, pixel)
            matched = self._level_for(pixel, settings.ratio_target)
            coarse = self._level_for(pixel, settings.ratio_target * COARSE)
            finer = min(node.level + FINER_LEVELS, self._level_for(pixel, settings.finest_ratio))
            level = {
                "edges": matched if edge else 0,
                "finer edges": max(matched, finer) if edge else 0,
                "coarse coverage": coarse,
                "coverage": matched,
                "follow": matched if edge else coarse,
            }[wish]
            if level <= node.level:
                continue
            asking.append(pixel)
            nodes = 2.0 ** self.shape.log2_nodes_at(level)
            square = pixel.face, level, int(pixel.u * nodes), int(pixel.v * nodes)
            request = requests.setdefault(square, Request(square))
            request.benefit += share
            # N_required = N_current * area ratio, by sides.
            current = self.texels / self.c ** (level - node.level)
            ratio = 2.0 ** (pixel.log2_ratio - self.log2_resolution[node.level])
            request.n_required = max(request.n_required, (current * ratio) ** 2)

        worth = [r for r in requests.values() if self._profit(r) >= settings.least_profit]
        return sorted(worth, key=self._order), asking

    def _profit(self, request: Request) -> float:
        seconds = self.cost.a_seconds_per_texel * request.n_required + self.cost.b_seconds
        return request.benefit / seconds

    def _order(self, request: Request):
        face, level, column, row = request.square
        return -self._profit(request), level, face, row, column

    # Refining

    def _rest(self, view: EyeBuffer) -> None:
        """Stage by stage: (wish, part of the free pages a pass may take, passes, every pixel)."""
        settings, most = self.settings, self.settings.max_passes
        cover, finer = settings.cover, settings.finest_ratio < settings.ratio_target
        last = "finer edges" if finer else "edges"
        if not cover and not finer:
            stages = [("edges", 1.0, most, False), ("edges", 1.0, most, True)]
        elif cover:
            stages = [("coarse coverage", 0.25, 1, False), ("edges if full", 0.5, most, False),
                      (last, 0.5, most, True), ("coverage", 1.0, 1, False),
                      (last, 1.0, most, True)]  # fmt: skip
        else:
            stages = [("edges", 0.5, most, False), (last, 0.5, most, True)]
        self.camera, turn = view.camera, self.frame
        self.waiting, self.waited = [], 0
        self.served_by: dict[int, Square] = {}
        before: list[Pixel] | None = None
        while stages:
            wish, part, passes, thorough = stages.pop(0)
            little = self.shape.pages // LEAST_SHARE
            if wish == "edges if full":
                if self._free() >= little:
                    continue
                wish = "edges"
            if wish == "coverage" and (self.frame == 1 or self._free() <= little):
                break
            if not stages and cover and self._free() == 0:
                self.status = Status.MEMORY_LIMIT
                break
            if thorough:
                self._refine_for_all(view, wish, part, passes)
                before = None
            else:
                for done in range(1, passes + 1):
                    share, again = settings.pixel_share, before is not None
                    pixels = before if before is not None else self._pixels(view, share, turn)
                    before, turn = None, turn + 1
                    wanted, _ = self._look(pixels, share, wish, note=not again)
                    made = self._make_part(wanted, part, wish)
                    if self.status.is_limit or made <= self.shape.pages // BUSY_SHARE:
                        break
                    if done == passes and "edges" in wish:
                        self.status = Status.PASS_LIMIT
                before = pixels
            if self.status.is_limit:
                break

    def _refine_for_all(self, view: EyeBuffer, wish: str, part: float, passes: int) -> None:
        """Every pixel once, then those that asked, then those that another node serves by now."""
        everyone, count = self._pixels(view), view.points.count
        asked = self._unsettled(everyone) if self.served_by else everyone
        for _ in range(passes):
            note = not self.served_by
            chosen = everyone if padded_size(count, len(asked)) == count else asked
            for pixel in chosen:
                self.served_by[pixel.index] = self._serving(pixel).square
            wanted, asked = self._look(chosen, 1, wish, note)
            made = self._make_part(wanted, part, wish)
            if self.status.is_limit:
                return
            if not made:
                asked = self._unsettled(everyone)
            if not asked:
                return
        if "edges" in wish:
            self.status = Status.PASS_LIMIT

    def _unsettled(self, pixels: list[Pixel]) -> list[Pixel]:
        return [p for p in pixels if self._serving(p).square != self.served_by[p.index]]

    def _make_part(self, wanted: list[Request], part: float, wish: str) -> int:
        allowed = max(int(part * self._free()), self.shape.pages // LEAST_SHARE, 1)
        return self._make(wanted[:allowed], replace=wish == "edges")

    def _follow(self, view: EyeBuffer) -> None:
        self.camera = view.camera
        much = self._free() > self.shape.pages // LEAST_SHARE
        for turn in range(self.frame, self.frame + FOLLOW_PASSES):
            share = self.settings.pixel_share
            wish = "follow" if self.settings.cover else "edges"
            if self.settings.cover and much:
                wish = "coverage"
            wanted, _ = self._look(self._pixels(view, share, turn), share, wish)
            waiting = {request.square: request for request in [*wanted, *self.waiting]}
            if len(waiting) < self.shape.pages // WORTH_SHARE and self.waited < LONGEST_WAIT:
                self.waiting = list(waiting.values())
                self.waited = self.waited + 1 if waiting else 0
                break
            self.waiting, self.waited = [], 0
            if not waiting:
                break
            chosen = sorted(waiting.values(), key=self._order)
            if wish == "coverage":
                chosen = chosen[: self._free()]
            made = self._make(chosen, replace=wish != "coverage")
            if made <= self.shape.pages // BUSY_SHARE or self.status.is_limit:
                break
        if not self.status.is_limit:
            self.status = Status.FOLLOWED

    def _make(self, requests: list[Request], replace: bool) -> int:
        """Make nodes in order, as far as there is or can be made room; how many."""
        if len(requests) > self._free():
            reserve = self.shape.pages // RESERVE_SHARE
            for node in self._unused()[: len(requests) - self._free() + reserve]:
                self._give_up(node)
        free = self._free()
        if len(requests) > free and replace:
            weakest = self._leaves()
            wins = []
            for k, request in enumerate(requests):
                if k < free:
                    wins.append(request)
                elif weakest and request.benefit > weakest[0].benefit:
                    wins.append(request)
                    self._give_up(weakest.pop(0))
        else:
            wins = requests[:free]
        if len(wins) < len(requests):
            self.status = Status.MEMORY_LIMIT
        for request in wins:
            self._insert(request)
        self.passes += bool(wins)
        return len(wins)

    def _free(self) -> int:
        return self.shape.pages - len(self.nodes())

    def _unused(self) -> list[Node]:
        """Whole subtrees that answered nobody in the last full turn: least recently used first."""
        oldest = self.frame - self.settings.pixel_share
        gone = [n for n in self.nodes() if n.level > 0 and n.last_use() < oldest]
        return sorted(gone, key=lambda n: (n.last_use(), -n.level))

    def _leaves(self) -> list[Node]:
        """The nodes without any below them, weakest first."""
        leaves = [n for n in self.nodes() if n.level > 0 and list(n.walk()) == [n]]
        return sorted(leaves, key=lambda n: (n.benefit, -n.level))

    def _give_up(self, node: Node) -> None:
        node.depth = node.prim = None
        self.evicted += 1
        for root in self.roots.values():
            root.prune()

    def _insert(self, request: Request) -> None:
        """The node over a square, with the ones on the way; its texels."""
        face, level, column, row = request.square
        side = 1 << self.shape.log2_roots
        size = self.c**level
        node = self.roots[face, column // size, row // size]
        assert column // size < side and row // size < side
        for below in range(1, level + 1):
            size //= self.c
            at = column // size % self.c, row // size % self.c
            square = face, below, column // size, row // size
            node = node.cells.setdefault(at, Node(square))
        assert node.square == request.square and node.depth is None
        node.benefit = request.benefit
        self._cast(node)

    def _cast(self, node: Node) -> None:
        """One ray through each texel's centre, guard band included."""
        face, level, column, row = node.square
        resolution = 2.0 ** self.log2_resolution[level]
        depth, prim = [], []
        for y in range(-GUARD, self.texels + GUARD):
            u = (column * self.texels + np.arange(-GUARD, self.texels + GUARD) + 0.5) / resolution
            v = (row * self.texels + y + 0.5) / resolution
            t, hit = self.rays.closest(*self.light.ray(face, u, np.full(u.size, v)))
            depth.append(t)
            prim.append(hit)
        # Maps hold float32.
        node.depth, node.prim = np.array(depth, np.float32), np.array(prim)
        node.stamp = node.made = self.frame
        self.made += 1
