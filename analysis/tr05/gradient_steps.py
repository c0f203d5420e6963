"""Gradients of the predicted error, and the optimum that a search by them finds."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from asmjax import theory
from asmjax.buffers import SurfacePoints
from asmjax.geometry import Camera, look_at
from asmjax.shadow.warped.predicted import Layout, log2_errors, log2_p_mean, slab_alpha
from asmjax.shadow.warped.sight import BINS, Seen, parallel_sight
from asmjax.shadow.warped.tune import minimised
from tr05.sizes import Analysis

LIGHT = (0.2, 0.3, -1.0)
RECEIVERS = 400
PARTS = 3
STEP = 1e-6
"""Of the central differences, beside numbers of about 1."""

TEXELS = 1024.0**2
XIS = (-0.7, -0.3, 0.3, 0.7)
ALPHAS = (2.0, 10.0, 100.0, 1e4)
POWERS = (1.0, 4.0, 32.0)


def gradients(analysis: Analysis) -> None:
    """log m of each receiver by xi, u, splits and the light's direction: derivatives against
    central differences, the largest deviation beside the argument's largest derivative."""
    points, camera = rough_ground()
    seen = jax.jit(lambda direction: parallel_sight(direction, points, camera))(jnp.array(LIGHT))
    layout = _layout(seen)
    alpha = jax.jit(slab_alpha)(seen, layout.splits)

    def by_layout(**changes):
        return _errors(seen, layout._replace(**changes))

    found = {
        "u": _deviation(lambda u: by_layout(u=u), layout.u),
        "xi": max(
            _deviation(
                lambda xi: by_layout(u=theory.u_from_xi(xi, alpha)), jnp.full((1, PARTS), xi)
            )
            for xi in XIS
        ),
        "splits": _deviation(lambda splits: by_layout(splits=splits), layout.splits),
        "light direction": _deviation(
            lambda direction: _errors(parallel_sight(direction, points, camera), layout),
            jnp.array(LIGHT),
        ),
    }
    analysis.record["gradients"] = found


def optimum(analysis: Analysis) -> None:
    """n of the least p-mean of equation 2 over receivers even in log z, found by gradient, beside
    1 + sqrt(alpha): g is symmetric there, so it is the optimum for every p."""

    @jax.jit
    def search(alpha, power):
        z = jnp.exp(jnp.linspace(0.0, jnp.log(alpha), 257))

        def loss(t):
            errors = theory.m_z(z, alpha, jnp.exp(-jax.nn.softplus(t)), 0.5)
            return log2_p_mean(jnp.log2(errors), jnp.ones_like(z), power)

        return jnp.exp(jax.nn.softplus(minimised(loss, jnp.array(1.0), tolerance=1e-8).value))

    analysis.record["optimum"] = [
        {"alpha": alpha, "power": power, "n": n, "deviation": abs(n / (1 + alpha**0.5) - 1)}
        for alpha in ALPHAS
        for power in POWERS
        if (n := float(search(alpha, power)))
    ]


def rough_ground() -> tuple[SurfacePoints, Camera]:
    """Receivers on a rough ground below an eye, even in the logarithm of depth from 2 to 30."""
    camera = look_at((0, 0, 0), (0, 1, -0.2), fov_x_deg=60.0, width=64, height=64)
    rng = np.random.default_rng(0)
    depth = np.exp(rng.uniform(np.log(2.0), np.log(30.0), RECEIVERS))
    across, below = rng.uniform(-0.5, 0.5, RECEIVERS), rng.uniform(0.1, 0.4, RECEIVERS)
    right, down, forward = camera.rotation
    position = depth * (np.outer(right, across) + np.outer(down, below) + forward[:, None])
    normal = np.stack([*rng.normal(0, 0.1, (2, RECEIVERS)), np.ones(RECEIVERS)])
    points = SurfacePoints(
        position=jnp.asarray(position),
        normal=jnp.asarray(normal / np.linalg.norm(normal, axis=0)),
        prim=jnp.zeros(RECEIVERS, jnp.int32),
        valid=jnp.ones(RECEIVERS, bool),
        origin=np.zeros(3),
    )
    return points, camera


def _layout(seen: Seen) -> Layout:
    """Splits within bins, where the error is smooth in them; uneven strengths and shares."""
    bins = np.floor(BINS * np.arange(1, PARTS) / PARTS) + 1 / 3
    some = 1 + 0.2 * jnp.arange(PARTS)[None]
    splits = seen.near * (seen.far / seen.near) ** jnp.asarray(bins / BINS)
    return Layout(0.7 / some, splits, some / some.sum(), some)


def _errors(seen: Seen, layout: Layout):
    log2, weight = log2_errors(seen, layout, TEXELS)
    return log2 * weight


def _deviation(errors: Callable, at: ArrayLike) -> float:
    """Of the derivative along each axis of `at`; infinite where one is not finite."""
    at = jnp.asarray(at)

    @jax.jit
    def along(push):
        _, slope = jax.jvp(errors, (at,), (push,))
        return slope, (errors(at + STEP * push) - errors(at - STEP * push)) / (2 * STEP)

    pushes = np.eye(at.size).reshape(at.size, *at.shape)
    slopes, differences = (
        np.stack(both) for both in zip(*(along(jnp.asarray(p)) for p in pushes), strict=True)
    )
    if not np.isfinite(slopes).all():
        return float("inf")
    return float(np.abs(slopes - differences).max() / np.abs(differences).max())
