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


@dataclass(frozen=True)
class Surroundings:
    """An emitter all around the scene, which no map of a light stands for.

    Attributes:
        name: its id.
        radiance: mean luminance over all directions.
    """

    name: str
    radiance: float
