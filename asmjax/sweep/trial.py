"""One trial of a sweep: an algorithm with its settings on a view, measured, as plain values."""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import jax
import numpy as np

from asmjax.experiment.code import code_facts
from asmjax.experiment.traces import counted_traces
from asmjax.experiment.trial import Trial
from asmjax.memory import limit_of
from asmjax.plain import NonFinite, plain
from asmjax.shadow import (
    AdaptiveShadowMap,
    CostModel,
    FilteredShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
    resolution_for,
)
from asmjax.sweep.ready import Ready, ReadyViews
from asmjax.sweep.resolve import algorithm_in, settings_table
from asmjax.sweep.share import Share

_READY = ReadyViews()

_ONE_AT_A_TIME = threading.Lock()
"""Trials beside each other in one process would time each other, and share what is ready."""


@dataclass(frozen=True)
class Outcome:
    """What came of a trial.

    Attributes:
        record: plain values, as docs/sweeps.md explains them.
        arrays: those that its configuration asks to keep, by name.
    """

    record: dict[str, Any]
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


def run_trial(config: Mapping[str, Any], share: Share | None = None) -> Outcome:
    """Measure a trial; `config` is that of `asmjax.sweep.config.Trial`.

    The process keeps scene, eye buffers and truth of the last trials, and all compiled code.

    Args:
        share: of memory, which the process may hold; None for what it holds and a part of what is
            free.

    Raises:
        MemoryShort: it would take more.
        UseError: the trial is not possible: no such view, nothing lit, or settings that do not suit
            this light.
    """
    with _ONE_AT_A_TIME, counted_traces() as traced:
        start = time.perf_counter()
        _READY.limit = limit_of if share is None else share.limit
        ready = _READY.of(config, partial(algorithm_for, config))
        bench = ready.bench
        algorithm = _with_costs(algorithm_for(config, bench.frame.faces), ready, config)
        edges = bench.edge_length
        prepared = time.perf_counter() - start
        images: dict[int, np.ndarray] = {}
        [trial] = bench.try_all(
            [algorithm],
            config["repeats"],
            predicted=config["predicted"],
            warm_ups=config["warm_ups"],
            images=images,
        )
        image = images[0].reshape(bench.eyes[0].size)
        record = _record(trial, algorithm, ready) | {
            "edge_length_px": edges,
            "prepared_seconds": prepared,
            "wall_seconds": time.perf_counter() - start,
            "functions_traced": len(traced),
        }
    arrays = {"visibility": image.astype(np.float32)} if "visibility" in config["keep"] else {}
    return Outcome(plain(record, NonFinite.NONE), arrays)


def algorithm_for(config: Mapping[str, Any], faces: int) -> ShadowAlgorithm:
    """The algorithm of a configuration for a light of so many faces, not calibrated yet.

    Raises:
        UseError: settings that it refuses, or memory for no texel.
    """
    algorithm = algorithm_in(config["algorithm"], config["settings"])
    if config["memory_mb"] is None or isinstance(algorithm, AdaptiveShadowMap):
        return algorithm
    resolution = resolution_for(int(config["memory_mb"] * 2**20), faces)
    if isinstance(algorithm, FilteredShadowMap):
        return replace(algorithm, inner=UniformShadowMap(resolution))
    # All that is left has a resolution: the protocol does not promise it.
    return replace(algorithm, resolution=resolution)  # type: ignore[call-arg]


def _with_costs(
    algorithm: ShadowAlgorithm, ready: Ready, config: Mapping[str, Any]
) -> ShadowAlgorithm:  # fmt: skip
    """The algorithm, which need not calibrate in its timed builds."""
    if isinstance(algorithm, AdaptiveShadowMap):
        return replace(algorithm, cost_model=ready.cost_model(config))
    if isinstance(algorithm, FilteredShadowMap):
        return replace(algorithm, inner=_with_costs(algorithm.inner, ready, config))
    return algorithm


def _costs_of(algorithm: ShadowAlgorithm) -> CostModel | None:
    """What an adaptive map, or one that is filtered, decides by."""
    inner = algorithm.inner if isinstance(algorithm, FilteredShadowMap) else algorithm
    return inner.cost_model if isinstance(inner, AdaptiveShadowMap) else None


def _record(trial: Trial, algorithm: ShadowAlgorithm, ready: Ready) -> dict[str, Any]:
    """What was measured and where, medians over the runs."""
    scene, bench = ready.scene, ready.bench
    eye, model = bench.eyes[0], _costs_of(algorithm)
    stages = {stage: float(np.median(runs)) for stage, runs in trial.seconds.items()}
    return {
        "scene": scene.name,
        "triangles": scene.geometry.triangles,
        "view": trial.view,
        "light": scene.light(ready.light).name,
        "faces": bench.frame.faces,
        "size": [eye.camera.width, eye.camera.height],
        "samples": trial.samples,
        "valid_pixels": int(eye.valid.sum()),
        "lit_fraction": float(bench.truth[eye.valid].mean()),
        "name": trial.name,
        "family": trial.family,
        "settings": settings_table(algorithm),
        "cost_model": None if model is None else [model.a_seconds_per_texel, model.b_seconds],
        "status": trial.status,
        "error": trial.error,
        "predicted_px": trial.predicted_px,
        "seconds": stages | {"total": trial.total.value},
        "runs_seconds": {**trial.seconds, "yardstick": trial.yardstick},
        "yardstick_seconds": float(np.median(trial.yardstick)),
        "yardstick_ratio": trial.ratio.value,
        "bytes": trial.bytes,
        "texels": trial.texels,
        "rays": trial.rays,
        "nodes": trial.nodes,
        "notices": list(scene.notices),
        "variant": scene.variant,
        "device": jax.devices()[0].device_kind,
        "code": code_facts()["code"],
    }
