"""A walkthrough, frame by frame: the same methods as in a single run, each with what it kept."""

import gc
import statistics
from collections.abc import Iterable
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.experiment.clock import median_by_stage, repeated, timed
from asmjax.experiment.methods import (
    Measured,
    TracedShadows,
    measure_rays,
    queried,
    settings_of,
)
from asmjax.geometry import LightFrame
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import (
    AdaptiveShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
    resolution_for,
)


@dataclass(frozen=True, eq=False)
class FrameInput:
    """One frame as the methods meet it.

    Attributes:
        number: counts from 0.
        eyes: the samples of each pixel, pixel centres first.
        eye_seconds: wall time of casting them.
        fitted: the light frame that is best for this view, for maps drawn anew.
        kept: the light frame that changes as seldom as it can, for maps that are kept.
        refitted: whether `kept` had to be fitted anew since the frame before; a light that moves
            takes its frame along.
        rays: what casts the light's rays.
        shadow_rays: the prepared truth of each of `eyes`.
        moved: boxes of casters that moved since the frame before, see `ShadowAlgorithm.update`.
    """

    number: int
    view: ViewSpec
    light: LightSpec
    eyes: list[EyeBuffer]
    eye_seconds: float
    fitted: LightFrame
    kept: LightFrame
    refitted: bool
    rays: LightRays
    shadow_rays: list[TracedShadows]
    moved: Float64[np.ndarray, "boxes 3 2"] | None = None


@dataclass(frozen=True, eq=False)
class FrameResult:
    """What the methods did to one frame.

    Attributes:
        methods: the uniform map drawn anew, the one that is kept, the adaptive map, and the traced
            rays, which are the truth. `cost.seconds` has `id_pass` and `total` besides the stages
            of a single run. States are good until the next frame is measured.
    """

    input: FrameInput
    methods: list[Measured]

    @property
    def truth(self) -> Measured:
        return self.methods[-1]

    @property
    def adaptive(self) -> Measured:
        return self.methods[2]


class Walkthrough:
    """Measures frames in their order, each method going on from the frame before.

    Three maps of the same memory, and the rays: the uniform map drawn anew in every frame, the
    uniform map kept while light and casters rest, and the adaptive map.

    Args:
        adaptive: with its cost model calibrated.
        repeats: timed updates, each of a copy of the state, and queries of each method and frame.
        compile_all: compile beforehand whatever a later frame may call, not only what the first do.
    """

    def __init__(self, adaptive: AdaptiveShadowMap, repeats: int, compile_all: bool = False):
        self.adaptive = adaptive
        self._repeats, self._compile_all = repeats, compile_all
        self._runners: list[_Runner] = []
        self._compiled: set[tuple[int, ...]] = set()

    def warm_up(self, frames: Iterable[FrameInput]) -> None:
        """Compile what the first frames need: measure them, and forget that they were."""
        for frame in frames:
            self.measure(frame)
        self._runners = []

    def measure(self, frame: FrameInput) -> FrameResult:
        """Build or update every map for the next frame, and query them."""
        gc.collect()
        self._prepare(frame)
        _, id_pass = repeated(
            lambda: [jnp.array(eye.prim, copy=True) for eye in frame.eyes], self._repeats
        )
        methods = [runner.step(frame, id_pass, self._repeats) for runner in self._runners]
        rays = measure_rays(frame.shadow_rays, frame.eyes, self._repeats)
        seconds = rays.cost.seconds | {"id_pass": 0.0, "total": rays.cost.seconds["query"]}
        methods.append(replace(rays, cost=replace(rays.cost, seconds=seconds)))
        return FrameResult(frame, methods)

    def _prepare(self, frame: FrameInput) -> None:
        """Runners for this frame; new ones of the uniform map where the number of faces is new.

        A map per face: to keep to its memory, the uniform map must be coarser with more faces.
        """
        limit = self.adaptive.memory_bytes
        anew = UniformShadowMap(resolution_for(limit, frame.fitted.faces))
        kept = UniformShadowMap(resolution_for(limit, frame.kept.faces), keep=True)
        wanted = [(anew, False), (kept, True), (self.adaptive, True)]
        if not self._runners:
            self._runners = [_Runner(algorithm, keeps) for algorithm, keeps in wanted]
        shapes = (frame.fitted.faces, frame.kept.faces)
        for runner, (algorithm, _) in zip(self._runners, wanted, strict=True):
            if algorithm.name != runner.algorithm.name:
                runner.algorithm, runner.state = algorithm, None
            if shapes not in self._compiled:
                runner.compile(frame, self._compile_all)
        self._compiled.add(shapes)


class _Runner:
    """One map on its way from frame to frame."""

    def __init__(self, algorithm: ShadowAlgorithm, keeps: bool):
        self.algorithm, self.state = algorithm, None
        self._keeps = keeps

    def compile(self, frame: FrameInput, compile_all: bool) -> None:
        """Build and query once, and compile all that later frames may call; nothing is kept."""
        state = self.algorithm.build(frame.eyes[0], self._frame(frame), frame.rays)
        queried(self.algorithm, state, frame.eyes[:1], 1)
        if compile_all:
            self.algorithm.warm_up(state, frame.eyes[0], self._frame(frame))

    def step(self, frame: FrameInput, id_pass: float, repeats: int) -> Measured:
        algorithm = self.algorithm
        costs, walls = [], []
        for run in range(repeats + 1):
            own = None if self.state is None else algorithm.copied(self.state)
            state, wall = timed(lambda own=own: self._next(own, frame))
            if run:
                costs.append(algorithm.cost(state))
                walls.append(wall)
        wall = statistics.median(walls)
        self.state = state
        visibility, query = queried(algorithm, state, frame.eyes, repeats)
        cost = costs[-1]
        if getattr(algorithm, "compare", "depth") == "depth":
            id_pass = 0.0
        seconds = median_by_stage([cost.seconds for cost in costs]) | {
            "query": query, "id_pass": id_pass, "total": wall + query + id_pass,
        }  # fmt: skip
        return Measured(
            name=algorithm.name,
            settings=settings_of(algorithm),
            visibility=visibility,
            cost=replace(cost, seconds=seconds),
            status=algorithm.status(state),
            effective_resolution=algorithm.effective_resolution(state),
            state=state,
        )

    def _next(self, state, frame: FrameInput):
        eye, light = frame.eyes[0], self._frame(frame)
        if state is None:
            return self.algorithm.build(eye, light, frame.rays)
        return self.algorithm.update(state, eye, light, frame.rays, moved=frame.moved)

    def _frame(self, frame: FrameInput) -> LightFrame:
        return frame.kept if self._keeps else frame.fitted
