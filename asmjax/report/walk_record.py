"""From measured frames to the report of a walkthrough."""

import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import jax

from asmjax.experiment.walkthrough import FrameResult
from asmjax.memory import Forecast
from asmjax.report.measured import (
    cost_model_record,
    light_text,
    method_records,
    truth_record,
)
from asmjax.report.provenance import provenance
from asmjax.report.record import report_of_entries
from asmjax.report.schema import WALKTHROUGH_SCHEMA
from asmjax.report.walk_table import NODE_COUNTS
from asmjax.shadow import AdaptiveShadowMap, CostModel, Status

COMPLETE = "complete"
"""How a walkthrough ended that came to its last frame."""


@dataclass(frozen=True)
class WalkSetting:
    """What is the same in all frames of a walkthrough.

    Attributes:
        scene, variant, notices: as of `RunResult`.
        view: what the camera follows, in words.
        motion: what moves.
        frames: how many frames were asked for.
        adaptive: the adaptive map, calibrated with `cost_model`.
        memory: what it was estimated to take; None where nobody asked.
        not_simulated: effects that the scene calls for and that no method has, with reasons.
    """

    scene: str
    variant: str
    notices: tuple[str, ...]
    view: str
    motion: str
    frames: int
    adaptive: AdaptiveShadowMap
    cost_model: CostModel
    seed: int
    memory: Forecast | None = None
    not_simulated: Mapping[str, str] = field(default_factory=dict)


class WalkRecord:
    """The numbers of the frames so far; none of their images.

    Attributes:
        frames: the `frames` of the report.
    """

    def __init__(self, setting: WalkSetting):
        self.setting = setting
        self.frames: list[dict] = []
        self._limits: dict[tuple[str, Status], int] = {}
        self._light, self._size = "", (1, 1)

    def add(self, result: FrameResult) -> dict:
        """Take up the next frame, and return its entry."""
        frame = result.input
        eye = frame.eyes[0]
        methods = method_records(eye, result.truth, result.methods, self.setting.adaptive)
        for entry, method in zip(methods, result.methods, strict=True):
            counts = method.cost.nodes
            if counts is not None:
                entry |= {f"nodes_{name}": getattr(counts, name) for name in NODE_COUNTS}
            if method.status.is_limit:
                key = method.name, method.status
                self._limits[key] = self._limits.get(key, 0) + 1
        self.frames.append(
            {
                "frame": frame.number,
                "eye": {
                    "origin": frame.view.origin,
                    "target": frame.view.target,
                    "up": frame.view.up,
                    "fov_x_deg": frame.view.fov_x_deg,
                    "seconds": frame.eye_seconds,
                },
                "light_position": frame.light.position,
                "light_direction": frame.light.direction,
                "light_frame_refitted": frame.refitted,
                "moved_boxes": 0 if frame.moved is None else len(frame.moved),
                "truth": truth_record(frame.eyes, result.truth),
                "methods": methods,
            }
        )
        self._light = light_text(frame.light, frame.kept)
        self._size = (eye.camera.width, eye.camera.height)
        return self.frames[-1]

    def report(self, ended: str = COMPLETE) -> dict:
        """The validated report of the frames so far, of which there must be one at least."""
        setting = self.setting
        notices = [
            f"{name}: {status.value} (in {count} of {len(self.frames)} frames)"
            for (name, status), count in self._limits.items()
        ]
        return report_of_entries(
            schema=WALKTHROUGH_SCHEMA,
            argv=["asmjax", *sys.argv[1:]],
            provenance=provenance(setting.variant, jax.devices()[0].device_kind),
            seed=setting.seed,
            memory=setting.memory,
            scene=setting.scene,
            view=setting.view,
            light=self._light,
            size=self._size,
            motion=setting.motion,
            frames_asked=setting.frames,
            ended=ended,
            memory_limit_bytes=setting.adaptive.memory_bytes,
            cost_model=cost_model_record(setting.cost_model),
            summary=summary_of(self.frames),
            frames=self.frames,
            notices=[
                *setting.notices,
                *(f"not simulated: {name}: {why}" for name, why in setting.not_simulated.items()),
                *notices,
            ],
        )


def summary_of(frames: Sequence[Mapping]) -> dict:
    """Medians over all frames but the first, which builds from nothing; over it if it is alone.

    Methods are told apart by their place: a uniform map's resolution, and so its name, changes
    with the number of the light's faces. Ratios are formed in each frame before their median.
    """
    warm = frames[1:] or frames
    lists = [[frame["methods"][i] for frame in warm] for i in range(len(warm[0]["methods"]))]
    adaptive = next(list_ for list_ in lists if list_[0]["name"].startswith("adaptive"))
    return {
        "first_frame": warm[0]["frame"],
        "frames": len(warm),
        "methods": [_medians(of_method, adaptive) for of_method in lists],
    }


def _medians(frames: list[Mapping], adaptive: list[Mapping]) -> dict:
    first = frames[0]

    def median(value: Callable[[Mapping], float]) -> float:
        return statistics.median(value(method) for method in frames)

    def ratio(value: Callable[[Mapping], float]) -> float | None:
        """Of the adaptive map to this method; frames in which that is 0 / 0 or infinite are out."""
        of_frames = [
            value(asm) / value(method)
            for asm, method in zip(adaptive, frames, strict=True)
            if value(method) > 0
        ]
        return statistics.median(of_frames) if of_frames and frames is not adaptive else None

    sides = [method["effective_resolution"] for method in frames]
    counts = ["nodes", *(f"nodes_{name}" for name in NODE_COUNTS)]
    return {
        "name": first["name"],
        "seconds": {
            stage: median(lambda method, stage=stage: method["seconds"][stage])
            for stage in first["seconds"]
        },
        "slowest_seconds": max(method["seconds"]["total"] for method in frames),
        "effective_resolution": None if None in sides else max(sides),
        "bytes": max(method["bytes"] for method in frames),
        "rays": median(lambda method: method["rays"]),
        "misclassified_fraction": median(lambda m: m["error"]["misclassified_fraction"]),
        "boundary_displacement_px": median(
            lambda m: m["error"]["boundary_displacement_px"]["mean"]
        ),
        **{
            name: median(lambda method, name=name: method[name])
            for name in counts
            if all(name in method for method in frames)
        },
        "time_ratio": ratio(lambda method: method["seconds"]["total"]),
        "error_ratio": ratio(lambda method: method["error"]["misclassified_fraction"]),
    }
