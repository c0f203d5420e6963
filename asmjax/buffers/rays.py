"""Light rays: the one interface between shadow algorithms and whatever casts rays."""

import abc
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int32

from asmjax.geometry import Charts, LightFrame

EXACT_IDS = 2**16
"""Primitives whose ids stay apart in the 16 bits that maps keep of each
(`asmjax.shadow.comparison.pack_prim`)."""

_RAYS_AT_ONCE = 1 << 16
"""Rays that windows of a face hand to `closest` together: some MB of temporaries."""


@dataclass(frozen=True, eq=False)
class TexelWindows:
    """Square windows of texels in a light's image, all of one size, cast in one launch.

    Texel (row, column) of window k is centred at `corner[:, k] + (column + 0.5, row + 0.5) *
    texel[:, k]` in image coordinates u, v of face `face[k]`; it may lie outside [0, 1].

    Attributes:
        face: (k,) int.
        corner: (2, k) float64, u and v of the window's corner.
        texel: (2, k) float64, size of a texel in u and v.
        side: texels per side.
    """

    face: np.ndarray
    corner: np.ndarray
    texel: np.ndarray
    side: int

    @property
    def count(self) -> int:
        return self.face.shape[0]

    @property
    def texels(self) -> int:
        return self.count * self.side**2

    def plane(self, frame: LightFrame) -> tuple[np.ndarray, np.ndarray]:
        """Plane coordinates (2, k) float64 of the first texel's centre, and of one texel."""
        corner, extent = frame.corner[self.face].T, frame.extent[self.face].T
        return corner + (self.corner + 0.5 * self.texel) * extent, self.texel * extent


class LightBuffer(NamedTuple):
    """Depth and primitive of the first surface behind each texel of some windows, on the host.

    Attributes:
        depth: (k, side, side) float32 axial depth in scene units, +inf where nothing is hit.
        prim: (k, side, side) int32 global primitive id, -1 where nothing is hit.
    """

    depth: Float32[np.ndarray, "k side side"]
    prim: Int32[np.ndarray, "k side side"]


class ChartBuffer(NamedTuple):
    """Depth and primitive of the first surface behind each texel of some charts, on the host.

    Attributes:
        depth: (texels,) float32 axial depth in scene units, +inf where nothing is hit.
        prim: (texels,) int32 global primitive id, -1 where nothing is hit.
    """

    depth: Float32[np.ndarray, " texels"]
    prim: Int32[np.ndarray, " texels"]


def whole_image(frame: LightFrame, resolution: int) -> TexelWindows:
    """One window per face that covers the face with `resolution` texels a side."""
    return TexelWindows(
        face=np.arange(frame.faces),
        corner=np.zeros((2, frame.faces)),
        texel=np.full((2, frame.faces), 1.0 / resolution),
        side=resolution,
    )


class LightRays(abc.ABC):
    """Casts rays for shadow algorithms, which count what they ask for."""

    @abc.abstractmethod
    def closest(
        self, origins: np.ndarray, directions: np.ndarray, t_min: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """First hits of world rays (3, n): t (n,), +inf for a miss, and primitive (n,).

        t is float64, as exact as the caster: what is computed in float32 keeps its rounding, some
        1e-7 of the distance. Points that have to be exact are met again by way of the primitive
        (`asmjax.geometry.reintersect`).
        """

    @abc.abstractmethod
    def occluded(self, origins: np.ndarray, directions: np.ndarray, t_max: float) -> np.ndarray:
        """Whether anything is hit before `t_max` by world rays (3, n): (n,) bool."""

    def light_buffer(self, frame: LightFrame, windows: TexelWindows) -> LightBuffer:
        """Depth and primitive at every texel centre of `windows`, through `closest`."""
        side = windows.side
        at = np.arange(side) + 0.5
        depth = np.empty((windows.count, side, side), np.float32)
        prim = np.empty((windows.count, side, side), np.int32)
        together = max(1, _RAYS_AT_ONCE // side**2)
        for face in np.unique(windows.face):
            mine = np.flatnonzero(windows.face == face)
            for some in np.split(mine, range(together, mine.size, together)):
                u, v = windows.corner[:, some, None] + at * windows.texel[:, some, None]
                u, v = np.broadcast_arrays(u[:, None, :], v[:, :, None])
                origins, directions = frame.ray(int(face), u.ravel(), v.ravel())
                t, hit = self.closest(origins, directions)
                depth[some], prim[some] = t.reshape(u.shape), hit.reshape(u.shape)
        return LightBuffer(depth, prim)

    def chart_buffer(self, frame: LightFrame, charts: Charts) -> ChartBuffer:
        """Depth and primitive at every texel centre of `charts`, through `closest`."""
        depth = np.empty(charts.texels, np.float32)
        prim = np.empty(charts.texels, np.int32)
        for k in range(charts.count):
            mine = slice(charts.first[k], charts.first[k] + charts.size[k].prod())
            origins, directions = frame.ray(int(charts.face[k]), *charts.centres(k))
            depth[mine], prim[mine] = self.closest(origins, directions)
        return ChartBuffer(depth, prim)
