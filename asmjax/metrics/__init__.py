"""Errors of a method's shadows against truth, from plain images; NumPy in, floats out."""

from asmjax.metrics.boundary import (
    CAP_PX,
    BoundaryDisplacement,
    SurfacePairs,
    boundary_displacement,
    boundary_edges,
    boundary_length,
    edge_midpoints,
    surface_pairs,
)
from asmjax.metrics.soft_error import NOTICED, SoftError, soft_error
from asmjax.metrics.summary import error_summary
from asmjax.metrics.visibility_error import VisibilityError, signed_error, visibility_error

__all__ = [
    "CAP_PX",
    "NOTICED",
    "BoundaryDisplacement",
    "SoftError",
    "SurfacePairs",
    "VisibilityError",
    "boundary_displacement",
    "boundary_edges",
    "boundary_length",
    "edge_midpoints",
    "error_summary",
    "signed_error",
    "soft_error",
    "surface_pairs",
    "visibility_error",
]
