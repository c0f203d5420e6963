"""What tuning works on, made without a renderer: benches of analytic shapes, and made-up evidence
whose samples, crowds and gaps are plain random numbers of possible kinds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from asmjax.experiment.bench import Bench
from asmjax.scene.analytic_scenes import ANALYTIC_SCENES
from asmjax.scene.spec import LightSpec, Shape, ViewSpec
from asmjax.shadow import AdaptiveShadowMap
from asmjax.tuning.correction import no_correction
from asmjax.tuning.evidence import DEEPEST, GAP_STEPS, GAPS, LEAST_SPAN, SPANS, Evidence
from asmjax.tuning.search import Model
from asmjax.tuning.space import Space, space_of
from asmjax.tuning.surrogate import Fit, rules_of
from helpers.registry import FAST
from helpers.traced_cases import traced_case

BASE = AdaptiveShadowMap(memory_bytes=2**22, cost_model=FAST)
"""Settings that boxes are laid about."""

RULES = rules_of(BASE)
"""That its maps go by."""

EXPECTED = Fit(*(np.zeros(()) for _ in Fit._fields))
"""Every number as expected."""


@dataclass
class Known:
    """Shadow rays whose answer is known."""

    visible: np.ndarray
    count: int

    def trace(self) -> np.ndarray:
        return self.visible


def bench_of_shapes(
    shapes: Sequence[Shape], view: ViewSpec, light: LightSpec, name: str = "above"
) -> Bench:
    """A view of shapes known in closed form, with one exact shadow ray a pixel."""
    case = traced_case(shapes, view, light)
    rays = Known(case.expected > 0.5, int(case.judged.sum()))
    facts = {"scene": "shapes", "view": name, "machine": "of a test"}
    return Bench(name, facts, [case.eye], case.frame, case.rays, [rays])


def disc_bench(side: int, name: str = "above", aside: float = 0.0) -> Bench:
    """A disc over a plane, seen from above by an eye that stands that far aside."""
    spec = ANALYTIC_SCENES["a4_disc_light"]().spec
    view = next(iter(spec.views.values())).resized(side, side)
    x, y, z = view.origin
    light = next(iter(spec.lights.values()))
    return bench_of_shapes(spec.shapes, replace(view, origin=(x + aside, y, z)), light, name)


def made_space() -> Space:
    """The box about `BASE`, for a light of one face and 50 ms a frame."""
    return space_of(BASE, 1, 0.05)


def made_evidence(seed: int, count: int = 24) -> Evidence:
    """A view whose edges ask for 2^8 to 2^13 texels a side, some of them crowded, at gaps of all
    sizes."""
    rng = np.random.default_rng(seed)
    level = np.arange(DEEPEST + 1.0)[:, None]
    edges, receivers = 800.0, 40_000.0

    def crowd(total, decay):
        return np.maximum(total * np.exp2(-decay * level), 1.0)

    ratio, all_ratio = rng.uniform(8, 13, count), rng.uniform(7, 12, count)
    gap = rng.uniform(np.log(GAPS[0]), np.log(GAPS[-1]), (GAP_STEPS, count))
    span = LEAST_SPAN + np.arange(SPANS)[:, None]
    lift = rng.uniform(0, 1, count) * np.linspace(0.3, 1, SPANS)[:, None]
    return Evidence(
        log2_ratio=ratio,
        spread=rng.uniform(0.1, 0.4, count),
        log_gap=np.maximum.accumulate(gap),
        served=ratio - span + lift,
        crowd=crowd(edges, rng.uniform(0.8, 1.3, count)),
        all_log2_ratio=all_ratio,
        all_crowd=crowd(receivers, rng.uniform(1.5, 2, count)),
        edges=np.asarray(edges),
        receivers=np.asarray(receivers),
        faces=np.asarray(1.0),
    )


def random_fit(rng: np.random.Generator, spread: float = 0.3) -> Fit:
    """A machine and a scene that are not as expected."""
    return Fit(*(np.asarray(x) for x in spread * rng.normal(size=len(Fit._fields))))


def made_model(seeds: Sequence[int] = (0,), fit: Fit = EXPECTED) -> Model:
    """The surrogate of made-up views over `made_space`; wants x64."""
    space = made_space()
    low, high = space.ends
    parts = Model(
        tuple(made_evidence(seed) for seed in seeds),
        tuple(fit for _ in seeds),
        tuple(no_correction(len(low) + 2, 1) for _ in seeds),
        jnp.full(len(seeds), 1 / len(seeds)),
        jnp.asarray(low),
        jnp.asarray(high),
        RULES,
    )
    return jax.tree.map(jax.numpy.asarray, parts)
