"""What every command that measures does first: its view, its samples, its map."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.errors import UseError, file_errors, require
from asmjax.experiment import Measured, measure_rays
from asmjax.experiment.bench import Bench
from asmjax.experiment.code import code_facts
from asmjax.experiment.soft_rays import SOFT_REPEATS, SOFT_STRATA, soft_truth
from asmjax.geometry import LightFrame
from asmjax.job_memory import Sight, held_besides
from asmjax.machine import keeps_freed_memory
from asmjax.memory import Forecast, Memory, Stage, check, limit_of
from asmjax.options import (
    AnalyzeOptions,
    CompareOptions,
    JobOptions,
    MapJobOptions,
    RunOptions,
    ViewJobOptions,
)
from asmjax.plain import NonFinite, plain
from asmjax.render.caster import MitsubaRays
from asmjax.render.content import content_of
from asmjax.render.load import Scene, load_scene
from asmjax.render.soft_truth import SoftShadowRays
from asmjax.scene.path import aimed_at
from asmjax.scene.spec import LightSpec, ViewSpec
from asmjax.shadow import (
    AdaptiveShadowMap,
    CostModel,
    ShadowAlgorithm,
    family_of,
    preset,
    read_settings,
)
from asmjax.shadow.adaptive import kept_or_measured, on_this_machine

AIM_SIDE = 32
"""Side in pixels of the image from which the distance of what a view sees is taken."""

GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of the R2 sequence (Roberts 2018): evenly spread points for any number of samples."""


Progress = Callable[[str], None]
"""Hears the name of each step as it begins."""


class StepBar:
    """A `Progress` that counts the steps that ended on a bar."""

    def __init__(self, bar: tqdm):
        self._bar, self._begun = bar, False

    def __call__(self, step: str) -> None:
        if self._begun:
            self._bar.update()
        self._begun = True
        self._bar.set_description(step)


@dataclass(frozen=True, eq=False)
class Subject:
    """What is measured: a scene, a view of it, a light, and the rays that find its shadows.

    Attributes:
        eyes: the samples of each pixel, pixel centres first.
        frame: of the light, for the receivers that the pixel centres see.
        rays: of the light.
        memory: what all of the job will take.
        lamp: what the rays of a lamp's light took of it.
    """

    scene: Scene
    view: ViewSpec
    light: LightSpec
    eyes: list[EyeBuffer]
    frame: LightFrame
    rays: MitsubaRays
    memory: Forecast
    lamp: Memory

    def truth(self, repeats: int) -> Measured:
        """The traced shadow rays of every sample."""
        traced = [self.scene.shadow_rays(eye, self.frame, self.rays) for eye in self.eyes]
        return measure_rays(traced, self.eyes, repeats)

    def checked(self, stages: Sequence[Stage]) -> Forecast:
        """What a job of these stages will take, where more is known of it than at first. Raises
        `UseError` as `asmjax.memory.check`."""
        return check(held_besides(self.lamp, stages), self.memory.limit)

    def soft_truth(self, seed: int) -> tuple[Measured, np.ndarray]:
        """Shadow rays of every sample to points all over a light with a size, as
        `asmjax.experiment.soft_rays.soft_truth`."""
        return soft_truth(_soft_rays(self.scene, self.frame, self.rays, seed), self.eyes)


def subject_of(
    options: RunOptions | AnalyzeOptions,
    stages: Callable[[Sight, int], Sequence[Stage]],
    progress: Progress,
) -> Subject:
    """What the options name, loaded and seen; two steps of progress.

    Args:
        stages: of the job, for what it looks at and a number of the light's faces.

    Raises:
        UseError: no such scene, view or light, nothing is seen or lit, or the stages take more
            memory than may be taken.
    """
    progress("scene")
    scene = chosen_scene(options)
    view = chosen_view(scene, options)
    light = scene.light(options.light)
    sight, limit = sight_of(scene, view, options.samples), limit_of(options.max_memory_mb)
    lamp = scene.light_rays_memory(options.light)
    check(held_besides(lamp, stages(sight, 1)), limit)
    progress("eye buffer")
    eyes = [scene.eye(view, offset) for offset in sample_offsets(options.samples, options.seed)]
    frame = scene.light_frame(eyes, options.light)
    # Only now it is known how many faces of the light see what the eye sees.
    memory = check(held_besides(lamp, stages(sight, frame.faces)), limit)
    return Subject(scene, view, light, eyes, frame, scene.light_rays(options.light), memory, lamp)


def _soft_rays(
    scene: Scene, frame: LightFrame, rays: MitsubaRays, seed: int
) -> Callable[[int, EyeBuffer], SoftShadowRays]:
    """What makes the soft truth of the k-th sample of the pixels, each with places of its own."""
    return lambda k, eye: scene.soft_rays(eye, frame, rays, SOFT_STRATA, SOFT_REPEATS, (seed, k))


def sight_of(scene: Scene, view: ViewSpec, samples: int) -> Sight:
    """A view with so many samples of each pixel, as estimates of memory take it."""
    return Sight(view.width, view.height, samples, scene.variant.startswith("scalar"))


def bench_of(
    scene: Scene, view: ViewSpec, options: JobOptions, samples: int, soft: bool = False
) -> Bench:
    """A view of a scene under the light of the options, with the shadow rays of all samples.

    Args:
        soft: whether truth is, of a light with a size; the yardstick is hard all the same.

    Raises:
        UseError: no such light, or nothing is seen or lit.
    """
    light = scene.light(options.light)
    eyes = [scene.eye(view, offset) for offset in sample_offsets(samples, options.seed)]
    frame = scene.light_frame(eyes, options.light)
    rays = scene.light_rays(options.light)
    return Bench(
        view=view.name,
        facts=_facts(scene, view, light, samples, options, soft),
        eyes=eyes,
        frame=frame,
        rays=rays,
        traced=[scene.shadow_rays(eye, frame, rays) for eye in eyes],
        soft_rays=_soft_rays(scene, frame, rays, options.seed) if soft else None,
    )


def _facts(
    scene: Scene, view: ViewSpec, light: LightSpec, samples: int, options: JobOptions, soft: bool
) -> dict[str, Any]:
    """What a measurement depends on besides the algorithm, as plain values."""
    geometry = scene.geometry
    where = on_this_machine(
        scene.name, geometry.triangles, geometry.bounds, light.kind, scene.variant
    )
    facts = {
        **asdict(where),
        "content": content_of(options.scene, options.trust_scene),
        "view": asdict(view),
        "light": asdict(light),
        "samples": samples,
        "seed": options.seed if samples > 1 or soft else 0,
        # Where truth is hard measurements keep the keys that they always had.
        **({"soft_truth": [SOFT_STRATA, SOFT_REPEATS]} if soft else {}),
        "keeps_freed_memory": keeps_freed_memory(),
        **code_facts(),
    }
    return plain(facts, NonFinite.NAMED)


def check_edges(bench: Bench, scene: Scene) -> None:
    """Raise `UseError` where a view sees no edge of a shadow."""
    require(
        bench.edge_length > 0,
        f"view '{bench.view}' of scene '{scene.name}' sees no edge of a shadow, so that errors per "
        "pixel of edge mean nothing there; choose other views (--view, --views) or another "
        "--light.",
    )


def check_writable(folder: Path) -> None:
    """Raise `UseError` if `folder` cannot be made or written to: before any work is done for it."""
    with file_errors(f"cannot write results to '{str(folder)[:80]}'", "choose another --out"):
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise UseError(
            f"cannot write results to '{folder}': '{existing}' is not a writable folder; choose "
            "another --out."
        )


def chosen_scene(options: ViewJobOptions) -> Scene:
    """The scene that the options name, within the memory that they allow. Raises `UseError` as
    `load_scene`."""
    limit = limit_of(options.max_memory_mb)
    return load_scene(options.scene, options.variant, trust=options.trust_scene, limit=limit)


def chosen_view(scene: Scene, options: ViewJobOptions) -> ViewSpec:
    """The view that the options name, or the first, at the size that they name.

    Raises:
        UseError: no such view, or both a view and a sensor are named.
    """
    require(
        options.view is None or options.sensor is None,
        "--view and --sensor both name what sees the scene; give one of them.",
    )
    return sized(scene.view(options.sensor if options.view is None else options.view), options)


def aimed(scene: Scene, view: ViewSpec) -> ViewSpec:
    """`view` with its target as far away as what it sees, by the median over its pixels."""
    eye = scene.eye(view.resized(AIM_SIDE, AIM_SIDE))
    return aimed_at(view, float(np.median(eye.depth[eye.valid])))


def sized(view: ViewSpec, options: ViewJobOptions) -> ViewSpec:
    """`view` at the size that the options name, if they do."""
    return view if options.size is None else view.resized(*options.size)


@dataclass(frozen=True, eq=False)
class ChosenMaps:
    """The shadow maps that the options ask for, not calibrated yet.

    Attributes:
        adaptive: of the settings file if it is of its family, else of the other options.
        other: of a settings file of another family; None without one.
        source: the settings file if it is the adaptive map's.
    """

    adaptive: AdaptiveShadowMap
    other: ShadowAlgorithm | None = None
    source: str | None = None

    def check(self, faces: int) -> None:
        """Raise `UseError` where a light of so many faces needs more than the adaptive map may
        use, in the words of who set that limit."""
        try:
            self.adaptive.tree_shape(faces)
        except UseError as problem:
            if self.source is None:
                raise
            # As the file names it, and without the marks of options of the command line.
            words = str(problem).replace("`memory_bytes`", "memory_mb").replace("`", "")
            raise UseError(f"settings file '{self.source}': {words}") from problem


def chosen_maps(options: MapJobOptions) -> ChosenMaps:
    """The maps of the options and their settings file.

    Raises:
        UseError: as `read_settings` and the settings do, or an option says what an adaptive
            settings file says too.
    """
    if options.settings is None:
        return ChosenMaps(adaptive_map(options))
    chosen = read_settings(options.settings)
    if not isinstance(chosen, AdaptiveShadowMap):
        return ChosenMaps(adaptive_map(options), other=chosen)
    for name in ("memory_mb", "time_limit_ms", "preset", "node_resolution", "cells"):
        require(
            getattr(options, name) is None,
            f"--{name.replace('_', '-')} and the settings file '{options.settings}' both say how "
            "the adaptive map is built; give it in the file, or leave out --settings.",
        )
    return ChosenMaps(chosen, source=options.settings)


def check_named(
    options: AnalyzeOptions | CompareOptions, chosen: ChosenMaps, families: Sequence[str]
) -> None:
    """Raise `UseError` if the settings file is of a family that `--methods` leaves out."""
    if options.settings is None:
        return
    family = family_of(chosen.other or chosen.adaptive)
    require(
        family in families,
        f"the settings file '{options.settings}' is of {family}, which --methods leaves out; name "
        "it there, or leave out --settings.",
    )


def adaptive_map(options: MapJobOptions) -> AdaptiveShadowMap:
    """The adaptive map of the options but for their settings file, not calibrated yet. Raises
    `UseError` as its settings do."""
    changes = {
        name: value
        for name in ("node_resolution", "cells")
        if (value := getattr(options, name)) is not None
    }
    return preset(
        options.preset or "default",
        memory_bytes=options.memory_bytes,
        time_limit=None if options.time_limit_ms is None else options.time_limit_ms / 1000,
        **changes,
    )


def calibrated(
    scene: Scene, light: LightSpec, rays: LightRays, frame: LightFrame, options: ViewJobOptions
) -> CostModel:
    """What casting texels costs in this scene on this machine: kept from an earlier run if that
    measured it, and if the options do not ask to measure again."""
    geometry = scene.geometry
    what = on_this_machine(
        scene.name, geometry.triangles, geometry.bounds, light.kind, scene.variant
    )
    return kept_or_measured(rays, frame, what, recalibrate=options.recalibrate)


def sample_offsets(samples: int, seed: int) -> list[tuple[float, float]]:
    """Offsets (right, down) from the pixel centre in pixels: the centre, then an R2 sequence."""
    start = np.random.default_rng(seed).random(2)
    index = np.arange(1, samples)[:, None]
    spread = (start + index * np.array(GOLDEN)) % 1.0 - 0.5
    return [(0.0, 0.0), *((float(x), float(y)) for x, y in spread)]
