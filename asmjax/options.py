"""The options of the commands, as plain frozen dataclasses.

An option is written once, in the group under which `--help` shows it; a command's options are a
class that inherits the groups it needs, so notebooks and the command line use one flat object:
`RunOptions(scene="terrain", memory_mb=32)`. The text below a field is its help text.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, get_args

from tyro.conf import Positional, arg

from asmjax.errors import require, unknown_name

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

LARGEST = 2**53
"""Of numbers that are counts or amounts: up to here a float holds every whole one."""

LEAST_EVALUATIONS = 50
"""Fewer cannot calibrate the surrogate that leads a search, and check what it says."""


def _named(metavar: str, default: str) -> object:
    """An option that may be left out; `default` says in words what happens then."""
    return arg(metavar=metavar, help_behavior_hint=f"(default: {default})")


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

    minutes: Annotated[float | None, _named("MINUTES", "until everything is tried")] = None
    """Time after which no further trial begins. The most telling come first, and the same command
    goes on from there. Tuning measures its first 40 samples and the held-out views all the
    same."""

    fresh: bool = False
    """Forget the measurements that an earlier run left in the folder; otherwise those of the same
    scene, views, settings and machine are used again."""


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

    evaluations: Annotated[int, arg(metavar="COUNT")] = 60
    """Settings that the search may try on the real map, 50 or more; the default, a grid of 32, the
    rest of a random search and what is measured on the held-out views come on top."""

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
class RunOptions(
    SceneOptions,
    WalkOptions,
    EffectOptions,
    LimitOptions,
    MapOptions,
    MeasureOptions,
    MachineOptions,
    OutputOptions,
):
    """Options of `asmjax run`.

    Raises:
        UseError: a number outside its range. Names, files and sizes are checked by those who
            look them up.
    """

    command: ClassVar[str] = "run"
    """The command's name, with which the default folder of its results begins."""

    def __post_init__(self):
        _check_effects(self)
        _check_measured(self)
        _check_walk(self)


@dataclasses.dataclass(frozen=True, kw_only=True)
class AnalyzeOptions(
    SceneOptions,
    ComparisonOptions,
    LimitOptions,
    MapOptions,
    MeasureOptions,
    MachineOptions,
    OutputOptions,
):
    """Options of `asmjax analyze`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "analyze"

    def __post_init__(self):
        _check_measured(self)
        _at_least(0, "--angles", self.angles, "directions")


@dataclasses.dataclass(frozen=True, kw_only=True)
class CompareOptions(
    SceneOptions,
    TrialOptions,
    PatienceOptions,
    MethodOptions,
    LimitOptions,
    MapOptions,
    RepeatOptions,
    MachineOptions,
    FolderOptions,
):
    """Options of `asmjax compare`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "compare"

    def __post_init__(self):
        _check_limits(self)
        require(len(self.samples) > 0, "--samples names no number of samples; give 1 or more.")
        for samples in self.samples:
            _at_least(1, "--samples", samples, "sample per pixel")
        _check_patience(self)
        require(
            not self.views or (self.view is None and self.sensor is None),
            "--views and --view or --sensor both say what is looked at; give one of them.",
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class TuneOptions(
    SceneOptions,
    GoalOptions,
    SearchOptions,
    PatienceOptions,
    TunedMapOptions,
    MachineOptions,
    FolderOptions,
):
    """Options of `asmjax tune`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "tune"

    def __post_init__(self):
        goals = {"--price": self.price, "--within-ms": self.within_ms, "--error": self.error}
        given = [name for name, value in goals.items() if value is not None]
        require(
            len(given) <= 1,
            f"{' and '.join(given)} are different goals; give one of them.",
        )
        for name in given:
            _above(0, name, goals[name])
        _check_patience(self)
        if self.memory_mb is not None:
            _at_least(1e-6, "--memory-mb", self.memory_mb, "MB")
        _at_least(LEAST_EVALUATIONS, "--evaluations", self.evaluations, "settings")
        _at_least(1, "--repeats", self.repeats, "timed run")
        _at_least(0, "--seed", self.seed, "")
        _check_machine(self)
        require(
            bool(self.views) == bool(self.held_out),
            "--views says what is tuned on, --held-out what chooses; give both, or neither.",
        )
        both = [name for name in self.views if name in self.held_out]
        require(
            not both,
            f"view '{' and '.join(both)}' is named by --views and by --held-out; views that choose "
            "must not be tuned on: leave it out of one.",
        )
        require(
            not self.views or (self.view is None and self.sensor is None),
            "--views and --view or --sensor both say what is looked at; give one of them.",
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlanOptions(ViewOptions, PlanningOptions, EffectOptions, MachineOptions, FolderOptions):
    """Options of `asmjax plan`.

    Raises:
        UseError: as `RunOptions`.
    """

    command: ClassVar[str] = "plan"

    def __post_init__(self):
        _check_effects(self)
        _at_least(0, "--seed", self.seed, "")
        _check_machine(self)


MapJobOptions = RunOptions | AnalyzeOptions | CompareOptions
"""Options of the commands that measure maps with settings that are given."""

JobOptions = MapJobOptions | TuneOptions
"""Options of the commands that measure a scene."""

ViewJobOptions = JobOptions | PlanOptions
"""Options of the commands that look at a scene."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ScenesOptions:
    """Output."""

    json: bool = False
    """Print JSON instead of text."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class InfoOptions:
    """Output."""

    json: bool = False
    """Print JSON instead of text."""


def force_of(words: Sequence[str]) -> dict[str, str]:
    """The words of --force by light: "soft" is of all ("*"), "lamp=soft" of one.

    Raises:
        UseError: a word that is none of `Force`, or two for the same.
    """
    force: dict[str, str] = {}
    for word in words:
        light, _, kind = word.rpartition("=")
        if kind not in get_args(Force):
            raise unknown_name("effect to force", kind, get_args(Force))
        require(
            (light or "*") not in force,
            f"--force says two things of {f'light {light!r}' if light else 'all lights'}: "
            f"{force.get(light or '*')} and {kind}; leave one of them out.",
        )
        force[light or "*"] = kind
    return force


def _check_effects(options: EffectOptions) -> None:
    _at_least(0, "--tolerance", options.tolerance, "")
    force_of(options.force)


def _check_measured(options: RunOptions | AnalyzeOptions) -> None:
    """What commands that measure one view ask of their numbers."""
    _check_limits(options)
    _at_least(1, "--samples", options.samples, "ray per pixel")


def _check_limits(options: MapJobOptions) -> None:
    """What all commands that measure a scene ask of their numbers."""
    if options.memory_mb is not None:
        _at_least(1e-6, "--memory-mb", options.memory_mb, "MB")
    if options.time_limit_ms is not None:
        _at_least(1e-3, "--time-limit-ms", options.time_limit_ms, "milliseconds")
    if options.node_resolution is not None:
        _at_least(1, "--node-resolution", options.node_resolution, "texels")
    if options.cells is not None:
        _at_least(1, "--cells", options.cells, "cell per side")
    _at_least(1, "--repeats", options.repeats, "timed run")
    _at_least(0, "--seed", options.seed, "")
    _check_machine(options)


def _check_machine(options: MachineOptions) -> None:
    if options.max_memory_mb is not None:
        _at_least(1, "--max-memory", options.max_memory_mb, "MB")


def _check_walk(options: RunOptions) -> None:
    if options.motion not in get_args(Motion):
        raise unknown_name("--motion", options.motion, get_args(Motion))
    if options.frames is None:
        for option, given in (
            (f"--motion {options.motion}", options.motion != "camera"),
            ("--keys", bool(options.keys)),
            ("--object", options.object is not None),
        ):
            require(not given, f"{option} is for walkthroughs; say how many --frames to walk.")
        return
    _at_least(1, "--frames", options.frames, "frame")
    require(
        not options.force,
        "--force chooses what is simulated, but walkthroughs have hard shadows only; leave out "
        "--force, or --frames.",
    )
    require(
        options.object is None or options.motion == "object",
        f"--object names what moves, but --motion is {options.motion}; add --motion object.",
    )
    if not options.keys:
        return
    require(
        options.motion == "camera",
        f"--keys are the camera's, but --motion is {options.motion}; leave one of them out.",
    )
    require(len(options.keys) > 1, "--keys needs two views or more to walk between; name another.")
    require(
        options.view is None and options.sensor is None,
        "--keys and --view or --sensor both say where the camera is; give one of them.",
    )


def _check_patience(options: PatienceOptions) -> None:
    if options.minutes is not None:
        _at_least(1e-3, "--minutes", options.minutes, "minutes")


def _memory_bytes(memory_mb: float | None) -> int:
    return int((MEMORY_MB if memory_mb is None else memory_mb) * MEGABYTE)


def _above(least: float, option: str, got: float | None) -> None:
    require(
        got is not None and math.isfinite(got) and got > least,
        f"{option} is {got}; allowed: a finite number above {least:g}; choose another {option}",
    )


def _at_least(least: float, option: str, got: float, unit: str) -> None:
    unit = f" {unit}" if unit else ""
    # Compared, not converted: a whole number may have more digits than any float.
    require(
        least <= got <= LARGEST,
        f"{option} is {str(got)[:40]}; allowed: a finite number, at least {least:g}{unit}, and at "
        f"most 2^53; choose another {option}",
    )
