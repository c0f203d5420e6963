"""What the figures of one run are drawn from: plain NumPy images and the report's numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from asmjax.errors import require
from asmjax.metrics import VisibilityError, visibility_error
from asmjax.report.figures.scales import texels_a_side
from asmjax.report.figures.shading import compose, exposure
from asmjax.report.schema import MAP_NAMES
from asmjax.report.table import MB, significant

Image = Any
"""Whatever `np.asarray` takes, JAX arrays among it; once constructed, records hold NumPy arrays."""


@dataclass(frozen=True)
class TreePicture:
    """The nodes of an adaptive shadow map, and a way to see what the light sees beneath them.

    Attributes:
        level: (k,) int, 0 for a root.
        face: (k,) int, which face of the light frame.
        lo: (2, k) u and v of the corner nearest to u = v = 0, in [0, 1].
        size: (k,) side in u and v.
        node_resolution: texels per side of a node.
        faces: number of faces of the light frame.
        cast: called as `cast(face, u, v, size, side)`: axial depth (side, side) in scene units at
            the texel centres of the square of that `size` whose corner is u, v; row 0 at its
            least v; +inf where there is no surface.
    """

    level: Image
    face: Image
    lo: Image
    size: Image
    node_resolution: int
    faces: int
    cast: Callable[[int, float, float, float, int], Image]

    def __post_init__(self):
        _set(self, level=int, face=int, lo=float, size=float)
        count = self.level.size
        require(
            self.face.shape == self.size.shape == (count,) and self.lo.shape == (2, count),
            f"a tree of {count} nodes needs face and size ({count},) and lo (2, {count}).",
        )
        require(
            set(self.face.tolist()) <= set(range(self.faces)),
            f"a tree's faces must be 0 to {self.faces - 1}.",
        )


@dataclass(frozen=True)
class RunPictures:
    """Everything that the figures of one run show; images are (height, width), row 0 at the top.

    Attributes:
        title: scene and view, for headings.
        direct: (height, width, 3) linear RGB that the light adds where it is seen.
        ambient: (height, width, 3) linear RGB without it; see `linear_parts` for both.
        valid: bool, whether the eye sees a surface.
        truth: visibility in truth, 1 lit to 0 shadowed.
        visibilities: name of a method to its visibility; names as in `methods`.
        methods: the `methods` of the report.
        maps: name (of `asmjax.report.MAP_NAMES`) to image; what is missing is not drawn.
        log2_resolution: log2 of the effective resolution that answered each pixel, NaN where none
            did; None where there is no adaptive map.
        tree: the adaptive map's nodes, or None.
    """

    title: str
    direct: Image
    ambient: Image
    valid: Image
    truth: Image
    visibilities: Mapping[str, Image]
    methods: Sequence[Mapping] = ()
    maps: Mapping[str, Image] = field(default_factory=dict)
    log2_resolution: Image | None = None
    tree: TreePicture | None = None

    def __post_init__(self):
        _set(self, direct=np.float32, ambient=np.float32, valid=bool, truth=float)
        for name in ("visibilities", "maps"):
            images = {key: np.asarray(image) for key, image in getattr(self, name).items()}
            object.__setattr__(self, name, images)
        if self.log2_resolution is not None:
            _set(self, log2_resolution=float)
        size = self.valid.shape
        images = {"truth": self.truth, "log2_resolution": self.log2_resolution}
        for name, image in {**images, **self.visibilities, **self.maps}.items():
            shape = size if image is None else image.shape
            require(shape == size, f"the image '{name}' has shape {shape}; allowed is {size}.")
        for name in ("direct", "ambient"):
            require(getattr(self, name).shape == (*size, 3), f"'{name}' must be {(*size, 3)}.")
        unknown = [name for name in self.maps if name not in MAP_NAMES]
        require(not unknown, f"unknown map {unknown}; known: {', '.join(MAP_NAMES)}.")

    @property
    def size(self) -> tuple[int, int]:
        """(height, width)."""
        return self.valid.shape

    def drawn_methods(self, most: int | None = None) -> list[str]:
        """Names of methods to show, uniform ones first, then adaptive ones, then others.

        Ray-traced methods are left out: they look like truth, and have their own chart. With
        `most`, one of each kind before a second of any.
        """
        names = [name for name in self.visibilities if not name.startswith("rays")]
        by_kind = [[n for n in names if n.startswith(kind)] for kind in ("uniform", "adaptive")]
        by_kind.append([n for n in names if not n.startswith(("uniform", "adaptive"))])
        if most is not None and len(names) > most:
            turns = [group[i] for i in range(most) for group in by_kind if i < len(group)]
            by_kind = [[n for n in group if n in turns[:most]] for group in by_kind]
        return [name for group in by_kind for name in group]

    def error(self, name: str) -> VisibilityError:
        """Errors of one method's visibility."""
        return visibility_error(self.truth, self.visibilities[name], self.valid)

    def price(self, name: str) -> str:
        """A method's effective resolution and memory; empty where `methods` lacks it."""
        for method in self.methods:
            if method["name"] == name:
                texels = method["effective_resolution"]
                sides = [f"{texels_a_side(texels)} texels a side"] if texels else []
                return ", ".join([*sides, f"{significant(method['bytes'] / MB)} MB"])
        return ""

    def shaded(self, visibility, exposed: float | None = None) -> np.ndarray:
        """(height, width, 3) uint8 sRGB picture with that shadow; `exposed` None for this view's
        own exposure."""
        exposed = self.exposed if exposed is None else exposed
        return compose(self.direct, self.ambient, visibility, self.valid, exposed)

    @cached_property
    def exposed(self) -> float:
        """The exposure of this view, one for all of its shadows."""
        return exposure(self.direct, self.ambient, self.valid)


def _set(record, **dtypes: type) -> None:
    """Turn fields of a frozen record into NumPy arrays of the given dtypes."""
    for name, dtype in dtypes.items():
        object.__setattr__(record, name, np.asarray(getattr(record, name), dtype))
