"""Predicted against measured: how far texels of a known size must move a shadow's edge.

A texel's square of edges a and b (pixels) moves an edge of unit normal n by A/4 + B^2 / (12 A) on
average, A >= B the two of |a . n| and |b . n| (M4 of docs/theory.md): so many pixels go wrong per
pixel of edge. The prediction knows the map's density and truth's edges; it looks up no texel.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from asmjax.buffers import EyeBuffer
from asmjax.experiment.aliasing import AliasingMaps
from asmjax.metrics.boundary import SurfacePairs, boundary_edges, surface_pairs
from asmjax.metrics.windows import box_sum
from asmjax.theory import mean_displacement, texel_edges

WINDOW = 5
"""Side, in pixels, of the window that tells an edge's direction."""


@dataclass(frozen=True)
class Displacement:
    """Pixels that go wrong per pixel of truth's edges, on surfaces that texels answer.

    Attributes:
        predicted: from the texels' sizes alone (M4).
        measured: misclassified pixels / length.
        length: of truth's edges, pixels.
    """

    predicted: float
    measured: float
    length: float


@dataclass(frozen=True, eq=False)
class TruthEdges:
    """Where the shadow's edges of truth lie in the image, pair by pair of neighbouring pixels.

    Attributes:
        pixel: (2, k) the two pixels of each pair, flat.
        normal: (2, k) unit normal of the edge, right and down.
        length: (k,) pixels of edge that the pair stands for.
    """

    pixel: np.ndarray
    normal: np.ndarray
    length: np.ndarray


def truth_edges(truth: ArrayLike, eye: EyeBuffer, counted: np.ndarray) -> TruthEdges:
    """The edges of `truth` (n,) between neighbours that see one surface and are both `counted`."""
    height, width = eye.size
    lit = (np.asarray(truth) >= 0.5).reshape(height, width)
    pairs = surface_pairs(counted.reshape(height, width), eye.depth.reshape(height, width))
    edges = boundary_edges(lit, pairs)
    right, down = _signed(lit, edges)
    across, along = box_sum(right, WINDOW), box_sum(down, WINDOW)
    number = np.arange(height * width).reshape(height, width)
    parts = []
    for mask, one, other in (
        (edges.right, np.s_[:, :-1], np.s_[:, 1:]),
        (edges.down, np.s_[:-1], np.s_[1:]),
    ):
        normal = np.stack([(a[one] + a[other])[mask] for a in (across, along)])
        own = normal[0] if mask is edges.right else normal[1]
        norm = np.hypot(*normal)
        # Two edges of a thin shadow cancel: each pair is then taken for an edge of its own.
        alone = np.abs(own) < 0.1 * norm
        alone |= norm == 0
        straight = np.zeros_like(normal)
        straight[0 if mask is edges.right else 1] = 1
        normal = np.where(alone, straight, normal / np.where(norm == 0, 1, norm))
        length = np.abs(normal[0] if mask is edges.right else normal[1])
        parts.append((np.stack([number[one][mask], number[other][mask]]), normal, length))
    return TruthEdges(*(np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)))


def _signed(lit: np.ndarray, edges: SurfacePairs) -> tuple[np.ndarray, np.ndarray]:
    """Images (height, width) of steps to the right and down: +1 into light, -1 out of it, at both
    pixels of a pair."""
    right, down = np.zeros(lit.shape), np.zeros(lit.shape)
    step = np.where(edges.right, lit[:, 1:].astype(float) - lit[:, :-1], 0.0)
    right[:, :-1] += step
    right[:, 1:] += step
    step = np.where(edges.down, lit[1:].astype(float) - lit[:-1], 0.0)
    down[:-1] += step
    down[1:] += step
    return right, down


def displacement(
    truth: ArrayLike, visibility: ArrayLike, eye: EyeBuffer, maps: AliasingMaps
) -> Displacement:
    """Both numbers for one map. Without any edge, all are 0."""
    counted = eye.valid & maps.known
    edges = truth_edges(truth, eye, counted)
    length = float(edges.length.sum())
    if length == 0:
        return Displacement(0.0, 0.0, 0.0)
    # Of the two pixels' Jacobians the mean of what they predict.
    expected = np.mean([_expected(maps.jacobian[..., pixel], edges) for pixel in edges.pixel], 0)
    predicted = float((expected * edges.length).sum()) / length
    wrong = (np.asarray(truth) >= 0.5) != (np.asarray(visibility) >= 0.5)
    return Displacement(predicted, float((wrong & counted).sum()) / length, length)


def _expected(jacobian: np.ndarray, edges: TruthEdges) -> np.ndarray:
    texels = texel_edges(jnp.asarray(jacobian), 1.0)
    normal = jnp.asarray(edges.normal, texels.dtype)
    return np.asarray(mean_displacement(texels, normal), np.float64)
