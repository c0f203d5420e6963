"""Which resolution each eye pixel needs."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def n_required(n_current, ratio):
    """Texels that an area of `n_current` texels needs to match the eye: n_current * area ratio.

    Fernando et al. 2001, 3.1, print the inverse ratio (eye / shadow); read literally that asks
    for fewer texels the coarser the map is. Shrinking the light's focal length by 2 must multiply
    this by 4 (docs/theory.md).
    """
    return n_current * ratio


def required_level(log2_ratio, log2_cells, log2_target=0.0) -> Float[Array, " n"]:
    """Real-valued refinement level below a map where log2(linear ratio or m) is `log2_ratio`.

    Each level multiplies the linear resolution by 2**log2_cells; 0 where the map is fine enough
    for a target ratio of 2**log2_target.
    """
    return jnp.maximum((log2_ratio - log2_target) / log2_cells, 0)
