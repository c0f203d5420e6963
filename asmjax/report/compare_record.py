"""A comparison as the entries of its report."""

import sys
from collections.abc import Sequence

import jax

from asmjax.experiment.clock import median_of
from asmjax.experiment.comparison import (
    COSTS,
    Compared,
    EqualError,
    equal_errors,
    front_of,
    telling_errors,
)
from asmjax.experiment.trial import Trial
from asmjax.plain import NonFinite, plain
from asmjax.report.compare_result import ComparisonResult
from asmjax.report.compare_schema import COMPARISON_SCHEMA
from asmjax.report.measured import cost_model_record
from asmjax.report.provenance import provenance
from asmjax.report.record import report_of_entries


def report_of_comparison(result: ComparisonResult, seed: int) -> dict:
    """The validated `report.json` of a comparison with that seed."""
    model = result.cost_model
    return report_of_entries(
        schema=COMPARISON_SCHEMA,
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.variant, jax.devices()[0].device_kind),
        seed=seed,
        memory=result.memory,
        scene=result.scene,
        view=", ".join(view.name for view in result.views),
        light=result.light,
        size=result.views[0].size,
        memory_limit_bytes=result.memory_bytes,
        ended=result.ended,
        trials_asked=result.asked,
        measurements={"made": result.made, "reused": result.reused},
        cost_model=None if model is None else cost_model_record(model),
        views=[
            {
                "name": view.name,
                "size": view.size,
                "valid_pixels": view.valid_pixels,
                "samples": [
                    {"samples": samples, "edge_length_px": length}
                    for samples, length in view.edges.items()
                ],
            }
            for view in result.views
        ],
        trials=[record for samples in result.samples for record in _trials(result, samples)],
        yardsticks=[_trial(item) for item in result.yardsticks],
        equal_error=[
            record for samples in result.samples for record in _equal(result.of(samples), samples)
        ],
        notices=result.notices,
    )


def _trials(result: ComparisonResult, samples: int) -> list[dict]:
    items = result.of(samples)
    fronts = {kind: [id(item) for item in front_of(items, kind)] for kind in COSTS}
    return [
        _trial(item) | {"on_front": {kind: id(item) in fronts[kind] for kind in COSTS}}
        for item in items
    ]


def _trial(item: Compared) -> dict:
    trial = item.trial
    return {
        "name": trial.name,
        "family": trial.family,
        "label": item.label,
        "settings": plain(trial.settings, NonFinite.NAMED),
        "samples": trial.samples,
        **measured_record(trial),
        "ranked_seconds": item.seconds.record(),
        "views": [{"view": view.view, **measured_record(view)} for view in item.views],
    }


def measured_record(trial: Trial) -> dict:
    """Errors, times with intervals and memory of a trial."""
    stages = {stage: median_of(runs).record() for stage, runs in trial.seconds.items()}
    return {
        "error": trial.error,
        "predicted_displacement_px": trial.predicted_px,
        "seconds": stages | {"total": trial.total.record()},
        "ratio": trial.ratio.record(),
        "bytes": trial.bytes,
        "texels": trial.texels,
        "rays": trial.rays,
        "nodes": trial.nodes,
        "status": trial.status,
    }


def _equal(items: Sequence[Compared], samples: int) -> list[dict]:
    wanted = telling_errors(items)
    by_cost = [equal_errors(items, kind, wanted) for kind in COSTS]
    return [
        {
            "samples": samples,
            "error_px": seconds.error_px,
            "family": seconds.family,
            "seconds": _reach(seconds),
            "bytes": _reach(bytes),
        }
        for seconds, bytes in zip(*by_cost, strict=True)
    ]


def _reach(found: EqualError) -> dict:
    reach = found.reach
    return {
        "value": None if reach is None else reach.cost,
        "bound": reach is not None and reach.bound,
        "ratio": found.ratio,
    }
