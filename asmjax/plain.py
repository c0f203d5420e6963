"""Values as JSON can hold them, of whatever library they come.

JSON has no word for numbers that are not finite: what becomes of them is always said.
"""

import enum
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


class NonFinite(enum.Enum):
    """What becomes of a number that is not finite."""

    NAMED = "its name, as inf: of settings and keys, which are read again"
    NONE = "null: of measurements, which have no value then"
    KEPT = "itself: whoever writes it refuses it"


def plain(value: Any, non_finite: NonFinite) -> Any:
    """`value` with mappings as dicts, sequences and arrays as lists, NumPy's and JAX's numbers as
    Python's, subclasses of numbers and text as their base, paths as text; all else as it is."""
    if isinstance(value, Mapping):
        return {str(name): plain(item, non_finite) for name, item in value.items()}
    # bool first, which is an int too.
    for kind in (bool, str, int):
        if isinstance(value, kind):
            return kind(value)
    if isinstance(value, float):
        return _number(float(value), non_finite)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):
        return plain(np.asarray(value).tolist(), non_finite)
    if isinstance(value, Sequence):
        return [plain(item, non_finite) for item in value]
    return value


def _number(value: float, non_finite: NonFinite) -> float | str | None:
    if math.isfinite(value) or non_finite is NonFinite.KEPT:
        return value
    return str(value) if non_finite is NonFinite.NAMED else None
