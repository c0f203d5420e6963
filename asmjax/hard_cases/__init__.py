"""A catalogue of hard cases: the numerical traps of shadow maps as data, and their measure.

    from asmjax.hard_cases import CASES, measure

    for record in measure(CASES["light parallel to the receiver"]):
        print(record.algorithm, record.severity, record.error, record.verdict)

Kernel cases ask one kernel beside fifty digits or a closed form; scene cases ask every algorithm
beside float64 shadow rays. `docs/stability.md` is the whole of it, measured.
"""

from asmjax.hard_cases import (
    addresses,
    hits,
    ids,
    lights,
    projections,
    soft,
    surfaces,
    views,
    warps,
)
from asmjax.hard_cases.case import ROWS, THEMES, Bound, HardCase, Kernel
from asmjax.hard_cases.measure import PRECISIONS, SIDE, Measured, families_of, measure
from asmjax.hard_cases.scene import Scene, Setup, traced

CASES: dict[str, HardCase] = {
    case.name: case
    for module in (projections, addresses, hits, ids, warps, lights, views, surfaces, soft)
    for case in module.CASES
}
"""By name, kernels first."""

__all__ = [
    "CASES",
    "PRECISIONS",
    "ROWS",
    "SIDE",
    "THEMES",
    "Bound",
    "HardCase",
    "Kernel",
    "Measured",
    "Scene",
    "Setup",
    "families_of",
    "measure",
    "traced",
]
