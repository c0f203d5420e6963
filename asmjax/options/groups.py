"""Groups of options: each option is written once, under the heading that `--help` gives it."""

import dataclasses
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from asmjax.options.search import GRID_POINTS, LEAST_EVALUATIONS, SAMPLES

MEGABYTE = 2**20
"""Bytes in one MB of the command line."""

MEMORY_MB = 16.0
"""Memory limit where neither the options nor a settings file give one, MB."""

PRICE = 0.1
"""Of a second, where nothing is asked of a tuned map, in pixels of shadow edge."""

TOLERANCE = 5e-4
"""Part of the picture's light whose change nobody minds. Edges are a small part of a picture: a
penumbra 10 pixels wide along 52 pixels of edge reaches it at 512 x 512."""

Force = Literal["none", "hard", "soft"]
"""What may be asked for, whatever the numbers say."""


def _named(metavar: str, default: str, text: str | None = None) -> object:
    """An option that may be left out; `default` says in words what happens then, and `text` what it
    is for, where no text stands below it."""
    return arg(metavar=metavar, help_behavior_hint=f"(default: {default})", help=text)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """What is looked at."""

    scene: Annotated[str, Positional, arg(metavar="[SCENE]")] = "paper_room"
    """Built-in scene (`asmjax scenes` lists them) or path of a Mitsuba scene file."""

    view: Annotated[str | None, _named("NAME", "the first one")] = None
    """Named view of a built-in scene, such as closeup."""

    size: Annotated[tuple[int, int] | None, _named("W H", "as the view says")] = None
    """Width and height of the image in pixels, 1 to 16384 each."""

    sensor: Annotated[str | None, _named("ID", "the first one")] = None
    """Sensor of a scene file: its id, or its index from 0."""

    trust_scene: bool = False
    """Load a scene file as it is. Otherwise it is checked first, for it can read other files, run
    code of its own, or crash; docs/scene_files.md says what is refused."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneOptions(ViewOptions):
    """What is looked at, and which light casts the shadow."""

    light: Annotated[str | None, _named("ID", "the first one")] = None
    """Light that casts the shadow: its name or id, or its index from 0."""


Motion = Literal["camera", "light", "object", "still"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class WalkOptions:
    """A walkthrough of several frames, each measured; maps keep what they can between frames."""

    frames: Annotated[int | None, _named("COUNT", "a single view")] = None
    """Number of frames to walk. A frame is 1.4 degrees or 2.5 % of the viewing distance from the
    one before, so more frames walk further; at its end a path is walked back."""

    motion: Annotated[Motion, arg(help_behavior_hint="(default: camera)")] = "camera"
    """What moves. camera: along --keys, or the scene's own path (paper_room), or an arc of 20
    degrees about what the view sees. light: on a small circle, 120 frames a turn. object: one
    shape, on such a circle. still: nothing."""

    keys: Annotated[
        tuple[str, ...], _named("VIEW VIEW ...", "the scene's own path, or an arc")
    ] = ()
    """Named views or sensors that the camera passes through, two or more."""

    object: Annotated[str | None, _named("NAME", "the finest mesh below half the scene")] = None
    """The shape that --motion object moves: its name or id, what several names begin with
    before a _ (robot), or its index from 0."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MethodOptions:
    """Which algorithms are measured."""

    methods: Annotated[tuple[str, ...], _named("NAME NAME ...", "all maps")] = ()
    """Families of shadow algorithms, such as uniform, adaptive, light-space, filtered; an unknown
    name lists them all. Tracing shadow rays is always among the results."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ComparisonOptions(MethodOptions):
    """Which algorithms are analysed, and under how many directions of light."""

    angles: Annotated[int, arg(metavar="COUNT")] = 7
    """Directions of a parallel light, from 2 degrees off the view to 90 (overhead), for which the
    errors are found again; 0 for none."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class LimitOptions:
    """What a shadow map may cost."""

    memory_mb: Annotated[float | None, _named("MB", f"{MEMORY_MB:g}")] = None
    """Memory of the adaptive map with all its arrays, never exceeded, and of the texels of each
    other map it is compared with, in MB (2^20 bytes)."""

    time_limit_ms: Annotated[float | None, _named("MS", "until nothing is left to gain")] = None
    """Time to build the adaptive map, in milliseconds; calibration is not counted."""

    @property
    def memory_bytes(self) -> int:
        """The memory limit in bytes, of `MEMORY_MB` where none is given."""
        return _memory_bytes(self.memory_mb)


@dataclasses.dataclass(frozen=True, kw_only=True)
class MapOptions:
    """How the adaptive shadow map is built."""

    settings: Annotated[str | None, _named("FILE", "none")] = None
    """Settings file (TOML) of a shadow algorithm; docs/settings.md explains it. Of an adaptive map:
    the one that is measured. Of another: `run` and `compare` measure it as well, `analyze` in
    its family's place."""

    preset: Annotated[str | None, _named("NAME", "default")] = None
    """Settings of the adaptive map by name: default, or paper_2001 for the paper to the letter."""

    node_resolution: Annotated[int | None, _named("TEXELS", "as the preset says, 16")] = None
    """Texels along each side of a node of the tree: 8 to 512, a power of two."""

    cells: Annotated[int | None, _named("COUNT", "as the preset says, 2")] = None
    """Cells along each side of a node, 2, 4 or 8; each cell may become a child of its own."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RepeatOptions:
    """How often times are measured, and what chance decides."""

    repeats: Annotated[int, arg(metavar="COUNT")] = 3
    """Timed runs of each method after one to warm up; medians are reported."""

    seed: Annotated[int, arg(metavar="INT")] = 0
    """Seed of everything random. The same seed, cost model and no time limit give the
    same numbers."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MeasureOptions(RepeatOptions):
    """How truth and time are measured."""

    samples: Annotated[int, arg(metavar="COUNT")] = 1
    """Samples per pixel: shadow rays of the ray-traced truth, and queries of every map."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrialOptions:
    """What is tried, and how much of it: memory is from 1/16 to 4 times --memory-mb."""

    views: Annotated[tuple[str, ...], _named("VIEW VIEW ...", "the one of --view or --sensor")] = ()
    """Named views or sensors that every algorithm is tried on; errors and times are of all of them
    together."""

    samples: Annotated[tuple[int, ...], arg(metavar="COUNT COUNT ...")] = (1, 16)
    """Samples per pixel, each a comparison of its own: with many, a map is built once and asked
    often, while every sample takes a shadow ray."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class PatienceOptions:
    """How long it may take, and whether it begins anew."""

    minutes: Annotated[
        float | None,
        _named(
            "MINUTES",
            "until everything is tried",
            "Time after which no further trial begins. The most telling come first, and the same "
            f"command goes on from there. Tuning measures its first {SAMPLES} samples and the "
            "held-out views all the same.",
        ),
    ] = None

    fresh: bool = False
    """Forget the measurements that an earlier run left in the folder; otherwise those of the same
    scene with the same files, views, settings and machine are used again."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class GoalOptions:
    """What is asked of the map: one of these three at most."""

    price: Annotated[float | None, _named("PX_PER_S", f"{PRICE:g}")] = None
    """What a second is worth: least wrong pixels per pixel of shadow edge + price x seconds."""

    within_ms: Annotated[float | None, _named("MS", "no limit")] = None
    """Least error within so many milliseconds from nothing to the last pixel."""

    error: Annotated[float | None, _named("PX", "no limit")] = None
    """Least time within so many wrong pixels per pixel of shadow edge."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Where settings are tried, and how often."""

    views: Annotated[tuple[str, ...], _named("VIEW VIEW ...", "the one of --view or --sensor")] = ()
    """Named views or sensors that settings are tuned on, with --held-out; more of them take as many
    times longer."""

    held_out: Annotated[
        tuple[str, ...], _named("VIEW VIEW ...", "the view, turned by 10 and 20 degrees")
    ] = ()
    """Other views, on which the best settings are measured again, and which choose among them."""

    evaluations: Annotated[
        int,
        arg(
            metavar="COUNT",
            help=f"Settings that the search may try on the real map, {LEAST_EVALUATIONS} or more; "
            f"the default, a grid of {GRID_POINTS}, the rest of a random search and what is "
            "measured on the held-out views come on top.",
        ),
    ] = 70

    repeats: Annotated[int, arg(metavar="COUNT")] = 3
    """Timed runs on the held-out views, all settings in turns."""

    seed: Annotated[int, arg(metavar="INT")] = 0
    """Seed of everything random."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TunedMapOptions:
    """The map whose settings are tuned."""

    memory_mb: Annotated[float | None, _named("MB", f"{MEMORY_MB:g}")] = None
    """The most memory that any settings may use, with all arrays, in MB (2^20 bytes)."""

    settings: Annotated[str | None, _named("FILE", "the default settings")] = None
    """Settings file (TOML) of an adaptive map, which counts as the default: what is not tuned stays
    as it says."""

    @property
    def memory_bytes(self) -> int:
        """As of `LimitOptions`."""
        return _memory_bytes(self.memory_mb)


@dataclasses.dataclass(frozen=True, kw_only=True)
class EffectOptions:
    """Which shadow effects are simulated."""

    tolerance: Annotated[float, arg(metavar="PART")] = TOLERANCE
    """Part of the picture's light, mean over its pixels, whose change nobody minds: effects that
    change less are skipped. 0.0005 is 0.05 %."""

    force: Annotated[tuple[str, ...], _named("KIND KIND ...", "none")] = ()
    """What is simulated whatever the numbers say: hard, soft (of lights with a size) or none, for
    all lights; NAME=KIND for one of them. `asmjax run` measures its two hard maps, to
    compare, even of a light without a shadow."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlanningOptions:
    """What is planned for."""

    lights: Annotated[tuple[str, ...], _named("ID ID ...", "all")] = ()
    """Lights that are planned for: names or ids, or indices from 0."""

    seed: Annotated[int, arg(metavar="INT")] = 0
    """Seed of everything random: the directions in which the surroundings are looked at."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MachineOptions:
    """What it runs on."""

    variant: Annotated[str | None, _named("NAME", "the fastest that works without CUDA")] = None
    """Mitsuba variant: llvm_ad_rgb, cuda_ad_rgb, or scalar_rgb (the same hits, about 16 times
    slower). `asmjax info` tells which is used and why."""

    max_memory_mb: Annotated[
        float | None,
        arg(
            metavar="MB",
            aliases=("--max-memory",),
            help_behavior_hint="(default: what is loaded, and 80 % of what is free)",
        ),
    ] = None
    """Main memory that the process may hold in all, in MB (2^20 bytes). What by an estimate would
    need more is refused before anything large is made."""

    recalibrate: bool = False
    """Measure again what casting texels costs, though an earlier run with the same machine, scene,
    kind of light and variant has."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FolderOptions:
    """Where results are written."""

    out: Annotated[str | None, _named("DIR", "out/<command>-<scene>")] = None
    """Folder for report.json and the figures."""

    quiet: bool = False
    """No progress bar and no table; warnings and errors still appear."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class OutputOptions(FolderOptions):
    """What is written, and where."""

    save_arrays: bool = False
    """Also write arrays.npz: truth, visibilities and all maps, row 0 at the top. Of a walkthrough,
    frame_0000.npz and so on, without the maps."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class PageOptions:
    """What is shown, and where the page is written."""

    folders: Annotated[
        tuple[str, ...],
        Positional,
        arg(metavar="DIR [DIR ...]", help_behavior_hint="(one or more)"),
    ] = ()
    """Folders that asmjax run, analyze, compare, tune, plan or sweep wrote, in the order of the
    page."""

    out: Annotated[str | None, _named("FILE", "report.html in the first folder")] = None
    """The page, one HTML file that needs no other."""

    quiet: bool = False
    """Print nothing; errors still appear."""


def _memory_bytes(memory_mb: float | None) -> int:
    return int((MEMORY_MB if memory_mb is None else memory_mb) * MEGABYTE)
