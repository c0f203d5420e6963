"""What of a scene lets light through, and what surrounds it, as plain data."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Materials:
    """Of each shape, in scene order, what a ray of light meets there.

    Attributes:
        straight: (n_shapes,) float64, part of the light that passes without a turn: 0 for an opaque
            surface, 1 for one that is not there (null); the mean of a texture.
        textured: (n_shapes,) bool, whether `straight` differs from place to place.
        refracts: (n_shapes,) bool, whether light passes with a turn (dielectrics).
        extinction: (n_shapes,) float64, the largest of the medium inside, per scene unit; 0 for
            none.
    """

    straight: np.ndarray
    textured: np.ndarray
    refracts: np.ndarray
    extinction: np.ndarray

    @property
    def transmits(self) -> bool:
        """Whether anything lets light through without a turn, or dims it on its way."""
        return bool((self.straight > 0).any() or (self.extinction > 0).any())

    @property
    def opaque(self) -> bool:
        """Whether nothing lets any light through."""
        return not self.transmits and not self.refracts.any()

    def words(self) -> str:
        """How many shapes of each kind, such as "transmissive: 3 shapes; media: 1"."""
        counts = {
            "transmissive shapes": int(np.count_nonzero(self.straight)),
            "refractive shapes": int(np.count_nonzero(self.refracts)),
            "shapes with a medium inside": int(np.count_nonzero(self.extinction)),
        }
        return ", ".join(f"{name}: {count}" for name, count in counts.items() if count)


def opaque_materials(shapes: int) -> Materials:
    """Of so many shapes that let nothing through."""
    none = np.zeros(shapes)
    return Materials(none, none > 0, none > 0, none)


DIRECTIONS = 256
"""Directions in which the radiance of surroundings is looked at."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """An emitter all around the scene, which no map of a light stands for.

    Attributes:
        name: its id.
        directions: (3, k) float64, world, unit, each for an equal part of what is looked at.
        luminance: (k,) float64, of the radiance from there.
    """

    name: str
    directions: np.ndarray
    luminance: np.ndarray

    def irradiance(self, normal: np.ndarray) -> np.ndarray:
        """What arrives at receivers with unit normals (3, n) where nothing shades them, (n,): pi
        times the radiance, mean over the hemisphere by the cosine; a sky brings twice as much to a
        floor as to a wall."""
        cosine = np.maximum(self.directions.T @ normal, 0)
        weight = cosine.sum(axis=0)
        return np.pi * (self.luminance @ cosine) / np.where(weight > 0, weight, 1.0)

    def towards(self, directions: np.ndarray) -> np.ndarray:
        """Luminance (n,) of the radiance from unit vectors (3, n): of what was seen nearest."""
        if np.ptp(self.luminance) == 0:
            return np.full(directions.shape[1], self.luminance[0])
        return self.luminance[(self.directions.T @ directions).argmax(axis=0)]


def even_directions(count: int = DIRECTIONS) -> np.ndarray:
    """Unit vectors (3, count) float64 on a spiral that is even on the sphere."""
    step = np.arange(count) + 0.5
    z, angle = 1 - 2 * step / count, step * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z])


def even_surroundings(name: str, radiance: float) -> Surroundings:
    """As bright from everywhere."""
    return Surroundings(name, even_directions(), np.full(DIRECTIONS, radiance))
