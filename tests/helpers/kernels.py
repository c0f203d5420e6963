"""All kernels as data: what they are given, what they are compared with, and where they may jump.

`test_kernel_promises.py` asks the same of every one of them. A new kernel is one more entry in one
of the files named below.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Arrays = tuple[np.ndarray, ...]
"""Arguments of a kernel in float64."""

Draw = Callable[[np.random.Generator, int], Arrays]
"""Of random numbers and a count n to arguments."""

ROWS = 8
"""Rows of hostile numbers that the arguments of all kernels are dealt out from."""

POINTS = 8
"""Points in one hostile example: the first half of them hostile, the second nearly sane."""


@dataclass(frozen=True)
class Part:
    """Rows of a result that are one quantity, a vector as a rule.

    Attributes:
        rows: how many.
        least: errors are relative to the vector's length, or to this if that is shorter.
        octaves: whether it is a logarithm of base 2: the error is that of its power.
    """

    rows: int
    least: float = 0.0
    octaves: bool = False

    def error(self, wrong: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Relative errors (n,) of differences (rows, n) from what was wanted."""
        if self.octaves:
            return np.abs(wrong).max(axis=0) * np.log(2)
        length = np.maximum(np.linalg.norm(wanted, axis=0), self.least)
        difference = np.linalg.norm(wrong, axis=0)
        return difference / np.where(length > 0, length, 1)


def as_allowed(*arguments: np.ndarray) -> Arrays:
    """Every number is allowed."""
    return arguments


@dataclass(frozen=True, eq=False)
class Kernel:
    """One kernel, a function of float arrays whose last axis counts points (or parts) as a rule.

    Attributes:
        name: for test ids.
        of: arrays to one array: (n,) or rows of it; parts of different meaning are stacked.
        sane: arguments for which the promised digits hold: no cancellation but the inputs' own.
        parts: the rows of the result in order.
        allowed: makes allowed arguments of any finite ones: unit normals, ascending splits.
        near: arguments at the limits of what is allowed, such as edge-on; `sane` if None.
        oracle: NumPy twin in float64; the kernel itself in float64 if None.
        digits: twin of one point in mpmath: numbers or lists of them, a list for each axis, to a
            list. None where there is no closed form.
        spaced: arguments for `digits`, even in the logarithm where they have a scale; `sane` if
            None.
        jumps: arguments to (n,) bool: points within a rounding of a stated discontinuity, of which
            float32 and float64 may take different sides.
        jumps_at: what those are, in words.
        pushes: how far arguments are pushed for central differences, times 1e-6; their own size
            if None. 0 for what is not differentiated.
        smooth: makes arguments without kinks of `sane` ones, for central differences.
        infinite: whether values may be +infinity, as documented.
        slopes: whether it has gradients that are worth comparing.
        precise: whether digits are promised at all, or only that everything is finite.
    """

    name: str
    of: Callable
    sane: Draw
    parts: tuple[Part, ...] = (Part(1),)
    allowed: Callable[..., Arrays] = as_allowed
    near: Draw | None = None
    oracle: Callable[..., np.ndarray] | None = None
    digits: Callable[..., list] | None = None
    spaced: Draw | None = None
    jumps: Callable[..., np.ndarray] | None = None
    jumps_at: str = ""
    pushes: Callable[..., Arrays] | None = None
    smooth: Callable[..., Arrays] = as_allowed
    infinite: bool = False
    slopes: bool = True
    precise: bool = True

    def hostile(self, numbers: np.ndarray, seed: int) -> Arrays:
        """Allowed arguments of `POINTS` points: hostile numbers (ROWS, POINTS / 2) as they come,
        then such that are nearly sane: mixed with extremes of any size."""
        rng = np.random.default_rng(seed)
        sane = (self.near or self.sane)(rng, POINTS)
        rows = np.concatenate([numbers, np.roll(numbers[::-1], 1, axis=1)], axis=1)
        mixed, row = [], 0
        for argument in sane:
            flat = argument.reshape(-1, argument.shape[-1] if argument.ndim else 1)
            dealt = np.empty(flat.shape)
            for k in range(flat.shape[0]):
                dealt[k] = np.resize(rows[(row + k) % ROWS], flat.shape[1])
            row += flat.shape[0]
            size = 10.0 ** rng.uniform(-45, 6, flat.shape) * rng.choice(
                [-1.0, 0.0, 1.0], flat.shape
            )
            keep = rng.random(flat.shape)
            late = np.arange(flat.shape[1]) >= flat.shape[1] // 2
            nearly = np.where(keep < 0.8, flat, np.where(keep < 0.9, size, dealt))
            mixed.append(np.where(late, nearly, dealt).reshape(argument.shape))
        return self.allowed(*mixed)

    def error(self, wrong: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Largest relative error of the parts at each point: (n,)."""
        pairs = zip(self.split(wrong), self.split(wanted), strict=True)
        errors = [
            part.error(*pair) for part, pair in zip(self.parts, pairs, strict=True)
        ]  # fmt: skip
        return np.max(errors, axis=0)

    def lengths(self, values: np.ndarray) -> np.ndarray:
        """The length of the part that each number belongs to: (rows, n)."""
        parts = (np.linalg.norm(part, axis=0) * np.ones_like(part) for part in self.split(values))
        return np.concatenate(list(parts))

    def split(self, values: np.ndarray) -> list[np.ndarray]:
        """A result (n,) or rows of it as its parts, (rows, n) each."""
        values = np.asarray(values, np.float64)
        values = values.reshape(-1, values.shape[-1] if values.ndim else 1)
        ends = np.cumsum([part.rows for part in self.parts])
        assert ends[-1] == len(values), f"{self.name}: {len(values)} rows, {ends[-1]} described"
        return np.split(values, ends[:-1])


def powers(rng: np.random.Generator, n: int, low: float, high: float) -> np.ndarray:
    """(n,) from `low` to `high`, even in the logarithm."""
    return low * (high / low) ** rng.random(n)


def spaced_powers(rng: np.random.Generator, n: int, low: float, high: float) -> np.ndarray:
    """The same at equal steps of the logarithm, in random order."""
    return rng.permutation(np.geomspace(low, high, n))
