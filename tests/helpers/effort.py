"""How much the tests try: quick by default, and ten times as much and more where it is asked for.

`ASMJAX_TEST_HARD=1` asks for it; `HYPOTHESIS_PROFILE` chooses the examples of properties alone.
"""

import os
from typing import TypeVar

T = TypeVar("T")

HARD = os.environ.get("ASMJAX_TEST_HARD", "0") not in ("", "0")

EXAMPLES = {"fast": 50, "ci": 1_000, "hard": 10_000}
"""Examples of a property, by hypothesis profile."""

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "hard" if HARD else "fast")


ALIKE = ("perspective", "trapezoidal", "logarithmic", "partitioned")
"""Families that the quick run leaves to siblings: maps of one warped chart, as `light-space` is, or
of several, as `subdivided` and `tuned` are."""


def effort(quick: T, hard: T) -> T:
    """`quick`, or `hard` where the long run was asked for."""
    return hard if HARD else quick
