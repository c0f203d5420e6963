"""Running hard cases: errors against truth in both precisions, and whether failure is announced."""

import functools
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isqrt
from typing import Literal

import jax
import numpy as np

from asmjax.errors import UseError, unknown_name
from asmjax.hard_cases.case import HardCase, Kernel
from asmjax.hard_cases.judge import judged, judged_soft
from asmjax.hard_cases.scene import Setup
from asmjax.shadow import (
    FILTERS,
    MAPS,
    SOFT,
    AdaptiveShadowMap,
    CostModel,
    ShadowAlgorithm,
    of_resolution,
)
from asmjax.shadow.comparison import texel_bytes

Precision = Literal["float32", "float64"]
Verdict = Literal["stable", "announced", "silent"]

PRECISIONS: tuple[Precision, ...] = ("float32", "float64")

SIDE = 32
"""Pixels a side of scene cases."""

TEXELS = 4**7
"""Texels of each map in all: 16 for each pixel, unless its memory goes to tables."""

SOFT_TEXELS = 4**9
"""The same under lights with a size, where the errors of texels at edges would hide all others."""

_COSTS = CostModel(a_seconds_per_texel=1e-8, b_seconds=1e-5, residual=0.0)
"""Calibrated ones would make the order of refinement depend on the machine's load."""


@dataclass(frozen=True)
class Measured:
    """One case at one severity in one precision; of a scene, with one algorithm.

    Attributes:
        algorithm: family name; "" for a kernel.
        error: in the unit of the case's bound; NaN where nothing came back.
        gradient_error: relative to the largest entry of the gradient; None where not asked for.
        wrong: share of judged pixels wrong in all, edges of texels included; None for kernels.
        silent: the part of `error` that nothing announces.
        verdict: "stable" within the bound, "announced" or "silent" beyond it.
        how: what announced it; "" where nothing did.
    """

    case: str
    algorithm: str
    precision: Precision
    severity: float
    error: float
    gradient_error: float | None
    wrong: float | None
    silent: float
    verdict: Verdict
    how: str


def measure(
    case: HardCase,
    *,
    severities: Iterable[float] | None = None,
    precisions: Sequence[Precision] = PRECISIONS,
    algorithms: Iterable[str] | None = None,
    side: int = SIDE,
) -> list[Measured]:
    """`case` at each severity, in each precision, and for a scene with each algorithm.

    Args:
        severities: some of the case's, or others; None for all of them.
        algorithms: family names; None for all of `families_of`. A kernel has none.
        side: pixels a side of a scene.

    Raises:
        UseError: an algorithm that is not asked on such cases.
    """
    asked = families_of(case)
    families = asked if algorithms is None else tuple(algorithms)
    for family in families:
        if case.is_scene and family not in asked:
            raise unknown_name("algorithm", family, asked)
    found: list[Measured] = []
    for severity in case.severities if severities is None else severities:
        for precision in precisions:
            with jax.enable_x64(precision == "float64"):
                if case.is_scene:
                    found += _scene(case, severity, precision, families, side)
                else:
                    found.append(_kernel(case, severity, precision))
    return found


def families_of(case: HardCase) -> tuple[str, ...]:
    """The algorithms that are asked on a scene: soft maps under lights with a size, and maps and
    filters of one under others, which make soft maps the uniform one."""
    if not case.is_scene:
        return ()
    return tuple(SOFT) if case.is_soft else (*MAPS, *FILTERS)


def algorithm_for(family: str, faces: int, texels: int = TEXELS) -> ShadowAlgorithm:
    """An algorithm of that family with so many texels in all for a light of so many faces."""
    if family == "adaptive":
        # Its own comparison stores both depth and primitive, 6 bytes a texel.
        return AdaptiveShadowMap(memory_bytes=texels * texel_bytes("both"), cost_model=_COSTS)
    return of_resolution(family, isqrt(texels // faces))


# Scenes.


def _scene(
    case: HardCase, severity: float, precision: Precision, families: Iterable[str], side: int
) -> Iterator[Measured]:
    setup = case.build(severity)
    assert isinstance(setup, Setup)
    try:
        scene = setup.traced(side)
    except UseError as problem:
        for family in families:
            yield _refused(case, family, precision, severity, problem)
        return
    for family in families:
        try:
            texels = SOFT_TEXELS if scene.is_soft else TEXELS
            algorithm = algorithm_for(family, scene.frame.faces, texels)
            state = algorithm.build(scene.eye, scene.frame, scene.rays)
        except UseError as problem:
            yield _refused(case, family, precision, severity, problem)
            continue
        found = (judged_soft if scene.is_soft else judged)(scene, algorithm, state)
        verdict, how = _verdict(found.error, found.silent, case.bound.of(precision), found.how)
        yield Measured(
            case.name, family, precision, severity, found.error, None, found.wrong, found.silent,
            verdict, how,
        )  # fmt: skip


def _verdict(error: float, silent: float, bound: float, how: str) -> tuple[Verdict, str]:
    """The verdict, and what announced it."""
    if error <= bound:
        return "stable", ""
    return ("announced", how) if silent <= bound else ("silent", "")


# Kernels.


def _kernel(case: HardCase, severity: float, precision: Precision) -> Measured:
    kernel = case.build(severity)
    assert isinstance(kernel, Kernel)
    refusal = _refusal_of(kernel)
    dtype = np.dtype(precision)
    with np.errstate(over="ignore"):
        inputs = [np.asarray(x, dtype) for x in kernel.inputs]
    exact = [x.astype(np.float64) for x in inputs]
    if refusal and not kernel.goes_on:
        return _refused(case, "", precision, severity, refusal)
    run = kernel.value if kernel.host else _compiled(kernel.value)
    value = np.asarray(run(*inputs), np.float64)
    truth = kernel.truth(*exact)
    errors = _errors(value, truth, kernel.unit)
    gradient_error, slopes = None, np.zeros(1)
    if kernel.gradient is not None and kernel.gradient_truth is not None:
        gradient = np.asarray(_compiled(kernel.gradient)(*inputs), np.float64)
        expected = kernel.gradient_truth(*exact)
        unit = np.abs(expected).max()
        slopes = _errors(gradient, expected, float(unit) if unit > 0 else 1.0)
        gradient_error = float(slopes.max())
    marks = np.zeros(1, bool)
    if kernel.marks is not None:
        marks = np.asarray(_compiled(kernel.marks)(*inputs))
    bound, steepest = case.bound.of(precision), case.bound.of_gradient(precision)
    error = float(errors.max())
    stable = error <= bound and (gradient_error or 0.0) <= steepest
    left = _unmarked(errors, marks), _unmarked(slopes, marks)
    if refusal:
        verdict, how, left = "announced", f"refused: {refusal}", (0.0, 0.0)
    elif stable:
        verdict, how = "stable", ""
    elif left[0] <= bound and left[1] <= steepest:
        verdict, how = "announced", "marked"
    else:
        verdict, how = "silent", ""
    return Measured(
        case.name, "", precision, severity, error, gradient_error, None, left[0], verdict, how
    )


def _refusal_of(kernel: Kernel) -> str:
    if kernel.refusal is None:
        return ""
    try:
        kernel.refusal()
    except UseError as problem:
        return str(problem)
    return ""


def _refused(
    case: HardCase, family: str, precision: Precision, severity: float, problem: object
) -> Measured:
    how = f"refused: {re.sub(r'[(][^)]*[)]', '', str(problem))}"
    return Measured(
        case.name, family, precision, severity, math.nan, None, None, 0.0, "announced", how
    )


def _errors(value: np.ndarray, truth: np.ndarray, unit: float | None) -> np.ndarray:
    """Errors in units, or relative ones; infinite where a value is not the number it should be."""
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.abs(truth) if unit is None else unit
        off = np.abs(value - truth)
        relative = off / np.where(size > 0, size, 1.0)
    return np.where(value == truth, 0.0, np.where(np.isnan(relative), np.inf, relative))


def _unmarked(errors: np.ndarray, marks: np.ndarray) -> float:
    """The largest error of an entry that is not marked; entries count along the last axis."""
    fits = marks.shape[-1:] == errors.shape[-1:]
    return float(np.where(marks if fits else False, 0.0, errors).max())


@functools.cache
def _compiled(function):
    """One compilation for each function, shape and precision."""
    return jax.jit(function)
