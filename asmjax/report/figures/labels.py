"""Labels beside points of a chart, where nothing is in their way."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

LINE, LETTER, PAD = 20.0, 9.6, 13.0
"""Pixels: height of a label of 8 points, mean width of its letters, distance from its point."""

_STEPS = (0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6, -6)
"""Lines above a point at which its label may stand."""

_FAR = (0.0, 40.0, 90.0)
"""Pixels farther away, to the sides."""

_AROUND = 11.0
"""Half the side in pixels of the square that a point takes."""


class Label(NamedTuple):
    """A point in the axes' data, what is written beside it, and in which colour."""

    x: float
    y: float
    text: str
    colour: str


class _Place(NamedTuple):
    """Left, bottom, right and top of a label, how far it is from its best place, and where on it
    is the side that its point is on: 0 left, 0.5 in the middle, 1 right."""

    left: float
    bottom: float
    right: float
    top: float
    far: float
    side: float

    @property
    def anchor(self) -> tuple[float, float]:
        """Widths are estimated: text hangs on the side that is next to its point."""
        return (1 - self.side) * self.left + self.side * self.right, (self.bottom + self.top) / 2


def write_labels(
    axes: Axes, labels: Sequence[Label], points: np.ndarray, lines: Sequence[np.ndarray]
) -> None:  # fmt: skip
    """Write each label on the side of its point that is the most free, with a thin line to it
    where that is not next to it.

    Args:
        points: (n, 2) all that is drawn, in the axes' data.
        lines: corners (k, 2) of lines that labels should not cover.
    """
    frame = axes.get_window_extent()
    drawn = axes.transData.transform(points) if len(points) else np.zeros((0, 2))
    taken = np.concatenate([drawn - _AROUND, drawn + _AROUND], axis=1)
    covered = np.concatenate(
        [
            np.zeros((0, 2)),
            *(_along(axes.transData.transform(line)) for line in lines if len(line) > 1),
        ]
    )
    for label in labels:
        x, y = axes.transData.transform((label.x, label.y))

        def trouble(place: _Place, taken=taken) -> float:
            outside = (
                max(frame.x0 - place.left, 0) + max(place.right - frame.x1, 0)
                + max(frame.y0 - place.bottom, 0) + max(place.top - frame.y1, 0)
            )  # fmt: skip
            inside = (covered[:, 0] > place.left) & (covered[:, 0] < place.right)
            inside &= (covered[:, 1] > place.bottom) & (covered[:, 1] < place.top)
            return 50 * outside + _overlap(place, taken) + 6 * np.count_nonzero(inside) + place.far

        places = _places(x, y, LETTER * len(label.text))
        best = min(places, key=trouble)
        taken = np.concatenate([taken, [best[:4]]])
        axes.annotate(
            label.text,
            best.anchor,
            xycoords="figure pixels",
            ha={0.0: "left", 0.5: "center", 1.0: "right"}[best.side],
            va="center",
            fontsize=8,
            color=label.colour,
            zorder=6,
        )
        if best.far > LINE:
            _lead(axes, (x, y), best, label.colour)


def _along(corners: np.ndarray) -> np.ndarray:
    """Points on a line, 6 pixels or less apart."""
    parts = []
    for start, end in zip(corners[:-1], corners[1:], strict=True):
        count = int(np.hypot(*(end - start)) / 6) + 2
        parts.append(start + np.linspace(0, 1, count)[:, None] * (end - start))
    return np.concatenate(parts)


def _overlap(place: _Place, taken: np.ndarray) -> float:
    """Area in pixels that a place shares with what is taken."""
    wide = np.minimum(place.right, taken[:, 2]) - np.maximum(place.left, taken[:, 0])
    high = np.minimum(place.top, taken[:, 3]) - np.maximum(place.bottom, taken[:, 1])
    return float((np.maximum(wide, 0) * np.maximum(high, 0)).sum())


def _places(x: float, y: float, width: float) -> list[_Place]:
    found = []
    for step in _STEPS:
        for far in _FAR:
            low = y + step * LINE - LINE / 2
            for left, side in ((x + PAD + far, 0.0), (x - PAD - far - width, 1.0)):
                off = abs(step) * LINE + far + 2 * side
                found.append(_Place(left, low, left + width, low + LINE, off, side))
        if abs(step) == 1:
            low = y + step * LINE - LINE / 2
            found.append(_Place(x - width / 2, low, x + width / 2, low + LINE, LINE + 1, 0.5))
    return found


def _lead(axes: Axes, point: tuple[float, float], place: _Place, colour: str) -> None:
    across, middle = place.anchor
    axes.annotate(
        "",
        (across + 6 * (place.side - 0.5), middle),
        xytext=point,
        xycoords="figure pixels",
        textcoords="figure pixels",
        arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6, "shrinkA": 6},
        zorder=4,
    )


def tick_words(value: float, _) -> str:
    """A tick of a logarithmic axis: whole numbers, and powers of ten from 10^4 on."""
    if value >= 1e4:
        exponent = str(round(np.log10(value)))
        return "10" + exponent.translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{value:g}"
