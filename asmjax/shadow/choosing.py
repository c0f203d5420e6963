"""The table of docs/choosing.md: what each algorithm holds, its settings, and when to take it.

Names, references, settings and defaults are read from the code; the words stand here, a row for
each entry of the registry. `python -m asmjax.shadow.choosing docs/choosing.md` writes the table
between the page's two markers.
"""

import math
from dataclasses import MISSING, fields
from typing import NamedTuple

from asmjax.errors import require
from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.pages import between_markers, write_pages
from asmjax.shadow.registry import ALGORITHMS
from asmjax.shadow.warped.body import STILL

BEGIN = "<!-- begin: written by `python -m asmjax.shadow.choosing docs/choosing.md` -->"
END = "<!-- end -->"

COLUMNS = (
    "algorithm",
    "reference",
    "holds",
    "passes",
    "settings (defaults)",
    "weak where",
    "choose it when",
)


class Words(NamedTuple):
    """What no code says about an algorithm.

    Attributes:
        holds: what its state stores.
        passes: launches of light rays for a view.
        weak: where it loses its advantage.
        choose: when it is the one to take.
    """

    holds: str
    passes: str
    weak: str
    choose: str


UNSHAPED = (
    "light near the view's direction: the warp grows no weaker before it ends, at "
    f"{math.degrees(math.asin(STILL)):.1f} degrees"
)

WORDS = {
    "uniform": Words(
        "N x N texels per light face: depth (4 bytes), primitive id (2 bytes), or both",
        "1",
        "one resolution must serve all: close-ups, grazing light, large worlds",
        "the view never gets close, or as the baseline that everything else has to beat",
    ),
    "adaptive": Words(
        "a tree of pages of R x R texels, as fine as the eye needs, within a memory limit",
        "about 8 from nothing, one a frame while the light frame stays",
        "very many edges at once: each needs texels, and the limit ends refinement",
        "close-ups, uneven needs, a fixed memory budget, wide lights",
    ),
    "perspective": Words(
        "N x N texels per light face after the eye's own perspective",
        "1",
        "light along the view; what is far gets few texels",
        "light across the view, and what is near matters most",
    ),
    "light-space": Words(
        "N x N texels, a perspective whose error is the same at both ends",
        "1",
        "light within a sixth of the field of view of the view's direction: no warp is left",
        "the single warp to begin with",
    ),
    "trapezoidal": Words(
        "N x N texels, 80 % of the rows up to a focus",
        "1",
        f"what lies beyond the focus; {UNSHAPED}",
        "a known distance matters, such as that of a player",
    ),
    "logarithmic": Words(
        "N x N texels, logarithmic along the view",
        "1",
        UNSHAPED,
        "far / near is large and light comes across the view: the least error one map can have",
    ),
    "partitioned": Words(
        "a chart for each of k slabs of eye depth, N x N texels in all",
        "1",
        "slabs overlap in the light's image: texels of surfaces that only others see are wasted",
        "any direction of light, large far / near",
    ),
    "subdivided": Words(
        "a warped chart for each face of the view's frustum and for parts of it, texels in "
        "proportion to error",
        "1",
        "lamps with corners of the frustum behind them fall back to one chart a face",
        "any direction of light, also along the view",
    ),
    "tuned": Words(
        "a warped chart for each of k slabs of eye depth; warps, splits and shares of texels by "
        "gradient from those in closed form",
        "1",
        "a search of its own for each view; as partitioned",
        "a view is kept, or it is to be known about how little error slabs can have",
    ),
    "filtered": Words(
        "what its inner map holds, of whatever family",
        "those of its inner map",
        "edges are blurred by a constant number of texels, near casters too; corners where walls "
        "rise darken over as many",
        "texels are larger than pixels and their steps must not be seen",
    ),
    "pcss": Words(
        "N x N texels per light face; under a light with a size also over what lies beside them",
        "1, and 64 x 64 rays before, under a light with a size",
        "blockers of several depths above one receiver, whose mean is the depth of none; lights "
        "that stand above a receiver's horizon with less than a half",
        "a light has a size, and its penumbrae are to cost one map and a hundred look-ups",
    ),
    "moment": Words(
        "sums of four moments of depth, 32 bytes a texel, under a light with a size or for a "
        "filter; else as `uniform`",
        "as above",
        "three depths and more in one penumbra: light leaks; the foot of what stands on a slope "
        "is lit",
        "penumbrae or filters are wide: all widths cost the same; nothing must get too dark",
    ),
    "accumulated": Words(
        "m x m flat maps from samples of the light, N x N texels for each of its faces in all; one "
        "map of a light without a size",
        "m x m",
        "each map is coarse; wide penumbrae show the edges of m x m hard shadows; time grows with "
        "m x m",
        "a light is very large, umbrae vanish, or the truth is wanted without a ray tracer",
    ),
}
"""By family, in the registry's order."""

RAYS = (
    "traced rays (`rays`)",
    "the truth",
    "nothing",
    "1",
    "rays per pixel",
    "many eye samples per pixel; no ray tracer at hand",
    "you can afford it: on a scene that a ray tracer handles well, one shadow ray per pixel is "
    "exact and hard to beat",
)
"""The last row, which is no algorithm of the registry."""


def settings_of(algorithm: type[ShadowAlgorithm]) -> str:
    """All settings of an algorithm with their defaults, as a cell of the table."""
    return ", ".join(f"`{field.name}` {_default(field)}".rstrip() for field in fields(algorithm))


def _default(field) -> str:
    value = field.default
    if value is MISSING:
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    if value is None:
        return "none"
    if isinstance(value, ShadowAlgorithm):
        return value.name
    return f"{value:g}" if isinstance(value, float) else str(value)


def table() -> str:
    """The table in Markdown: a row for each entry of the registry, then the traced rays.

    Raises:
        UseError: an algorithm of the registry has no words, or words have no algorithm.
    """
    without = sorted(set(ALGORITHMS) ^ set(WORDS))
    require(
        not without,
        f"{', '.join(without)}: not both in ALGORITHMS and in WORDS; give each registered family "
        "a row of asmjax.shadow.choosing.",
    )
    rows = [COLUMNS, ("---",) * len(COLUMNS)]
    for family, algorithm in ALGORITHMS.items():
        words = WORDS[family]
        rows.append((
            f"`{algorithm.__name__}` (`{family}`)",
            algorithm.reference,
            words.holds,
            words.passes,
            settings_of(algorithm),
            words.weak,
            words.choose,
        ))  # fmt: skip
    return "".join(f"| {' | '.join(row)} |\n" for row in (*rows, RAYS))


def written_into(page: str) -> str:
    """`page` with the table between its markers.

    Raises:
        UseError: the page has not one line of each marker, in their order.
    """
    return between_markers(page, BEGIN, END, table())


if __name__ == "__main__":
    write_pages(written_into)
