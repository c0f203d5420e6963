"""The schema of the report of `asmjax plan`, as data; a run that follows a plan has its `plan`."""

from collections.abc import Mapping

from asmjax.report.keys import InvalidReport, Key
from asmjax.report.schema_parts import HEAD, NOTICES

PLAN_SCHEMA = "asmjax/plan/1"

KINDS = ("none", "hard", "soft", "transmittance")
"""What is done about a light."""

_WIDTHS = {
    "width_p50": Key("amount", "of penumbrae across shadow edges, median, pixels"),
    "width_p95": Key("amount", "95th percentile of it, pixels"),
}

_DECISION = {
    "light": Key("text", "its name"),
    "kind": Key("text", ", ".join(KINDS)),
    "geometry": Key("text", "of the map, in words"),
    "faces": Key("count", "of the map; 0 where there is none"),
    "fov_deg": Key("amount", "of its widest face, degrees; null for parallel", nullable=True),
    "methods": Key("text list", "families of the registry: the map, then what filters it"),
    "settings": Key(
        "any object", "of the methods: widths in parts of the map's side, numbers of samples"
    ),
    "samples": Key("count", "of the light; 1 is its centre"),
    "sample_error": Key("amount", "largest error of visibility of sampling alone"),
    "quantity": Key("text", "what decided, in words"),
    "number": Key("amount", "its value"),
    "threshold": Key("amount", "where the decision would become another"),
    "reason": Key("text", "in words"),
    **_WIDTHS,
    "error": Key("amount", "what ignoring the effect would change, part of the light"),
    "rays": Key("count", "that the methods cast, estimated"),
    "seconds": Key("amount", "that they take, estimated"),
    "forced": Key("flag", "whether somebody asked for it, and got it"),
    "simulated": Key("flag", "whether there is a method for it"),
}

_LEFT_OUT = {
    "light": Key("text", "its name; null for all lights", nullable=True),
    "effect": Key("text", "in a word or two"),
    "reason": Key("text", "in words"),
    "error": Key("amount", "what that changes, part of the light"),
}

_NUMBERS = {
    "name": Key("text", "of the light"),
    "kind": Key("text", "point, spot or directional"),
    "shape": Key("text", "rectangle, disk, sphere or sun; null without size", nullable=True),
    "point_for_lamp": Key("flag", "whether a point stands for a lamp of another shape"),
    "spread": Key(
        "amount", "of its radiance over it, part of the mean; null where unknown", nullable=True
    ),
    "share": Key("fraction", "part of the light that comes from here"),
    "facing": Key("fraction", "part of the pixels that it, or a part of it, shines on"),
    "straddled": Key("fraction", "part of the pixels in whose plane it stands"),
    "faces": Key("count", "of its map"),
    "fov_deg": Key("amount", "of the widest face, degrees; null for parallel", nullable=True),
    "pixels": Key("count", "of the picture that see a surface"),
    "shadowed": Key(
        "fraction", "of those that it shines on: in its hard shadow; null unseen", nullable=True
    ),
    "edge_px": Key("amount", "length of the hard shadow's edges, pixels"),
    "contrast": Key("fraction", "part of the light that comes from here, beside those edges"),
    **_WIDTHS,
    "width_mean": Key("amount", "mean of it, pixels"),
    "width_map": Key("amount", "of them in the light's image, median, parts of its side"),
    "umbra": Key("fraction", "part of the hard shadow's pixels that stay dark"),
    "solid_angle": Key("amount", "of the light, steradians, median over what it shines on"),
    "transmitted": Key("amount", "part of the light that passes through casters"),
    "refracted": Key("amount", "part of the light that refractive casters stop"),
    "lone_convex": Key("flag", "whether one convex object is all there is"),
    "rays": Key("count", "that the probe cast for this light"),
}

PLAN = Key(
    {
        "tolerance": Key("amount", "part of the light whose change nobody minds"),
        "probe_rays": Key("count", "that planning cast"),
        "cost_measured": Key("flag", "whether a texel's cost is of this machine and scene"),
        "notes": Key("text list", "how numbers were come by where that is not as usual"),
        "decisions": Key(_DECISION, "one or two entries per light, the brightest first", each=True),
        "skipped": Key(_LEFT_OUT, "effects that are not there or too small", each=True),
        "not_simulated": Key(_LEFT_OUT, "effects that are called for and missing", each=True),
        "numbers": Key(_NUMBERS, "one entry per light: what decided", each=True),
    },
    "what the lights of the view call for; parts of the light are means over the picture",
)

PLAN_KEYS: Mapping[str, Key] = {
    "schema": Key("text", f'"{PLAN_SCHEMA}"'),
    **HEAD,
    "plan": PLAN,
    "notices": NOTICES,
}


def check_plan(plan: Mapping, path: str = "plan") -> None:
    """What the keys alone do not say: kinds are known, and every light has its numbers.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    lights = [numbers["name"] for numbers in plan["numbers"]]
    for i, decision in enumerate(plan["decisions"]):
        where = f"{path}.decisions[{i}]"
        if decision["kind"] not in KINDS:
            raise InvalidReport(f"{where}.kind: '{decision['kind']}' is none of {', '.join(KINDS)}")
        if decision["light"] not in lights:
            raise InvalidReport(f"{where}.light: '{decision['light']}' has no entry in numbers")
