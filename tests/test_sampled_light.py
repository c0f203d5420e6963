"""Frames for samples of a light hold what the light's own frame holds, whatever the light."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asmjax.buffers import EyeBuffer, eye_buffer
from asmjax.errors import UseError
from asmjax.geometry import (
    LightFrame,
    disk_light,
    in_domain,
    look_at,
    rectangle_light,
    sphere_light,
    sun_light,
)
from asmjax.scene.lights import light_frame
from asmjax.scene.spec import LightSpec
from asmjax.shadow.soft.sampled_light import NEAREST, sample_frames

COUNT = 60
BOUNDS = np.array([[-4.0, 4.0], [-4.0, 4.0], [-4.0, 4.0]])


def seen(chance: np.random.Generator, towards: np.ndarray | None) -> EyeBuffer:
    """Receivers anywhere in a box, turned to a point or, where there is none, up."""
    world = chance.uniform(-4, 4, (3, COUNT))
    normal = np.repeat([[0.0], [0.0], [1.0]], COUNT, axis=1)
    if towards is not None:
        normal = towards[:, None] - world
    return eye_buffer(
        look_at((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), fov_x_deg=60, width=COUNT,
                height=1),
        world=world,
        normal=normal / np.linalg.norm(normal, axis=0),
        depth=9.0 - world[2],
        prim=np.zeros(COUNT, np.int32),
        shape=np.zeros(COUNT, np.int32),
        albedo=np.ones((3, COUNT), np.float32),
        flat=np.ones(COUNT, bool),
    )  # fmt: skip


def placed(chance: np.random.Generator, shape: str) -> tuple[LightSpec, np.ndarray | None]:
    """A light of any size and turn, in or near the box; a sun from above."""
    if shape == "sun":
        direction = (*chance.uniform(-1, 1, 2).tolist(), -chance.uniform(0.1, 1))
        angle = float(np.radians(chance.uniform(0.1, 30)))
        return LightSpec(
            "sun", "directional", None, direction, area=sun_light(direction, angle)
        ), None
    x, y, z = chance.uniform(-5, 5, 3).tolist()
    axes, _ = np.linalg.qr(chance.normal(size=(3, 3)))
    half_u, half_v = (chance.uniform(0.05, 0.6) * axis for axis in axes[:2])
    if shape == "sphere":
        area = sphere_light((x, y, z), float(np.linalg.norm(half_u)))
    else:
        area = (rectangle_light if shape == "rectangle" else disk_light)((x, y, z), half_u, half_v)
    return LightSpec("lamp", "point", (x, y, z), area=area), np.array([x, y, z])


def depths_of(frame: LightFrame, world: np.ndarray) -> np.ndarray:
    """(n,) of the faces that hold points, the least of them; infinite where none does."""
    found = np.full(world.shape[1], np.inf)
    relative = world - frame.origin[:, None]
    for face in range(frame.faces):
        one = replace(
            frame,
            rotation=frame.rotation[face : face + 1],
            corner=frame.corner[face : face + 1],
            extent=frame.extent[face : face + 1],
        )
        depth = frame.rotation[face, 2] @ relative
        found = np.where(in_domain(one, world), np.minimum(found, depth), found)
    return found


@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
@pytest.mark.parametrize("shape", ["rectangle", "disk", "sphere", "sun"])
def test_samples_hold_what_their_light_holds(shape, seed, samples):
    """All receivers but those nearer than the light is wide, on the light's own face; where it has
    several, all of them, on as many as it takes. Of a sun, all that may shade them stands behind
    where its rays start."""
    chance = np.random.default_rng(seed)
    light, centre = placed(chance, shape)
    eye = seen(chance, centre)
    try:
        frame = light_frame(light, eye, BOUNDS)
    except UseError:
        # A flat light that looks away from everything.
        return
    assert frame.area is not None
    depth = depths_of(frame, eye.world)
    held = np.isfinite(depth)
    if frame.faces == 1:
        held &= depth > NEAREST * frame.area.radius * frame.perspective
    frames = sample_frames(frame, eye, samples)
    assert len(frames) == samples**2
    mean_origin = np.mean([one.origin for one in frames], axis=0)
    if shape in ("rectangle", "disk"):
        np.testing.assert_allclose(mean_origin, frame.origin, atol=1e-9)
    for one in frames:
        assert one.area is None and (one.faces == 1 or frame.faces > 1)
        # What lies behind a flat light is dark to all its samples.
        open_ended = replace(one, cos_cutoff=-1.0)
        assert in_domain(open_ended, eye.world[:, held]).all()
        if shape == "sun":
            ahead, own = one.rotation[0, 2], frame.rotation[0, 2]
            np.testing.assert_allclose(one.rotation[0] @ one.rotation[0].T, np.eye(3), atol=1e-12)
            assert np.linalg.det(one.rotation[0]) == pytest.approx(1.0)
            starts = eye.world - ahead[:, None] * (depth / (own @ ahead))
            assert (ahead @ (starts - one.origin[:, None]) >= -1e-9).all()


def test_a_light_without_a_size_has_one_frame_and_it_is_its_own():
    light = LightSpec("lamp", "point", (0.0, 0.0, 3.0))
    eye = seen(np.random.default_rng(1), np.array([0.0, 0.0, 3.0]))
    frame = light_frame(light, eye, BOUNDS)
    assert sample_frames(frame, eye, 5) == [frame]
    # So it is of the sample in the middle of a flat light, but for what knows of a size.
    sized = light_frame(
        replace(light, area=rectangle_light((0, 0, 3), (0.1, 0, 0), (0, -0.1, 0))), eye, BOUNDS
    )
    middle = sample_frames(sized, eye, 3)[4]
    np.testing.assert_array_equal(middle.extent, sized.extent)
    assert middle.area is None
