"""The schema of the report of `asmjax tune`, as data."""

from collections.abc import Mapping
from dataclasses import replace

from asmjax.report.keys import InvalidReport, Key
from asmjax.report.schema_parts import COST_MODEL, HEAD, MEASURED, NOTICES, interval_key

TUNING_SCHEMA = "asmjax/tuning/1"

OUTCOMES = ("found", "default_stands", "not_met", "time_spent", "unsettled", "interrupted")
"""How tuning ended: the names of `asmjax.tuning.result.Outcome`, which loads JAX."""

RIVALS = ("default", "tuned", "grid_best", "random_best")
"""Settings that are set beside each other, as measured on the held-out views."""

ROLES = ("default", "single", "sample", "random", "grid", "surrogate", "neighbour")
"""Why settings were tried."""

_CANDIDATE = {
    "role": Key("text", f"why it was tried: {', '.join(ROLES)}"),
    "settings": Key("any object", "those that are tuned; null is no limit of time"),
    "met": Key("flag", "whether it keeps the limit; always with a price"),
    "objective": Key("amount", "what is minimised; null where the limit is broken", nullable=True),
    "edge_px": Key("amount", "wrong pixels per pixel of shadow edge, mean of the views"),
    "seconds": interval_key("from nothing: means over the views, seconds"),
    "ratio": interval_key("its time / one shadow ray per pixel, over all turns of all views"),
    "bytes": Key("count", "memory of all arrays, the most of any view, bytes"),
}

_RIVAL = {
    **_CANDIDATE,
    "all_settings": Key("any object", "all that it ran with"),
    "gain": Key(
        "number", "1 - tuned objective / its objective; null where one has none", nullable=True
    ),
    "views": Key(
        {"view": Key("text", "name of the view"), **MEASURED}, "each held-out view", each=True
    ),
}

_RIVAL_KEYS = {
    "default": Key(_RIVAL, "the settings that tuning started from"),
    "tuned": Key(_RIVAL, "the best that the search found, or the default"),
    "grid_best": Key(_RIVAL, "the best of a grid of 32; null where none was tried", nullable=True),
    "random_best": Key(
        _RIVAL,
        "the best of a random search with as many evaluations; null where none was tried",
        nullable=True,
    ),
}

_SAID = {
    "edge_px": Key("amount", "error by the surrogate; null for none", nullable=True),
    "seconds": Key("amount", "time by the surrogate; null for none", nullable=True),
}

TUNING_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{TUNING_SCHEMA}"'),
    **HEAD,
    "memory_limit_bytes": Key("count", "the most that any settings may use, bytes"),
    "goal": Key(
        {
            "kind": Key("text", "price, seconds or error"),
            "value": Key("amount", "pixels per second, seconds or pixels"),
            "words": Key("text", "what is minimised"),
        },
        "what was asked",
    ),
    "views": Key(
        {
            "name": Key("text", "of the view"),
            "held_out": Key("flag", "whether it chose, or else was tuned on"),
            "size": Key("size", "[width, height] of its image, pixels"),
            "valid_pixels": Key("count", "pixels that see a surface"),
            "edge_length_px": Key("amount", "of truth's shadow edges, pixels"),
        },
        "one entry per view",
        each=True,
    ),
    "outcome": Key("text", f"how it ended: {', '.join(OUTCOMES)}"),
    "advice": Key("text", "what to do about it; empty where all is well"),
    "objective": Key(_RIVAL_KEYS, "as measured on the held-out views"),
    "evaluations": Key("count", "settings that the search could try"),
    "measurements": Key(
        {
            "made": Key("count", "trials on one view that this run measured"),
            "reused": Key("count", "those that it took from an earlier run"),
        },
        "where numbers come from",
    ),
    "seconds": Key("amount", "wall time of the search, seconds"),
    "tried": Key(
        {**_CANDIDATE, "predicted": Key(_SAID, "by the surrogate as it was in the end")},
        "all settings that were measured on the views tuned on, in order",
        each=True,
    ),
    "finalists": Key(_CANDIDATE, "all that were measured on the held-out views", each=True),
    "calibration": Key(
        {
            "view": Key("text", "name of the view"),
            "trials": Key("count", "that the surrogate was fitted to"),
            "error_misfit": Key("amount", "median of abs(log(predicted / measured)) of errors"),
            "seconds_misfit": Key("amount", "the same of times"),
            "settled": Key("flag", "whether the fit came to rest"),
            "fit": Key("any object", "natural logarithms of the fitted factors, by name"),
        },
        "of the surrogate, one entry per view tuned on",
        each=True,
    ),
    "rank_correlation": Key(
        "number", "Spearman's, of the surrogate with those of `tried` that it was not fitted to "
        "(random, grid); null where there are none or all are equal",
        nullable=True,
    ),
    "sensitivity": Key(
        {
            "price": Key("amount", "where, pixels per second"),
            "log_settings": Key("any object", "d log(setting) / d log(price) by name"),
            "log_edge": Key("number", "d log(error) / d log(price)"),
            "log_seconds": Key("number", "d log(seconds) / d log(price)"),
            "settled": Key("flag", "whether they are of an optimum; else they mean little"),
        },
        "how the surrogate's best settings move with the price; null without a price",
        nullable=True,
    ),
    "front": Key(
        {
            "price": Key("amount", "of a second, pixels"),
            "settings": Key("any object", "the surrogate's best, between steps, by name"),
            **_SAID,
            "gap": Key("number", "objective of the curve / of tuning's own search - 1"),
            "taken_over": Key("flag", "whether that search was better, and the point is its"),
        },
        "the surrogate's best settings for other prices; empty without a price",
        each=True,
    ),
    "cost_model": replace(COST_MODEL, means=COST_MODEL.means + ", the map decides by it"),
    "notices": NOTICES,
}  # fmt: skip


def check_tuning(report: Mapping) -> None:
    """What the keys do not say: known outcome and roles, rivals measured on all held-out views
    (interrupted: on those tuned on), an objective exactly where the limit is kept.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    if report["outcome"] not in OUTCOMES:
        raise InvalidReport(
            f"outcome: expected one of {', '.join(OUTCOMES)}, got '{report['outcome']}'"
        )
    stopped = report["outcome"] == "interrupted"
    chose = [view["name"] for view in report["views"] if view["held_out"] is not stopped]
    rivals = {name: one for name, one in report["objective"].items() if one is not None}
    for name, rival in rivals.items():
        own = [view["view"] for view in rival["views"]]
        if own != chose:
            raise InvalidReport(f"objective.{name}.views: expected {chose}, got {own}")
    groups = {f"objective.{name}": one for name, one in rivals.items()}
    for group in ("tried", "finalists"):
        groups |= {f"{group}[{i}]": one for i, one in enumerate(report[group])}
    for path, one in groups.items():
        if one["role"] not in ROLES:
            raise InvalidReport(f"{path}.role: expected one of {', '.join(ROLES)}")
        if one["met"] is not (one["objective"] is not None):
            raise InvalidReport(f"{path}.objective: a number exactly where `met` is true")
