"""`asmjax run --frames N`: a walk through a scene, every frame measured, maps kept between them."""

import contextlib
import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from tqdm import tqdm

from asmjax.delivery import deliver
from asmjax.effects.plan import with_error
from asmjax.errors import UseError, require
from asmjax.experiment import timed
from asmjax.experiment.walkthrough import FrameInput, FrameResult, Walkthrough
from asmjax.folders import results_folder
from asmjax.job_memory import Sight, held_besides, walk_stages
from asmjax.memory import Forecast, Stage, check, limit_of
from asmjax.options import RunOptions, given_options
from asmjax.planning import plan_effects
from asmjax.preparation import (
    aimed,
    calibrated,
    chosen_maps,
    chosen_scene,
    chosen_view,
    sample_offsets,
    sight_of,
    sized,
)
from asmjax.render.load import Scene
from asmjax.render.moving import MovingShapes
from asmjax.report.walk_files import WalkFiles
from asmjax.report.walk_record import COMPLETE, WalkRecord, WalkSetting
from asmjax.report.walk_table import walkthrough_table
from asmjax.scene.motion import OBJECT_RADIUS, circle, moved_light
from asmjax.scene.path import CameraPath, orbit_keys
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap, resolution_for

_log = logging.getLogger("asmjax")

LONG_WALK = 12
"""Walks of so many frames compile beforehand whatever a later frame may call."""

WARM_FRAMES = 2
"""Frames that are measured and forgotten before frame 0 counts, so that all code is compiled."""


def run_walkthrough(options: RunOptions) -> dict:
    """Measure the frames, write the results below `options.out`, print a table, return the report.

    Whatever ends it early, the finished frames are written first.

    Raises:
        UseError: wrong options or a scene that cannot be used.
        KeyboardInterrupt: with a message that says where the finished frames are.
    """
    outputs = results_folder(options)
    problem: BaseException | None = None
    bar = tqdm(total=options.frames, disable=options.quiet or None, leave=False, unit="frame")
    with bar:
        bar.set_description("scene")
        walk = Walk(options, bar.set_description)
        outputs.make()
        files = WalkFiles(walk.setting, outputs, save_arrays=options.save_arrays)
        try:
            for result in walk.frames():
                files.add(result)
                bar.update()
        except BaseException as raised:
            problem = raised
        done = len(files.record.frames)
        if done == 0:
            assert problem is not None
            with contextlib.suppress(OSError):
                outputs.path.rmdir()
            raise problem
        bar.set_description("figures")
        report = files.record.report(COMPLETE if problem is None else _reason(problem))
        for notice in report["notices"][len(walk.setting.notices) :]:
            _log.warning("%s", notice)
        table = walkthrough_table(report["summary"])
        deliver(table, partial(files.finish, report), outputs, bar, quiet=options.quiet)
    if problem is None:
        return outputs.report
    finished = f"the {done} finished of {walk.setting.frames} frames are in {outputs}/"
    if isinstance(problem, KeyboardInterrupt):
        raise KeyboardInterrupt(finished) from problem
    if isinstance(problem, UseError):
        raise UseError(f"frame {done}: {problem} ({finished})") from problem
    raise problem


def measure_walkthrough(options: RunOptions | str = "paper_room", **changes: Any) -> dict:
    """The report of `run_walkthrough` with the options, or `measure_walkthrough("terrain",
    frames=8)`; writes nothing. Raises as the first problem does."""
    walk = Walk(given_options(RunOptions, options, changes))
    record = WalkRecord(walk.setting)
    for result in walk.frames():
        record.add(result)
    return record.report()


class Walk:
    """A scene, ready to be walked through: frames are measured as they are asked for.

    `for result in Walk(RunOptions(scene="paper_room", frames=8)).frames(): ...` gives a
    `FrameResult` each, whose maps are good until the next.

    Attributes:
        setting: what is the same in all frames.

    Raises:
        UseError: wrong options or a scene that cannot be used.
    """

    def __init__(self, options: RunOptions, progress: Callable[[str], None] = lambda _: None):
        if options.frames is None:
            raise UseError("a walkthrough needs a number of frames; give --frames.")
        chosen = chosen_maps(options)
        require(
            chosen.other is None,
            f"a walkthrough sets the adaptive map beside a uniform map of its memory, but "
            f"'{options.settings}' is of another algorithm; name a file of an adaptive map, or "
            "leave out --frames.",
        )
        self._options, self._progress = options, progress
        self._scene = scene = chosen_scene(options)
        self._light = scene.light(options.light)
        self._path, name = camera_path(scene, options)
        self._mover = MovingShapes(scene, options.object) if options.motion == "object" else None
        self._offsets = sample_offsets(options.samples, options.seed)
        sight = sight_of(scene, self._path.view(0), options.samples)
        limit = limit_of(options.max_memory_mb)
        lamp = scene.light_rays_memory(options.light)

        def checked(faces: int) -> Forecast:
            return check(held_besides(lamp, _stages(sight, chosen.adaptive, faces)), limit)

        checked(1)
        progress("cost model")
        first = next(self._inputs(1))
        chosen.check(first.kept.faces)
        memory = checked(first.kept.faces)
        missing = _not_simulated(scene, self._path.view(0), self._light.name, options)
        cost_model = calibrated(scene, self._light, first.rays, first.kept, options)
        adaptive = replace(chosen.adaptive, cost_model=cost_model)
        long = options.frames >= LONG_WALK
        self._walkthrough = Walkthrough(adaptive, options.repeats, compile_all=long)
        self.setting = WalkSetting(
            scene=scene.name,
            variant=scene.variant,
            notices=scene.notices,
            view=name,
            motion=options.motion if self._mover is None else f"object ({self._mover.name})",
            frames=options.frames,
            adaptive=adaptive,
            cost_model=cost_model,
            seed=options.seed,
            memory=memory,
            not_simulated=missing,
        )

    def frames(self) -> Iterator[FrameResult]:
        """Warm up, then measure one frame after the other."""
        self._progress("warm-up")
        self._walkthrough.warm_up(self._inputs(min(WARM_FRAMES, self.setting.frames)))
        self._progress("frames")
        for frame in self._inputs(self.setting.frames):
            yield self._walkthrough.measure(frame)

    def _inputs(self, count: int) -> Iterator[FrameInput]:
        """The frames as they are to be measured, from the resting scene on."""
        scene, light, motion = self._scene, self._options.light, self._options.motion
        low, high = scene.geometry.bounds.T
        diagonal = float(np.linalg.norm(high - low))
        rays, kept = None, None
        for k in range(count):
            view = self._path.view(k if motion == "camera" else 0)
            moved = None
            if motion == "light":
                scene = scene.with_light(moved_light(self._light, k, diagonal, view.up), light)
            elif self._mover is not None:
                way = circle(k, OBJECT_RADIUS * self._mover.diagonal, view.up)
                scene, moved = self._mover.at(way)
            if rays is None or moved is not None:
                rays = scene.light_rays(light)
            eyes, seconds = timed(lambda scene=scene, view=view: self._eyes(scene, view))
            before, kept = kept, scene.kept_light_frame(kept, eyes, light)
            fitted = scene.light_frame(eyes, light)
            yield FrameInput(
                number=k,
                view=view,
                light=scene.light(light),
                eyes=eyes,
                eye_seconds=seconds,
                fitted=fitted,
                kept=kept,
                refitted=before is not None and not np.array_equal(before.corner, kept.corner),
                rays=rays,
                shadow_rays=[scene.shadow_rays(eye, fitted, rays) for eye in eyes],
                # Frame 0 builds from nothing, wherever the object was before.
                moved=moved if k > 0 else None,
            )

    def _eyes(self, scene: Scene, view: ViewSpec) -> list:
        return [scene.eye(view, offset) for offset in self._offsets]


def _not_simulated(scene: Scene, view: ViewSpec, light: str, options: RunOptions) -> dict[str, str]:
    """What the maps of a walkthrough, which are hard, leave out of the light's shadow, and why, by
    its effect: planned once, for the first view."""
    plan = plan_effects(
        scene, view, options.tolerance, lights=[light],
        moving=options.motion != "still", seed=options.seed,
    )  # fmt: skip
    missing = {item.effect: with_error(item) for item in plan.not_simulated}
    decision = plan.decision(light)
    if decision.kind == "soft" and decision.simulated:
        missing["penumbra"] = f"walkthroughs have hard shadows only; {decision.reason}"
    return missing


def _stages(sight: Sight, adaptive: AdaptiveShadowMap, faces: int) -> list[Stage]:
    """Of a walkthrough with its three maps."""
    uniform = UniformShadowMap(resolution_for(adaptive.memory_bytes, faces))
    return walk_stages(sight, [uniform, uniform, adaptive], faces)


def camera_path(scene: Scene, options: RunOptions) -> tuple[CameraPath, str]:
    """The way of the camera, and what it is in words.

    Through `--keys`; else the scene's own path, unless a view is named; else an arc about what the
    view sees. Where the camera rests, the path begins at the view.

    Raises:
        UseError: no such view, or none that sees a surface.
    """
    if options.keys:
        keys = [aimed(scene, sized(scene.view(name), options)) for name in options.keys]
        return CameraPath(keys), f"path {' - '.join(key.name for key in keys)}"
    view = chosen_view(scene, options)
    if options.motion != "camera":
        return CameraPath([view]), view.name
    if scene.path and options.view is None and options.sensor is None:
        return CameraPath([sized(key, options) for key in scene.path]), "path of the scene"
    return CameraPath(orbit_keys(aimed(scene, view))), f"arc from {view.name}"


def _reason(problem: BaseException) -> str:
    if isinstance(problem, KeyboardInterrupt):
        return "interrupted"
    return f"{type(problem).__name__}: {problem}"
