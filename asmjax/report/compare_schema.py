"""The schema of the report of `asmjax compare`, as data."""

from collections.abc import Mapping

from asmjax.report.keys import InvalidReport, Key
from asmjax.report.schema_parts import COST_MODEL, HEAD, MEASURED, NOTICES, interval_key

COMPARISON_SCHEMA = "asmjax/comparison/1"

ENDS = ("complete", "time limit", "interrupted")
"""How a comparison ended."""


_TRIAL = {
    "name": Key("text", "begins with the family"),
    "family": Key("text", "of the algorithm, or rays"),
    "label": Key("text", "what tells it from others of its family"),
    "settings": Key("any object", "all settings that it ran with"),
    "samples": Key("count", "of each pixel"),
    **MEASURED,
    "ranked_seconds": interval_key(
        "`ratio` x the median of all turns of the rays of as many samples: by this trials are "
        "ranked and drawn, seconds"
    ),
    "views": Key(
        {"view": Key("text", "name of the view"), **MEASURED}, "of each view alone", each=True
    ),
}

_REACH = {
    "value": Key("amount", "what the family needs for that error", nullable=True),
    "bound": Key("flag", "whether its cheapest is better already: it needs less than `value`"),
    "ratio": Key(
        "amount", "`value` / the least of all families, or more if that is a bound", nullable=True
    ),
}

COMPARISON_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{COMPARISON_SCHEMA}"'),
    **HEAD,
    "memory_limit_bytes": Key("count", "--memory-mb; trials have up to 4 times as much, bytes"),
    "ended": Key("text", f"how it ended: {', '.join(ENDS)}"),
    "trials_asked": Key("count", "settings x numbers of samples"),
    "measurements": Key(
        {
            "made": Key("count", "trials on one view that this run measured"),
            "reused": Key("count", "those that it took from an earlier run"),
        },
        "where numbers come from",
    ),
    "cost_model": Key(
        COST_MODEL.kind, COST_MODEL.means + "; null without adaptive maps", nullable=True
    ),
    "views": Key(
        {
            "name": Key("text", "of the view"),
            "size": Key("size", "[width, height] of its image, pixels"),
            "valid_pixels": Key("count", "pixels that see a surface"),
            "samples": Key(
                {
                    "samples": Key("count", "of each pixel"),
                    "edge_length_px": Key("amount", "of truth's shadow edges, pixels"),
                },
                "what depends on the number of samples",
                each=True,
            ),
        },
        "one entry per view",
        each=True,
    ),
    "trials": Key(
        {
            **_TRIAL,
            "on_front": Key(
                {
                    "seconds": Key("flag", "nothing else is as fast and as accurate"),
                    "bytes": Key("flag", "nothing else is as small and as accurate"),
                },
                "of all trials with as many samples; rays do not count",
            ),
        },
        "one entry per setting and number of samples, finished ones only",
        each=True,
    ),
    "yardsticks": Key(_TRIAL, "traced shadow rays, one entry per number of samples", each=True),
    "equal_error": Key(
        {
            "samples": Key("count", "of each pixel"),
            "error_px": Key("amount", "wrong pixels per pixel of truth's edge"),
            "family": Key("text", "of the algorithm"),
            "seconds": Key(_REACH, "of `ranked_seconds`; null where it is not reached"),
            "bytes": Key(_REACH, "bytes; null where it is not reached"),
        },
        "what each family needs for a given error, interpolated between its own trials",
        each=True,
    ),
    "notices": NOTICES,
}


def check_comparison(report: Mapping) -> None:
    """What the keys do not say: names are those of their family, no setting occurs twice, every
    trial has all views.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    if report["ended"] not in ENDS:
        raise InvalidReport(f"ended: expected one of {', '.join(ENDS)}, got '{report['ended']}'")
    views = [view["name"] for view in report["views"]]
    for group in ("trials", "yardsticks"):
        seen = set()
        for i, trial in enumerate(report[group]):
            path = f"{group}[{i}]"
            name, family = trial["name"], trial["family"]
            if not name.startswith(family):
                raise InvalidReport(f"{path}.name: '{name}' must begin with '{family}'")
            key = family, trial["label"], trial["samples"]
            if key in seen:
                raise InvalidReport(f"{path}: {family} {trial['label']} occurs twice")
            seen.add(key)
            own = [view["view"] for view in trial["views"]]
            if own != views:
                raise InvalidReport(f"{path}.views: expected {views}, got {own}")
