"""The time limit of a build or update: kept, told, and made up for by the next ones."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.analytic_cases import analytic_case
from helpers.registry import FAST

from asmjax.buffers import LightRays
from asmjax.shadow import AdaptiveShadowMap, NodeCounts, Status
from asmjax.shadow.adaptive import asm, refiner


def nodes_of(algorithm, state) -> NodeCounts:
    nodes = algorithm.cost(state).nodes
    assert nodes is not None
    return nodes


class Clock:
    """Stands for the module `time`: its seconds pass only while rays are cast."""

    def __init__(self):
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


class ClockedRays(LightRays):
    """Rays that take `factor` times as long as `FAST` says."""

    def __init__(self, inner: LightRays, clock: Clock, factor: float):
        self.inner, self.clock, self.factor = inner, clock, factor

    def closest(self, origins, directions, t_min=0.0):
        return self.inner.closest(origins, directions, t_min)

    def occluded(self, origins, directions, t_max):
        return self.inner.occluded(origins, directions, t_max)

    def light_buffer(self, frame, windows):
        self.clock.now += self.factor * FAST.seconds(windows.texels)
        return self.inner.light_buffer(frame, windows)


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_a_time_limit_is_kept_and_told(factor, monkeypatch):
    """Also where casting takes three times what the cost model says: the limit may only be passed
    by what must be there, the level-0 nodes. More time never makes fewer nodes."""
    case = analytic_case("a4_disc_light", 64)
    whole = AdaptiveShadowMap(memory_bytes=2**19, start_resolution=16, cost_model=FAST)
    ended = []
    # The one level-0 node takes 1.3e-5 seconds or thrice that; all nodes some 4e-4.
    for limit in (1e-6, 1e-4, 3e-4, 1e-2):
        clock = Clock()
        monkeypatch.setattr(asm, "time", clock)
        monkeypatch.setattr(refiner, "time", clock)
        algorithm = replace(whole, time_limit=limit)
        state = algorithm.build(case.eye, case.frame, ClockedRays(case.rays, clock, factor))
        taken = clock.now
        assert taken <= max(limit, factor * FAST.seconds(state.shape.roots * state.shape.side**2))
        ended.append((algorithm.status(state), nodes_of(algorithm, state).held))
    statuses, held = zip(*ended, strict=True)
    assert statuses[:2] == (Status.TIME_LIMIT,) * 2 and statuses[-1] is Status.COMPLETE
    assert list(held) == sorted(held) and held[0] == 1


@pytest.mark.parametrize("limit", [2e-4, 1.0])
def test_moving_casters_keep_the_time_limit(limit, monkeypatch):
    """Touched pages that there is no time for are given up: nothing stale is left."""
    case = analytic_case("a4_disc_light", 64)
    whole = AdaptiveShadowMap(memory_bytes=2**19, start_resolution=16, cost_model=FAST)
    clock = Clock()
    monkeypatch.setattr(asm, "time", clock)
    monkeypatch.setattr(refiner, "time", clock)
    rays = ClockedRays(case.rays, clock, 1.0)
    state = whole.build(case.eye, case.frame, rays)
    before, start = nodes_of(whole, state), clock.now
    everything = np.array([[[-50.0, 50.0]] * 3])
    state = replace(whole, time_limit=limit).update(
        state, case.eye, case.frame, rays, moved=everything
    )
    after = nodes_of(whole, state)
    assert clock.now - start <= limit
    assert after.recast + after.dropped == before.held
    assert (after.dropped == 0) == (limit == 1.0)
    assert after.recast > state.shape.roots


def test_updates_at_rest_finish_what_a_time_limit_cut_short(monkeypatch):
    case = analytic_case("a4_disc_light", 64)
    whole = AdaptiveShadowMap(
        memory_bytes=2**19, start_resolution=16, pixel_share=1, finest_ratio=1.0, cost_model=FAST
    )
    clock = Clock()
    monkeypatch.setattr(asm, "time", clock)
    monkeypatch.setattr(refiner, "time", clock)
    rays = ClockedRays(case.rays, clock, 1.0)
    hasty = replace(whole, time_limit=5e-5)
    state = hasty.build(case.eye, case.frame, rays)
    assert hasty.status(state) is Status.TIME_LIMIT
    for _ in range(40):
        state = hasty.update(state, case.eye, case.frame, rays)
        if hasty.status(state) is Status.COMPLETE:
            break
    expected = whole.build(case.eye, case.frame, case.rays)
    np.testing.assert_array_equal(
        hasty.visibility(state, case.eye.points), whole.visibility(expected, case.eye.points)
    )
