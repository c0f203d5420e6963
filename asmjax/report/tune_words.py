"""What tuning calls things, for people: rivals, and settings with their units."""

from typing import Any

from asmjax.report.table import MB

RIVAL_WORDS = {
    "default": "default",
    "tuned": "tuned",
    "grid_best": "best of a grid",
    "random_best": "best at random",
}
"""The rivals."""

OTHERS = {
    "default": "the default",
    "grid_best": "the best of a grid",
    "random_best": "the best of a random search",
}
"""Those that tuned settings are compared with, within a sentence."""


def setting_words(name: str, value: Any) -> str:
    """A tuned setting's value with the unit that people use."""
    if value is None:
        return "none"
    if name == "memory_bytes":
        return f"{value / MB:.4g} MB"
    if name == "time_limit":
        return f"{1e3 * value:.3g} ms"
    return f"{value:.3g}" if 1e-4 <= abs(value) < 1e4 or value == 0 else f"{value:.2g}"
