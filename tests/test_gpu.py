"""Kernels from stored buffers: the same answers from the file, on the CPU and on a GPU."""

import jax
import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from numpy.testing import assert_allclose, assert_array_equal

from asmjax.errors import UseError
from asmjax.experiment.devices import (
    KERNELS,
    available_devices,
    device_name,
    footprints,
    kernel_times,
    visibility,
)
from asmjax.experiment.stored_view import (
    Device,
    StoredView,
    load_view,
    on_device,
    save_view,
    stored_view,
)
from asmjax.shadow import AdaptiveShadowMap, CostModel

CASES = {"perspective": "a1_square", "parallel": "a6_sphere_sun"}


@pytest.fixture(scope="module", params=CASES)
def kept(request, tmp_path_factory):
    """A view and its adaptive map, made on the CPU without a renderer and read back from a file;
    and what the algorithm itself answers."""
    case = analytic_case(CASES[request.param], 96)
    algorithm = AdaptiveShadowMap(memory_bytes=2**20, cost_model=CostModel(1e-8, 1e-4, 0.0))
    state = algorithm.build(case.eye, case.frame, case.rays)
    path = tmp_path_factory.mktemp("view") / "view.npz"
    save_view(path, stored_view(algorithm, state, case.eye))
    return load_view(path), np.asarray(algorithm.visibility(state, case.eye.points))


def test_a_stored_view_answers_as_the_map_did(kept):
    view, expected = kept
    found = visibility(view)
    assert_array_equal(np.asarray(found["lit"]), expected > 0.5)
    assert 0 < expected.mean() < 1 and int(found["level"].max()) > 0


def test_storing_loses_nothing(kept, tmp_path):
    view, _ = kept
    save_view(tmp_path / "again.npz", view)
    again = load_view(tmp_path / "again.npz")
    assert jax.tree.structure(again) == jax.tree.structure(view)
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(view), strict=True):
        assert type(a) is type(b)
        assert_array_equal(np.asarray(a), np.asarray(b))


def test_a_map_of_depths_alone_is_stored_too(tmp_path):
    case = analytic_case("a1_square", 16)
    algorithm = AdaptiveShadowMap(
        memory_bytes=2**19, compare="depth", cost_model=CostModel(1e-8, 1e-4, 0.0)
    )
    state = algorithm.build(case.eye, case.frame, case.rays)
    save_view(tmp_path / "view.npz", stored_view(algorithm, state, case.eye))
    assert load_view(tmp_path / "view.npz").tree.prim is None


def test_files_that_hold_no_view_are_refused(tmp_path):
    path = tmp_path / "view.npz"
    with pytest.raises(UseError, match="holds no stored view"):
        load_view(path)
    path.write_text("no arrays")
    with pytest.raises(UseError, match="save_view"):
        load_view(path)
    np.savez(path, settings=np.array("{}"))
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(UseError, match="holds no stored view"):
        load_view(path)
    np.savez(path, settings=np.array("{}"))
    with pytest.raises(UseError, match="no array points.position"):
        load_view(path)


def test_the_cpu_is_always_there_and_named():
    devices = available_devices()
    assert devices[0].platform == "cpu"
    assert device_name(devices[0]).startswith("CPU: ")
    assert len(devices) == 1 + (jax.default_backend() == "gpu")


def test_times_are_told_per_kernel(kept):
    view, _ = kept
    times = kernel_times(view, available_devices()[0], repeats=3)
    assert [time.kernel for time in times] == list(KERNELS)
    assert all(0 < time.least <= time.median < 10 for time in times)
    assert all(time.pixels == 96 * 96 for time in times)


def agree(view: StoredView, one: Device, other: Device) -> None:
    """Footprints to float32's rounding, and visibilities but for what lies on a tolerance.

    A GPU contracts products and sums, so a depth may differ in its last bit; a receiver whose
    depth equals the texel's to within the bias is decided by that bit.
    """
    views = [on_device(view, device) for device in (one, other)]
    first, second = (footprints(v) for v in views)
    for name, values in first.items():
        assert {d.platform for d in second[name].devices()} == {other.platform}
        assert_allclose(np.asarray(second[name]), np.asarray(values), atol=2e-4, err_msg=name)
    first, second = (visibility(v) for v in views)
    for name, values in first.items():
        differ = np.mean(np.asarray(second[name]) != np.asarray(values))
        assert differ <= 1e-3, f"{name} differs for {differ:.2%} of the points"


def test_the_cpu_agrees_with_itself(kept):
    cpu = available_devices()[0]
    agree(kept[0], cpu, cpu)


@pytest.mark.gpu
def test_a_gpu_agrees_with_the_cpu(kept):
    agree(kept[0], jax.devices("cpu")[0], jax.devices("gpu")[0])
