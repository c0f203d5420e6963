"""What is asked of a map: error and seconds traded at a price, or one of them limited."""

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from asmjax.errors import require

LEAST_PX = 1e-4
"""Error in pixels of edge that is told apart from none."""

SLOPE = 30.0
"""How much steeper than the objective the wall of a limit is, in logarithms."""

WALL = 0.03
"""Width of the wall's foot, in logarithms."""


KINDS = ("price", "seconds", "error")


@dataclass(frozen=True)
class Goal:
    """One of three goals; the others are None.

    Attributes:
        price: minimise edge_px + price * seconds; pixels of edge displacement per second.
        seconds: least error within that time, seconds from nothing.
        error: least time within that error, pixels of edge displacement.

    Raises:
        UseError: none or several of them, or one that is not positive and finite.
    """

    price: float | None = None
    seconds: float | None = None
    error: float | None = None

    def __post_init__(self):
        given = {name: value for name, value in vars(self).items() if value is not None}
        require(
            len(given) == 1,
            f"a goal needs one of price, seconds and error, got {sorted(given) or 'none'}; give "
            "one of them.",
        )
        ((name, value),) = given.items()
        require(
            math.isfinite(value) and value > 0,
            f"{name} is {value}; allowed: a finite number above 0.",
        )

    def objective(self, edge_px: float, seconds: float) -> float:
        """The number that is minimised, as measured: infinite where a limit is not met."""
        if not self.met(edge_px, seconds):
            return math.inf
        if self.price is not None:
            return edge_px + self.price * seconds
        return edge_px if self.seconds is not None else seconds

    def met(self, edge_px: float, seconds: float) -> bool:
        """Whether a limit is kept; always so where a price trades."""
        if self.seconds is not None:
            return seconds <= self.seconds
        return self.error is None or edge_px <= self.error

    def rank(self, edge_px: float, seconds: float) -> tuple[float, float]:
        """Candidates are put in order by it: what breaks a limit least, then the objective."""
        if self.met(edge_px, seconds):
            return 0.0, self.objective(edge_px, seconds)
        if self.seconds is not None:
            return seconds / self.seconds, edge_px
        assert self.error is not None
        return edge_px / self.error, seconds

    @property
    def kind(self) -> str:
        """Which of the three it is."""
        return next(name for name in KINDS if getattr(self, name) is not None)

    @property
    def value(self) -> float:
        """Its number."""
        return getattr(self, self.kind)

    @property
    def words(self) -> str:
        """For titles and tables."""
        if self.price is not None:
            return f"edge error + {self.price:g} px/s x seconds"
        if self.seconds is not None:
            return f"least edge error within {1e3 * self.seconds:g} ms"
        return f"least time within {self.error:g} px of edge error"


def smooth_objective(
    kind: str,
    log_value: Float[Array, ""] | float,
    edge_px: Float[Array, "*points"] | Float[np.ndarray, "*points"],
    seconds: Float[Array, "*points"] | Float[np.ndarray, "*points"],
) -> Float[Array, "*points"]:
    """A differentiable stand-in for a goal's objective, in logarithms: what a search minimises.

    Args:
        kind, log_value: of the goal, the natural logarithm of its number.
    """
    if kind == "price":
        return jnp.log(edge_px + jnp.exp(log_value) * seconds)
    log_error = jnp.log(edge_px + LEAST_PX)
    if kind == "seconds":
        return log_error + _wall(jnp.log(seconds) - log_value)
    return jnp.log(seconds) + _wall(log_error - log_value)


def _wall(excess):
    return SLOPE * WALL * jax.nn.softplus(excess / WALL)
