"""The test of one receiver against one texel: no acne, a bounded bias, and the predicted error."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.effort import effort
from helpers.planes import Plane, square_light, surface_points, tilted, vector
from helpers.poses import projected
from helpers.slow_tree import receivers_at

from asmjax.errors import UseError
from asmjax.scene.analytic_rays import AnalyticRays
from asmjax.scene.spec import Rectangle
from asmjax.shadow import UniformShadowMap
from asmjax.shadow.comparison import (
    BIAS,
    CURVATURE_BIAS,
    Compare,
    check_test,
    lit_by_texel,
    pack_prim,
    stored,
    texel_bytes,
)

COMPARISONS: tuple[Compare, ...] = ("depth", "id", "both")

AXIS = np.array([0.3, -0.5, -0.8])
"""The light's direction: along no axis, so that every coordinate is rounded."""


def visibility(shapes, frame, points, resolution, compare: Compare = "depth"):
    """What a flat map of analytic shapes says about points, and the points in its image."""
    algorithm = UniformShadowMap(resolution, compare=compare)
    # A flat map asks nothing of the view.
    eye = analytic_case("a4_disc_light", 8).eye
    state = algorithm.build(eye, frame, AnalyticRays(shapes))
    lit = np.asarray(algorithm.visibility(state, points))
    return lit, state, projected(points, frame)


@pytest.mark.parametrize("perspective", [True, False], ids=["perspective", "parallel"])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 80.0, 89.0, 89.9])
def test_no_acne_on_a_tilted_plane(degrees, perspective):
    """Nothing shades a single plane: no float32 point may be dark, at whatever tilt and resolution.

    The depth of the texel's centre differs from the receiver's own by far more than the bias (the
    comparison that ignores the plane would darken half of the points of a tilted one).
    """
    uv = np.random.default_rng(int(degrees)).random((2, 20_000))
    frame = square_light(AXIS, 2.0 if perspective else 8.0, 5.0, perspective=perspective)
    plane = tilted(degrees, AXIS, roll=0.7)
    points = surface_points(plane.seen(frame, uv)[:, :4096], plane.normal)
    for resolution in (16, 128, 1024):
        lit, state, seen = visibility([plane.shape()], frame, points, resolution)
        facing = np.asarray(seen.facing)
        assert facing.all() and points.position.dtype == jnp.float32
        assert (lit[facing] == 1).all()
        if degrees >= 30:
            column, row = (np.asarray(seen.uv) * resolution).astype(int)
            depth = np.asarray(state.depth).reshape(resolution, -1)[row, column]
            naive = depth >= np.asarray(seen.depth) * (1 - BIAS)
            assert 0.2 < naive[facing].mean() < 0.8


@pytest.mark.parametrize("degrees", [0.0, 45.0, 75.0])
@pytest.mark.parametrize("resolution", [64, 512])
@pytest.mark.parametrize("perspective", [True, False], ids=["perspective", "parallel"])
def test_casters_above_the_documented_bias_are_seen(degrees, resolution, perspective):
    """Peter-panning is bounded: a plate parallel to the receiver is seen from a distance along the
    normal of `bias` depths and `CURVATURE_BIAS` texel widths on, and not before.

    Parallel rays: to 1 %. A cone of 11 degrees: within 5 % + 2 texels of 1/resolution, for the
    angle between the receiver's ray and the texel's.
    """
    extent = 0.2 if perspective else 1.0
    frame = square_light(AXIS, extent, 5.0, perspective=perspective)
    plane = tilted(degrees, AXIS, roll=0.7)
    uv = 0.5 + 0.2 * np.random.default_rng(1).uniform(-1, 1, (2, 2000))
    points = surface_points(plane.seen(frame, uv), plane.normal)
    seen = projected(points, frame)
    assert np.asarray(seen.facing).all()
    bound = BIAS * np.asarray(seen.depth) + CURVATURE_BIAS / resolution * np.asarray(seen.reach)
    slack = (
        0.01 if not perspective else 0.05 + 2 * extent / resolution * np.tan(np.radians(degrees))
    )
    # Far larger than the window of receivers, and still inside the light's image: the plate is
    # seen by every texel that a receiver asks.
    above, below = bound.max() * (1 + slack), bound.min() * (1 - slack)
    for lift, expected in ((above, 0.0), (below, 1.0)):
        shapes = [plane.shape(), plane.shape("plate", lift=lift, half=1e3)]
        lit, _, _ = visibility(shapes, frame, points, resolution)
        assert (lit == expected).all(), (lift, lit.mean())


def test_back_sides_are_dark_whatever_the_id_says():
    """The same primitive is what the texel holds, and yet its back side sees no light."""
    frame = square_light(AXIS, 1.0, 5.0, perspective=False)
    plane = tilted(30.0, AXIS, roll=0.2)
    world = plane.seen(frame, np.random.default_rng(0).random((2, 500)))
    for compare in COMPARISONS:
        front, _, _ = visibility(
            [plane.shape()], frame, surface_points(world, plane.normal), 64, compare
        )
        back, _, _ = visibility(
            [plane.shape()], frame, surface_points(world, -plane.normal), 64, compare
        )
        assert (front == 1).all() and (back == 0).all()


def decide(map_depth, map_prim, prim=7, facing=True, compare_depth=1.0):
    """One receiver at depth 1, without slope, against one texel of size 1e-3 over its point."""
    receivers = receivers_at(np.zeros(1), np.full((2, 1), 0.5, np.float32))
    receivers = type(receivers)(
        **{name: getattr(receivers, name) for name in ("face", "uv", "slope", "secant", "reach")},
        depth=jnp.full(1, compare_depth, jnp.float32),
        prim=jnp.full(1, prim, jnp.int32),
        facing=jnp.full(1, facing),
    )
    return bool(
        lit_by_texel(
            receivers,
            jnp.zeros((2, 1), jnp.float32),
            1e-3,
            None if map_depth is None else jnp.full(1, map_depth, jnp.float32),
            None if map_prim is None else pack_prim(jnp.full(1, map_prim, jnp.int32)),
            bias=BIAS,
            perspective=True,
        )[0]
    )


@pytest.mark.parametrize(
    ("map_depth", "map_prim", "lit"),
    [
        (2.0, None, True),
        (0.5, None, False),
        (np.inf, None, True),
        (None, 7, True),
        (None, 8, False),
        (0.5, 7, True),
        (2.0, 8, True),
        (0.5, 8, False),
        (np.inf, -1, True),
        (None, -1, False),
    ],
)
def test_lit_if_either_comparison_says_so(map_depth, map_prim, lit):
    """Depth: not farther than the texel's surface. Id: the same primitive. A ray that hits nothing
    lets light through. Never where the receiver does not face the light."""
    assert decide(map_depth, map_prim) is lit
    assert decide(map_depth, map_prim, facing=False) is False


def test_bias_is_what_is_documented():
    """bias * depth + CURVATURE_BIAS * texel * reach, along the normal (here: along the ray)."""
    for depth in (1.0, 100.0):
        bound = BIAS * depth + CURVATURE_BIAS * 1e-3
        assert decide(depth - 0.98 * bound, None, compare_depth=depth)
        assert not decide(depth - 1.02 * bound, None, compare_depth=depth)


def test_ids_of_up_to_65536_primitives_differ():
    """They are kept as they are; and "nothing" is the last."""
    packed = np.asarray(pack_prim(jnp.arange(-1, 2**16 - 1)))
    assert packed.dtype == np.uint16 and packed.tolist() == [2**16 - 1, *range(2**16 - 1)]
    assert decide(0.5, 7) and not decide(0.5, 8)
    # Receivers without an id of their own (curved primitives) are lit by depth alone.
    assert not decide(0.5, -1, prim=-1) and decide(2.0, -1, prim=-1)


def test_ids_beyond_that_are_alike_by_chance_alone():
    """Each run of 65,536 keeps its order, from a start of its own: one id of each run is alike, and
    it is another one each time. Cut to 16 bits, all those a multiple of 65,536 further on were."""
    assert not decide(0.5, 7 + 2**16) and not decide(0.5, 7 + 2**20)
    runs = np.r_[1:200, 2**15 - 1]
    starts = np.asarray(pack_prim(jnp.asarray(2**16 * runs, jnp.int32)))
    assert np.unique(starts).size == runs.size and starts.all()
    for run in runs[:: effort(40, 1)].tolist():
        packed = np.asarray(pack_prim(2**16 * run + jnp.arange(2**16)))
        assert np.unique(packed).size == 2**16 and (np.diff(packed) == 1).sum() >= 2**16 - 2
        alike = 2**16 * run + int(np.flatnonzero(packed == 7)[0])
        assert decide(0.5, alike)


def test_what_is_stored_and_its_bytes():
    depth, prim = jnp.ones(3, jnp.float32), jnp.arange(3)
    for compare in COMPARISONS:
        kept = [a for a in stored(compare, depth, prim) if a is not None]
        assert sum(a.nbytes for a in kept) == 3 * texel_bytes(compare)
    assert stored("depth", depth, prim)[1] is None and stored("id", depth, prim)[0] is None
    with pytest.raises(UseError, match="known: both, depth, id"):
        check_test("colour", 0.0)


def half_plane(normal, anchor, height) -> Rectangle:
    """Where normal . (x - anchor) <= 0, both (2,), on the plane z = `height`, far out."""
    far = 1e3
    a, b = normal
    centre = anchor - far * normal
    return Rectangle(
        "caster", vector([*centre, height]), vector([a * far, b * far, 0]),
        vector([-b * far, a * far, 0]),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(effort(2, 20)))
def test_measured_displacement_is_the_predicted_one(seed):
    """Reference T5. A half-plane's shadow edge under parallel light from a random direction, with
    texels a x b of random size on the receiver: skewed parallelograms. Misclassified area per edge
    length must be E|d| = A / 4 + B^2 / (12 A), with A >= B the lengths of a and b along the edge's
    normal (M4), and the worst case is (A + B) / 2.

    3 %: 20,000 of the 200,000 points are wrong, and the edge crosses some 300 texels.
    """
    rng = np.random.default_rng(seed)
    axis = np.array([*rng.uniform(-0.8, 0.8, 2), -1.0])
    resolution, height = 1024, 3.0
    frame = square_light(axis, 16.0, 30.0, perspective=False)
    stretch = rng.uniform(0.4, 1.0)
    frame = type(frame)(
        **{k: getattr(frame, k) for k in ("origin", "rotation", "corner", "cone_axis")},
        extent=frame.extent * [[1.0, stretch]],
        cos_cutoff=np.asarray(-1.0),
        near=np.asarray(0.0),
        perspective=False,
    )
    # Texel edges a, b on z = 0: where the light's ray through one texel on moves to.
    e_u, e_v, e_w = frame.rotation[0]
    texels = frame.extent[0] / resolution
    edges = np.stack([(e - e_w * e[2] / e_w[2])[:2] * w for e, w in zip((e_u, e_v), texels,
                                                                         strict=True)])  # fmt: skip
    angle = rng.uniform(0, 2 * np.pi)
    normal = np.array([np.cos(angle), np.sin(angle)])
    big, small = np.sort(np.abs(edges @ normal))[::-1]
    predicted = big / 4 + small**2 / (12 * big)
    # The image's centre on z = 0, and the caster's edge above it along the light's rays.
    u_centre = frame.corner[0] + frame.extent[0] / 2
    middle = frame.origin + e_u * u_centre[0] + e_v * u_centre[1]
    middle = middle - e_w * middle[2] / e_w[2]
    anchor = (middle + e_w * height / e_w[2])[:2]
    width, length = 2.2 * (big + small) / 2, 5.0
    across, along = rng.uniform(-0.5, 0.5, (2, 200_000)) * [[width], [length]]
    tangent = np.array([-normal[1], normal[0]])
    flat = middle[:2, None] + normal[:, None] * across + tangent[:, None] * along
    world = np.vstack([flat, np.zeros(across.size)])
    floor = Plane(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    points = surface_points(world, floor.normal)
    lit, _, seen = visibility(
        [floor.shape(), half_plane(normal, anchor, height)], frame, points, resolution
    )
    assert np.asarray(seen.facing).all()
    wrong = lit != (across > 0)
    assert wrong.mean() * width == pytest.approx(predicted, rel=0.03)
    assert np.abs(across[wrong]).max() <= (big + small) / 2 * 1.001
    longest = 1 / np.linalg.svd(np.linalg.inv(edges.T), compute_uv=False)[-1]
    assert predicted <= longest / 4 * (1 + 1e-12)
