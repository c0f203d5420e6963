"""The passes that refine a tree: look, decide, cast, store, until a limit or nothing is left."""

import time
from collections.abc import Iterator
from typing import NamedTuple

import jax
import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.attention import Attention
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.look import Analysis, Audience, analyse, first_look
from asmjax.shadow.adaptive.page_table import page_of
from asmjax.shadow.adaptive.pool import NodePool, Requests, no_requests
from asmjax.shadow.adaptive.refine import (
    Asking,
    Wish,
    asking_of,
    most_profitable_first,
    requests_of,
)
from asmjax.shadow.adaptive.shape import TreeShape, page_windows
from asmjax.shadow.adaptive.state import BuildLog
from asmjax.shadow.adaptive.storing import store, stores_compiled
from asmjax.shadow.adaptive.tree import Tree, with_room
from asmjax.shadow.base import Status

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
    """

    wish: Wish
    share: float
    passes: int
    thorough: bool = False


class Look(NamedTuple):
    """One look at receivers.

    Attributes:
        wanted: what they ask for, most profitable first.
        audience, analysis: who was looked at, and what was found.
        asking: who of them asks.
    """

    wanted: Requests
    audience: Audience
    analysis: Analysis
    asking: Asking


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
        self.planted = False
        self.attention: Attention | None = None
        self.made = np.zeros(shape.pages, bool)
        log.frame += 1

    def plant(self) -> None:
        """Make the level-0 nodes: all that there is before the first look."""
        self.planted = True
        got = self.pool.admit(self.pool.roots(), self.log.frame, self.log.frame, False)
        self.log.made += got.pages.size
        self.made[got.pages] = True
        self.cast(got.pages)

    def renew(self, pages: np.ndarray) -> None:
        """Cast pages again that were used lately, and give up the other ones of `pages`, and those
        that the time limit leaves no time for: nothing stale answers."""
        pool = self.pool
        unused = pool.unused(self._oldest)
        kept = pages[~np.isin(pages, unused)]
        below_roots = pool.squares[1, kept] > 0
        kept = kept[np.lexsort((-pool.benefit[kept], below_roots))]
        most = max(self._affordable(kept.size), int((~below_roots).sum()))
        self.given_up, kept = kept[most:].size, kept[:most]
        self.log.dropped += pool.evict(pages[~np.isin(pages, kept)])
        self.log.recast += kept.size
        self.cast(kept)

    @property
    def _oldest(self) -> int:
        """Pages with an older stamp answered nobody in the last full turn of the looks."""
        return self.log.frame - self.settings.pixel_share

    def rest(self) -> None:
        """Refine a view at rest until nothing is left to gain or a limit ends it."""
        # What waited is found again.
        self.pool.gather(no_requests(), 0, 0)
        # Turns go on from update to update: where a limit ends each after its first look, all
        # pixels still are seen, and no page that serves one of them looks unused.
        turn, audience = self.log.frame, None
        for stage in self._stages():
            if stage.thorough:
                audience = None
                self._refine_for_all(stage)
            else:
                turn, audience = self._refine_in_turns(stage, turn, audience)
            if self.log.status.is_limit:
                break
        self._finish()

    def _refine_in_turns(
        self, stage: Stage, turn: int, audience: Audience | None
    ) -> tuple[int, Audience | None]:
        """Passes that look at one turn's share of the pixels each, the first at `audience` if any.

        Returns the next turn and the last audience.
        """
        last = audience
        for _ in range(stage.passes):
            look = self._look(stage.wish, audience, turn)
            turn, audience, last = turn + 1, None, look.audience
            made = self._make_part(look.wanted, stage)
            if self.log.status.is_limit or made <= self.shape.pages // BUSY_SHARE:
                return turn, last
        self._note_passes(stage)
        return turn, last

    def _refine_for_all(self, stage: Stage) -> None:
        """Passes that look at every pixel once, then at those that asked for more, and in the end
        at those that are served by other pages than before: those may have shown them an edge."""
        attention, asked = self.attention, None
        for _ in range(stage.passes):
            if attention is None:
                look = self._look(stage.wish)
                self.attention = attention = Attention(look.audience, self.tree, look.analysis)
                who = np.arange(look.audience.count)
            else:
                if asked is None:
                    asked = attention.unsettled(self.shape, self.tree)
                audience, who = attention.some(asked)
                look = self._look(stage.wish, audience)
                attention.note(who, look.analysis)
            made = self._make_part(look.wanted, stage)
            if self.log.status.is_limit:
                return
            asked = who[look.asking.who] if made else attention.unsettled(self.shape, self.tree)
            if not asked.size:
                return
        self._note_passes(stage)

    def _make_part(self, wanted: Requests, stage: Stage) -> int:
        """Make the first of the requests, as many as one pass may; how many were made."""
        part = int(stage.share * self.pool.free_pages)
        allowed = max(part, self.shape.pages // LEAST_SHARE, 1)
        return self._make(wanted.take(slice(allowed)), replace=stage.wish is Wish.EDGES)

    def _note_passes(self, stage: Stage) -> None:
        if stage.wish in (Wish.EDGES, Wish.FINER_EDGES):
            self.log.status = Status.PASS_LIMIT

    def follow(self) -> None:
        """Refine for a moving view: one turn's share of its pixels, matched and no finer.

        As long as much memory is free, pixels without an edge are matched too.
        """
        wish = Wish.FOLLOW if self.settings.cover else Wish.EDGES
        much = self.pool.free_pages > self.shape.pages // LEAST_SHARE
        if self.settings.cover and much:
            wish = Wish.COVERAGE
        least = self.shape.pages // WORTH_SHARE
        for turn in range(FOLLOW_PASSES):
            look = self._look(wish, turn=self.log.frame + turn)
            wanted = self.pool.gather(look.wanted, least, LONGEST_WAIT)
            if wanted.count == 0:
                break
            wanted = most_profitable_first(wanted, self.cost_model, self.settings.least_profit)
            if wish is Wish.COVERAGE:
                wanted = wanted.take(slice(self.pool.free_pages))
            made = self._make(wanted, replace=wish is not Wish.COVERAGE)
            if made <= self.shape.pages // BUSY_SHARE or self.log.status.is_limit:
                break
        if not self.log.status.is_limit:
            self.log.status = Status.FOLLOWED
        self._finish()

    def _stages(self) -> Iterator[Stage]:
        """What to look for, in order.

        Finer edges are found pass by pass, so each takes half of what is left: the last pages go
        where the last look says they help most. Pixels without an edge come last, in updates: there
        memory helps least, but the next frames of a moving view find edges there.
        """
        most, cover = self.settings.max_passes, self.settings.cover
        modern = self.settings.finest_ratio < self.settings.ratio_target
        little = self.shape.pages // LEAST_SHARE
        if not cover and not modern:
            yield Stage(Wish.EDGES, 1.0, most)
            yield Stage(Wish.EDGES, 1.0, most, thorough=True)
            return
        if cover:
            yield Stage(Wish.COARSE_COVERAGE, 0.25, 1)
        if not cover or self.pool.free_pages < little:
            # Matched edges may take the place of what serves fewer pixels; finer ones may not.
            yield Stage(Wish.EDGES, 0.5, most)
        last = Wish.FINER_EDGES if modern else Wish.EDGES
        yield Stage(last, 0.5, most, thorough=True)
        if cover and not self.planted and self.pool.free_pages > little:
            yield Stage(Wish.COVERAGE, 1.0, 1)
            if self.pool.free_pages > 0:
                yield Stage(last, 1.0, most, thorough=True)
            else:
                self.log.status = Status.MEMORY_LIMIT

    def _look(self, wish: Wish, audience: Audience | None = None, turn: int | None = None) -> Look:
        """Look at `audience`, or else at one turn's share of the view, or at all of it."""
        began = time.perf_counter()
        settings, goals = self.settings, self.settings.goals
        again = audience is not None
        if audience is None:
            share, turn = (1, 0) if turn is None else (settings.pixel_share, turn)
            audience, analysis = first_look(
                self.tree, self.view, self.frame, goals, shape=self.shape,
                measure=settings.measure, share=share, turn=turn,
            )  # fmt: skip
        else:
            perspective = self.frame.perspective
            analysis = analyse(
                self.tree, audience, *goals, shape=self.shape, perspective=perspective
            )
        self.log.status = Status.COMPLETE
        if not again:
            facing = np.asarray(audience.receivers.facing)
            pages = page_of(np.asarray(analysis.entry)[facing])
            self.pool.use(pages, self.log.frame, audience.weight)
        asking = asking_of(analysis, audience, wish)
        wanted = requests_of(self.shape, audience, asking)
        wanted = most_profitable_first(wanted, self.cost_model, settings.least_profit)
        self.last_look = time.perf_counter() - began
        return Look(wanted, audience, analysis, asking)

    def _make(self, requests: Requests, replace: bool) -> int:
        """Cast and store the nodes that fit into time and memory; returns how many were made."""
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
        room = with_room(self.shape, self.tree, int(pages.max()) + 1)
        self.tree = stores_compiled(self.shape, room)
        self.tree = store(self.shape, self.tree, pages, depth, prim)
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
        # All that is not casting and storing, whatever it was.
        wall = time.perf_counter() - self.start
        self.log.analysis = wall - self.log.build
