"""Visibility of a light that has a size, by many shadow rays, and how sure it is."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.errors import UseError, require
from asmjax.geometry import LightFrame, in_domain, stratified
from asmjax.scene.analytic import closest
from asmjax.scene.spec import Shape

STRATA = 8
"""Cells of a light a side, of equal area."""

REPEATS = 4
"""Samples in each cell; their spread is what the standard error is made of."""

LIFTED = 1e-9
"""Float64 shadow rays start this much of their coordinates' size above the surface."""


class SoftVisibility(NamedTuple):
    """The visible share of a light's area, and the standard error of its estimate, both (n,)
    float64.

    Of a sphere the share of the disk that the receiver sees. What is behind the receiver's own
    plane is not visible, and nothing is from where a flat light does not emit to.
    """

    visibility: np.ndarray
    error: np.ndarray


class LightSamples:
    """Where the shadow rays of one view go to a light with a size; a seed gives everybody the same.

    Args:
        frame: of the light, with its area.
        strata: cells of the light a side.
        repeats: samples in each cell.
        seed: of the samples' places in their cells, which are each pixel's own.

    Attributes:
        pixels: those that the light may reach; all others are dark without a ray.
        world, normal: (3, n) float64 of these, the unit normals towards the eye.
        count: rays in all.

    Raises:
        UseError: the light has no size, or there are no cells, or less than two samples in each.
    """

    def __init__(
        self,
        eye: EyeBuffer,
        frame: LightFrame,
        strata: int = STRATA,
        repeats: int = REPEATS,
        seed: int | tuple[int, ...] = 0,
    ):
        if frame.area is None:
            raise UseError(
                "soft truth is of lights with a size, and this one has none; give it an area, or "
                "take hard truth."
            )
        require(
            strata >= 1 and repeats >= 2,
            f"{strata} x {strata} cells with {repeats} samples each are not possible; allowed: 1 "
            "cell or more and 2 samples or more, whose spread is the error.",
        )
        self.frame, self._area = frame, frame.area
        self._strata, self._repeats, self._seed = strata, repeats, seed
        self._all = eye.valid.size
        self.pixels = self._reached(eye)
        self.world, self.normal = eye.world[:, self.pixels], eye.normal[:, self.pixels]
        self.count = int(self.pixels.size) * strata**2 * repeats

    def _reached(self, eye: EyeBuffer) -> np.ndarray:
        area, world = self._area, np.where(eye.valid, eye.world, 0.0)
        if area.shape == "sun":
            to_centre = np.broadcast_to(-area.normal[:, None], world.shape)
        else:
            to_centre = area.centre[:, None] - world
        height = np.einsum("in,in->n", eye.normal, to_centre) + area.extent_along(eye.normal)
        seen = eye.valid & (height > 0) & in_domain(self.frame, world)
        return np.flatnonzero(seen & area.emits_towards(world))

    def estimate(self, blocked: Callable[[np.ndarray], np.ndarray]) -> SoftVisibility:
        """The mean over all samples, (n,) of all eye pixels. Cells are strata, so that only the
        spread within a cell is an error (Cochran 1977, Sampling Techniques, section 5.6).

        Args:
            blocked: from a sample for each of `pixels`, (3, n) float64, to whether something
                stands before it, (n,) bool. Points of the light, world, or directions towards the
                sun.
        """
        chance = np.random.default_rng(self._seed)
        count, repeats = self.pixels.size, self._repeats
        total, spread = np.zeros(count), np.zeros(count)
        for centre in stratified(self._strata).T:
            lit = np.zeros(count)
            for _ in range(repeats):
                square = centre[:, None] + (chance.random((2, count)) - 0.5) / self._strata
                sample, towards = self._sample(square)
                in_front = np.einsum("in,in->n", self.normal, towards) > 0
                lit += in_front & ~blocked(sample)
            total += lit
            # repeats^2 times p (1 - p) for the share p of lit samples in the cell.
            spread += lit * (repeats - lit)
        cells = self._strata**2
        variance = spread / (repeats**2 * (repeats - 1) * cells**2)
        visibility, error = np.zeros(self._all), np.zeros(self._all)
        visibility[self.pixels], error[self.pixels] = total / (repeats * cells), np.sqrt(variance)
        return SoftVisibility(visibility, error)

    def _sample(self, square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What `blocked` takes, and directions (3, n) towards it."""
        offset = self._area.offsets(square, self.world)
        if self._area.shape == "sun":
            towards = -(self._area.normal[:, None] + offset)
            return towards, towards
        sample = self._area.centre[:, None] + offset
        return sample, sample - self.world


def analytic_soft_visibility(
    shapes: Sequence[Shape],
    eye: EyeBuffer,
    frame: LightFrame,
    strata: int = STRATA,
    repeats: int = REPEATS,
    seed: int | tuple[int, ...] = 0,
) -> SoftVisibility:
    """Soft truth of analytic shapes by float64 rays; the lamp is not one of the shapes.

    Raises:
        UseError: as `LightSamples`.
    """
    samples = LightSamples(eye, frame, strata, repeats, seed)
    size = np.maximum(np.abs(samples.world).max(axis=0, initial=0.0), eye.depth[samples.pixels])
    start = samples.world + LIFTED * size * samples.normal

    def blocked(sample: np.ndarray) -> np.ndarray:
        if not frame.perspective:
            return closest(shapes, start, sample)[1] >= 0
        return closest(shapes, start, sample - start, 0.0, 1.0)[1] >= 0

    return samples.estimate(blocked)
