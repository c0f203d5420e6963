"""Charts: parts of a light's image that a shadow map stores each in a parameterization of its own.

A chart maps image coordinates u, v of a face to s, t in [0, 1]: a homography, then, where `log` is
not 0, t <- log(1 + c t) / log(1 + c). Every warp of the literature is one: a perspective along an
axis (perspective, light-space perspective and trapezoidal maps), a shear and a perspective (the
subdivided maps of Lloyd et al. 2005), and the logarithmic ones, which no graphics hardware drew.
Texel (column, row) of a chart is centred at s = (column + 0.5) / columns, t = (row + 0.5) / rows.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float64, Int64

from asmjax.errors import require
from asmjax.geometry.light_frame import LightFrame

STRAIGHT = 1e-9
"""A `log` no larger than this bends nothing that float32 could tell, and the renderer's exp(x) - 1
would lose its digits there."""

LINES = 4
"""Lines that bound the region of a chart."""

EVERYWHERE = (0.0, 0.0, 1.0)
"""A line that all of the image lies on the inner side of."""


@dataclass(frozen=True, eq=False)
class Charts:
    """k charts and their place in one flat array of texels.

    Attributes:
        face: (k,) face of the light frame.
        to_chart: (k, 3, 3) homographies of (u, v, 1) to (s, t, 1), before the logarithm.
        log: (k,) the c of the logarithm; 0 for none, above -1.
        lines: (k, 4, 3) the chart holds points with lines @ (u, v, 1) >= 0.
        depths: (k, 2) and with an eye depth in [least, most), scene units.
        size: (k, 2) columns and rows.
        first: (k,) number of its first texel; texels follow row by row.
    """

    face: Int64[np.ndarray, " k"]
    to_chart: Float64[np.ndarray, "k 3 3"]
    log: Float64[np.ndarray, " k"]
    lines: Float64[np.ndarray, "k 4 3"]
    depths: Float64[np.ndarray, "k 2"]
    size: Int64[np.ndarray, "k 2"]
    first: Int64[np.ndarray, " k"]

    @property
    def count(self) -> int:
        return self.face.size

    @property
    def texels(self) -> int:
        return int(self.size.prod(axis=1).sum())

    @property
    def from_chart(self) -> Float64[np.ndarray, "k 3 3"]:
        """The inverse homographies."""
        return np.linalg.inv(self.to_chart)

    def centres(self, chart: int) -> tuple[np.ndarray, np.ndarray]:
        """Image coordinates u and v (texels,) of the texel centres of one chart, row by row."""
        columns, rows = self.size[chart]
        s = np.tile((np.arange(columns) + 0.5) / columns, rows)
        t = np.repeat((np.arange(rows) + 0.5) / rows, columns)
        return self.image(chart, s, t)

    def image(self, chart: int, s, t) -> tuple[np.ndarray, np.ndarray]:
        """Image coordinates u and v of places s, t of one chart: the inverse parameterization."""
        log = self.log[chart]
        if log:
            t = np.expm1(t * np.log1p(log)) / log
        u, v, w = self.from_chart[chart] @ np.stack([s, t, np.ones_like(s)])
        return u / w, v / w


@dataclass(frozen=True, eq=False)
class Chart:
    """One chart without its texels.

    Attributes:
        face, to_chart, log, depths: as in `Charts`.
        lines: up to four of them.
        error: what its texels are in proportion to along s and t, in any one unit: the larger, the
            more of the map it gets (TR05-024, equation 6).
    """

    face: int
    to_chart: np.ndarray
    log: float = 0.0
    lines: tuple[tuple[float, float, float], ...] = ()
    depths: tuple[float, float] = (-np.inf, np.inf)
    error: tuple[float, float] = (1.0, 1.0)


def laid_out(charts: list[Chart], texels: int) -> Charts:
    """Give each chart columns and rows, `texels` in all at most.

    A chart of errors (e_s, e_t) gets columns and rows in proportion to them; all have the same
    error then. A single chart of equal errors gets a square map.

    Raises:
        UseError: no chart, an error that is not positive, or fewer texels than charts.
    """
    require(len(charts) > 0, "a map of no charts is empty; give it one at least.")
    error = np.array([chart.error for chart in charts], np.float64)
    require(
        bool(np.all(np.isfinite(error) & (error > 0))),
        f"errors of {error.tolist()} cannot share out texels; allowed: finite, above 0.",
    )
    require(
        texels >= len(charts),
        f"{texels} texels do not suffice for {len(charts)} charts; give each one at least.",
    )
    area = error.prod(axis=1)
    share = 1 + (texels - len(charts)) * area / area.sum()
    aspect = np.sqrt(error[:, 0] / error[:, 1])
    columns = np.clip(np.floor(np.sqrt(share) * aspect + 1e-9), 1, np.floor(share))
    rows = np.floor(share / columns + 1e-9)
    size = np.stack([columns, rows], axis=1).astype(np.int64)
    counts = size.prod(axis=1)
    lines = np.tile(np.array(EVERYWHERE), (len(charts), LINES, 1))
    for k, chart in enumerate(charts):
        for j, line in enumerate(chart.lines):
            lines[k, j] = line
    return Charts(
        face=np.array([chart.face for chart in charts], np.int64),
        to_chart=np.stack([chart.to_chart for chart in charts]).astype(np.float64),
        log=np.array([chart.log if abs(chart.log) > STRAIGHT else 0.0 for chart in charts]),
        lines=lines,
        depths=np.array([chart.depths for chart in charts], np.float64),
        size=size,
        first=np.cumsum(counts) - counts,
    )


def padded(charts: Charts, count: int) -> Charts:
    """`charts` and copies of the first one that hold no point and no texel, `count` in all."""
    missing = count - charts.count
    if missing == 0:
        return charts
    parts = {f.name: getattr(charts, f.name) for f in fields(charts)}
    grown = {
        name: np.concatenate([part, np.repeat(part[:1], missing, axis=0)])
        for name, part in parts.items()
    }
    grown["depths"][charts.count :] = (np.inf, np.inf)
    grown["size"][charts.count :] = 0
    grown["first"][charts.count :] = charts.texels
    return Charts(**grown)


def plane_to_image(frame: LightFrame, face: int) -> np.ndarray:
    """(3, 3) homography of plane coordinates (x, y, 1) of a face to its (u, v, 1)."""
    (x, y), (width, height) = frame.corner[face], frame.extent[face]
    return np.array([[1 / width, 0, -x / width], [0, 1 / height, -y / height], [0, 0, 1]])


def image_to_plane(frame: LightFrame, face: int) -> np.ndarray:
    """The inverse of `plane_to_image`."""
    (x, y), (width, height) = frame.corner[face], frame.extent[face]
    return np.array([[width, 0, x], [0, height, y], [0, 0, 1]])
