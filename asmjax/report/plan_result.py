"""What `asmjax plan` found."""

from dataclasses import dataclass

from asmjax.buffers import EyeBuffer
from asmjax.effects import Plan
from asmjax.memory import Forecast


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A plan, and what its report and figure need besides.

    Attributes:
        plan: the decisions.
        eye: the probe's image of the view.
        variant: the Mitsuba variant that cast the rays.
        notices: what of the scene is simulated differently from what it says.
        memory: what planning was estimated to take; None where nobody asked.
    """

    plan: Plan
    eye: EyeBuffer
    variant: str
    notices: tuple[str, ...]
    memory: Forecast | None = None
