"""Words for people: how long something takes, and what a setting is."""

import math
from typing import Any

_LONGEST = 48
"""Letters of a value that are shown; of a path its end tells it apart."""


def in_words(seconds: float) -> str:
    """A time to the digits that an estimate has: "40 s", "25 min", "3.5 h"."""
    if seconds < 90:
        return f"{max(1, seconds):.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def value_words(value: Any) -> str:
    """A setting as one would write it: 0.25, 4, true, [96, 96]; "none" where nobody says it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:.6g}"
    text = str(value)
    return text if len(text) <= _LONGEST else f"...{text[3 - _LONGEST :]}"
