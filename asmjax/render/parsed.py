"""Scene files and dictionaries, parsed first and made into a Mitsuba scene in any frame.

Between the two, transforms are float64: shapes are moved into a working frame before anything is
rounded, and the places of sensors and lights are read as the file says them.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from types import MappingProxyType

import numpy as np

from asmjax.errors import UseError
from asmjax.render.search_path import only_beside
from asmjax.render.working_frame import WORLD, WorkingFrame

UNNAMED = "_unnamed_"
"""Begins the id of what the file gives none, as Mitsuba has it."""

FIXED_RADII = ("bsplinecurve", "linearcurve")
"""Shapes whose radii no transform scales."""

AT_HOME: Mapping[str, WorkingFrame] = MappingProxyType({})
"""No shape group is moved."""


class ParsedScene:
    """A scene that is parsed but not made.

    Args:
        mi: the mitsuba module with its variant set.
        source: a scene file, or a dictionary.
        what: names it in messages.

    Raises:
        UseError: Mitsuba cannot parse it.
    """

    def __init__(self, mi, source: Path | dict, what: str):
        self._mi, self._source, self._what = mi, source, what
        self._state = self._parsed()

    def _parsed(self):
        mi = self._mi
        self._config = config = mi.parser.ParserConfig(mi.variant())
        # Materials that are equal do not make one shape of two.
        config.merge_meshes = config.merge_equivalent = False

        def parse():
            if isinstance(self._source, dict):
                state = mi.parser.parse_dict(config, self._source)
            else:
                state = mi.parser.parse_file(config, str(self._source))
            mi.parser.transform_all(config, state)
            return state

        state = self._attempt(parse)
        self._read = [str(name) for name in state.files]
        for k, node in enumerate(state.nodes):
            if not node.props.id():
                node.props.set_id(f"{UNNAMED}{k}")
        return state

    def _attempt(self, action: Callable):
        source, mi = self._source, self._mi
        try:
            with nullcontext() if isinstance(source, dict) else only_beside(mi, source):
                return action()
        except Exception as problem:
            lines = [line.strip() for line in str(problem).splitlines() if line.strip()]
            reason = " ".join(lines[:2]) if lines else type(problem).__name__
            raise UseError(
                f"{self._what} is not a scene that Mitsuba can load: {reason[:400]}; mend the "
                "scene."
            ) from problem

    def made(self, working: WorkingFrame, groups: Mapping[str, WorkingFrame] = AT_HOME):
        """The Mitsuba scene, its shapes moved into `working`; sensors and lights stay.

        Args:
            groups: frames into which the parts of shape groups are moved, by the group's id; of
                others they stay.

        Raises:
            UseError: Mitsuba cannot make it.
        """
        # Making uses up what was parsed.
        state, self._state = self._state or self._parsed(), None
        shown = self._shown(state)
        for number in self._shapes_in(state, 0):
            own = groups.get(shown.get(number, ""), WORLD)
            _move(self._mi, state.nodes[number].props, working, own)
        for number, group in self._groups(state).items():
            for part in self._shapes_in(state, number):
                _move(self._mi, state.nodes[part].props, groups.get(group, WORLD))
        return self._attempt(lambda: self._mi.parser.instantiate(self._config, state))

    def check_documents(self, scanned: Sequence[Path]) -> None:
        """Raise `UseError` where the renderer read other scene files than were checked."""
        # Those that were checked may be more: files that only define parameters make no node, and
        # Mitsuba tells only of files that made one.
        unchecked = {os.path.realpath(name) for name in self._read} - {
            os.path.realpath(path) for path in scanned
        }
        if unchecked:
            raise UseError(
                f"{self._what} includes {len(unchecked)} files that were not checked; write them "
                "out, or give `trust=True` if you trust the scene."
            )

    @property
    def can_move(self) -> bool:
        """Whether all shapes can be moved: what a dictionary holds ready-made cannot, nor can a
        shape that stands in several places, in a group and outside or in two groups."""
        nodes = self._nodes()
        ready = any(
            isinstance(value, self._mi.Shape)
            for node in nodes
            for _, value in self._mi.Properties(node.props).items()
        )
        roots = (0, *self._groups(self._state))
        standing = [number for root in roots for number in self._shapes_in(self._state, root)]
        return not ready and len(standing) == len(set(standing))

    @property
    def can_scale(self) -> bool:
        """Whether shapes can be scaled with all that belongs to them."""
        return all(node.props.plugin_name() not in FIXED_RADII for node in self._nodes())

    def _nodes(self):
        self._state = self._state or self._parsed()
        return self._state.nodes

    def properties(self) -> dict[str, dict]:
        """What is said of each plugin by its id, vectors and transforms as float64 arrays."""
        # Of copies: what was read of the originals no longer counts as unknown.
        copies = [self._mi.Properties(node.props) for node in self._nodes()]
        return {props.id(): _plain(props) for props in copies}

    def shown_groups(self) -> dict[str, str]:
        """Id of the shape group that each instance shows, by the instance's id."""
        nodes = self._nodes()
        return {nodes[k].props.id(): group for k, group in self._shown(self._state).items()}

    def _groups(self, state) -> dict[int, str]:
        """Ids of the shape groups by their numbers."""
        return {
            number: node.props.id()
            for number, node in enumerate(state.nodes)
            if node.props.plugin_name() == "shapegroup"
        }

    def _shown(self, state) -> dict[int, str]:
        """Id of the shape group that each instance shows, by the number of the instance."""
        groups = self._groups(state)
        return {
            number: groups[child]
            for number, node in enumerate(state.nodes)
            if node.props.plugin_name() == "instance"
            for child in self._referred(state, number)
            if child in groups
        }

    def _referred(self, state, number: int) -> list[int]:
        """Numbers of the nodes that a node refers to."""
        # A copy: what was read of the original no longer counts as unknown.
        props = self._mi.Properties(state.nodes[number].props)
        return [
            value.index()
            for _, value in props.items()
            if isinstance(value, self._mi.Properties.ResolvedReference)
        ]

    def _shapes_in(self, state, root: int) -> list[int]:
        """Numbers of the shapes that stand in the scene itself, which is node 0, and not in a
        group; or in a group."""
        shape = self._mi.ObjectType.Shape
        found: dict[int, None] = {}
        waiting = [root]
        while waiting:
            for number in self._referred(state, waiting.pop()):
                child = state.nodes[number]
                if child.type == shape and child.props.plugin_name() == "merge":
                    waiting.append(number)
                elif child.type == shape and child.props.plugin_name() != "shapegroup":
                    # Once, however often it is referred to.
                    found[number] = None
        return list(found)


def _plain(props) -> dict:
    found = {}
    for name, value in props.items():
        if name == "to_world" and "Transform" in type(value).__name__:
            found[name] = np.array(value.matrix, np.float64).reshape(4, 4)
        elif isinstance(value, bool | int | float | str):
            found[name] = value
        elif name in ("position", "direction", "sun_direction"):
            found[name] = np.array(value, np.float64).ravel()
    return found


def _move(mi, props, working: WorkingFrame, group: WorkingFrame = WORLD) -> None:
    """Put `working` after the transform of a shape; places that are properties of their own become
    part of it, for they would be rounded first. An instance leads out of the frame of its `group`.
    """
    if working.is_identity and group.is_identity:
        return
    matrix = working.matrix
    if "to_world" in props:
        matrix = matrix @ np.array(props["to_world"].matrix, np.float64).reshape(4, 4)
    matrix = matrix @ group.inverse
    if props.plugin_name() == "sphere":
        own = np.eye(4)
        if "radius" in props:
            own[:3, :3] *= props["radius"]
            del props["radius"]
        if "center" in props:
            own[:3, 3] = np.array(props["center"], np.float64).ravel()
            del props["center"]
        matrix = matrix @ own
    elif props.plugin_name() == "cylinder" and "to_world" not in props:
        for name, usual in (("p0", (0.0, 0.0, 0.0)), ("p1", (0.0, 0.0, 1.0))):
            end = np.array(props.get(name, usual), np.float64).reshape(3, 1)
            props[name] = mi.ScalarPoint3d(*working.inward(end)[:, 0])
        props["radius"] = float(props.get("radius", 1.0)) * working.scale
        return
    props["to_world"] = mi.ScalarTransform4d(matrix)
