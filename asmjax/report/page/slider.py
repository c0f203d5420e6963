"""Two pictures of one view, one in front of the other, and a slider that moves their border.

Without script, and on paper, the pictures stand side by side; with it they are hidden, and two at
a time are shown. Each is in the file only once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from asmjax.report.page.markup import Markup, tag
from asmjax.report.page.pictures import Picture

_MAGNIFIED = (1, 2, 4, 8)
"""Screen pixels per pixel of the pictures, beside the size that fits the page."""


@dataclass(frozen=True)
class Layer:
    """A picture to compare, its name, and what it shows."""

    name: str
    alt: str
    picture: Picture


def slider(layers: Sequence[Layer], left: int, right: int) -> Markup:
    """The comparison; `left` and `right` are the layers that it begins with."""
    shown = [
        tag("figure", layer.picture.image(layer.alt), tag("figcaption", layer.name))
        for layer in layers
    ]
    return tag(
        "div",
        tag(
            "div",
            _choice("Left", "left", layers, left),
            _choice("Right", "right", layers, right),
            _magnified(),
            class_="controls",
            hidden=True,
        ),
        tag(
            "div",
            tag("div", tag("div", class_="pair"), class_="window"),
            tag("div", class_="border"),
            class_="stage",
            hidden=True,
        ),
        tag(
            "input",
            type="range",
            min="0",
            max="1000",
            value="500",
            aria_label="border between the left and the right picture",
            hidden=True,
        ),
        tag("div", *shown, class_="layers"),
        class_="slider",
    )


def _choice(words: str, side: str, layers: Sequence[Layer], chosen: int) -> Markup:
    options = [
        tag("option", layer.name, value=k, selected=k == chosen) for k, layer in enumerate(layers)
    ]
    return tag("label", f"{words} ", tag("select", *options, data_side=side))


def _magnified() -> Markup:
    options = [tag("option", "fitted", value=0)]
    options += [tag("option", f"{factor} x", value=factor) for factor in _MAGNIFIED]
    return tag("label", "Size ", tag("select", *options, data_side="size"))
