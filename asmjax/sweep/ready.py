"""Scenes and views of the last trials, ready for the next one: a process loads each once.

Memory is bounded: what was used longest ago is let go first.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from asmjax.errors import require
from asmjax.experiment.bench import Bench
from asmjax.experiment.light_angles import parallel_light
from asmjax.experiment.soft_rays import calls_for_soft_truth
from asmjax.job_memory import RAY, Sight, held_besides, trial_stages
from asmjax.memory import Limit, Memory, check, limit_of
from asmjax.options import RunOptions
from asmjax.preparation import bench_of, calibrated, sight_of
from asmjax.render.load import TRIANGLE, Scene, load_scene
from asmjax.scene.builtin import is_builtin
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import CostModel, ShadowAlgorithm
from asmjax.sweep.identity import file_content

SCENE_BYTES, VIEW_BYTES = 2 * 2**30, 2**30
"""Of scenes and of views that stay, at most; the last one of each always does."""

SCENE_PART, VIEW_PART = 1 / 4, 1 / 8
"""Of what the process may hold, likewise."""

K = TypeVar("K", bound=Hashable)
T = TypeVar("T")


class Recent(Generic[K, T]):
    """The values that were used last."""

    def __init__(self):
        self._kept: OrderedDict[K, tuple[T, int]] = OrderedDict()

    @property
    def keys(self) -> list[K]:
        """Of what is there, the last one that was asked for at the end."""
        return list(self._kept)

    def get(self, key: K, make: Callable[[], tuple[T, int]], most: float) -> T:
        """The value of that key; `make` gives it and its bytes where it is not there.

        What is kept is of `most` bytes in all, or one that is larger.
        """
        if key not in self._kept:
            self._kept[key] = make()
        self._kept.move_to_end(key)
        while len(self._kept) > 1 and sum(size for _, size in self._kept.values()) > most:
            self._kept.popitem(last=False)
        return self._kept[key][0]

    def drop(self, key: K) -> None:
        """Let go what is there of that key."""
        self._kept.pop(key, None)


@dataclass(eq=False)
class Ready:
    """A view of a scene under a light.

    Attributes:
        scene: with the trial's light, which is called `light`; None is the first one.
        bench: the view with its truth, which is computed when it is first asked for.
        model: what casting texels costs there, once it was asked for.
    """

    scene: Scene
    bench: Bench
    light: str | None
    model: CostModel | None = None

    def cost_model(self, config: Mapping[str, Any]) -> CostModel:
        """What the configuration says, else what was calibrated on this machine."""
        if config["cost_model"] is not None:
            return CostModel(*config["cost_model"], residual=0.0)
        if self.model is None:
            light, options = self.scene.light(self.light), RunOptions(scene=config["scene"])
            bench = self.bench
            self.model = calibrated(self.scene, light, bench.rays, bench.frame, options)
        return self.model


class ReadyViews:
    """What a process has loaded and seen.

    Args:
        limit: of what the process may hold, told anew each time.
    """

    def __init__(
        self,
        limit: Callable[[], Limit] = limit_of,
        scene_bytes: int = SCENE_BYTES,
        view_bytes: int = VIEW_BYTES,
    ):
        self.limit, self._scene_bytes, self._view_bytes = limit, scene_bytes, view_bytes
        self._scenes: Recent[Hashable, Scene] = Recent()
        self._views: Recent[tuple[Hashable, ...], Ready] = Recent()

    def of(
        self, config: Mapping[str, Any], algorithm_for: Callable[[int], ShadowAlgorithm]
    ) -> Ready:
        """The view of a trial's configuration, with memory enough to try its algorithm there.

        Args:
            algorithm_for: of a number of the light's faces, of which one is known at first.

        Raises:
            UseError: the scene is not what it was when the sweep was read, has no such view or
                light, nothing is seen or lit, or memory is too short.
        """
        scene = self._scene(config)
        view = _view(scene, config)
        scene = _lit(scene, view, config)
        sight = sight_of(scene, view, config["samples"])
        area = scene.light(config["light"]).area
        soft = calls_for_soft_truth(area, [algorithm_for(1)])
        told = ("light", "light_angle_deg", "samples", "seed")
        key = (_scene_key(config), view, soft, *(config[name] for name in told))

        def check_room(faces: int, held: int) -> None:
            stages = trial_stages([sight], [algorithm_for(faces)], faces, soft=soft)
            lamp = scene.light_rays_memory(config["light"])
            limit = self.limit()
            # What stages count as theirs is there already where the view is warm.
            check(held_besides(lamp, stages), replace(limit, held=max(0, limit.held - held)))

        def made() -> tuple[Ready, int]:
            check_room(1, 0)
            light = config["light"]
            options = RunOptions(
                scene=config["scene"],
                trust_scene=config["trust_scene"],
                light=light,
                seed=config["seed"],
            )
            bench = bench_of(scene, view, options, config["samples"], soft)
            return Ready(scene, bench, light), _bytes(sight)

        ready = self._views.get(key, made, self._most(self._view_bytes, VIEW_PART))
        check_room(ready.bench.frame.faces, _bytes(sight))
        return ready

    def _scene(self, config: Mapping[str, Any]) -> Scene:
        def made() -> tuple[Scene, int]:
            source, trust = config["scene"], config["trust_scene"]
            require(
                is_builtin(source) or file_content(Path(source), trust) == config["content"],
                f"scene file '{source}' has changed since the sweep was read; start it again.",
            )
            scene = load_scene(source, config["variant"], trust=trust, limit=self.limit())
            return scene, (scene.geometry.faces.shape[1] * TRIANGLE).bytes

        most = self._most(self._scene_bytes, SCENE_PART)
        scene = self._scenes.get(_scene_key(config), made, most)
        for key in self._views.keys:
            # A view holds its scene.
            if key[0] not in self._scenes.keys:
                self._views.drop(key)
        return scene

    def _most(self, most: int, part: float) -> float:
        """Bytes that may stay."""
        allowed = self.limit().bytes
        return most if allowed is None else min(most, part * allowed)


def _scene_key(config: Mapping[str, Any]) -> Hashable:
    return config["content"], config["variant"]


def _view(scene: Scene, config: Mapping[str, Any]) -> ViewSpec:
    view = scene.view(config["view"])
    return view if config["size"] is None else view.resized(*config["size"])


def _lit(scene: Scene, view: ViewSpec, config: Mapping[str, Any]) -> Scene:
    """The scene with a parallel light in the light's place, where that is asked for."""
    angle = config["light_angle_deg"]
    if angle is None:
        return scene
    light = scene.light(config["light"])
    return scene.with_light(parallel_light(light.name, view.camera(), angle), config["light"])


def _bytes(sight: Sight) -> int:
    return (sight.held + sight.of(Memory(), RAY)).bytes
