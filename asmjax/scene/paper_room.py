"""The test scene of the 2001 adaptive shadow map paper (section 5), rebuilt by code.

A room of 10 x 10 x 6 metres, z up, with a point light of 122 degrees field of view at the ceiling,
far from the objects, which looks straight down. In it: a smooth model of 20,000 small triangles,
a robot, and a sculpture of fine mesh; 31,000 triangles in all. The models are our own.

The light's square frame is `2 d tan(61 deg)` wide at the axial depth d, 21.1 m on the floor: one
texel of a 2048^2 map is 10.3 mm there, of a 65,536^2 map 0.32 mm, of a 524,288^2 map 0.040 mm.
"""

import math
from dataclasses import replace

from asmjax.scene.bunny import make_bunny
from asmjax.scene.lattice import make_lattice
from asmjax.scene.mesh_tools import rotation, transform
from asmjax.scene.robot import make_robot
from asmjax.scene.shapes import box, quad
from asmjax.scene.spec import LightSpec, Mesh, SceneSpec, Vector, ViewSpec

TRIANGLES = 31_000
LIGHT_POSITION: Vector = (-2.6, 0.6, 5.85)
LIGHT_FOV_DEG = 122.0
LATTICE_FOOT: Vector = (0.25, 3.45, 0.0)

_HALF, _HEIGHT = 5.0, 6.0
_FLOOR: Vector = (0.66, 0.60, 0.52)
_WALL: Vector = (0.74, 0.76, 0.76)
_ACCENT_WALL: Vector = (0.50, 0.60, 0.66)
_CEILING: Vector = (0.85, 0.85, 0.85)


def make_paper_room() -> SceneSpec:
    """The scene with its three views, its one light, and a walk past the objects; metres."""
    bunny = transform(make_bunny(), _turn(-100.0), (2.16, 3.22, 0.145))
    robot = [transform(part, _turn(-100.0), (1.10, 4.25, 0.0)) for part in make_robot()]
    lattice = transform(make_lattice(), _turn(8.0), LATTICE_FOOT)
    plinth = box("plinth", (1.78, 2.78, -0.01), (2.50, 3.74, 0.15), (0.55, 0.34, 0.30))
    light = LightSpec(
        "ceiling",
        "point",
        position=LIGHT_POSITION,
        direction=(0.0, 0.0, -1.0),
        fov_deg=LIGHT_FOV_DEG,
    )
    return SceneSpec(
        "paper_room",
        "the test room of the 2001 paper: rabbit, robot, woven sculpture, one wide ceiling light",
        (*_room(), plinth, bunny, *robot, lattice),
        {view.name: view for view in _views()},
        {light.name: light},
        path=_walk(),
    )


def _views() -> tuple[ViewSpec, ...]:
    """All 512 x 512, one pixel about 8 mm (overview), 0.31 mm (closeup), 0.040 mm (macro) wide.

    `closeup` and `macro` look at the floor beside the sculpture's foot, where the shadows of four
    layers of wire cross. As side of a flat map they need 2,400, 68,000 and 530,000 texels (median).
    """
    return (
        ViewSpec("overview", origin=(2.3, -0.9, 2.15), target=(1.29, 3.9, 0.58), fov_x_deg=36.0),
        ViewSpec(
            "closeup", origin=(0.402, 3.375, 0.19), target=(0.306, 3.492, 0.0), fov_x_deg=33.5
        ),
        ViewSpec("macro", origin=(0.330, 3.425, 0.085), target=(0.302, 3.482, 0.0), fov_x_deg=9.8),
    )


def _walk() -> tuple[ViewSpec, ...]:
    """From `overview` past the front of the objects to their left, then down to `closeup`."""
    overview, closeup, _ = _views()
    return (
        overview,
        replace(overview, origin=(0.4, -1.1, 2.0), target=(1.25, 3.9, 0.6)),
        replace(overview, origin=(-1.5, 0.2, 1.6), target=(1.1, 3.8, 0.5)),
        replace(overview, origin=(-0.6, 1.9, 0.9), target=(0.5, 3.55, 0.25)),
        closeup,
    )


def _turn(degrees: float):
    return rotation((0.0, 0.0, 1.0), math.radians(degrees))


def _room() -> list[Mesh]:
    """Six quads that face the inside of the room: 12 triangles."""
    h, top = _HALF, _HEIGHT
    a, b, c, d = (-h, -h, 0.0), (h, -h, 0.0), (h, h, 0.0), (-h, h, 0.0)
    e, f, g, i = (-h, -h, top), (h, -h, top), (h, h, top), (-h, h, top)
    return [
        quad("floor", [a, b, c, d], _FLOOR),
        quad("ceiling", [e, i, g, f], _CEILING),
        quad("wall_back", [d, c, g, i], _WALL),
        quad("wall_front", [b, a, e, f], _WALL),
        quad("wall_right", [c, b, f, g], _ACCENT_WALL),
        quad("wall_left", [a, d, i, e], _ACCENT_WALL),
    ]
