"""Requirements with numbers: what was measured, what is allowed, and whether that holds."""

import math
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Bound:
    """One line of a table of requirements; smaller is better.

    Attributes:
        name: short and unique.
        what: what was measured, with the yardstick of the same run.
        measured: the figure; None where it could not be measured.
        limit: the largest figure allowed.
        aim: the figure hoped for, None where there is none.
        reason: why there is no figure, or what to know about it.
    """

    name: str
    what: str
    measured: float | None
    limit: float
    aim: float | None = None
    reason: str = ""

    @property
    def verdict(self) -> str:
        """ "pass", "fail", or "skipped" where nothing was measured."""
        if self.measured is None or math.isnan(self.measured):
            return "skipped"
        return "pass" if self.measured <= self.limit else "fail"

    @property
    def reaches_aim(self) -> bool | None:
        """Whether the aim is reached; None without an aim or a figure."""
        if self.aim is None or self.verdict == "skipped":
            return None
        assert self.measured is not None
        return self.measured <= self.aim

    def record(self) -> dict:
        """The line as plain values, verdict included."""
        return asdict(self) | {"verdict": self.verdict, "reaches_aim": self.reaches_aim}
