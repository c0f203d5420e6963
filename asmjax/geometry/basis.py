"""Orthonormal bases in float64 on the host."""

import numpy as np

from asmjax.errors import require


def unit(v) -> np.ndarray:
    """`v / |v|` in float64. Raises `UseError` for a zero or non-finite vector."""
    v = np.asarray(v, np.float64)
    largest = np.abs(v).max()
    require(
        bool(np.isfinite(largest) and largest > 0),
        f"the vector {v.tolist()} has no direction; give a finite vector that is not zero.",
    )
    # Exact scaling by a power of two: squares of very small or large components leave float64.
    v = np.ldexp(v, -np.frexp(largest)[1])
    return v / np.linalg.norm(v)


def basis_from_axis(axis) -> np.ndarray:
    """Rows `(e_u, e_v, e_w)` of a right-handed orthonormal basis with `e_w` along `axis`."""
    return bases_along(unit(axis))


def bases_along(w: np.ndarray) -> np.ndarray:
    """Bases (3, 3, n) of unit vectors (3, n) float64, or one (3, 3) of one (3,): rows e_u, e_v and
    `w` itself.

    The roll depends on the axis alone, and is continuous except where its z changes sign.
    """
    x, y, z = w
    u, v = axes_across(x, y, z, np.copysign(1.0, z))
    return np.stack([np.stack(u), np.stack(v), w])


def axes_across(x, y, z, sign=1):
    """Rows of two axes that make a basis with the unit vector of rows `x`, `y` and `z`, arrays of
    any library; `sign` is that of z, 1 or -1.

    Branchless construction of Duff et al. 2017 ("Building an Orthonormal Basis, Revisited").
    """
    a = -1 / (sign + z)
    b = x * y * a
    return (1 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)
