"""How long a sweep will take, before anything is run: a rule of thumb, good to a factor of three.

What a trial takes is counted in four parts, with seconds as they were measured on one core of a
shared Intel Xeon: scenes to load, programs to compile, pixels that see and are judged, and runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from asmjax.scene.builtin import is_builtin, scene_item
from asmjax.sweep.config import Trial
from asmjax.sweep.words import in_words

START = 6.0
"""Seconds until a worker has imported everything and its renderer stands."""

SCENE, TRIANGLE = 0.3, 1e-6
"""Seconds to load a scene, and for each of its triangles."""

COMPILE = {"adaptive": 9.0}
"""Seconds to compile a family for one size of image and scene; `COMPILE_FLAT` for others."""

COMPILE_FLAT = 2.0

SEEN = 8e-7
"""Seconds for each sample of a pixel: eye buffer, and shadow rays of the truth."""

JUDGED = 3e-7
"""Seconds for each pixel of a run whose errors are found."""

ANSWERED = 1e-7
"""Seconds for each sample of a pixel in a run: answers of the map and the yardstick's ray."""

TEXEL = 2e-8
"""Seconds for each texel of a flat map."""

LOOKED = 8e-7
"""Seconds for each pixel while an adaptive map is built from nothing."""

USUAL_PIXELS, USUAL_TRIANGLES, USUAL_TEXELS = 512 * 512, 200_000, 2048 * 2048
"""Where the file does not say how many."""


@dataclass(frozen=True)
class Estimate:
    """What a sweep is expected to take.

    Attributes:
        trials: that are to be run.
        seconds: of wall time.
    """

    trials: int
    seconds: float

    @property
    def words(self) -> str:
        """For people: "about 40 s"."""
        return f"about {in_words(self.seconds)}"


def estimate(trials: Sequence[Trial], workers: int) -> Estimate:
    """The time of trials that are run on so many workers; 0 is this process alone.

    Each worker compiles and loads for itself, and the trials are spread evenly.
    """
    if not trials:
        return Estimate(0, 0.0)
    beside = max(1, min(workers, len(trials)))
    once = sum(_loading(config) for config in _first(trials, _scene_of))
    once += sum(_seeing(config) for config in _first(trials, _view_of))
    once += sum(_compiling(config) for config in _first(trials, _program_of))
    each = sum(_running(trial.config) for trial in trials)
    return Estimate(len(trials), START * (workers > 0) + once + each / beside)


def _first(trials: Sequence[Trial], what) -> list[dict[str, Any]]:
    """One configuration for each different value of `what`."""
    return list({what(trial.config): trial.config for trial in trials}.values())


def _scene_of(config: dict[str, Any]) -> tuple:
    return (config["content"],)


def _view_of(config: dict[str, Any]) -> tuple:
    names = ("content", "view", "light", "light_angle_deg", "samples", "seed")
    return (*(config[name] for name in names), _pixels(config))


def _program_of(config: dict[str, Any]) -> tuple:
    return config["algorithm"], _pixels(config), config["light"], config["content"]


def _pixels(config: dict[str, Any]) -> int:
    size = config["size"]
    return USUAL_PIXELS if size is None else size[0] * size[1]


def _loading(config: dict[str, Any]) -> float:
    source = config["scene"]
    triangles = scene_item(source).triangles if is_builtin(source) else USUAL_TRIANGLES
    return SCENE + TRIANGLE * triangles


def _seeing(config: dict[str, Any]) -> float:
    return SEEN * _pixels(config) * config["samples"]


def _compiling(config: dict[str, Any]) -> float:
    return COMPILE.get(config["algorithm"], COMPILE_FLAT)


def _running(config: dict[str, Any]) -> float:
    pixels, runs = _pixels(config), config["repeats"] + config["warm_ups"]
    if config["algorithm"] == "adaptive":
        built = LOOKED * pixels
    else:
        built = TEXEL * _texels(config)
    return JUDGED * pixels + runs * (built + ANSWERED * pixels * config["samples"])


def _texels(config: dict[str, Any]) -> float:
    if config["memory_mb"] is not None:
        return config["memory_mb"] * 2**20 / 4
    resolution = config["settings"].get("resolution")
    return USUAL_TEXELS if resolution is None else resolution**2
