"""The schemas of `report.json`, as data: the keys, their kinds, units and meanings.

The validator, the documentation test and the CSV header all read these tables. Version 1 of
`asmjax run` is "asmjax/run/1", of its walkthroughs "asmjax/walkthrough/1", of `asmjax analyze`
"asmjax/aliasing/1", of `asmjax compare` "asmjax/comparison/1", of `asmjax tune` "asmjax/tuning/1",
of `asmjax plan` "asmjax/plan/1" (the keys of these three have files of their own); a change that
could break a reader raises the number.
"""

from collections.abc import Mapping
from dataclasses import replace

from asmjax.report.compare_schema import COMPARISON_KEYS, COMPARISON_SCHEMA, check_comparison
from asmjax.report.keys import InvalidReport, Key, check_keys
from asmjax.report.plan_schema import PLAN_KEYS, PLAN_SCHEMA, check_plan
from asmjax.report.schema_parts import COST_MODEL, ERROR, HEAD, NOTICES
from asmjax.report.tune_schema import TUNING_KEYS, TUNING_SCHEMA, check_tuning

RUN_SCHEMA = "asmjax/run/1"
WALKTHROUGH_SCHEMA = "asmjax/walkthrough/1"
ALIASING_SCHEMA = "asmjax/aliasing/1"

METHOD_KINDS = (
    "uniform", "adaptive", "perspective", "light-space", "trapezoidal", "logarithmic",
    "partitioned", "subdivided", "tuned", "filtered", "pcss",
    "moment", "accumulated", "rays",
)  # fmt: skip
"""What the name of a method begins with: the families of the registry, which is not imported here
as it loads JAX, and traced rays."""

MAP_NAMES = ("area_ratio", "linear_ratio", "m", "n_required", "benefit")
"""Maps of one value per eye pixel, summarised in the report and stored by `--save-arrays`."""


_SUMMARY = {
    "p50": Key("number", "median over the valid pixels whose value is finite"),
    "p95": Key("number", "95th percentile of them"),
    "max": Key("number", "largest of them"),
    "count": Key("count", "how many pixels these are; with 0 the three above are 0", False),
}


_SECONDS = {
    "build": Key("amount", "casting and storing texels, seconds"),
    "analysis": Key("amount", "deciding what to refine, seconds"),
    "query": Key("amount", "visibility of all eye pixels, seconds"),
    "total": Key("amount", "all of it, seconds"),
}

_BIAS = {
    "median": Key("amount", "over the receivers that face the light, scene units"),
    "max": Key("amount", "largest of them: thicker walls let no light through, scene units"),
}

_METHOD = {
    "name": Key("text", "begins with a family of the registry, or rays; unique in the report"),
    "settings": Key("any object", "all settings that the method ran with"),
    "effective_resolution": Key(
        "count", "texels per side of a flat map as fine as its finest part", nullable=True
    ),
    "bytes": Key("count", "memory of all arrays that the method keeps, bytes"),
    "rays": Key("count", "rays cast"),
    "seconds": Key(_SECONDS, "wall time by stage"),
    "error": Key(ERROR, "errors against truth"),
    "bias": Key(_BIAS, "what its shadow test cannot tell, along the receivers' normals", False),
    "nodes": Key("count", "nodes of the tree that hold texels", False),
    "passes": Key("count", "launches of light rays, the starting resolution included", False),
    "max_level": Key("count", "level of the deepest node, 0 for the root", False),
    "status": Key("text", "why refinement ended", False),
}

ADAPTIVE_KEYS = ("nodes", "passes", "max_level", "status")
"""Keys that an adaptive method must have."""


_TRUTH = Key(
    {
        "samples": Key("count", "shadow rays per pixel"),
        "rays": Key("count", "shadow rays cast"),
        "seconds": Key("amount", "wall time, seconds"),
        "valid_pixels": Key("count", "pixels that see a surface"),
        "lit_fraction": Key("fraction", "mean visibility of the valid pixels"),
        "standard_error": Key(
            "amount", "of a soft truth's visibility, root of the mean square of the pixels'", False
        ),
    },
    "the ray-traced truth",
)


RUN_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{RUN_SCHEMA}"'),
    **HEAD,
    "truth": _TRUTH,
    "cost_model": COST_MODEL,
    "maps": Key(
        {
            "area_ratio": Key(_SUMMARY, "world area of a texel / of an eye pixel"),
            "linear_ratio": Key(_SUMMARY, "square root of area_ratio"),
            "m": Key(_SUMMARY, "texel width / pixel width in the worst direction"),
            "n_required": Key(_SUMMARY, "texels of a flat map that matches the pixel"),
            "benefit": Key(_SUMMARY, "eye pixels that refining the pixel's cell would help"),
        },
        "summary of each map over the eye's image",
    ),
    "methods": Key(_METHOD, "one entry per method, in the order of the table", each=True),
    "plan": replace(PLAN_KEYS["plan"], required=False),
    "notices": NOTICES,
}

_NODE_COUNTS = {
    "nodes_made": Key("count", "nodes cast in this frame", False),
    "nodes_reused": Key("count", "nodes that were there before and were asked", False),
    "nodes_evicted": Key("count", "nodes given up for others", False),
    "nodes_recast": Key("count", "nodes cast again, as light or casters moved", False),
    "nodes_dropped": Key("count", "nodes given up, as light or casters moved", False),
}

_FRAME_SECONDS = {
    **_SECONDS,
    "id_pass": Key("amount", "bringing the pixels' primitive ids to the device, seconds"),
}

_FRAME = {
    "frame": Key("count", "counts from 0"),
    "eye": Key(
        {
            "origin": Key("vector", "where the eye is, scene units"),
            "target": Key("vector", "what it looks at, scene units"),
            "up": Key("vector", "its up direction"),
            "fov_x_deg": Key("amount", "horizontal field of view, degrees"),
            "seconds": Key("amount", "casting the eye's image, seconds; in no method's time"),
        },
        "the view of this frame",
    ),
    "light_position": Key("vector", "scene units; null for parallel light", nullable=True),
    "light_direction": Key("vector", "along the light; null if it has none", nullable=True),
    "light_frame_refitted": Key("flag", "whether maps that are kept got another light frame"),
    "moved_boxes": Key("count", "boxes that hold what moved since the frame before"),
    "truth": _TRUTH,
    "methods": Key(
        {**_METHOD, "seconds": Key(_FRAME_SECONDS, "wall time by stage"), **_NODE_COUNTS},
        "as in a single run, for this frame alone",
        each=True,
    ),
}

_MEDIANS = {
    "name": Key("text", "as in the frames"),
    "seconds": Key(_FRAME_SECONDS, "median wall time by stage"),
    "slowest_seconds": Key("amount", "largest total, seconds"),
    "effective_resolution": Key("count", "largest; null for ray tracing", nullable=True),
    "bytes": Key("count", "largest, bytes"),
    "rays": Key("amount", "median"),
    "misclassified_fraction": Key("fraction", "median"),
    "boundary_displacement_px": Key("amount", "median of the means, pixels"),
    **{
        name: Key("amount", f"median of: {key.means}", False)
        for name, key in {"nodes": _METHOD["nodes"], **_NODE_COUNTS}.items()
    },
    "time_ratio": Key(
        "amount", "adaptive map's total / this method's: median over frames", nullable=True
    ),
    "error_ratio": Key(
        "amount", "adaptive map's misclassified / this method's: median", nullable=True
    ),
}

WALKTHROUGH_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{WALKTHROUGH_SCHEMA}"'),
    **HEAD,
    "motion": Key("text", "what moves: camera, light, object or still"),
    "frames_asked": Key("count", "frames that were asked for"),
    "ended": Key("text", '"complete", or what ended it before its last frame'),
    "memory_limit_bytes": Key("count", "what the adaptive map may use, bytes"),
    "cost_model": COST_MODEL,
    "summary": Key(
        {
            "first_frame": Key("count", "first of the frames that it is taken over"),
            "frames": Key("count", "how many frames these are"),
            "methods": Key(_MEDIANS, "one entry per method", each=True),
        },
        "medians over all frames but the first, which builds from nothing",
    ),
    "frames": Key(_FRAME, "one entry per finished frame", each=True),
    "notices": NOTICES,
}

_ALIASING = {
    "receivers": Key("count", "pixels whose receiver a texel answers; the others do not count"),
    "max_m": Key("amount", "largest m: texel width / pixel width in the worst direction"),
    "p95_m": Key("amount", "95th percentile of m"),
    "median_m": Key("amount", "median of m"),
    "above_1": Key("fraction", "share of the receivers with m above 1"),
    "below_1": Key("fraction", "share of the receivers with m below 1"),
    "max_perspective": Key("amount", "largest perspective factor of m, widths of beams"),
    "p95_perspective": Key("amount", "95th percentile of it"),
    "wasted": Key("fraction", "share of the stored texels that answer no pixel"),
}

_DISPLACEMENT = {
    "predicted": Key("amount", "wrong pixels per pixel of edge, from the texels' sizes"),
    "measured": Key("amount", "wrong pixels per pixel of edge"),
    "length": Key("amount", "of truth's edges that count, pixels"),
    "share": Key("fraction", "of all of truth's edges: those that stand alone"),
}

_ANGLE_ERROR = {
    "family": Key("text", "of the algorithm"),
    "max_perspective": Key("amount", "largest perspective factor"),
    "p95_perspective": Key("amount", "95th percentile of it"),
    "p95_m": Key("amount", "95th percentile of m"),
    "storage_factor": Key("amount", "texels / image pixels at which no texel is larger than one"),
    "theory_storage_factor": Key(
        "amount", "the theory's for the full view frustum; null where it has none", nullable=True
    ),
}

_LIGHT_ANGLES = {
    "alpha": Key("amount", "farthest / nearest eye depth that is seen"),
    "half_view_deg": Key("amount", "half the horizontal field of view, degrees"),
    "angles": Key(
        {
            "angle_deg": Key("amount", "between light and view direction, degrees"),
            "methods": Key(_ANGLE_ERROR, "one entry per algorithm", each=True),
        },
        "one entry per direction of a parallel light",
        each=True,
    ),
}

ALIASING_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{ALIASING_SCHEMA}"'),
    **HEAD,
    "memory_limit_bytes": Key("count", "of each map's texels, bytes"),
    "truth": _TRUTH,
    "cost_model": replace(COST_MODEL, nullable=True),
    "methods": Key(
        {
            **_METHOD,
            "family": Key("text", "of the algorithm, or rays; the name begins with it"),
            "aliasing": Key(_ALIASING, "of the map over the eye's image; not of rays", False),
            "displacement": Key(_DISPLACEMENT, "of shadow edges; not of rays", False),
        },
        "one entry per algorithm, rays last",
        each=True,
    ),
    "light_angles": Key(_LIGHT_ANGLES, "other directions of light; null for none", nullable=True),
    "notices": NOTICES,
}

SCHEMAS = {
    RUN_SCHEMA: RUN_KEYS,
    WALKTHROUGH_SCHEMA: WALKTHROUGH_KEYS,
    ALIASING_SCHEMA: ALIASING_KEYS,
    COMPARISON_SCHEMA: COMPARISON_KEYS,
    TUNING_SCHEMA: TUNING_KEYS,
    PLAN_SCHEMA: PLAN_KEYS,
}
"""The keys of each kind of report."""


def validate_report(report: object) -> None:
    """Check a report of a command that measures a scene against the keys of its schema.

    Beyond kinds: the schema is one of `SCHEMAS`, no key is unknown, numbers are finite, method
    names are unique and of a known kind (or, in an analysis, of their family), an adaptive method
    has `ADAPTIVE_KEYS`, every analysed map its `aliasing` and `displacement`, false lit and false
    dark add up to the misclassified, and frames count up.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    if not isinstance(report, dict):
        raise InvalidReport(f"report: expected an object, got {type(report).__name__}")
    schema = report.get("schema")
    if not isinstance(schema, str) or schema not in SCHEMAS:
        expected = " or ".join(f"'{name}'" for name in SCHEMAS)
        raise InvalidReport(f"schema: expected {expected}, got {schema!r}")
    check_keys(report, SCHEMAS[schema])
    if schema == RUN_SCHEMA:
        _check_methods(report["methods"], "methods")
        return
    if schema == ALIASING_SCHEMA:
        _check_analysed(report["methods"])
        return
    if schema == COMPARISON_SCHEMA:
        check_comparison(report)
        return
    if schema == TUNING_SCHEMA:
        check_tuning(report)
        return
    if schema == PLAN_SCHEMA:
        check_plan(report["plan"])
        return
    for i, frame in enumerate(report["frames"]):
        if frame["frame"] != i:
            raise InvalidReport(f"frames[{i}].frame: expected {i}, got {frame['frame']}")
        _check_methods(frame["methods"], f"frames[{i}].methods")


def _check_analysed(methods: list) -> None:
    for i, method in enumerate(methods):
        name, family = method["name"], method["family"]
        if not name.startswith(family):
            raise InvalidReport(f"methods[{i}].name: '{name}' must begin with '{family}'")
        for key in ("aliasing", "displacement"):
            if family != "rays" and key not in method:
                raise InvalidReport(f"methods[{i}].{key}: missing, needed for a map")
    _check_methods(methods, "methods", tuple(method["family"] for method in methods))


def _check_methods(methods: list, where: str, kinds: tuple[str, ...] = METHOD_KINDS) -> None:
    seen = set()
    for i, method in enumerate(methods):
        path, name = f"{where}[{i}]", method["name"]
        if not name.startswith(kinds):
            raise InvalidReport(f"{path}.name: '{name}' must begin with one of {', '.join(kinds)}")
        if name in seen:
            raise InvalidReport(f"{path}.name: '{name}' occurs twice")
        seen.add(name)
        if name.startswith("adaptive"):
            for key in ADAPTIVE_KEYS:
                if key not in method:
                    raise InvalidReport(f"{path}.{key}: missing, needed for an adaptive method")
        error = method["error"]
        parts = error["false_lit_fraction"] + error["false_dark_fraction"]
        if abs(parts - error["misclassified_fraction"]) > 1e-9:
            raise InvalidReport(
                f"{path}.error.misclassified_fraction: {error['misclassified_fraction']} is not "
                f"false lit + false dark = {parts}"
            )
