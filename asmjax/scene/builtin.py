"""The built-in scenes by name: what each one is, without building it, and how to build it."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass

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
    "letter_f": "asmjax.scene.letter_f:make_letter_f",
}

SIZED = "surface"
"""The scene that can be had at any size: its name, a colon, and a number of triangles."""

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
        "letter_f",
        "an asymmetric caster above a plane: shows every flip, transpose and shift",
        ("angle", "above"),
        ("point", "spot", "directional"),
        48,
    ),
)


def _large(place: str) -> Callable[[], SceneSpec]:
    """A factory that imports its module only when it is called."""

    def build() -> SceneSpec:
        module, function = place.split(":")
        return getattr(importlib.import_module(module), function)()

    return build


def _analytic(name: str) -> Callable[[], SceneSpec]:
    return lambda: ANALYTIC_SCENES[name]().spec


BUILTIN: dict[str, Callable[[], SceneSpec]] = {
    **{name: _large(place) for name, place in _LARGE.items()},
    **{name: _analytic(name) for name in ANALYTIC_SCENES},
}
"""Factories of all built-in scenes by name."""


def is_builtin(name: str) -> bool:
    """Whether `name` is, or wants to be, that of a built-in scene: "surface:12m" does, too."""
    base, colon, _ = name.partition(":")
    return base in BUILTIN if colon else name in BUILTIN


def load_builtin(name: str) -> SceneSpec:
    """Build the scene called `name`; a number of triangles after a colon sizes the one of any size.

    Raises:
        UseError: no such scene (the nearest name is suggested), a size that is no number of
            triangles, or one after the name of a scene that has its own.
    """
    base, colon, size = name.partition(":")
    if base not in BUILTIN:
        raise unknown_name("built-in scene", name, BUILTIN)
    if not colon:
        return BUILTIN[name]()
    if base != SIZED:
        raise UseError(
            f"the scene '{base}' has one size, so '{name[:80]}' is none; allowed: {SIZED} with a "
            f"number of triangles, such as {SIZED}:10k; leave ':{size[:40]}' out."
        )
    from asmjax.scene.surface import make_surface, parse_triangles

    return make_surface(parse_triangles(size), name)


def list_scenes() -> list[SceneItem]:
    """All built-in scenes in the order in which to show them."""
    analytic = (ANALYTIC_SCENES[name]().spec for name in ANALYTIC_SCENES)
    return [*_ITEMS, *(describe(spec) for spec in analytic)]


def describe(spec: SceneSpec) -> SceneItem:
    """The list entry of a scene that is already built."""
    return SceneItem(spec.name, spec.summary, tuple(spec.views), tuple(spec.lights), spec.triangles)
