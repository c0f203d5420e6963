"""The built-in scenes by name: what each one is, without building it, and how to build it."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType

from asmjax.errors import UseError, unknown_name
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import SceneSpec


@dataclass(frozen=True)
class SceneItem:
    """One line of `asmjax scenes`; the first view and the first light are the defaults."""

    name: str
    summary: str
    views: tuple[str, ...]
    lights: tuple[str, ...]
    triangles: int


_LARGE = {
    "paper_room": "asmjax.scene.paper_room:make_paper_room",
    "terrain": "asmjax.scene.terrain:make_terrain",
    "surface": "asmjax.scene.surface:make_surface",
    "plant": "asmjax.scene.plant:make_plant",
    "statues": "asmjax.scene.statues:make_statues",
    "letter_f": "asmjax.scene.letter_f:make_letter_f",
}

SIZED = ("surface", "plant", "statues")
"""The scenes that can be had at any size: their name, a colon, and a number of triangles."""

_REPEATED = ("statues",)
"""Those whose triangles are a few thousand, placed many times."""

# Written out, so that listing the scenes builds none of the large ones; a test compares the two.
_ITEMS = (
    SceneItem(
        "paper_room",
        "the test room of the 2001 paper: rabbit, robot, woven sculpture, one wide ceiling light",
        ("overview", "closeup", "macro"),
        ("ceiling",),
        31_000,
    ),
    SceneItem(
        "terrain",
        "real mountains (Jacksboro fault, Tennessee) under a low sun, seen from near the ground",
        ("ground", "aerial"),
        ("sun",),
        275_772,
    ),
    SceneItem(
        "surface",
        "rippled sand and rings, alike at every scale; any number of triangles: surface:12m",
        ("overview", "rings", "focus"),
        ("lamp",),
        249_992,
    ),
    SceneItem(
        "plant",
        "pipes, girders, gratings and tanks around an alley; any number of triangles: plant:12m",
        ("overview", "alley", "close"),
        ("sun", "lamp"),
        199_994,
    ),
    SceneItem(
        "statues",
        "statues on a terrace, one figure placed many times; any number of triangles: statues:82m",
        ("overview", "aisle", "close"),
        ("sun", "lamp"),
        1_001_610,
    ),
    SceneItem(
        "letter_f",
        "an asymmetric caster above a plane: shows every flip, transpose and shift",
        ("angle", "above"),
        ("point", "spot", "directional"),
        48,
    ),
)


def _maker(name: str) -> tuple[ModuleType, Callable[..., SceneSpec]]:
    """The module of a large scene and its function; imported only when the scene is wanted."""
    place, function = _LARGE[name].split(":")
    module = importlib.import_module(place)
    return module, getattr(module, function)


def _large(name: str) -> Callable[[], SceneSpec]:
    return lambda: _maker(name)[1]()


def _analytic(name: str) -> Callable[[], SceneSpec]:
    return lambda: ANALYTIC_SCENES[name]().spec


BUILTIN: dict[str, Callable[[], SceneSpec]] = {
    **{name: _large(name) for name in _LARGE},
    **{name: _analytic(name) for name in ANALYTIC_SCENES},
}
"""Factories of all built-in scenes by name."""


def is_builtin(name: str) -> bool:
    """Whether `name` is, or wants to be, that of a built-in scene: "surface:12m" does, too."""
    base, colon, _ = name.partition(":")
    return base in BUILTIN if colon else name in BUILTIN


def asked_triangles(name: str) -> int:
    """Triangles that a scene of any size will hold in memory, before any is made; 0 for others.

    Raises:
        UseError: as `load_builtin`.
    """
    base, colon, size = name.partition(":")
    _check_name(name)
    triangles = _asked(base, size) if colon else 0
    return 0 if base in _REPEATED else triangles


def load_builtin(name: str) -> SceneSpec:
    """Build the scene called `name`; a number of triangles after a colon sizes those of any size.

    Raises:
        UseError: no such scene (the nearest name is suggested), a size that is no number of
            triangles or that the scene cannot have, or one after the name of a scene that has its
            own.
    """
    base, colon, size = name.partition(":")
    _check_name(name)
    if not colon:
        return BUILTIN[name]()
    return _maker(base)[1](_asked(base, size), name)


def _asked(base: str, size: str) -> int:
    """The number of triangles that `size` says, which the scene called `base` can have."""
    sizes = _maker(base)[0].SIZES
    triangles = sizes.parse(size)
    sizes.check(triangles)
    return triangles


def _check_name(name: str) -> None:
    base, colon, size = name.partition(":")
    if base not in BUILTIN:
        raise unknown_name("built-in scene", name, BUILTIN)
    if colon and base not in SIZED:
        raise UseError(
            f"the scene '{base}' has one size, so '{name[:80]}' is none; allowed: "
            f"{', '.join(SIZED)} with a number of triangles, such as {SIZED[0]}:10k; leave "
            f"':{size[:40]}' out."
        )


def scene_item(name: str) -> SceneItem:
    """The list entry of the scene called `name`, which is not built. Of a size after a colon it has
    the name, and the triangles that are asked for.

    Raises:
        UseError: as `load_builtin`.
    """
    base, colon, size = name.partition(":")
    if base in ANALYTIC_SCENES and not colon:
        return describe(ANALYTIC_SCENES[base]().spec)
    _check_name(name)
    item = next(item for item in _ITEMS if item.name == base)
    if not colon:
        return item
    return replace(item, name=name, triangles=_asked(base, size))


def list_scenes() -> list[SceneItem]:
    """All built-in scenes in the order in which to show them."""
    analytic = (ANALYTIC_SCENES[name]().spec for name in ANALYTIC_SCENES)
    return [*_ITEMS, *(describe(spec) for spec in analytic)]


def describe(spec: SceneSpec) -> SceneItem:
    """The list entry of a scene that is already built."""
    return SceneItem(spec.name, spec.summary, tuple(spec.views), tuple(spec.lights), spec.triangles)
