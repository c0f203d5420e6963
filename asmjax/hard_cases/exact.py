"""Truth to fifty digits: NumPy arrays of `decimal.Decimal` that hold exactly what floats hold.

Formulas are written once more here, as the papers print them, with the operators of NumPy; what
cancels or overflows in floating point does not at fifty digits.
"""

from collections.abc import Callable, Iterable, Sequence
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext

import numpy as np

DIGITS = 50

_STEP = Decimal("1e-17")
"""Of central differences, as a part of the argument: right to more than thirty digits."""

Exact = np.ndarray
"""An array of `Decimal`."""


def digits(values) -> Exact:
    """`values` exactly, as an array of decimals."""
    numbers = np.asarray(values, np.float64)
    flat = [Decimal(x) for x in numbers.ravel().tolist()]
    exact = np.empty(len(flat), object)
    exact[:] = flat
    return exact.reshape(numbers.shape)


def floats(exact) -> np.ndarray:
    """The nearest float64 numbers."""
    return np.asarray(exact).astype(np.float64)


def fifty(formula: Callable[..., Exact]) -> Callable[..., np.ndarray]:
    """Makes of a formula in decimals a function from and to float64 arrays."""

    def truth(*inputs) -> np.ndarray:
        with localcontext(_context()):
            return floats(formula(*(digits(x) for x in inputs)))

    return truth


def slope(formula: Callable[..., Exact], argument: int) -> Callable[..., np.ndarray]:
    """The derivative of `formula` by one of its arguments, entry by entry; floats in and out."""

    def truth(*inputs) -> np.ndarray:
        with localcontext(_context()):
            exact = [digits(x) for x in inputs]
            middle = exact[argument]
            step = _STEP * np.where(middle == 0, 1, np.abs(middle))
            ends = []
            for sign in (1, -1):
                exact[argument] = middle + sign * step
                ends.append(formula(*exact))
            return floats((ends[0] - ends[1]) / (2 * step))

    return truth


def ln(exact) -> Exact:
    """Natural logarithm."""
    return _each(Decimal.ln, exact)


def power(base, exponent) -> Exact:
    """`base` ** `exponent` for positive bases."""
    return _each(Decimal.exp, exponent * ln(base))


def tan(exact) -> Exact:
    """Tangent of small multiples of a radian, by the series of sine and cosine."""
    return _each(_tan, exact)


def dot(a: Iterable, b: Iterable) -> Exact:
    """Inner product over the first axis."""
    first, *rest = (x * y for x, y in zip(a, b, strict=True))
    for term in rest:
        first = first + term
    return np.asarray(first, object)


def cross(a: Sequence | np.ndarray, b: Sequence | np.ndarray) -> Exact:
    """Cross product over the first axis."""
    return np.stack([
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    ])  # fmt: skip


def _context() -> Context:
    return Context(prec=DIGITS, Emin=MIN_EMIN, Emax=MAX_EMAX)


def _each(function: Callable[[Decimal], Decimal], exact) -> Exact:
    return np.asarray(np.frompyfunc(function, 1, 1)(np.asarray(exact, object)), object)


def _tan(x: Decimal) -> Decimal:
    sine, cosine, term, k = Decimal(0), Decimal(0), Decimal(1), 0
    least = Decimal(10) ** -(DIGITS + 5)
    while abs(term) > least or k < 4:
        sign = -1 if k % 4 >= 2 else 1
        if k % 2:
            sine += sign * term
        else:
            cosine += sign * term
        k += 1
        term = term * x / k
    return sine / cosine
