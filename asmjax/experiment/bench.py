"""A view with its truth, on which shadow algorithms are tried in turns with the yardstick."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from asmjax.buffers import EyeBuffer, LightRays, seen_points
from asmjax.buffers.points import SeenPoints
from asmjax.experiment.aliasing import aliasing_maps
from asmjax.experiment.clock import in_turns, timed
from asmjax.experiment.displacement import displacement
from asmjax.experiment.ledger import Ledger, digest
from asmjax.experiment.methods import TracedShadows, pixel_mean, settings_of
from asmjax.experiment.soft_rays import SoftRays, soft_truth
from asmjax.experiment.trial import STAGES, Trial, trial_of
from asmjax.geometry import LightFrame
from asmjax.metrics import SurfacePairs, boundary_edges, boundary_length, error_summary
from asmjax.metrics import surface_pairs as pairs_of
from asmjax.shadow import Cost, ShadowAlgorithm, Status, family_of

RAYS = "rays"
"""Family of the yardstick: shadow rays from the eye's points."""

_REHEARSED: set[Hashable] = set()
"""Programs that were compiled in this process, with the sizes of images: JAX remembers them."""

_HOLDS = [field.name for field in fields(Trial)]
"""Part of every key: what was kept of other things is measured again."""


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
        soft_rays: of the k-th of `eyes`, where truth is soft; None where it is `traced`.
    """

    view: str
    facts: Mapping[str, Any]
    eyes: Sequence[EyeBuffer]
    frame: LightFrame
    rays: LightRays
    traced: Sequence[TracedShadows]
    soft_rays: Callable[[int, EyeBuffer], SoftRays] | None = None

    @property
    def samples(self) -> int:
        """Of each pixel."""
        return len(self.eyes)

    @cached_property
    def truth(self) -> np.ndarray:
        """(n,) visibility of each pixel by shadow rays, the mean over its samples."""
        if self.soft_rays is not None:
            return soft_truth(self.soft_rays, self.eyes)[0].visibility
        return self._hard

    @cached_property
    def _hard(self) -> np.ndarray:
        """(n,) of the yardstick, one ray a sample: truth of hard shadows."""
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
        truth, image = self.truth.reshape(eye.size), visibility.reshape(eye.size)
        valid = eye.valid.reshape(eye.size)
        return error_summary(truth, image, valid, self._pairs, self.edge_length)

    def shadow_rays(self, rounds: int, ledger: Ledger | None = None) -> Trial:
        """The yardstick itself, tried like an algorithm."""
        key = {**self.facts, "family": RAYS, "rounds": rounds, "holds": _HOLDS}
        return self._known_or_tried(key, ledger, lambda: self._try_rays(rounds))

    def try_all(
        self,
        algorithms: Sequence[ShadowAlgorithm],
        rounds: int,
        ledger: Ledger | None = None,
        predicted: bool = False,
        warm_ups: int = 1,
        together: bool = False,
        images: dict[int, np.ndarray] | None = None,
    ) -> list[Trial]:
        """Build each from nothing and query it, `rounds` times in turns after `warm_ups` turns.

        Whatever would compile in the first of them is compiled before, with no limit of time.

        Args:
            ledger: what it knows is not measured again; the rest is added after the last turn, so
                an interruption costs what was asked for together.
            predicted: also predict the displacement of edges (M4), outside of what is timed.
            together: what the ledger knows counts only if all of it was measured in turns with the
                same others: times that are compared with one another must be of one while.
            images: gets the visibility (n,) of the last run of each that is measured, by place.

        Raises:
            UseError: as `build` does.
        """
        keys = [self.key(algorithm, rounds, predicted, warm_ups) for algorithm in algorithms]
        if together:
            company = [digest(key) for key in keys]
            keys = [{**key, "in_turns_with": company} for key in keys]
        known = [None if ledger is None else ledger.get(key) for key in keys]
        if together and None in known:
            known = [None] * len(known)
        calls = {
            str(number): _Try(self, algorithm, predicted)
            for number, (algorithm, found) in enumerate(zip(algorithms, known, strict=True))
            if found is None
        }
        turns = in_turns({RAYS: self._trace, **calls}, rounds, warm_ups) if calls else {}
        result = []
        for number, (algorithm, found) in enumerate(zip(algorithms, known, strict=True)):
            if found is None:
                trial = self._trial(algorithm, turns[str(number)], turns[RAYS])
                if images is not None:
                    images[number] = calls[str(number)].image
                if ledger is not None:
                    ledger.add(keys[number], trial.record())
            else:
                trial = trial_of(found)
            result.append(trial)
        return result

    def key(
        self, algorithm: ShadowAlgorithm, rounds: int, predicted: bool, warm_ups: int = 1
    ) -> dict[str, Any]:
        """What a trial depends on, as plain values."""
        model = getattr(algorithm, "cost_model", None)
        return {
            **self.facts,
            "family": family_of(algorithm),
            "settings": settings_of(algorithm),
            # What it decides by: not when it was measured, nor whether it was kept since.
            "cost_model": None if model is None else [model.a_seconds_per_texel, model.b_seconds],
            "rounds": rounds,
            "warm_ups": warm_ups,
            "predicted": predicted,
            "holds": _HOLDS,
        }

    def _trace(self) -> "_Run":
        seconds = timed(lambda: [rays.trace() for rays in self.traced])[1]
        return _Run({"query": seconds})

    def _trial(
        self, algorithm: ShadowAlgorithm, runs: Sequence["_Run"], yardstick: Sequence["_Run"]
    ) -> Trial:
        """What the runs came to: mean errors, and the memory of the last one."""
        predictions = [run.predicted for run in runs if run.predicted is not None]
        cost, status = runs[-1].cost, runs[-1].status
        return Trial(
            name=algorithm.name,
            family=family_of(algorithm),
            settings=settings_of(algorithm),
            view=self.view,
            samples=self.samples,
            error=_mean([run.error for run in runs]),
            predicted_px=sum(predictions) / len(predictions) if predictions else None,
            seconds={stage: [run.seconds[stage] for run in runs] for stage in STAGES},
            yardstick=[run.seconds["query"] for run in yardstick],
            bytes=cost.bytes,
            texels=cost.texels,
            rays=cost.rays,
            status=status.name.lower(),
            nodes=None if cost.nodes is None else cost.nodes.held,
        )

    def _try_rays(self, rounds: int) -> Trial:
        turns = in_turns({RAYS: self._trace}, rounds)
        runs = [run.seconds["query"] for run in turns[RAYS]]
        return Trial(
            name=f"{RAYS}-{self.samples}",
            family=RAYS,
            settings={"rays_per_pixel": self.samples},
            view=self.view,
            samples=self.samples,
            error=self.error(self._hard),
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


class _Run(NamedTuple):
    """One build and query: seconds by stage, and what came of it."""

    seconds: dict[str, float]
    error: dict = {}
    predicted: float | None = None
    cost: Cost = Cost(0, 0, 0, 0)
    status: Status = Status.COMPLETE


class _Try:
    """One algorithm on a bench: each call builds and queries it once. It keeps no state, which is
    freed at once, as nothing in one refers back to it: of any number of maps one is in memory.

    A build that a time limit ends differs from run to run, and each is judged on its own; any
    other does not, and is judged once.
    """

    def __init__(self, bench: Bench, algorithm: ShadowAlgorithm, predicted: bool):
        self.bench, self.algorithm, self.predicted = bench, algorithm, predicted
        self._image: np.ndarray | None = None
        self._judged: tuple[dict, float | None] = {}, None

    def __call__(self) -> _Run:
        bench, algorithm = self.bench, self.algorithm
        self._rehearse()
        state = algorithm.build(bench.eyes[0], bench.frame, bench.rays)
        seen = bench._seen
        lit, query = timed(lambda: [algorithm.visibility(state, some.points) for some in seen])
        images = [some.image(part) for some, part in zip(seen, lit, strict=True)]
        image = pixel_mean(images, bench.eyes)
        if self._image is None or not np.array_equal(image, self._image):
            predicted = self._prediction(state) if self.predicted else None
            self._image, self._judged = image, (bench.error(image), predicted)
        cost = algorithm.cost(state)
        seconds = {**cost.seconds, "query": query}
        return _Run(seconds, *self._judged, cost, algorithm.status(state))

    @property
    def image(self) -> np.ndarray:
        """(n,) visibility of the last run."""
        assert self._image is not None  # there was one
        return self._image

    def _rehearse(self) -> None:
        """Compile what settings of this program may call. Under a limit of time a build that
        compiles gets nowhere, and the next one would compile again."""
        bench, algorithm = self.bench, self.algorithm
        sizes = tuple(some.points.count for some in bench._seen)
        program = algorithm.program(bench.frame), _form(bench.frame), bench.eyes[0].size, sizes
        if program in _REHEARSED:
            return
        state = algorithm.rehearse(bench.eyes[0], bench.frame, bench.rays)
        for some in bench._seen:
            jax.block_until_ready(algorithm.visibility(state, some.points))
        _REHEARSED.add(program)

    def _prediction(self, state) -> float:
        bench, eye = self.bench, self.bench.eyes[0]
        maps = aliasing_maps(self.algorithm, state, eye, bench.frame)
        # Truth is judged as it is drawn: of several samples a pixel counts as most of them.
        return displacement(bench.truth, bench.truth, eye, maps).predicted


def _form(tree: object) -> Hashable:
    """Equal for trees that share compiled code: shapes of arrays, all other values themselves."""
    leaves, structure = jax.tree.flatten(tree)
    kinds = ((leaf.shape, leaf.dtype) if eqx.is_array(leaf) else leaf for leaf in leaves)
    return structure, tuple(kinds)


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
