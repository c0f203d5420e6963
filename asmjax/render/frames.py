"""The frames in which a Mitsuba scene and its shape groups are cast, by what was made of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from asmjax.render.geometry import box_of
from asmjax.render.instances import is_instance, parts_of, placement, shape_groups
from asmjax.render.working_frame import WORLD, WorkingFrame, working_frame

SMALLEST_SHOWN = 2.0**-24
"""Instances that shrink their group more than this show nothing that a ray would find."""


@dataclass(frozen=True)
class Frames:
    """The frame of a scene, and those of its shape groups, by id, that are not cast as they are."""

    working: WorkingFrame = WORLD
    groups: Mapping[str, WorkingFrame] = field(default_factory=dict)

    def better(self, mi, scene, shown: Mapping[str, str]) -> "Frames":
        """The frames that the box of `scene` and those of its groups, which was made in these
        frames, ask for; far away boxes are known roughly only.

        Args:
            shown: id of the group that an instance shows, by the instance's id.
        """
        working = working_frame(box_of(scene.bbox(), self.working), self.working)
        groups = {}
        for group in shape_groups(mi, scene):
            known = self.groups.get(group.id(), WORLD)
            frame = working_frame(box_of(group.bbox(), known), known)
            if any(part.class_name() == "Sphere" for part in parts_of(mi, group)):
                least = _least_scale(mi, scene, shown, group.id())
                least *= (working.scale / self.working.scale) * (known.scale / frame.scale)
                frame = _for_spheres(frame, least)
            groups[group.id()] = frame
        return Frames(working, _moved(groups))

    def unscaled(self) -> "Frames":
        """The same shifts without any scale."""
        groups = {group: replace(frame, scale=1.0) for group, frame in self.groups.items()}
        return Frames(replace(self.working, scale=1.0), _moved(groups))


def _moved(groups: Mapping[str, WorkingFrame]) -> dict[str, WorkingFrame]:
    return {group: frame for group, frame in groups.items() if not frame.is_identity}


def _for_spheres(frame: WorkingFrame, least: float) -> WorkingFrame:
    """`frame`, or a smaller one where instances shrink what is in it, down to `least` of its size.

    Mitsuba 3.9 begins a meeting with a sphere where the ray is nearest to its centre, and goes too
    far by the length of the ray's direction, which an instance that shrinks makes longer: at an
    eighth of the size a third of the outline is lost (`ray_intersect_preliminary` of `sphere.cpp`
    divides by the norm, and not by its square).
    """
    if not 0 < least < 1:
        return frame
    smaller = 2.0 ** np.floor(np.log2(max(least, SMALLEST_SHOWN)))
    return replace(frame, scale=float(frame.scale * smaller))


def _least_scale(mi, scene, shown: Mapping[str, str], group: str) -> float:
    """By how much the instances of a group shrink it at most, and those of which nobody knows what
    they show; 1 for one without instances, or with one that is not finite."""
    linear = [
        placement(mi, shape)[:, :3]
        for shape in scene.shapes()
        if is_instance(shape) and shown.get(shape.id(), group) == group
    ]
    if not linear or not np.isfinite(linear).all():
        return 1.0
    return float(np.linalg.svd(np.stack(linear), compute_uv=False).min())
