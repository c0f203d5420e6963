"""A figure laid out in its own pixels, so that images are shown texel for pixel.

Automatic layouts scale an image by some odd factor, which blurs or drops the one-pixel errors
that these figures are about; they also take longer to solve than the figure takes to draw.
"""

import io
import os
from collections.abc import Callable
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from asmjax.report.figures.style import DPI, FAINT, INK, style
from asmjax.writing import Writer, write_file

TITLE = 30
"""Height in pixels of a panel's one-line title."""

CAPTION = 22
"""Height in pixels of one line of small print."""

HEAD = TITLE + CAPTION
"""Height in pixels of a panel's title and the small print below it."""

GAP = 16
"""Space in pixels between panels."""

EDGE = 20
"""Margin in pixels around everything."""


class Drawing(Figure):
    """A figure that notebooks show, at its own pixels, without pyplot."""

    def _repr_png_(self) -> bytes:
        return png(self)


class Board:
    """A figure of `width` x `height` pixels; positions are pixels from the top left corner."""

    def __init__(self, width: int, height: int):
        self.width, self.height = width, height
        self.figure = Drawing(figsize=(width / DPI, height / DPI), dpi=DPI)

    def axes(self, x: int, y: int, width: int, height: int) -> Axes:
        """Empty axes over that rectangle."""
        bottom = self.height - y - height
        return self.figure.add_axes(
            (x / self.width, bottom / self.height, width / self.width, height / self.height)
        )

    def image(self, x: int, y: int, width: int, height: int, image, **options) -> Axes:
        """Axes without ticks that an image fills; `options` go to `imshow`."""
        axes = self.axes(x, y, width, height)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.imshow(image, aspect="auto", **options)
        return axes

    def text(self, x: float, y: float, text: str, **options) -> None:
        """Text whose top left corner is at that place, or as `options` say."""
        settings: dict = {"ha": "left", "va": "top", "color": INK} | options
        self.figure.text(x / self.width, 1 - y / self.height, text, **settings)

    def heading(self, x: int, y: int, width: int, title: str, small: str, tail: str = "") -> None:
        """A panel's title and the line of small print below it, cut to `width` pixels.

        They take `HEAD` pixels from `y` downwards; the panel comes right after. `tail` ends the
        title and is never cut.
        """
        self.text(x, y - 6, _cut(title, width / 11.6 - len(tail)) + tail, fontsize=9.5)
        self.text(x, y + TITLE - 8, _cut(small, width / 9.9), fontsize=8, color=FAINT)

    def caption(self, text: str, line: int = 0) -> None:
        """Small print at the lower left corner, cut to the board's width; `line` 1 is above 0."""
        text = _cut(text, (self.width - 2 * EDGE) / 9.6)
        y = self.height - EDGE + 6 - line * CAPTION
        self.text(EDGE, y, text, va="bottom", color=FAINT, fontsize=8)

    def scale_bar(
        self,
        colours: Colormap,
        norm: Normalize,
        x: int,
        y: int,
        width: int,
        height: int,
        ticks: dict[float, str],
        extend: str = "neither",
    ) -> Colorbar:
        """An upright colour scale with those values labelled; pointed where values lie beyond."""
        bar = self.figure.colorbar(
            ScalarMappable(norm, colours),
            cax=self.axes(x, y, width, height),
            extend=extend,
            extendfrac=min(0.8 * width / height, 0.2),
        )
        bar.set_ticks(list(ticks), labels=list(ticks.values()))
        bar.ax.minorticks_off()
        return bar


def _cut(text: str, letters: float) -> str:
    """`text`, shortened to about that many letters of mean width."""
    most = max(8, int(letters))
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"


def panel_size(height: int, width: int, target: int) -> tuple[int, int]:
    """(height, width) in pixels at which to show an image about `target` pixels wide.

    A whole multiple of the image where it is small, its own size where that is near the target,
    and a smaller one only where it is much wider. No side exceeds about 1.6 `target`.
    """
    longest = max(width, height / 1.4)
    if longest <= 1.15 * target:
        scale: float = max(1, round(target / longest))
    else:
        scale = target / longest
    return max(1, round(height * scale)), max(1, round(width * scale))


def columns_for(count: int) -> int:
    """How many panels stand side by side."""
    return count if count <= 3 else 2 if count == 4 else 3


def target_width(columns: int) -> int:
    """About how wide a panel is, in pixels, with that many side by side."""
    return {1: 860, 2: 680, 3: 520, 4: 420}[columns]


def png(figure: Figure) -> bytes:
    """A PNG of the figure's own pixels."""
    file = io.BytesIO()
    with style():
        # Level 6 takes three times as long for files a tenth smaller. No time stamp or version
        # of matplotlib inside: the same run gives the same file.
        figure.savefig(
            file,
            format="png",
            dpi=DPI,
            pil_kwargs={"compress_level": 3},
            metadata={"Software": None},
        )
    return file.getvalue()


def save(figure: Figure, path: str | os.PathLike) -> Path:
    """Write a PNG at the figure's own pixels and return its path. Raises `WriteError`."""
    write_file(path, drawing(lambda: figure))
    return Path(path)


def drawing(draw: Callable[[], Figure]) -> Writer:
    """Writes a PNG of a figure, drawn when it is wanted."""
    return lambda file: file.write(png(draw()))
