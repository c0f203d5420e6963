"""Which shadow effects a view of a scene calls for: looked at, decided, and said.

`looking` takes a few thousand rays (`probe`, `widths`) to numbers, `decide` takes numbers to
decisions, `planning` does both for all lights, and `plan` says what came of it. The formulas are
in docs/effects.md.
"""

from asmjax.effects.asked import LightAsked, SceneAsked
from asmjax.effects.decide import TOLERANCE, decide_light
from asmjax.effects.plan import LightSeen, Plan
from asmjax.effects.planning import plan_lights
from asmjax.effects.probe import probe_size
from asmjax.effects.records import Decision, LightNumbers, NotSimulated, Outcome, Rates, Skipped

__all__ = [
    "TOLERANCE",
    "Decision",
    "LightAsked",
    "LightNumbers",
    "LightSeen",
    "NotSimulated",
    "Outcome",
    "Plan",
    "Rates",
    "SceneAsked",
    "Skipped",
    "decide_light",
    "plan_lights",
    "probe_size",
]
