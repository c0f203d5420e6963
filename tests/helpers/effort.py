"""How much the tests try: quick by default, and ten times as much and more where it is asked for.

`ASMJAX_TEST_HARD=1` asks for it; `HYPOTHESIS_PROFILE` chooses the examples of properties alone.
"""

import os
from typing import TypeVar

import pytest

T = TypeVar("T")

HARD = os.environ.get("ASMJAX_TEST_HARD", "0") not in ("", "0")

EXAMPLES = {"fast": 30, "ci": 1_000, "hard": 10_000}
"""Examples of a property, by hypothesis profile."""

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "hard" if HARD else "fast")


ALIKE = ("perspective", "trapezoidal", "logarithmic", "partitioned")
"""Families that the quick run leaves to siblings: maps of one warped chart, as `light-space` is, or
of several, as `subdivided` and `tuned` are."""

LEFT_OUT = (*ALIKE, "tuned")
"""The same, and `tuned`, which takes as long as all others to compile: where a family does nothing
of its own."""


def each_of(siblings):
    """Siblings as parameters of a test, those `LEFT_OUT` marked as slow."""
    return [
        pytest.param(s, id=s.name, marks=[pytest.mark.slow] if s.name in LEFT_OUT else [])
        for s in siblings
    ]


def effort(quick: T, hard: T) -> T:
    """`quick`, or `hard` where the long run was asked for."""
    return hard if HARD else quick


def examples(quick: int, most: int = EXAMPLES["hard"]) -> int:
    """Examples of a dear property: `quick` in the quick profile; in others as many as they ask for,
    but `most`."""
    return quick if PROFILE == "fast" else min(most, EXAMPLES[PROFILE])
