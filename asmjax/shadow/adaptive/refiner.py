"""The passes that refine a tree: look, decide, cast, store, until a limit or nothing is left."""

import time
from collections.abc import Iterator
from typing import NamedTuple

import jax
import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.look import Audience, analyse, first_look
from asmjax.shadow.adaptive.page_table import page_of
from asmjax.shadow.adaptive.pool import NodePool, Requests, no_requests
from asmjax.shadow.adaptive.refine import Wish, most_profitable_first, requests_of
from asmjax.shadow.adaptive.shape import TreeShape, page_windows
from asmjax.shadow.adaptive.state import BuildLog
from asmjax.shadow.adaptive.tree import Tree, store_pages
from asmjax.shadow.base import Status

BUCKETS = (16, 128, 1024)
"""Numbers of pages that are stored in one call: others are padded, so that nothing retraces."""

STORE_TEXELS = 1 << 19
"""Texels that are stored in one call, at most, or one page: padding stays small beside a map."""

LEAST_SHARE = 12
"""A pass may always take this part of all pages, so that the last ones do not take many passes."""

BUSY_SHARE = 16
"""A pass over one turn's share of the pixels that makes more than this part of all pages is
followed by another; less is left to the next turns, or to a thorough look."""

FOLLOW_PASSES = 4
"""Passes of one update for a moving view, at most."""

WORTH_SHARE = 32
"""New nodes of a moving view that are fewer than this part of all pages wait for more to come:
making room, placing and launching take as long for a few as for a few hundred."""

LONGEST_WAIT = 7
"""Frames that a new node of a moving view waits at most: as long as its pixels may have waited
for a look."""


class Stage(NamedTuple):
    """One stage of refinement of a view at rest.

    Attributes:
        wish: what to look for.
        share: part of the free pages that a pass may take.
        passes: the most passes.
        thorough: look at every pixel rather than at one turn's share.
        if_uncovered: only for what an earlier coverage could not afford.
    """

    wish: Wish
    share: float
    passes: int
    thorough: bool = False
    if_uncovered: bool = False


class Refiner:
    """Refines one tree for one view: holds what the passes share.

    Args:
        settings: the `AdaptiveShadowMap`.
        start: `time.perf_counter()` of the call that it serves, for the time limit.
    """

    def __init__(
        self,
        settings,
        shape: TreeShape,
        tree: Tree,
        pool: NodePool,
        cost_model: CostModel,
        log: BuildLog,
        view: EyeBuffer,
        frame: LightFrame,
        rays: LightRays,
        start: float,
    ):
        self.settings, self.shape, self.tree, self.pool = settings, shape, tree, pool
        self.cost_model, self.log, self.view = cost_model, log, view
        self.frame, self.rays, self.start = frame, rays, start
        self.last_look = 0.0
        self.given_up = 0
        self.made = np.zeros(shape.pages, bool)
        log.frame += 1

    def plant(self) -> None:
        """Make the level-0 nodes: all that there is before the first look."""
        self.tree = _stores_compiled(self.shape, self.tree)
        got = self.pool.admit(self.pool.roots(), self.log.frame, self.log.frame, False)
        self.log.made += got.pages.size
        self.made[got.pages] = True
        self.cast(got.pages)

    def renew(self, pages: np.ndarray) -> None:
        """Cast pages again that were used lately, and give up the other ones of `pages`, and those
        that the time limit leaves no time for: nothing stale answers."""
        began = time.perf_counter()
        pool = self.pool
        unused = pool.unused(self._oldest)
        kept = pages[~np.isin(pages, unused)]
        below_roots = pool.squares[1, kept] > 0
        kept = kept[np.lexsort((-pool.benefit[kept], below_roots))]
        most = max(self._affordable(kept.size), int((~below_roots).sum()))
        self.given_up, kept = kept[most:].size, kept[:most]
        self.log.dropped += pool.evict(pages[~np.isin(pages, kept)])
        self.log.recast += kept.size
        self.log.analysis += time.perf_counter() - began
        self.cast(kept)

    @property
    def _oldest(self) -> int:
        """Pages with an older stamp answered nobody in the last full turn of the looks."""
        return self.log.frame - self.settings.pixel_share

    def rest(self) -> None:
        """Refine a view at rest until nothing is left to gain or a limit ends it."""
        # Turns go on from update to update: where a limit ends each after its first look, all
        # pixels still are seen, and no page that serves one of them looks unused.
        covered, turn, looking = True, self.log.frame, None
        # What waited is found again.
        self.pool.gather(no_requests(), 0, 0)
        for stage in self._stages():
            if stage.if_uncovered and covered:
                continue
            # The first pass looks at the same pixels as the stage before, where both take a share.
            thorough = stage.thorough
            following = None if thorough else looking
            for done in range(1, stage.passes + 1):
                wanted, looking, straddles = self._look(stage.wish, thorough, turn, following)
                turn += 1
                free = self.pool.free_pages
                allowed = max(int(stage.share * free), self.shape.pages // LEAST_SHARE, 1)
                if stage.wish is Wish.COVERAGE and not stage.if_uncovered:
                    covered = wanted.count <= int(stage.share * free)
                made = self._make(wanted.take(slice(allowed)), replace=stage.wish is Wish.EDGES)
                few = 0 if thorough else self.shape.pages // BUSY_SHARE
                if self.log.status.is_limit or (made <= few and not looking.picked):
                    break
                if done == stage.passes and stage.wish in (Wish.EDGES, Wish.FINER_EDGES):
                    self.log.status = Status.PASS_LIMIT
                # A thorough stage sees every pixel, then only those near an edge as long as they
                # gain; at the end all again: finer texels may have shown an edge to others. A share
                # of the pixels is followed by another.
                following = looking.only(straddles) if thorough and made else None
            if self.log.status.is_limit:
                break
            looking = None if thorough else looking
        self._finish()

    def follow(self) -> None:
        """Refine for a moving view: one turn's share of its pixels, matched and no finer."""
        wish = Wish.FOLLOW if self.settings.cover else Wish.EDGES
        least = self.shape.pages // WORTH_SHARE
        for turn in range(FOLLOW_PASSES):
            wanted, *_ = self._look(wish, False, self.log.frame + turn)
            wanted = self.pool.gather(wanted, least, LONGEST_WAIT)
            if wanted.count == 0:
                break
            made = self._make(most_profitable_first(wanted, self.cost_model), replace=True)
            if made <= self.shape.pages // BUSY_SHARE or self.log.status.is_limit:
                break
        if not self.log.status.is_limit:
            self.log.status = Status.FOLLOWED
        self._finish()

    def _stages(self) -> Iterator[Stage]:
        """What to look for, in order.

        Finer edges are found pass by pass, so each takes half of what is left: the last pages go
        where the last look says they help most.
        """
        most, cover = self.settings.max_passes, self.settings.cover
        modern = self.settings.finest_ratio < self.settings.ratio_target
        if not cover and not modern:
            yield Stage(Wish.EDGES, 1.0, most)
            yield Stage(Wish.EDGES, 1.0, most, thorough=True)
            return
        if cover:
            yield Stage(Wish.COARSE_COVERAGE, 0.25, 1)
        yield Stage(Wish.EDGES, 0.5, most)
        last = Wish.FINER_EDGES if modern else Wish.EDGES
        if cover:
            yield Stage(Wish.COVERAGE, 0.25, 1)
        yield Stage(last, 0.5, most, thorough=True)
        if cover:
            # What the first coverage could not afford, and the edges that it brings to light.
            yield Stage(Wish.COVERAGE, 1.0, most, if_uncovered=True)
            yield Stage(last, 1.0, most, thorough=True, if_uncovered=True)

    def _look(
        self, wish: Wish, thorough: bool, turn: int, looking: Audience | None = None
    ) -> tuple[Requests, Audience, np.ndarray]:
        """Look at `looking`, or else at the view or at one turn's share of it.

        Returns what is asked for, most profitable first; who was looked at; which of them straddle
        an edge.
        """
        began = time.perf_counter()
        settings, goals = self.settings, self.settings.goals
        if looking is None:
            looking, analysis = first_look(
                self.tree, self.view, self.frame, goals, shape=self.shape,
                measure=settings.measure, share=1 if thorough else settings.pixel_share, turn=turn,
            )  # fmt: skip
        else:
            perspective = self.frame.perspective
            analysis = analyse(
                self.tree, looking, *goals, shape=self.shape, perspective=perspective
            )
        self.log.status = Status.COMPLETE
        facing = np.asarray(looking.receivers.facing)
        pages = page_of(np.asarray(analysis.entry)[facing])
        self.pool.use(pages, self.log.frame, looking.weight)
        wanted = requests_of(self.shape, analysis, looking, wish)
        wanted = most_profitable_first(wanted, self.cost_model)
        self.last_look = time.perf_counter() - began
        self.log.analysis += self.last_look
        return wanted, looking, np.asarray(analysis.straddles)

    def _make(self, requests: Requests, replace: bool) -> int:
        """Cast and store the nodes that fit into time and memory; returns how many were made."""
        began = time.perf_counter()
        fits = self._affordable(requests.count)
        if fits < requests.count:
            self.log.status = Status.TIME_LIMIT
            requests = requests.take(slice(fits))
        got = self.pool.admit(requests, self.log.frame, self._oldest, replace)
        self.log.evicted += got.evicted
        if got.no_table:
            self.log.status = Status.NODE_CAPACITY
        elif got.refused:
            self.log.status = Status.MEMORY_LIMIT
        self.log.analysis += time.perf_counter() - began
        self.log.made += got.pages.size
        self.made[got.pages] = True
        self.cast(got.pages)
        return got.pages.size

    def _affordable(self, count: int) -> int:
        """How many of `count` pages can be cast within the time limit, by what was measured."""
        limit = self.settings.time_limit
        if limit is None or count == 0:
            return count
        left = limit - (time.perf_counter() - self.start) - self.last_look
        cost = self.cost_model
        per_page = max(cost.a_seconds_per_texel * self.shape.side**2, 1e-12)
        fits = (left / self.log.slowness - cost.b_seconds) / per_page
        return int(np.clip(fits, 0, count))

    def cast(self, pages: np.ndarray) -> None:
        """Cast the texels of pages in one launch, near ones together, and store them."""
        if pages.size == 0:
            # Others may have been given up all the same: they must serve nobody.
            entries = self.pool.table.on_device(self.tree.entries)
            self.tree = self.tree._replace(entries=entries)
            return
        began = time.perf_counter()
        pages = pages[np.argsort(self.pool.key[pages])]
        windows = page_windows(self.shape, self.pool.squares[:, pages])
        depth, prim = self.rays.light_buffer(self.frame, windows)
        most = buckets_of(self.shape)[-1]
        for start in range(0, pages.size, most):
            some = slice(start, start + most)
            self.tree = _store(self.shape, self.tree, pages[some], depth[some], prim[some])
        self.tree = self.tree._replace(entries=self.pool.table.on_device(self.tree.entries))
        jax.block_until_ready(self.tree)
        seconds = time.perf_counter() - began
        expected = self.cost_model.seconds(windows.texels)
        if expected > 0:
            # The larger of the last two: a launch that was slow once may be slow again.
            slow = seconds / expected
            self.log.slowness = max(slow, 0.5 * (self.log.slowness + slow))
        self.log.build += seconds
        self.log.rays += windows.texels
        self.log.passes += 1

    def _finish(self) -> None:
        if self.given_up and not self.log.status.is_limit:
            self.log.status = Status.TIME_LIMIT
        used = self.pool.stamp[self.pool.held()] == self.log.frame
        self.log.reused = int((used & ~self.made[self.pool.held()]).sum())


def buckets_of(shape: TreeShape) -> tuple[int, ...]:
    """Numbers of pages that are stored in one call of a tree: `BUCKETS` as far as they fit."""
    most = max(1, min(shape.pages, STORE_TEXELS // shape.side**2, BUCKETS[-1]))
    return (*(bucket for bucket in BUCKETS if bucket < most), most)


def _store(shape: TreeShape, tree: Tree, pages, depth, prim) -> Tree:
    """The tree, taken over, with the texels of `pages` (k,), k at most the largest bucket."""
    bucket = next(b for b in buckets_of(shape) if b >= pages.size)
    stored = store_pages(
        tree.depth,
        tree.prim,
        _padded(pages.astype(np.int32), bucket, shape.pages),
        None if tree.depth is None else _padded(depth, bucket),
        None if tree.prim is None else _padded(prim, bucket),
    )
    return Tree(tree.entries, *stored)


_compiled: set[tuple] = set()


def _stores_compiled(shape: TreeShape, tree: Tree) -> Tree:
    """The tree as it was, every bucket compiled once: a frame with many new nodes must not wait."""
    kind = shape, tree.depth is None, tree.prim is None, jax.config.read("jax_enable_x64")
    if kind not in _compiled:
        for bucket in buckets_of(shape):
            spare = np.full(bucket, shape.pages, np.int32)
            texels = (bucket, shape.side, shape.side)
            tree = _store(
                shape, tree, spare, np.zeros(texels, np.float32), np.zeros(texels, np.int32)
            )
        _compiled.add(kind)
    return tree


def _padded(a: np.ndarray, count: int, fill=0) -> np.ndarray:
    """`a` with its first axis filled up to `count` entries; itself where nothing is missing."""
    if a.shape[0] == count:
        return a
    result = np.full((count, *a.shape[1:]), fill, a.dtype)
    result[: a.shape[0]] = a
    return result
