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
    """Rows `(e_u, e_v, e_w)` of a right-handed orthonormal basis with `e_w` along `axis`.

    Branchless construction of Duff et al. 2017 ("Building an Orthonormal Basis, Revisited"):
    the roll depends on the axis alone, and is continuous except where `axis_z` changes sign.
    """
    w = unit(axis)
    sign = np.copysign(1.0, w[2])
    a = -1.0 / (sign + w[2])
    b = w[0] * w[1] * a
    u = np.array([1.0 + sign * w[0] * w[0] * a, sign * b, -sign * w[0]])
    v = np.array([b, sign + w[1] * w[1] * a, -w[1]])
    return np.stack([u, v, w])
