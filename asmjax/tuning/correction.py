"""What trials say beyond the physics: a Gaussian process on what is left of their logarithms.

The surrogate's rules know why a setting matters, and are off where the map does what they leave
out. Their misfits are therefore regressed on where a setting lies and on what the rules say of it,
with a kernel that is fixed as the priors of the rules are: a constant, a slope along each axis, and
a smooth rest. Where trials say little it stays near 0, held there by the noise that each has
(Rasmussen and Williams 2006, sections 2.2 and 2.7). Its numbers are rounded from those of the
largest marginal likelihood (section 5.4.1) of 160 trials each on paper_room, munich and terrain;
found on two of these scenes, they rank the third's settings as well or better than equal reaches.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.tuning.goal import LEAST_PX


class Kernel(NamedTuple):
    """Variances of a correction, of the logarithm.

    Attributes:
        constant, slope, rest: of its parts: what is alike everywhere, what changes along each side
            of the box from one end to the other, and what is left.
        noise: of one trial.
    """

    constant: float
    slope: float
    rest: float
    noise: float


KERNELS = (Kernel(0.005, 0.005, 0.1, 0.02), Kernel(0.005, 0.005, 0.04, 0.013))
"""Of the error and of the seconds. The rules may be off by a factor of 1.4, or 1.25 in time."""

REACH = 1 / np.array([1.0, 1.0, 0.5, 1.5, 0.5, 0.5, 0.7, 0.5, 4.0, 3.0, 3.0])
"""Distance along each axis, in sides of the box, over which the rest of a correction changes. The
knobs come in order (`asmjax.tuning.space.NAMES`): short is that of time limits, which end a pass or
the next; then what the rules say of error and seconds."""

MIDDLE = np.log([0.3, 0.05])
"""Logarithms of pixels of edge and of seconds that count as the middle of what the rules say."""

WIDTH = np.array([3.0, 1.5])
"""Widths of their ranges, which count as a side of the box."""


class Correction(NamedTuple):
    """A fitted correction.

    Attributes:
        places: (k, axes) where trials lie: their point of the box and what the rules say of them,
            both from the middle.
        weights: (2, k) of the error's and the seconds' kernels; 0 for what fills up.
    """

    places: Float[Array, "k axes"]
    weights: Float[Array, "2 k"]


def place_of(point, edge_px, seconds):
    """(axes,) place of a point (knobs,) of which the rules say so; differentiable."""
    said = jnp.stack([jnp.log(edge_px + LEAST_PX), jnp.log(seconds)])
    return jnp.concatenate([point - 0.5, (said - MIDDLE) / WIDTH])


def corrected(correction: Correction, point, edge_px, seconds):
    """Error and seconds at a point (knobs,) of which the rules say so; differentiable."""
    place = place_of(point, edge_px, seconds)
    shifts = [
        weight @ _kernel(kernel, correction.places, place[None])[:, 0]
        for kernel, weight in zip(KERNELS, correction.weights, strict=True)
    ]
    return (edge_px + LEAST_PX) * jnp.exp(shifts[0]), seconds * jnp.exp(shifts[1])


def fitted_correction(
    places: Float[np.ndarray, "k axes"],
    misfits: Float[np.ndarray, "2 k"],
    weight: Float[np.ndarray, " k"],
    room: int,
) -> tuple[Correction, Float[np.ndarray, "2 k"]]:
    """The correction of misfits log(measured / said), filled up to `room` trials; and what would be
    left of each had its trial not been known.

    Args:
        weight: of the trials; noise is divided by its square.
    """
    count = len(weight)
    weights, left = np.zeros((2, room)), np.zeros((2, count))
    for row, (kernel, misfit) in enumerate(zip(KERNELS, misfits, strict=True)):
        known = np.asarray(_kernel(kernel, places, places))
        inverse = np.linalg.inv(known + np.diag(kernel.noise / weight**2))
        weights[row, :count] = inverse @ misfit
        left[row] = weights[row, :count] / np.diag(inverse)
    padded = np.pad(places, ((0, room - count), (0, 0)))
    return Correction(jnp.asarray(padded), jnp.asarray(weights)), left


def no_correction(axes: int, room: int) -> Correction:
    """One that changes nothing but for the least error that is told apart."""
    return Correction(jnp.zeros((room, axes)), jnp.zeros((2, room)))


def _kernel(kernel: Kernel, one, other):
    """(k, m) covariances of places (k, axes) and (m, axes)."""
    apart = jnp.sum(((one[:, None] - other[None]) / REACH) ** 2, axis=-1)
    along = jnp.sum(one[:, None] * other[None], axis=-1)
    return kernel.constant + kernel.slope * along + kernel.rest * jnp.exp(-0.5 * apart)
