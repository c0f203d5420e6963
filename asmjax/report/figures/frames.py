"""Pictures of a walkthrough: a strip of its frames, and an animation of them all."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from matplotlib.figure import Figure

# Pillow is what matplotlib itself writes pictures with.
from PIL import Image

from asmjax.metrics import signed_error
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board, panel_size
from asmjax.report.figures.pictures import RunPictures
from asmjax.report.figures.shadows import worst_spots
from asmjax.report.figures.spots import Spot, outline
from asmjax.report.figures.style import FALSE_DARK, FALSE_LIT, SPOT_COLOURS, hex_rgb, styled
from asmjax.report.table import significant
from asmjax.writing import Writer

FRAME_WIDTH = 320
"""About how wide a frame is in the strip and in the animation, pixels."""

STRIP = 6
"""Frames in the strip."""

FRAME_SECONDS = 1 / 15
"""How long the animation shows a frame."""

_INSET = 28
"""Side of the magnified square, pixels of the eye's image."""

_COLOURS = 256
"""Colours of the animation's one palette."""


@dataclass(frozen=True)
class FramePicture:
    """What is kept of a frame to draw it later: small, however large the frame is.

    Attributes:
        number: of the frame.
        image: (height, width, 3) uint8 sRGB under the adaptive map's shadow, `FRAME_WIDTH` wide.
        wrong: name of the uniform and the adaptive method to misclassified fraction.
        insets: the same names to a magnified square, (side, side, 3) uint8, errors in colour.
        spot: that square, in pixels of `image`; None where there is nothing to magnify.
    """

    number: int
    image: np.ndarray
    wrong: dict[str, float]
    insets: dict[str, np.ndarray]
    spot: Spot | None


def frame_picture(number: int, pictures: RunPictures, exposed: float) -> FramePicture:
    """Shrink a frame to what the strip and the animation need.

    Args:
        pictures: of this frame; its first method is what the adaptive map, its last, is compared
            with.
        exposed: the factor of `exposure`, one for all frames, or the animation flickers.
    """
    uniform, adaptive = (list(pictures.visibilities)[k] for k in (0, -1))
    image = pictures.shaded(pictures.visibilities[adaptive], exposed)
    height, width = panel_size(*pictures.size, FRAME_WIDTH)
    shrinks = height < pictures.size[0]
    small = Image.fromarray(image).resize(
        (width, height), Image.Resampling.BOX if shrinks else Image.Resampling.NEAREST
    )
    spots = worst_spots(pictures, [adaptive], [_INSET], 1)
    spot = spots[0] if spots else None
    insets = {}
    for name in (uniform, adaptive):
        if spot is not None:
            insets[name] = _marked(pictures, name, spot, exposed)
    scale = width / pictures.size[1]
    return FramePicture(
        number=number,
        image=np.asarray(small),
        wrong={name: pictures.error(name).misclassified_fraction for name in (uniform, adaptive)},
        insets=insets,
        spot=None if spot is None else _scaled(spot, scale),
    )


def _scaled(spot: Spot, scale: float) -> Spot:
    return Spot(*(round(scale * length) for length in spot))


def _marked(pictures: RunPictures, name: str, spot: Spot, exposed: float) -> np.ndarray:
    """The square under a method's shadow, its wrong pixels in the colours of errors."""
    visibility = pictures.visibilities[name]
    image = spot.crop(pictures.shaded(visibility, exposed)).astype(np.float64)
    error = spot.crop(signed_error(pictures.truth, visibility, pictures.valid))
    for colour, part in ((FALSE_LIT, error), (FALSE_DARK, -error)):
        share = np.clip(part, 0, 1)[..., None]
        image = image * (1 - share) + hex_rgb(colour) * share
    return np.round(image).astype(np.uint8)


@styled
def draw_frames(frames: Sequence[FramePicture], title: str) -> Figure:
    """Up to `STRIP` frames, evenly spread from the first to the last; below each, magnified, the
    square where the adaptive map errs most: under the uniform map and under the adaptive one.
    """
    shown = [frames[k] for k in _spread(len(frames))]
    height, width = shown[0].image.shape[:2]
    inset = (width - GAP // 2) // 2
    count = len(shown)
    board = Board(
        max(2 * EDGE + count * width + (count - 1) * GAP, 4 * FRAME_WIDTH),
        EDGE + HEAD + height + GAP // 2 + inset + CAPTION + 2 * CAPTION + EDGE,
    )
    for k, frame in enumerate(shown):
        x, y = EDGE + k * (width + GAP), EDGE
        adaptive = list(frame.wrong)[-1]
        wrong = significant(100 * frame.wrong[adaptive])
        board.heading(x, y, width, f"Frame {frame.number}", f"{wrong} % wrong")
        axes = board.image(x, y + HEAD, width, height, frame.image)
        if frame.spot is None:
            continue
        outline(axes, frame.spot, SPOT_COLOURS[0])
        below = y + HEAD + height + GAP // 2
        for i, (name, image) in enumerate(frame.insets.items()):
            left = x + i * (inset + GAP // 2)
            detail = board.image(left, below, inset, inset, image, interpolation="nearest")
            for spine in detail.spines.values():
                spine.set(color=SPOT_COLOURS[0], linewidth=1.6)
            share = f"{significant(100 * frame.wrong[name])} %"
            board.text(left, below + inset + 7, share, fontsize=8)
    board.caption(f"{title}. Under the adaptive map; percent wrong are of the whole frame.", line=1)
    flat, tree = shown[0].wrong
    board.caption(
        f"Squares: where the adaptive map errs most, magnified, under {flat} (left) and {tree} "
        "(right). Orange: falsely lit. Blue: falsely dark."
    )
    return board.figure


def _spread(count: int) -> list[int]:
    """Up to `STRIP` indices below `count`, evenly spread from the first to the last."""
    return np.unique(np.linspace(0, count - 1, STRIP).round().astype(int)).tolist()


def animation(frames: Sequence[FramePicture]) -> Writer:
    """Writes the frames as a GIF that repeats."""
    return lambda file: _write_animation(frames, file)


def _write_animation(frames: Sequence[FramePicture], file: BinaryIO) -> None:
    images = [Image.fromarray(frame.image) for frame in frames]
    # One palette for all frames, from some of them side by side: colours must not flicker.
    some = np.concatenate([frames[k].image for k in _spread(len(frames))], axis=1)
    palette = Image.fromarray(some).quantize(
        _COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE
    )
    indexed = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    indexed[0].save(
        file,
        "GIF",
        save_all=True,
        append_images=indexed[1:],
        duration=round(1000 * FRAME_SECONDS),
        loop=0,
        optimize=False,
    )
