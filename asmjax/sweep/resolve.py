"""From what is said of a trial to its whole configuration, plain values that a worker can run."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from asmjax.errors import UseError, require, unknown_name
from asmjax.plain import NonFinite, plain
from asmjax.render.load import scene_file
from asmjax.scene.builtin import SceneItem, is_builtin, scene_item
from asmjax.scene.spec import pick
from asmjax.shadow import ALGORITHMS, FILTERS, ShadowAlgorithm, algorithm_of, family_of
from asmjax.shadow.settings import setting_types
from asmjax.sweep.axes import Path as Place
from asmjax.sweep.axes import Point
from asmjax.sweep.fields import FIELDS, KEEPS
from asmjax.sweep.identity import builtin_content, canonical, file_content

MEMORY, RESOLUTION = ("memory_mb", "memory_bytes"), ("resolution", "inner")
"""Settings that `memory_mb` of a trial says: of an adaptive map, and of others."""


class KnownScene(NamedTuple):
    """A scene as trials name it.

    Attributes:
        source: built-in name, or absolute path.
        content: as `asmjax.sweep.identity` has it.
        item: of a built-in scene; None of a file.
    """

    source: str
    content: str
    item: SceneItem | None


class Resolver:
    """Fills in what nobody says, and looks at each scene and each algorithm once.

    Args:
        folder: from which paths of scenes go on.
        trust_scene: take scene files as they are.
        variant: Mitsuba variant of all trials; None for the fastest that works.
    """

    def __init__(self, folder: Path, trust_scene: bool = False, variant: str | None = None):
        self._folder, self._trust, self._variant = folder, trust_scene, variant
        self._scenes: dict[str, KnownScene | UseError] = {}
        self._settings: dict[str, dict[str, Any] | UseError] = {}

    def config(self, said: Point) -> dict[str, Any]:
        """The configuration of a trial: every key of `FIELDS`, all settings of its algorithm, and
        what its scene consists of.

        Raises:
            UseError: no such scene, view, light or algorithm, settings that the algorithm refuses,
                or keys that exclude each other; it begins with the places in the file.
        """
        value = {name: _value(said, name) for name in FIELDS}
        scene = self._blamed(said, [("scene",)], lambda: self._scene(value["scene"]))
        if scene.item is not None:
            for name, kind in (("view", "view (sensor)"), ("light", "light (emitter)")):
                value[name] = self._blamed(
                    said, [(name,)], lambda n=name, k=kind: _picked(scene, n, k, value[n])
                )
        for name in ("view", "light"):
            value[name] = None if value[name] is None else str(value[name])
        if ("light_angle_deg",) in said:
            self._apart(said, "light_angle_deg", [("light",)], "where the light is")
            value["light"] = None
        settings = self._settings_of(said, value["algorithm"], value["memory_mb"])
        if "memory_bytes" in settings:
            # Said or not: results of all algorithms have one column of memory.
            value["memory_mb"] = settings["memory_bytes"] / 2**20
        for name in ("light_angle_deg", "memory_mb"):
            value[name] = None if value[name] is None else float(value[name])
        if value["cost_model"] is not None:
            value["cost_model"] = [float(cost) for cost in value["cost_model"]]
        value["keep"] = [name for name in KEEPS if name in value["keep"]]
        return {
            **value,
            "scene": scene.source,
            "content": scene.content,
            "settings": settings,
            "variant": self._variant,
            "trust_scene": self._trust,
        }

    def _scene(self, name: str) -> KnownScene:
        if name not in self._scenes:
            try:
                self._scenes[name] = self._looked_up(name)
            except UseError as problem:
                self._scenes[name] = problem
        return _given(self._scenes[name])

    def _looked_up(self, name: str) -> KnownScene:
        if is_builtin(name):
            return KnownScene(name, builtin_content(name), scene_item(name))
        # A mere word gets the nearest built-in name suggested.
        is_path = "/" in name or "." in name
        path = scene_file(str(self._folder / name) if is_path else name)
        require(
            path.suffix.lower() == ".xml",
            f"'{name}' is no Mitsuba scene; give a built-in name or the path of a .xml file.",
        )
        return KnownScene(str(path.absolute()), file_content(path, self._trust), None)

    def _settings_of(
        self, said: Point, family: str, memory_mb: float | None
    ) -> dict[str, Any]:  # fmt: skip
        """All settings of the algorithm, as plain values by field name."""
        algorithm = self._blamed(said, [("algorithm",)], lambda: _family(family))
        by_memory = "memory_bytes" in setting_types(algorithm)
        if memory_mb is not None:
            taken = [("settings", name) for name in (MEMORY if by_memory else RESOLUTION)]
            paths = [path for path in said if path[:2] in taken]
            self._apart(said, "memory_mb", paths, "how large the map is")
        table = _nested({path[1:]: item.value for path, item in said.items() if len(path) > 1})
        if memory_mb is not None and by_memory:
            table["memory_mb"] = memory_mb
        key = canonical({"algorithm": family, "settings": plain(table, NonFinite.NAMED)})
        if key not in self._settings:
            try:
                chosen = algorithm_of({"algorithm": family, "settings": table})
                self._settings[key] = settings_table(chosen)
            except UseError as problem:
                self._settings[key] = problem
        paths = [path for path in said if path[0] in ("settings", "algorithm", "memory_mb")]
        found = dict(self._blamed(said, paths, lambda: _given(self._settings[key])))
        if memory_mb is not None and not by_memory:
            # Known where the light's faces are.
            found["inner" if family in FILTERS else "resolution"] = None
        return found

    @staticmethod
    def _apart(said: Point, name: str, others: list[Place], what: str) -> None:
        """Raise `UseError` where `name` and one of `others` are said."""
        both = [path for path in others if path in said]
        if both:
            raise UseError(
                f"{said[(name,)].where} and {said[both[0]].where} both say {what}; leave one out."
            )

    @staticmethod
    def _blamed(said: Point, paths: list[Place], call):
        """What `call` gives; a `UseError` of it begins with the places that it is about."""
        try:
            return call()
        except UseError as problem:
            text = str(problem)
            places = {path: said[path].where for path in paths if path in said}
            named = [place for path, place in places.items() if _is_named(path[-1], text)]
            where = ", ".join(dict.fromkeys(named or places.values()))
            raise UseError(f"{where}: {text}") from problem


def settings_table(algorithm: ShadowAlgorithm) -> dict[str, Any]:
    """All settings of an algorithm as JSON can hold them: infinity is "inf", an inner algorithm a
    table of `algorithm` and `settings`; `algorithm_in` makes it again."""
    found = {}
    for name in setting_types(type(algorithm)):
        value = getattr(algorithm, name)
        if isinstance(value, ShadowAlgorithm):
            value = {"algorithm": family_of(value), "settings": settings_table(value)}
        found[name] = plain(value, NonFinite.NAMED)
    return found


def algorithm_in(family: str, settings: Mapping[str, Any]) -> ShadowAlgorithm:
    """The algorithm of a `settings_table`; what is None there is as the algorithm has it.

    Raises:
        UseError: as `algorithm_of`.
    """
    return algorithm_of({"algorithm": family, "settings": _read(settings)})


def _read(settings: Mapping[str, Any]) -> dict[str, Any]:
    """A table of settings as a file has it."""
    found = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            found[name] = {**value, "settings": _read(value["settings"])}
        elif value is not None:
            found[name] = math.inf if value == "inf" else value
    return found


def _value(said: Point, name: str) -> Any:
    item = said.get((name,))
    return FIELDS[name].default if item is None else item.value


def _given(found):
    if isinstance(found, UseError):
        raise found
    return found


def _picked(scene: KnownScene, name: str, kind: str, wanted: str | int | None) -> str:
    assert scene.item is not None  # asked of built-in scenes only
    names = scene.item.views if name == "view" else scene.item.lights
    return pick(kind, {one: one for one in names}, wanted, scene.item.name)


def _family(name: str) -> type[ShadowAlgorithm]:
    if name not in ALGORITHMS:
        raise unknown_name("algorithm", name, ALGORITHMS)
    return ALGORITHMS[name]


def _nested(values: Mapping[Place, Any]) -> dict[str, Any]:
    """Values by path as tables within tables."""
    table: dict[str, Any] = {}
    for path, value in values.items():
        inner = table
        for name in path[:-1]:
            inner = inner.setdefault(name, {})
        inner[path[-1]] = value
    return table


def _is_named(setting: str, text: str) -> bool:
    """Whether a message is about a setting, by its name or in words."""
    return any(
        re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", text)
        for name in (setting, setting.replace("_", " "))
    )
