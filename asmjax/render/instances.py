"""Shape groups and their instances: which group each instance shows, and where it stands.

Mitsuba tells of a hit which instance was met, which part of its group, and which primitive of the
part, but of an instance alone not which group it shows.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from asmjax.errors import UseError


@dataclass(frozen=True, eq=False)
class Instancing:
    """What of a scene's shapes are instances.

    Attributes:
        groups: Mitsuba's shape groups.
        parts: the shapes of each group, in the order in which hits count them.
        group: (n_shapes,) int, which group a shape of the scene shows; -1 for a shape of its own.
    """

    groups: tuple
    parts: tuple[tuple, ...]
    group: np.ndarray

    def __bool__(self) -> bool:
        return bool((self.group >= 0).any())


def is_instance(shape) -> bool:
    """Whether a Mitsuba shape is an instance of a shape group."""
    return shape.class_name() == "Instance"


def known_instances(mi, groups: list, group: list[int]) -> Instancing:
    """The instances of a scene whose maker knows that shape k shows `groups[group[k]]`, or -1.

    Raises:
        UseError: the variant cannot tell them apart.
    """
    if groups and mi.variant().startswith("cuda"):
        raise UseError(
            f"variant {mi.variant()} casts no rays at instances of shape groups here; choose "
            "`variant` llvm_ad_rgb or scalar_rgb, or write the instances out."
        )
    return Instancing(
        tuple(groups), tuple(tuple(parts_of(mi, g)) for g in groups), np.array(group, np.int64)
    )


def shape_groups(mi, scene) -> list:
    """The shape groups of a scene that Mitsuba loaded."""
    return [c for c in _children(mi, scene) if c.class_name().startswith("ShapeGroup")]


def find_instances(mi, scene, name: str, shown: Mapping[str, str]) -> Instancing:
    """The instances of a scene that Mitsuba loaded: what the scene says of them, or, of those that
    it holds ready-made, what primitive count and box of the groups tell.

    Args:
        shown: id of the group that an instance shows, by the instance's id.

    Raises:
        UseError: two groups with the same count and box, or a variant without instances.
    """
    shapes = scene.shapes()
    if not any(is_instance(shape) for shape in shapes):
        return Instancing((), (), np.full(len(shapes), -1))
    groups = shape_groups(mi, scene)
    number = {group.id(): k for k, group in enumerate(groups)}
    found = []
    for shape in shapes:
        said = number.get(shown.get(shape.id(), "")) if is_instance(shape) else -1
        found.append(_shown(mi, shape, groups, name) if said is None else said)
    return known_instances(mi, groups, found)


def parts_of(mi, group) -> list:
    """The shapes of a shape group, in the order in which hits count them."""
    return _children(mi, group)


def placement(mi, shape) -> np.ndarray:
    """(3, 4) float64 from an instance's own coordinates to the world's; identity for the others."""
    if not is_instance(shape):
        return np.eye(3, 4)
    return np.array(mi.traverse(shape)["to_world"].matrix, np.float64).reshape(4, 4)[:3]


def _shown(mi, instance, groups: list, scene: str) -> int:
    """Index of the group that an instance shows."""
    box, matrix = _box(instance), placement(mi, instance)
    fits = []
    for k, group in enumerate(groups):
        if group.primitive_count() != instance.effective_primitive_count():
            continue
        corners = np.stack(np.meshgrid(*_box(group))).reshape(3, -1)
        world = matrix[:, :3] @ corners + matrix[:, 3:]
        placed = np.stack([world.min(axis=1), world.max(axis=1)], axis=1)
        if np.allclose(placed, box, rtol=0, atol=1e-5 * np.abs(box).max()):
            fits.append(k)
    if len(fits) != 1:
        raise UseError(
            f"scene '{scene}' has the instance '{instance.id()}', which shows one of "
            f"{len(fits)} shape groups of the same box and number of primitives, and asmjax cannot "
            "tell which; write it out as shapes of its own."
        )
    return fits[0]


def _box(shape) -> np.ndarray:
    box = shape.bbox()
    return np.array([np.array(box.min).ravel(), np.array(box.max).ravel()], np.float64).T


def _children(mi, parent) -> list:
    """The objects inside a Mitsuba object, in its order."""

    class Collect(mi.TraversalCallback):
        def __init__(self):
            super().__init__()
            self.found = []

        def put(self, name, value, flags, *more):
            if isinstance(value, mi.Object):
                self.found.append(value)

    collect = Collect()
    parent.traverse(collect)
    return collect.found
