"""The frame in which rays are cast: near the origin, and about ten units wide.

A renderer's rays are float32, and rounding acts on the largest coordinate in play: a scene 20,000
units away keeps 2 mm of every metre. All of asmjax speaks of the scene where its user put it, in
float64; only what is handed to the renderer is moved and scaled, in float64 before any rounding.
Scales are powers of two and shifts have few digits, so that what is exact stays exact.

A shape group has such a frame too, for the renderer turns rays into its coordinates: one that was
modelled far from its own origin is moved there, and its instances lead back.
"""

from dataclasses import dataclass, replace

import numpy as np

from asmjax.geometry import LightFrame

SMALLEST, LARGEST = 2.0**-4, 2.0**14
"""Diagonals of scenes that are cast as they are, if they are near the origin."""

DIAGONAL_LOG2 = 3
"""Others are scaled to a diagonal from 2^3 to 2^4."""

FARTHEST = 4.0
"""Scenes whose centre is farther from the origin than this many diagonals are moved."""

CENTRE_STEPS = 16
"""Shifts are whole numbers of a power of two of which the diagonal has this many, about."""


@dataclass(frozen=True)
class WorkingFrame:
    """Working coordinates are (world - `centre`) * `scale`.

    Attributes:
        centre: world, scene units; it becomes the origin.
        scale: working units / scene unit, a power of two.
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0

    @property
    def is_identity(self) -> bool:
        return self.scale == 1.0 and not any(self.centre)

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4) float64, from world to working coordinates."""
        matrix = np.eye(4)
        matrix[:3, :3] *= self.scale
        matrix[:3, 3] = -self.scale * np.array(self.centre)
        return matrix

    @property
    def inverse(self) -> np.ndarray:
        """(4, 4) float64, from working to world coordinates."""
        matrix = np.eye(4)
        matrix[:3, :3] /= self.scale
        matrix[:3, 3] = self.centre
        return matrix

    def inward(self, points: np.ndarray) -> np.ndarray:
        """Working coordinates (3, n) float64 of world points (3, n)."""
        if self.is_identity:
            return points
        return (points - np.array(self.centre)[:, None]) * self.scale

    def outward(self, points: np.ndarray) -> np.ndarray:
        """World points (3, n) float64 of working coordinates (3, n)."""
        if self.is_identity:
            return points
        return points / self.scale + np.array(self.centre)[:, None]

    def light_frame(self, frame: LightFrame) -> LightFrame:
        """A light's frame with rays in working coordinates, without its area, which no ray needs;
        depths there are `scale` times ours."""
        if self.is_identity:
            return frame
        # Of perspective faces the plane's coordinates are slopes.
        plane = 1.0 if frame.perspective else self.scale
        return replace(
            frame,
            origin=self.inward(frame.origin[:, None])[:, 0],
            corner=frame.corner * plane,
            extent=frame.extent * plane,
            near=frame.near * self.scale,
            area=None,
        )

    def places_inward(self, places: np.ndarray) -> np.ndarray:
        """(3, 4, n) float64: transforms into world coordinates, followed by the one into working
        coordinates."""
        if self.is_identity:
            return places
        placed = self.scale * places
        placed[:, 3] -= self.scale * np.array(self.centre)[:, None]
        return placed

    def places_outward(self, places: np.ndarray) -> np.ndarray:
        """The inverse of `places_inward`."""
        if self.is_identity:
            return places
        placed = places / self.scale
        placed[:, 3] += np.array(self.centre)[:, None]
        return placed

    def places_from(self, places: np.ndarray) -> np.ndarray:
        """(3, 4, n) float64: transforms out of coordinates that this frame, as one of a shape
        group, takes for the world's, preceded by the way into those."""
        if self.is_identity:
            return places
        return np.einsum("ikn,kj->ijn", places, self.inverse)


WORLD = WorkingFrame()
"""Rays are cast where the scene is."""


def working_frame(bounds: np.ndarray, known: WorkingFrame = WORLD) -> WorkingFrame:
    """The frame for a scene with the box `bounds` (3, 2) float64, min and max per axis.

    `WORLD` for scenes of usual size near the origin; `known` itself where the scene already is
    as it should be in there. A box without a size, as a small one may be that was rounded far away,
    is moved to the origin.
    """
    if not np.isfinite(bounds).all():
        return known
    inside = known.inward(bounds)
    diagonal = float(np.linalg.norm(inside[:, 1] - inside[:, 0]))
    far = np.abs(inside.mean(axis=1)).max() > FARTHEST * diagonal
    if not far and (diagonal == 0 or SMALLEST <= diagonal <= LARGEST):
        return known
    diagonal = float(np.linalg.norm(bounds[:, 1] - bounds[:, 0]))
    centre = bounds.mean(axis=1)
    if diagonal == 0:
        return WorkingFrame((float(centre[0]), float(centre[1]), float(centre[2])))
    octave = np.floor(np.log2(diagonal))
    step = 2.0**octave / CENTRE_STEPS
    rounded = np.round(centre / step) * step
    return WorkingFrame(
        centre=(float(rounded[0]), float(rounded[1]), float(rounded[2])),
        scale=float(2.0 ** (DIAGONAL_LOG2 - octave)),
    )
