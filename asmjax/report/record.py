"""Builds the record of a run, and writes it whole or not at all."""

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from operator import index
from typing import SupportsIndex

import numpy as np

from asmjax.memory import Forecast
from asmjax.plain import NonFinite, plain
from asmjax.report.keys import InvalidReport, first_unstorable
from asmjax.report.schema import RUN_SCHEMA, validate_report
from asmjax.writing import text_writer, write_file


def map_summary(values, valid) -> dict:
    """The `maps` entry of one map: p50, p95, max and count over valid pixels.

    Pixels without a finite value (a light edge-on) are left out, so that one of them does not
    make the whole summary infinite; `count` says how many remain.
    """
    chosen = np.asarray(values, np.float64)[np.asarray(valid, bool)]
    chosen = chosen[np.isfinite(chosen)]
    if not chosen.size:
        return {"p50": 0.0, "p95": 0.0, "max": 0.0, "count": 0}
    p50, p95 = np.percentile(chosen, [50, 95])
    return {
        "p50": float(p50),
        "p95": float(p95),
        "max": float(chosen.max()),
        "count": int(chosen.size),
    }


def method_record(
    name: str,
    *,
    settings: Mapping,
    effective_resolution: SupportsIndex | None,
    bytes: SupportsIndex,
    rays: SupportsIndex,
    seconds: Mapping[str, float],
    error: Mapping,
    **more,
) -> dict:
    """One entry of `methods`; units and further keys as in `asmjax.report.schema`.

    Args:
        seconds: build, analysis and query, and id_pass in a walkthrough; `total` is their sum
            unless given.
        error: from `asmjax.metrics.error_summary`.
        more: bias of a map; nodes, passes, max_level and status of an adaptive method.
    """
    stages = {stage: float(seconds.get(stage, 0.0)) for stage in ("build", "analysis", "query")}
    if "id_pass" in seconds:
        stages["id_pass"] = float(seconds["id_pass"])
    texels = None if effective_resolution is None else index(effective_resolution)
    return {
        "name": name,
        "settings": plain(settings, NonFinite.NAMED),
        "effective_resolution": texels,
        "bytes": index(bytes),
        "rays": index(rays),
        "seconds": stages | {"total": float(seconds.get("total", sum(stages.values())))},
        "error": dict(error),
    } | more


def run_report(
    *,
    argv: Sequence[str],
    provenance: Mapping,
    seed: SupportsIndex,
    scene: str,
    view: str,
    light: str,
    size: Sequence[int],
    truth: Mapping,
    cost_model: Mapping,
    maps: Mapping[str, Mapping],
    methods: Sequence[Mapping],
    notices: Sequence[str] = (),
    memory: Forecast | None = None,
    **more,
) -> dict:
    """The validated report of `asmjax run`, NumPy and JAX scalars turned into plain numbers.

    Args:
        argv: the command line, program first.
        provenance: from `asmjax.report.provenance`.
        size: (width, height) in pixels.
        more: `plan`, as `asmjax.effects.Plan.record`.

    Raises:
        InvalidReport: as `validate_report`.
    """
    return report_of_entries(
        schema=RUN_SCHEMA,
        argv=argv,
        provenance=provenance,
        seed=seed,
        scene=scene,
        view=view,
        light=light,
        size=size,
        truth=truth,
        cost_model=cost_model,
        maps=maps,
        methods=methods,
        notices=notices,
        memory=memory,
        **more,
    )


def report_of_entries(
    *,
    schema: str,
    argv: Sequence[str],
    provenance: Mapping,
    seed: SupportsIndex,
    memory: Forecast | None = None,
    **entries,
) -> dict:
    """A validated report of that schema, NumPy and JAX scalars turned into plain numbers.

    Args:
        argv, provenance: as of `run_report`.
        memory: what the job was estimated to take, if it was.
        entries: all other keys of the schema.

    Raises:
        InvalidReport: as `validate_report`.
    """
    report = {
        "schema": schema,
        "command": shlex.join(argv),
        **provenance,
        **({} if memory is None else {"memory": memory.record()}),
        "seed": index(seed),
        **entries,
    }
    report = plain(report, NonFinite.KEPT)
    validate_report(report)
    return report


def write_json(path: str | os.PathLike, report: dict) -> None:
    """Write `report` to `path`: after a crash there is the old file or the new one, never half.

    Raises:
        InvalidReport: it holds a NaN, an infinity, or something that is not JSON.
        WriteError: the folder is missing or not writable, or the disk is full.
    """
    problem = first_unstorable(report)
    if problem:
        raise InvalidReport(problem)
    write_file(path, text_writer(lambda: json.dumps(report, indent=2, allow_nan=False) + "\n"))
