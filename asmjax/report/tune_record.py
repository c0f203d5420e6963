"""What tuning gave, as the entries of its report."""

import math
import sys
from typing import Any

import jax
import numpy as np

from asmjax.plain import NonFinite, plain
from asmjax.report.compare_record import measured_record
from asmjax.report.measured import cost_model_record
from asmjax.report.provenance import provenance
from asmjax.report.record import report_of_entries
from asmjax.report.tune_result import TuningResult
from asmjax.report.tune_schema import RIVALS, TUNING_SCHEMA
from asmjax.tuning.goal import Goal
from asmjax.tuning.result import Candidate, FrontPoint, Sensitivity


def report_of_tuning(result: TuningResult, seed: int) -> dict:
    """The validated `report.json` of tuning with that seed."""
    found = result.found
    return report_of_entries(
        schema=TUNING_SCHEMA,
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.variant, jax.devices()[0].device_kind),
        seed=seed,
        memory=result.memory,
        scene=found.scene,
        view=", ".join(view.name for view in result.seen),
        light=result.light,
        size=result.seen[0].size,
        memory_limit_bytes=found.space.base.memory_bytes,
        goal={"kind": found.goal.kind, "value": found.goal.value, "words": found.goal.words},
        views=[
            {
                "name": view.name,
                "held_out": view.name in found.held_out,
                "size": view.size,
                "valid_pixels": view.valid_pixels,
                "edge_length_px": view.edges[1],
            }
            for view in result.seen
        ],
        outcome=found.outcome.name.lower(),
        advice=found.advice,
        objective={name: _rival(result, name) for name in RIVALS},
        evaluations=found.evaluations,
        measurements={"made": result.made, "reused": found.reused},
        seconds=found.seconds,
        tried=tried_records(result),
        finalists=[candidate_record(one, found.goal) for one in found.finalists],
        calibration=_calibration(result),
        rank_correlation=_finite(found.rank_correlation),
        sensitivity=None if found.sensitivity is None else _sensitivity(found.sensitivity),
        front=[_front(point) for point in found.front],
        cost_model=cost_model_record(result.cost_model),
        notices=result.notices,
    )


def candidate_record(one: Candidate, goal: Goal) -> dict[str, Any]:
    """A candidate, all of its views together."""
    return {
        "role": one.role,
        "settings": plain(one.settings, NonFinite.NAMED),
        "met": goal.met(one.edge_px, one.seconds),
        "objective": _finite(one.objective(goal)),
        "edge_px": one.edge_px,
        "seconds": one.whole.total.record(),
        "ratio": one.ratio.record(),
        "bytes": one.whole.bytes,
    }


def tried_records(result: TuningResult) -> list[dict[str, Any]]:
    """All that were measured on the views tuned on, with what the surrogate says of them."""
    return [
        candidate_record(one, result.found.goal)
        | {"predicted": {"edge_px": _finite(edge_px), "seconds": _finite(seconds)}}
        for one, (edge_px, seconds) in zip(
            result.found.tried, result.found.said.T.tolist(), strict=True
        )
    ]  # fmt: skip


def _rival(result: TuningResult, name: str) -> dict[str, Any] | None:
    one = result.found.rivals.get(name)
    if one is None:
        return None
    settings = one.trials[0].settings
    return candidate_record(one, result.found.goal) | {
        "all_settings": plain(settings, NonFinite.NAMED),
        "gain": result.gain_over(name),
        "views": [{"view": trial.view, **measured_record(trial)} for trial in one.trials],
    }


def _calibration(result: TuningResult) -> list[dict[str, Any]]:
    return [
        {
            "view": view,
            "trials": fitted.trials,
            "error_misfit": fitted.error_misfit,
            "seconds_misfit": fitted.seconds_misfit,
            "settled": fitted.settled,
            "fit": {name: float(number) for name, number in fitted.fit._asdict().items()},
        }
        # None, where tuning was interrupted before there was a fit.
        for view, fitted in zip(result.found.views, result.found.calibrations, strict=False)
    ]


def _sensitivity(found: Sensitivity) -> dict[str, Any]:
    return {
        "price": found.price,
        "log_settings": found.log_settings,
        "log_edge": found.log_edge,
        "log_seconds": found.log_seconds,
        "settled": found.settled,
    }


def _front(point: FrontPoint) -> dict[str, Any]:
    return {
        "price": point.price,
        "settings": point.settings,
        "edge_px": point.edge_px,
        "seconds": point.seconds,
        "gap": point.gap,
        "taken_over": point.taken_over,
    }


def _finite(value: float | np.floating) -> float | None:
    return float(value) if math.isfinite(value) else None
