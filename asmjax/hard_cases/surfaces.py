"""Scene cases: surfaces that are hard on the shadow test, and on ids of casters and receivers."""

from dataclasses import replace

import numpy as np

from asmjax.hard_cases.case import HardCase
from asmjax.hard_cases.lights import DISK, GROUND, RAYS, SHAPES, SUN, TEST, VIEW, WRONG, sun
from asmjax.hard_cases.scene import Setup
from asmjax.scene.spec import Disk, LightSpec, Mesh, Rectangle, Sphere

FAR = Disk("far", (0.0, 14.0, 10.0), (0.0, 0.0, 1.0), 0.1)
"""Out of sight, towards the light: depths count from there, and are ten units or more."""

DOWN = replace(
    VIEW, origin=(0.0, 0.0, 8.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov_x_deg=60.0
)


def _tilted(severity: float) -> Setup:
    """A plane alone, seen squarely, lit at that angle."""
    return Setup((GROUND, FAR), DOWN, falling(severity))


def falling(degrees: float) -> LightSpec:
    """Parallel light that comes so far from straight down."""
    angle = np.radians(degrees)
    return sun(0.8 * np.sin(angle), 0.6 * np.sin(angle), -np.cos(angle))


def thin_gap(severity: float) -> Setup:
    """A cover over half of the ground, `1 / severity` above it, cut open for the eye."""
    gap = 1 / severity
    cover = Rectangle("cover", (-2.5, 0.3, gap), (2.6, 0.0, 0.0), (0.0, 5.0, 0.0))
    return Setup((GROUND, cover, FAR), replace(DOWN, near=8 - 0.5 * gap), SUN)


def _slivers(severity: float) -> Setup:
    """A ground of strips with ever thinner ones between them, and triangles without area."""
    thin = 2.0 / severity
    edges = [-10.0]
    for middle in (-1.0, -0.2, 0.4, 1.1):
        edges += [middle, middle + thin]
    x = np.array([*edges, 10.0])
    low, high = (np.stack([x, np.full(x.size, y), np.zeros(x.size)]) for y in (-10.0, 10.0))
    k, n = np.arange(x.size - 1), x.size
    faces = np.concatenate(
        [np.stack([k, k + 1, n + k + 1]), np.stack([k, n + k + 1, n + k]),
         np.stack([k, k, n + k]), np.stack([k, k + 1, k + 1])], axis=1
    ).astype(np.int32)  # fmt: skip
    ground = Mesh("ground", np.concatenate([low, high], axis=1), faces)
    return Setup((ground, DISK), VIEW, SUN)


def _square(name: str, height: float, flipped: bool) -> Mesh:
    """The ground as two triangles, along one diagonal or the other."""
    corners = np.array([[-10.0, 10, 10, -10], [-10, -10, 10, 10], [height] * 4])
    faces = [[0, 1, 3], [1, 2, 3]] if flipped else [[0, 1, 2], [0, 2, 3]]
    return Mesh(name, corners, np.array(faces, np.int32).T)


def _duplicates(severity: float) -> Setup:
    """The ground twice, cut along either diagonal, the second one `1 / severity` below."""
    grounds = _square("ground", 0.0, False), _square("copy", -1 / severity, True)
    return Setup((*grounds, DISK), VIEW, SUN)


def _crossing(severity: float) -> Setup:
    """A second plane through the ground, `severity` degrees from upright: both shade each other."""
    angle = np.radians(90 - severity)
    half = (float(np.cos(angle)), 0.0, float(np.sin(angle)))
    fin = Rectangle("fin", (0.2, 0.5, 0.0), half, (0.0, 1.0, 0.0))
    return Setup((GROUND, fin), VIEW, SUN)


def _inside(severity: float) -> Setup:
    """A shell around everything keeps all parallel light out."""
    return Setup((*SHAPES, Sphere("shell", (0.0, 0.0, 1.0), severity)), VIEW, SUN)


def _small(severity: float) -> Setup:
    """A field of disks so small."""
    place = np.linspace(-0.8, 1.2, 5)
    disks = tuple(
        Disk(f"disk_{i}_{j}", (float(x), float(y), 0.5), (0.0, 0.0, 1.0), 1 / severity)
        for i, x in enumerate(place)
        for j, y in enumerate(place)
    )
    return Setup((GROUND, *disks), VIEW, SUN)


CASES = (
    HardCase(
        "acne on a tilted plane", (19,), "surfaces",
        "Within a texel the depth of a plane changes by tan psi texels: it shades itself.",
        TEST, RAYS, "incidence of the light, degrees",
        (0.0, 45.0, 80.0, 89.9, 89.99, 89.999), WRONG, _tilted,
        89.993, "marked: `Receivers.secant` at its most",
    ),
    HardCase(
        "light through a cover close to its receiver", (19,), "surfaces",
        "A bias against acne lets light through casters nearer to the receiver than it.",
        f"{TEST}: sec psi (5e-6 z + 0.2 texel), vanishing as texels do", RAYS,
        "1 / gap between caster and receiver, scene units",
        (2.0, 10.0, 1e2, 1e4, 1e6), WRONG, thin_gap,
        100.0, "the stated bias: `bias_distance`, in scene units",
    ),
    HardCase(
        "slivers and triangles without area", (20,), "surfaces",
        "Normals are 0/0; an id test meets a triangle that no texel's ray does.",
        "a face without area has no normal and no hit; ids or depth", RAYS,
        "length / width of the slivers", (1e1, 1e3, 1e6, 1e9, 1e12), WRONG, _slivers,
    ),
    HardCase(
        "coplanar and duplicate faces", (21,), "surfaces",
        "The map names another face than the eye sees, at the same depth.",
        f"{TEST}: lit by id or by depth, ties lit", RAYS,
        "1 / distance of the two faces, scene units", (1e2, 1e4, 1e6, 1e8, 1e16), WRONG,
        _duplicates,
    ),
    HardCase(
        "surfaces that cut each other", (22,), "surfaces",
        "Caster and receiver meet: near the cut no bias is small enough.",
        f"{TEST}: the seen side must face the light, and a bias in texels", RAYS,
        "angle of the two, degrees from upright", (0.0, 60.0, 80.0, 89.0, 89.9), WRONG, _crossing,
    ),
    HardCase(
        "inside a closed surface", (22,), "surfaces",
        "The inside of a shell has the id of its outside, which the map sees.",
        f"{TEST}: only flat primitives have ids, and only seen sides are lit", RAYS,
        "radius of the shell, scene units", (12.0, 1e2, 1e3, 1e4), WRONG, _inside,
    ),
    HardCase(
        "casters smaller than texels", (23,), "surfaces",
        "A caster between the texels' rays has no shadow, or one of a whole texel.",
        "docs/theory.md, \"The adaptive map\": finer texels; no map finds what no ray met", RAYS,
        "1 / radius of the casters, scene units", (3.0, 10.0, 30.0, 100.0, 1e3), WRONG, _small,
    ),
)  # fmt: skip
"""Of the theme "surfaces"."""
