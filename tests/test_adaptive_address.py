"""Addresses in a light's image against exact rational arithmetic, at every level of a tree."""

from fractions import Fraction
from math import floor

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import unit_frame
from helpers.effort import examples
from helpers.poses import KINDS, Kind, projected, random_pose, surface_points
from hypothesis import given, settings
from hypothesis import strategies as st

from asmjax.buffers import SurfacePoints, anchor
from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.address import (
    BITS,
    DEEPEST_LOG2,
    Address,
    address_of,
    centre_offset,
    index_at,
)

FINEST = 2**22
"""Texels a side at which errors are told."""

FAR_AWAY = 1e4 * np.array([1.0, -2.0, 0.5])
"""The world's origin seen from the scene, scene units; the scene is some 10 units wide."""

COUNT = 32
"""Coordinates per example: one shape, one compilation."""


_address_of = eqx.filter_jit(address_of)


def addressed(points: SurfacePoints, frame: LightFrame):
    receivers = projected(points, frame)
    return receivers, _address_of(points, anchor(points, frame), receivers, frame.perspective)


def fractions(values) -> np.ndarray:
    """The same numbers, exactly."""
    return np.vectorize(lambda x: Fraction(float(x)), otypes=[object])(np.asarray(values))


def place(address: Address) -> np.ndarray:
    """Image coordinates (2, n) that an address stands for, exactly."""
    return (fractions(address.at) + fractions(address.rest)) / 2**BITS


def ref_place(points: SurfacePoints, frame: LightFrame, face) -> np.ndarray:
    """Image coordinates (2, n) of the points as they are stored, exactly."""
    offset = fractions(points.origin) - fractions(frame.origin)
    world = fractions(points.position) + offset[:, None]
    rotation, corner, extent = (
        fractions(table) for table in (frame.rotation, frame.corner, frame.extent)
    )
    result = np.empty((2, world.shape[1]), object)
    for i, k in enumerate(np.asarray(face)):
        x, y, depth = rotation[k] @ world[:, i]
        plane = [x / depth, y / depth] if frame.perspective else [x, y]
        result[:, i] = (np.array(plane) - corner[k]) / extent[k]
    return result


def texels_off(got: np.ndarray, true: np.ndarray) -> np.ndarray:
    """(n,) how many texels of the finest map two exact places lie apart."""
    return (np.abs(got - true) * FINEST).astype(float).max(axis=0)


def posed(seed: int, kind: Kind, shift, dtype) -> tuple[SurfacePoints, LightFrame]:
    pose = random_pose(seed, kind)
    frame = eqx.tree_at(lambda f: f.origin, pose.frame, pose.frame.origin + shift)
    world, origin = pose.world + shift[:, None], pose.camera.origin + shift
    return surface_points(world, pose.normal, origin, dtype), frame


def image_widths(points: SurfacePoints, frame: LightFrame, receivers) -> np.ndarray:
    """(n,) distance of each point from its points' origin, in widths of the image there."""
    extent = frame.extent[np.asarray(receivers.face)].min(axis=1)
    depth = np.asarray(receivers.depth) if frame.perspective else 1.0
    return np.linalg.norm(np.asarray(points.position), axis=0) / (depth * extent)


@pytest.mark.parametrize("shift", [0 * FAR_AWAY, FAR_AWAY], ids=["near", "far"])
@pytest.mark.parametrize("kind", KINDS)
def test_an_address_is_within_a_thousandth_texel_at_2_22(kind, shift, dtype):
    """In both precisions, 20,000 units from the origin too; of the points as they are stored."""
    largest = 0
    for seed in range(4):
        points, frame = posed(seed, kind, shift, dtype.type)
        receivers, address = addressed(points, frame)
        assert np.asarray(receivers.facing).all() and (frame.faces > 1) == (kind == "cube")
        off = texels_off(place(address), ref_place(points, frame, receivers.face))
        # In float64 only the light's offset is rounded: 2^-39 of 20,000 units.
        assert off.max() < (1e-3 if dtype == np.float32 else 1e-4)
        assert address.at.dtype == jnp.int32 and address.rest.dtype == dtype
        assert ((np.asarray(address.rest) >= 0) & (np.asarray(address.rest) < 1)).all()
        largest = max(largest, off.max())
    assert largest > 0, "the oracle is the route itself"


@pytest.mark.parametrize("kind", KINDS)
def test_image_coordinates_in_float32_are_no_address(kind):
    """What the test above would say of `Receivers.uv`: a quarter of a texel and more."""
    points, frame = posed(0, kind, 0 * FAR_AWAY, np.float32)
    receivers, _ = addressed(points, frame)
    off = texels_off(fractions(receivers.uv), ref_place(points, frame, receivers.face))
    assert off.max() > 0.05 and np.median(off) > 0.01


@given(seed=st.integers(0, 2**16), kind=st.sampled_from(KINDS), place_of=st.integers(0, 2**20))
@settings(max_examples=examples(25, 1_000))
def test_any_pose_anywhere_has_exact_addresses(seed, kind, place_of):
    shift = np.random.default_rng(place_of).normal(size=3) * 10.0 ** (place_of % 5)
    points, frame = posed(seed, kind, shift, np.float32)
    receivers, address = addressed(points, frame)
    off = texels_off(place(address), ref_place(points, frame, receivers.face))
    # The anchor has 48 bits: in an image so narrow that the eye is 10^5 widths away, some are lost.
    assert (off < np.maximum(1e-3, 2.0**-24 * image_widths(points, frame, receivers))).all()


def address_in_unit(uv: np.ndarray, perspective: bool, depth: float = 2.0) -> Address:
    """The address of points whose image coordinates are exactly `uv` (2, n)."""
    scale = uv.dtype.type(depth if perspective else 1.0)
    position = np.stack([*(uv * scale), np.full(uv.shape[1], depth, uv.dtype)])
    normal = np.zeros_like(position)
    normal[2] = -1
    points = SurfacePoints(
        position=jnp.asarray(position),
        normal=jnp.asarray(normal),
        prim=jnp.zeros(uv.shape[1], jnp.int32),
        valid=jnp.ones(uv.shape[1], bool),
        origin=np.zeros(3),
    )
    return addressed(points, unit_frame(perspective))[1]


def borders(dtype, log2: int, cell: int) -> list[float]:
    """The border below cell `cell` of a 2**log2 grid, and its neighbours in `dtype`, in [0, 1)."""
    border = np.ldexp(dtype.type(cell % (1 << log2)), -log2)
    one = dtype.type(1)
    near = [border, np.nextafter(border, one), np.nextafter(border, -one)]
    return [float(x) for x in near if x == 0 or np.finfo(dtype).tiny < x < 1]


def check_unit(values, log2: int, dtype, perspective: bool) -> None:
    """Address, index and offset of coordinates that are known exactly, against fractions."""
    filled = (values * COUNT)[:COUNT]
    uv = np.array([filled, filled[::-1]], dtype)
    address = address_in_unit(uv, perspective)
    exact = fractions(uv)
    np.testing.assert_array_equal(
        address.at, np.vectorize(lambda x: floor(x * 2**BITS), otypes=[np.int64])(exact)
    )
    index = index_at(address.at, log2)
    np.testing.assert_array_equal(
        index, np.vectorize(lambda x: floor(x * 2**log2), otypes=[np.int64])(exact)
    )
    check_offset(address, index, log2)


def check_offset(address: Address, index, log2: int) -> None:
    """Each of the two steps of `centre_offset` rounds once."""
    offset = centre_offset(address, index, log2)
    assert offset.dtype == address.rest.dtype
    true = (fractions(index) + Fraction(1, 2)) / 2**log2 - place(address)
    lost = np.abs(fractions(offset) - true)
    eps = Fraction(float(np.finfo(offset.dtype).eps))
    assert (lost <= eps * np.abs(true)).all()
    if (index == index_at(address.at, log2)).all():
        assert (np.abs(fractions(offset)) <= Fraction(1, 2 ** (log2 + 1))).all()


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("log2", [0, 1, 4, 9, 19, 23, DEEPEST_LOG2])
def test_a_point_on_a_border_belongs_to_one_node(log2, perspective, dtype):
    """On a border, and within one rounding of it: the node that holds it, at every level."""
    last = (1 << log2) - 1
    cells = (0, 1, last // 3, last // 2, last - 1, last, last + 1)
    # last + 1 wraps to 0; the number before 1 is added, the greatest coordinate there is.
    values = [x for cell in cells for x in borders(dtype, log2, max(cell, 0))]
    greatest = float(np.nextafter(dtype.type(1), dtype.type(0)))
    check_unit([*values, greatest], log2, dtype, perspective)
    check_unit([greatest, 0.0, 2.0**-40], log2, dtype, perspective)


@given(
    values=st.lists(
        st.floats(0, 1, exclude_max=True, width=32, allow_subnormal=False),
        min_size=1,
        max_size=COUNT,
    ),
    log2=st.integers(0, DEEPEST_LOG2),
    cell=st.integers(0, 2**DEEPEST_LOG2 - 1),
    perspective=st.booleans(),
)
def test_any_coordinate_at_any_level(values, log2, cell, perspective):
    float32 = np.dtype(np.float32)
    check_unit([*borders(float32, log2, cell), *values], log2, float32, perspective)


@given(
    at=st.lists(st.integers(0, 2**BITS - 1), min_size=2, max_size=2),
    rest=st.floats(0, 1, exclude_max=True, width=32),
    log2=st.integers(0, DEEPEST_LOG2),
    step=st.lists(st.integers(-1, 1), min_size=2, max_size=2),
)
def test_offset_to_a_texel_or_its_neighbour_is_exact(at, rest, log2, step):
    """Beyond the image too: the guard band of a page on its border lies there."""
    address = Address(*jnp.array(at, jnp.int32)[:, None], *jnp.full((2, 1), rest, jnp.float32))
    index = index_at(address.at, log2) + jnp.array(step, jnp.int32)[:, None]
    check_offset(address, index, log2)


@given(
    at=st.integers(0, 2**BITS - 1),
    levels=st.lists(st.integers(0, DEEPEST_LOG2), min_size=2, max_size=2),
)
def test_levels_nest(at, levels):
    """The texel of a coarse level is the one that holds the texel of a fine level."""
    coarse, fine = sorted(levels)
    place = jnp.array([at], jnp.int32)
    assert int(index_at(place, fine)[0]) >> (fine - coarse) == int(index_at(place, coarse)[0])


def test_receivers_that_the_light_does_not_face_are_in_the_middle(dtype):
    """Behind the light, at it, beside its image, and not valid: nothing is NaN or out of range."""
    position = np.array([[0.2, 0.0, 9.0, 0.2], [0.3, 0.0, -9.0, 0.3], [-1.0, 0.0, 1.0, 1.0]], dtype)
    normal = np.zeros_like(position)
    normal[2] = -1
    points = SurfacePoints(
        position=jnp.asarray(position),
        normal=jnp.asarray(normal),
        prim=jnp.zeros(4, jnp.int32),
        valid=jnp.array([True, True, True, False]),
        origin=np.zeros(3),
    )
    for perspective in (False, True):
        receivers, address = addressed(points, unit_frame(perspective))
        assert not np.asarray(receivers.facing).any()
        assert (np.asarray(address.at) == 1 << (BITS - 1)).all()
        assert not np.asarray(address.rest).any()


def test_rounding_never_leaves_the_image(dtype):
    """`project` may find a point inside that lies a rounding outside: it is served by the last
    texel, with nothing left over."""
    uv = np.array([[1.0, -1e-12, 0.5], [1 + 1e-6, 0.5, -1e-6]], dtype)
    position = jnp.asarray(np.stack([*uv, np.ones(3, dtype)]))
    points = SurfacePoints(
        position, 0 * position, jnp.zeros(3, jnp.int32), jnp.ones(3, bool), np.zeros(3)
    )
    frame = unit_frame(True)
    receivers = projected(points, frame)
    held = eqx.tree_at(lambda r: r.facing, receivers, jnp.ones(3, bool))
    address = _address_of(points, anchor(points, frame), held, True)
    last, middle = 2**BITS - 1, 2 ** (BITS - 1)
    np.testing.assert_array_equal(address.at, [[last, 0, middle], [last, middle, 0]])
    outside = np.array([[True, True, False], [True, False, True]])
    assert not np.asarray(address.rest)[outside].any()


@pytest.mark.parametrize("kind", KINDS)
def test_jit_with_frame_and_origin_as_arguments_works(kind):
    """Inside a transformation of the caller's, in the precision at hand: float32 as it is."""
    points, frame = posed(1, kind, 0 * FAR_AWAY, np.float32)
    receivers, address = addressed(points, frame)

    @jax.jit
    def inside(position, origin):
        moved = eqx.tree_at(lambda p: (p.position, p.origin), points, (position, origin))
        return address_of(moved, anchor(moved, frame), receivers, frame.perspective)

    traced = inside(points.position, jnp.asarray(points.origin, jnp.float32))
    off = texels_off(place(traced), place(address)) / image_widths(points, frame, receivers)
    assert off.max() < 2
