"""The markers of the figures as outlines for SVG: the same letters, about the same shapes."""

import math
from collections.abc import Iterable

_R = 5.5
"""Radius of a marker, pixels."""


def outline(marker: str) -> str:
    """The `d` of a path around the origin for one of matplotlib's marker letters; a circle for
    those that are not known here."""
    corners = _CORNERS.get(marker)
    if corners is None:
        return f"M{_R:g} 0A{_R:g} {_R:g} 0 1 1 {-_R:g} 0A{_R:g} {_R:g} 0 1 1 {_R:g} 0Z"
    return "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in corners) + "Z"


def _around(count: int, turn_deg: float, radii: Iterable[float]) -> list[tuple[float, float]]:
    """Corners at even angles from straight up, clockwise, at those radii, over and over."""
    wheel = list(radii)
    angles = [math.radians(turn_deg + 360 * k / count - 90) for k in range(count)]
    return [
        (wheel[k % len(wheel)] * math.cos(angle), wheel[k % len(wheel)] * math.sin(angle))
        for k, angle in enumerate(angles)
    ]


def _plus(turn_deg: float) -> list[tuple[float, float]]:
    """A plus with arms a third as wide as it is long."""
    long, short = 1.1 * _R, 0.37 * _R
    arm = [(-short, -long), (short, -long), (short, -short)]
    cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    corners = []
    for x, y in arm + [(-y, x) for x, y in arm] + [(-x, -y) for x, y in arm] + [
        (y, -x) for x, y in arm
    ]:  # fmt: skip
        corners.append((cos * x - sin * y, sin * x + cos * y))
    return corners


_CORNERS = {
    "s": _around(4, 45, [1.25 * _R]),
    "D": _around(4, 0, [1.2 * _R]),
    "d": _around(4, 0, [1.3 * _R, 0.8 * _R]),
    "^": _around(3, 0, [1.25 * _R]),
    ">": _around(3, 90, [1.25 * _R]),
    "v": _around(3, 180, [1.25 * _R]),
    "<": _around(3, 270, [1.25 * _R]),
    "p": _around(5, 0, [1.1 * _R]),
    "h": _around(6, 0, [1.1 * _R]),
    "8": _around(8, 22.5, [1.1 * _R]),
    "*": _around(10, 0, [1.4 * _R, 0.6 * _R]),
    "P": _plus(0),
    "X": _plus(45),
}
