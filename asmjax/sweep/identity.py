"""What a trial is known by: its whole configuration and what its scene consists of, in 32 digits.

The same on every machine and in every process: JSON with sorted keys, numbers as `repr` writes
them, and for a scene file the bytes of all its files, wherever they are (`render.content`).
"""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from asmjax.render.content import DIGITS, builtin_content, file_content

__all__ = ["DIGITS", "NOT_IDENTITY", "builtin_content", "canonical", "file_content", "key_of"]

NOT_IDENTITY = ("scene", "trust_scene")
"""Of a configuration: where the scene is, for which `content` stands, and whether it is trusted."""


def key_of(config: Mapping[str, Any]) -> str:
    """The key of a trial: equal for equal configurations of equal scenes."""
    known = {name: value for name, value in config.items() if name not in NOT_IDENTITY}
    return hashlib.sha256(canonical(known).encode()).hexdigest()[:DIGITS]


def canonical(value: Any) -> str:
    """Plain values as text, one for each value.

    Raises:
        ValueError: a number that is not finite, which JSON has no word for.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
