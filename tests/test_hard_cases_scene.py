"""Every algorithm on every scene of the catalogue, beside shadow rays: no silent failure.

`ASMJAX_TEST_HARD=1` asks for all algorithms, all severities, both precisions and ten times as many
pixels; the quick run leaves out those whose siblings run the same code, and `tuned`, which takes as
long as all others to compile.
"""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.analytic_cases import kept_arrays
from helpers.effort import HARD, LEFT_OUT
from helpers.hard_oracles import ref_dark
from helpers.poses import projected

from asmjax.hard_cases import CASES, SIDE, Setup, families_of, measure
from asmjax.hard_cases.explain import explained
from asmjax.hard_cases.judge import judged_soft
from asmjax.hard_cases.lights import SHAPES, SUN, VIEW
from asmjax.hard_cases.measure import SOFT_TEXELS, TEXELS, _verdict, algorithm_for
from asmjax.shadow import FILTERS, MAPS, SOFT, MomentShadowMap, Status
from asmjax.shadow.soft import PCSSShadowMap

SCENES = [case for case in CASES.values() if case.is_scene]
HARD_LIGHTS = [case for case in SCENES if not case.is_soft]
each_scene = pytest.mark.parametrize("case", SCENES, ids=lambda case: case.name)
FAMILIES = tuple(family for family in MAPS if HARD or family not in LEFT_OUT)
each_family = pytest.mark.parametrize("family", FAMILIES)

LARGEST = 2.0**42
"""Texels per image side that a map may claim to have: 1e10, by which the longest range magnifies,
times 128 and a little."""


def _scene(case, severity, side=SIDE):
    setup = case.build(severity)
    assert isinstance(setup, Setup)
    return setup.traced(side)


def _asked(case) -> tuple[str, ...]:
    return tuple(family for family in families_of(case) if HARD or family not in LEFT_OUT)


@each_scene
def test_no_algorithm_fails_in_silence(case):
    """Right beyond a texel of an edge up to where the case says so, and from there on announced."""
    if HARD:
        # An odd multiple: what is centred on a pixel stays so. In all severities, both precisions
        # and every algorithm.
        records = measure(case, side=3 * SIDE)
    else:
        records = measure(
            case, severities=case.few[1:], precisions=("float32",), algorithms=_asked(case)
        )
    for record in records:
        allowed = {"stable"}
        if case.fails_from is not None and record.severity >= case.fails_from:
            allowed = {"stable", "announced"}
        assert record.verdict in allowed, record
    assert case.fails_from is None or any(record.verdict == "announced" for record in records)
    assert {record.algorithm for record in records} == set(_asked(case))


@pytest.mark.parametrize("case", HARD_LIGHTS, ids=lambda case: case.name)
def test_truth_of_scenes(case):
    """Shadow rays, and segments that cross shapes by another computation."""
    scene = _scene(case, case.severities[0], side=16)
    dark = ref_dark(scene)
    differ = scene.judged & (dark != (scene.expected == 0))
    assert differ.sum() <= 1


HELD = {
    "light against the view: duelling frusta": 90.0,
    "light at the eye": 1e12,
    "lamp with a wide field of view": 179.0,
    "large range of depths": 1e10,
    "one depth only": 1e8,
    "few pixels, one, and none": 1e9,
    "nothing that the light reaches": 3.0,
}
"""Severities at which states are looked into."""


@pytest.mark.parametrize("name", HELD)
@each_family
def test_what_an_algorithm_says_of_itself_is_sound(family, name):
    """Nothing is NaN; density is 0 exactly where nothing is lit; costs are those of its arrays."""
    scene = _scene(CASES[name], HELD[name])
    algorithm = algorithm_for(family, scene.frame.faces)
    points = scene.eye.points
    state = algorithm.build(scene.eye, scene.frame, scene.rays)
    for array in kept_arrays(state):
        assert not np.isnan(np.asarray(array)).any()
    density = np.asarray(algorithm.density(state, points), np.float64)
    assert np.isfinite(density).all() and np.abs(density).max() < LARGEST
    facing = np.asarray(projected(points, scene.frame).facing)
    assert (np.abs(np.linalg.det(np.moveaxis(density, -1, 0))) > 0).tolist() == facing.tolist()
    cost = algorithm.cost(state)
    assert cost.bytes == sum(array.nbytes for array in kept_arrays(state))
    assert 0 < cost.texels <= TEXELS and 0 < cost.rays
    assert 1 <= algorithm.effective_resolution(state) < LARGEST
    assert algorithm.status(state).value


def test_the_scenes_are_what_they_are_named():
    for name, sign in (
        ("light along the view", 1),
        ("light against the view: duelling frusta", -1),
    ):
        scene = _scene(CASES[name], 90.0)
        forward = scene.eye.camera.rotation[2]
        assert forward @ scene.frame.rotation[0, 2] == pytest.approx(sign, abs=1e-12)
    eye = _scene(CASES["light at the eye"], 1e12)
    np.testing.assert_array_equal(eye.expected, eye.judged)
    assert np.ptp(_scene(CASES["one depth only"], 1e16).eye.depth) < 1e-12
    seen = [_scene(CASES["few pixels, one, and none"], s).judged.sum() for s in (1.0, 10.0, 1e9)]
    assert seen[0] > 100 and seen[1:] == [1, 0]
    assert not _scene(CASES["nothing that the light reaches"], 3.0).expected.any()
    wide = [_scene(CASES["lamp with a wide field of view"], s).frame.faces for s in (122.0, 150.0)]
    assert wide == [1, 5]
    depth = _scene(CASES["large range of depths"], 1e8).eye.depth
    assert depth.max() == pytest.approx(1e8 * depth.min())


def test_a_leak_is_found():
    """All pixels lit: those in shadow further than a texel from its edge are silently wrong."""
    scene = Setup(SHAPES, VIEW, SUN).traced(SIDE)
    algorithm = algorithm_for("uniform", 1)
    state = algorithm.build(scene.eye, scene.frame, scene.rays)
    why = explained(scene, algorithm, state, np.ones(SIDE**2))
    dark = scene.judged & (scene.expected == 0)
    assert (why.wrong == dark).all() and why.edge.any()
    # The side of the ball that turns away from the light is dark without a texel's help.
    assert why.silent.sum() > 0.5 * dark.sum() and not (why.silent & why.edge).any()
    acne = np.asarray(algorithm.visibility(state, scene.eye.points)).copy()
    middle = np.flatnonzero(scene.judged & (scene.expected == 1) & ~why.edge)[::7]
    acne[middle] = 0
    why = explained(scene, algorithm, state, acne)
    assert why.silent.sum() > 0.5 * middle.size and why.stated.sum() == 0


def test_a_refused_scene_is_announced():
    """Where float64 has no digits left for the eye and what it sees."""
    case = CASES["scene far from the origin"]
    records = measure(case, severities=(1e14,), algorithms=("uniform",), precisions=("float32",))
    assert [record.verdict for record in records] == ["announced"]
    assert "move the scene to the origin" in records[0].how and math.isnan(records[0].error)


def test_truth_does_not_depend_on_jax_precision(dtype):
    scene = _scene(CASES["light parallel to the receiver"], 89.9)
    assert scene.eye.points.position.dtype == dtype
    assert 10 < (scene.expected[scene.judged] == 0).sum() < 100
    assert jnp.zeros(()).dtype == dtype


class _Lit(PCSSShadowMap):
    """It finds no shadow, and says of itself what it is told to."""

    says: Status = Status.COMPLETE

    def visibility(self, state, points):
        return jnp.ones(points.valid.shape)

    def status(self, state) -> Status:
        return self.says


def test_a_soft_shadow_that_is_missing_is_silent_unless_it_is_announced():
    case = CASES["soft shadows in tiny scenes"]
    scene = _scene(case, 1.0)
    for says, verdict in ((Status.COMPLETE, "silent"), (Status.MARGIN_LIMIT, "announced")):
        lit = _Lit(resolution=128, says=says)
        found = judged_soft(scene, lit, lit.build(scene.eye, scene.frame, scene.rays))
        assert _verdict(found.error, found.silent, case.bound.float32, found.how)[0] == verdict
        assert found.error == pytest.approx(1 - scene.expected[scene.judged].mean())
    assert found.wrong == pytest.approx((scene.expected[scene.judged] <= 0.5).mean())


SOFT_CASES = [case for case in SCENES if case.is_soft]
each_soft = pytest.mark.parametrize("case", SOFT_CASES, ids=lambda case: case.name)

LIT_ALL_OVER = ("acne below a light with a size", "light that crosses the receiver's horizon")
"""Cases without a caster: what is asked is that nothing is dark."""


@each_soft
def test_no_soft_case_is_passed_by_all_or_nothing(case):
    """Where it has to be stable, a map that finds no shadow is beyond its bound, and so is one that
    finds nothing else."""
    for severity in case.severities:
        if case.fails_from is not None and severity >= case.fails_from:
            break
        scene = _scene(case, severity)
        lit = float(scene.expected[scene.judged].mean())
        assert lit > case.bound.float32
        assert case.name in LIT_ALL_OVER or 1 - lit > case.bound.float32, severity


def test_the_range_of_depths_is_as_long_as_it_is_named():
    case = CASES["moments of a long range of depths"]
    scene = _scene(case, case.severities[-1])
    algorithm = algorithm_for("moment", 1, SOFT_TEXELS)
    state = algorithm.build(scene.eye, scene.frame, scene.rays)
    assert isinstance(algorithm, MomentShadowMap)
    assert float(state.sums.scale[1]) > 0.4 * case.severities[-1]


@pytest.mark.parametrize("name, severity", [
    ("light as large as its distance", 3.0), ("light with a size and a wide field of view", 150.0),
])  # fmt: skip
@pytest.mark.parametrize("family", (*SOFT, *FILTERS))
def test_what_a_soft_map_says_of_itself_is_sound(family, name, severity):
    scene = _scene(CASES[name], severity)
    algorithm = algorithm_for(family, scene.frame.faces)
    points = scene.eye.points
    state = algorithm.build(scene.eye, scene.frame, scene.rays)
    density = np.asarray(algorithm.density(state, points), np.float64)
    assert np.isfinite(density).all() and np.abs(density).max() < LARGEST
    facing = np.asarray(projected(points, scene.frame).facing)
    assert (np.abs(np.linalg.det(np.moveaxis(density, -1, 0))) > 0).tolist() == facing.tolist()
    cost = algorithm.cost(state)
    assert 0 < cost.texels <= 4 * TEXELS and 0 < cost.bytes and 0 < cost.rays
    assert 1 <= algorithm.effective_resolution(state) < LARGEST
