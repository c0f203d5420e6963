"""A view with its truth, on which shadow algorithms are tried in turns with the yardstick."""

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays, seen_points
from asmjax.buffers.points import SeenPoints
from asmjax.experiment.aliasing import aliasing_maps
from asmjax.experiment.clock import in_turns
from asmjax.experiment.displacement import displacement
from asmjax.experiment.ledger import Ledger
from asmjax.experiment.methods import TracedShadows, pixel_mean, settings_of
from asmjax.experiment.timing import timed
from asmjax.experiment.trial import STAGES, Trial, trial_of
from asmjax.geometry import LightFrame
from asmjax.metrics import SurfacePairs, boundary_edges, boundary_length, error_summary
from asmjax.metrics import surface_pairs as pairs_of
from asmjax.shadow import ALGORITHMS, ShadowAlgorithm

RAYS = "rays"
"""Family of the yardstick: shadow rays from the eye's points."""


@dataclass(frozen=True, eq=False)
class Bench:
    """A view with its truth.

    Attributes:
        view: its name.
        facts: plain values that a measurement depends on, besides algorithm and rounds: scene,
            view, light, size, samples, machine.
        eyes: the samples of each pixel, pixel centres first.
        frame, rays: of the light.
        traced: the shadow rays of each of `eyes`.
    """

    view: str
    facts: Mapping[str, Any]
    eyes: Sequence[EyeBuffer]
    frame: LightFrame
    rays: LightRays
    traced: Sequence[TracedShadows]

    @property
    def samples(self) -> int:
        """Of each pixel."""
        return len(self.eyes)

    @cached_property
    def truth(self) -> np.ndarray:
        """(n,) visibility of each pixel by shadow rays, the mean over its samples."""
        return pixel_mean([rays.trace() for rays in self.traced], self.eyes)

    @cached_property
    def edge_length(self) -> float:
        """Pixels of truth's shadow edges, which errors per edge length are measured by."""
        lit = self.truth.reshape(self.eyes[0].size)
        return boundary_length(boundary_edges(lit, self._pairs))

    @cached_property
    def _pairs(self) -> SurfacePairs:
        eye = self.eyes[0]
        depth = np.where(eye.valid, eye.depth, 1.0)
        return pairs_of(eye.valid.reshape(eye.size), depth.reshape(eye.size))

    @cached_property
    def _seen(self) -> list[SeenPoints]:
        return [seen_points(eye) for eye in self.eyes]

    def error(self, visibility: np.ndarray) -> dict:
        """The errors of an image (n,), as `asmjax.metrics.error_summary`."""
        eye = self.eyes[0]
        images = (image.reshape(eye.size) for image in (self.truth, visibility, eye.valid))
        return error_summary(*images, self._pairs)

    def shadow_rays(self, rounds: int, ledger: Ledger | None = None) -> Trial:
        """The yardstick itself, tried like an algorithm."""
        key = {**self.facts, "family": RAYS, "rounds": rounds}
        return self._known_or_tried(key, ledger, lambda: self._try_rays(rounds))

    def try_all(
        self,
        algorithms: Sequence[ShadowAlgorithm],
        rounds: int,
        ledger: Ledger | None = None,
        predicted: bool = False,
    ) -> list[Trial]:
        """Build each from nothing and query it, `rounds` times in turns after a warm-up.

        Args:
            ledger: what it knows is not measured again; what is measured is added at once.
            predicted: also predict the displacement of edges (M4).

        Raises:
            UseError: as `build` does.
        """
        keys = [self.key(algorithm, rounds, predicted) for algorithm in algorithms]
        known = [None if ledger is None else ledger.get(key) for key in keys]
        calls = {
            number: _Try(self, algorithm)
            for number, (algorithm, found) in enumerate(zip(algorithms, known, strict=True))
            if found is None
        }
        names = {str(number): call for number, call in calls.items()}
        turns = in_turns({RAYS: self._trace, **names}, rounds) if calls else {}
        result = []
        for number, found in enumerate(known):
            if found is None:
                call = calls[number]
                trial = call.trial(turns[str(number)], turns[RAYS], predicted)
                if ledger is not None:
                    ledger.add(keys[number], trial.record())
            else:
                trial = trial_of(found)
            result.append(trial)
        return result

    def key(self, algorithm: ShadowAlgorithm, rounds: int, predicted: bool) -> dict[str, Any]:
        """What a trial depends on, as plain values."""
        model = getattr(algorithm, "cost_model", None)
        return {
            **self.facts,
            "family": family_of(algorithm),
            "settings": settings_of(algorithm),
            "cost_model": None if model is None else asdict(model),
            "rounds": rounds,
            "predicted": predicted,
        }

    def _trace(self) -> float:
        return timed(lambda: [rays.trace() for rays in self.traced])[1]

    def _try_rays(self, rounds: int) -> Trial:
        runs = in_turns({RAYS: self._trace}, rounds)[RAYS]
        return Trial(
            name=f"{RAYS}-{self.samples}",
            family=RAYS,
            settings={"rays_per_pixel": self.samples},
            view=self.view,
            samples=self.samples,
            error=self.error(self.truth),
            predicted_px=None,
            seconds={stage: runs if stage == "query" else [0.0] * rounds for stage in STAGES},
            yardstick=runs,
            bytes=0,
            texels=0,
            rays=sum(rays.count for rays in self.traced),
            status="complete",
        )

    @staticmethod
    def _known_or_tried(
        key: dict[str, Any], ledger: Ledger | None, tried: Callable[[], Trial]
    ) -> Trial:
        found = None if ledger is None else ledger.get(key)
        if found is not None:
            return trial_of(found)
        trial = tried()
        if ledger is not None:
            ledger.add(key, trial.record())
        return trial


class _Try:
    """One algorithm on a bench: each call builds and queries it once.

    Its errors are the means over the runs that count: a build that a time limit ends differs from
    run to run, any other does not.
    """

    def __init__(self, bench: Bench, algorithm: ShadowAlgorithm):
        self.bench, self.algorithm = bench, algorithm
        self._image: np.ndarray | None = None
        self._error: dict = {}
        self.state: Any = None

    def __call__(self) -> tuple[dict[str, float], dict]:
        """Seconds by stage, and the errors."""
        bench, algorithm = self.bench, self.algorithm
        # The tree before is freed before the next takes as much again.
        self.state = None
        gc.collect()
        self.state = state = algorithm.build(bench.eyes[0], bench.frame, bench.rays)
        seen = bench._seen
        lit, query = timed(lambda: [algorithm.visibility(state, some.points) for some in seen])
        images = [some.image(part) for some, part in zip(seen, lit, strict=True)]
        image = pixel_mean(images, bench.eyes)
        if self._image is None or not np.array_equal(image, self._image):
            self._image, self._error = image, bench.error(image)
        seconds = {**algorithm.cost(state).seconds, "query": query}
        return {stage: seconds[stage] for stage in STAGES}, self._error

    def trial(self, runs: list, yardstick: list[float], predicted: bool) -> Trial:
        """What the runs came to."""
        bench, algorithm, state = self.bench, self.algorithm, self.state
        cost = algorithm.cost(state)
        return Trial(
            name=algorithm.name,
            family=family_of(algorithm),
            settings=settings_of(algorithm),
            view=bench.view,
            samples=bench.samples,
            error=_mean([error for _, error in runs]),
            predicted_px=self._predicted() if predicted else None,
            seconds={stage: [seconds[stage] for seconds, _ in runs] for stage in STAGES},
            yardstick=yardstick,
            bytes=cost.bytes,
            texels=cost.texels,
            rays=cost.rays,
            status=algorithm.status(state).name.lower(),
            nodes=None if cost.nodes is None else cost.nodes.held,
        )

    def _predicted(self) -> float:
        bench, eye = self.bench, self.bench.eyes[0]
        maps = aliasing_maps(self.algorithm, self.state, eye, bench.frame)
        # Truth is judged as it is drawn: of several samples a pixel counts as most of them.
        return displacement(bench.truth, bench.truth, eye, maps).predicted


def family_of(algorithm: ShadowAlgorithm) -> str:
    """Its name in the registry."""
    return next(name for name, kind in ALGORITHMS.items() if type(algorithm) is kind)


def _mean(errors: Sequence[dict]) -> dict:
    """The mean of equal dictionaries of numbers, one by one."""
    first = errors[0]
    if all(error is first for error in errors):
        return first
    return {
        name: _mean([error[name] for error in errors])
        if isinstance(value, dict)
        else sum(error[name] for error in errors) / len(errors)
        for name, value in first.items()
    }
