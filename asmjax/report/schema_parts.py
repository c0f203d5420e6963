"""Parts that the schemas of several kinds of report share."""

from asmjax.report.keys import Key

ERROR = {
    "misclassified_fraction": Key("fraction", "wrong pixels / valid pixels"),
    "false_lit_fraction": Key("fraction", "shadowed in truth, lit by the method"),
    "false_dark_fraction": Key("fraction", "lit in truth, shadowed by the method"),
    "boundary_displacement_px": Key(
        {
            "mean": Key("amount", "mean distance between shadow boundaries, pixels"),
            "p95": Key("amount", "95th percentile, pixels"),
            "hausdorff": Key("amount", "largest distance, pixels", False),
            "unmatched_fraction": Key("fraction", "share of edges with no partner", False),
            "per_edge_length": Key(
                "amount", "wrong pixels per pixel of true boundary, pixels", False
            ),
        },
        "how far shadow edges move in the image",
    ),
    "soft": Key(
        {
            "mae": Key("fraction", "mean of abs(visibility - truth)"),
            "rmse": Key("fraction", "root of the mean of its square"),
            "max": Key("fraction", "the largest"),
            "penumbra_width_px": Key(
                "number", "mean width of penumbrae minus truth's, pixels; below 0: too narrow"
            ),
            "leak_fraction": Key(
                "fraction", "pixels lighter than truth by more than 1/16 and 4 standard errors"
            ),
            "acne_fraction": Key("fraction", "pixels lit in truth and darker by more than that"),
        },
        "errors of penumbrae, where truth has some",
        False,
    ),
}

HEAD = {
    "command": Key("text", "the command line, quoted for a shell"),
    "versions": Key("text object", "package name to version"),
    "machine": Key(
        {
            "cpu": Key("text", "processor model"),
            "cores": Key("count", "cores that this process may use"),
            "memory_bytes": Key("count", "main memory, bytes; 0 where it cannot be told"),
            "device": Key("text", "where the JAX kernels ran"),
            "variant": Key("text", "Mitsuba variant that cast the rays"),
        },
        "the machine",
    ),
    "memory": Key(
        {
            "estimate_bytes": Key("count", "what the job was estimated to add at its peak, bytes"),
            "held_bytes": Key("count", "what the process held before: programs and scene, bytes"),
            "limit_bytes": Key(
                "count", "of both together, see --max-memory, bytes; null for none", nullable=True
            ),
        },
        "main memory, as estimated before anything large was made",
        False,
    ),
    "seed": Key("integer", "the seed of everything random"),
    "scene": Key("text", "built-in name, or name of the file without .xml"),
    "view": Key("text", "name of the view or sensor"),
    "light": Key("text", "which light, and its type"),
    "size": Key("size", "[width, height] of the eye's image, pixels"),
    "scene_file": Key("text", "absolute path of the scene file; not of a built-in scene", False),
    "files": Key("text list", "names of the report's other files in its folder", False),
}

COST_MODEL = Key(
    {
        "a_seconds_per_texel": Key("amount", "slope of the cost of a node, seconds/texel"),
        "b_seconds": Key("amount", "cost of a node of no texels, seconds"),
        "residual": Key("amount", "root-mean-square relative residual of the fit"),
        "converged": Key("flag", "whether the fit came to rest", False),
        "measured_at": Key("text", "when it was measured, UTC, ISO 8601", False, nullable=True),
        "kept": Key("flag", "whether an earlier run measured it, or else this one", False),
    },
    "seconds to cast N texels: a N + b, measured on this machine at `measured_at`",
)


def interval_key(what: str, required: bool = True) -> Key:
    """A median with its interval."""
    keys = {
        "median": Key("amount", "median of the runs"),
        "low": Key("amount", "lower end of its interval: with 95 %, of few runs the least"),
        "high": Key("amount", "upper end of it"),
        "runs": Key("count", "how many"),
        "coverage": Key("amount", "probability that the interval holds the median of all runs"),
    }
    return Key(keys, what, required)


MEASURED = {
    "error": Key(ERROR, "errors against traced rays of as many samples"),
    "predicted_displacement_px": Key(
        "amount",
        "wrong pixels per pixel of edge by the texels' sizes, where edges stand alone",
        nullable=True,
    ),
    "seconds": Key(
        {
            "build": interval_key("casting and storing texels, seconds"),
            "analysis": interval_key("deciding what to refine, seconds"),
            "query": interval_key("visibility of all samples, seconds"),
            "total": interval_key("all of it, seconds"),
        },
        "wall time by stage",
    ),
    "ratio": interval_key("total / one shadow ray for each sample, turn by turn"),
    "bytes": Key("count", "memory of all arrays that the method keeps, bytes"),
    "texels": Key("count", "texels stored"),
    "rays": Key("count", "rays cast"),
    "nodes": Key("count", "nodes of an adaptive map's tree; null for others", nullable=True),
    "status": Key("text", "how the build ended"),
}
"""Of a trial: `asmjax.report.compare_record.measured_record`."""

NOTICES = Key("text list", "what the run left out or approximated, one line each")
