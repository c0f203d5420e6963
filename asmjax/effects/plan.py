"""The plan of a view: what its lights call for, what is skipped and why, and what is missing."""

import textwrap
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from asmjax.effects.records import Decision, LightNumbers, NotSimulated, Rates, Skipped, percent
from asmjax.scene.spec import ViewSpec

LINE = 100
"""Characters of a line of `Plan.explain`."""


@dataclass(frozen=True, eq=False)
class LightSeen:
    """What the probe saw of a light; images (height, width) of the probe.

    Attributes:
        light: its name.
        facing: bool, pixels that it shines on.
        cosine: between the normals and the ways back to it.
        lit: bool, those that its centre shines on; None where nobody looked.
        widest: the widest penumbra that any blocker between pixel and light could make, pixels of
            the picture, 0 for none; None for a light without size or where nobody looked.
    """

    light: str
    facing: np.ndarray
    cosine: np.ndarray
    lit: np.ndarray | None = None
    widest: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """What is simulated for a view of a scene, what is skipped, and what is missing.

    Attributes:
        scene: its name.
        view: at the size of the picture.
        tolerance: part of the light, mean over the picture; what changes less is left out.
        decisions: by light, the brightest first.
        skipped, not_simulated: with reasons; of what is missing the largest error first.
        numbers: what decided, by light, in the order of `decisions`.
        seen: what the probe saw, in that order, for figures.
        probe_rays: that planning cast.
        notes: how the numbers were come by where that is not as usual.
        rates: what things were taken to cost.
    """

    scene: str
    view: ViewSpec
    tolerance: float
    decisions: tuple[Decision, ...]
    skipped: tuple[Skipped, ...]
    not_simulated: tuple[NotSimulated, ...]
    numbers: tuple[LightNumbers, ...]
    seen: tuple[LightSeen, ...]
    probe_rays: int
    notes: tuple[str, ...] = ()
    rates: Rates = field(default_factory=Rates)

    @property
    def lights(self) -> tuple[str, ...]:
        """The lights whose shadows are simulated, the brightest first."""
        return tuple(
            decision.light for decision in self.decisions if decision.kind in ("hard", "soft")
        )

    def decision(self, light: str) -> Decision:
        """What is done about the shadow of a light. Raises `KeyError` for one that is not in it."""
        for decision in self.decisions:
            if decision.light == light and decision.kind != "transmittance":
                return decision
        raise KeyError(light)

    def methods_for(self, light: str) -> tuple[str, ...]:
        """Families of the registry for the shadow of a light, the map first, then what filters it;
        none where it casts none. Raises `KeyError` for a light that is not in the plan."""
        return self.decision(light).methods

    def record(self) -> dict:
        """As a report has it, under `plan`."""
        return {
            "tolerance": self.tolerance,
            "probe_rays": self.probe_rays,
            "cost_measured": self.rates.measured,
            "notes": list(self.notes),
            "decisions": [asdict(decision) for decision in self.decisions],
            "skipped": [asdict(item) for item in self.skipped],
            "not_simulated": [asdict(item) for item in self.not_simulated],
            "numbers": [asdict(numbers) for numbers in self.numbers],
        }

    def explain(self) -> str:
        """The plan in words, without a last newline."""
        size = f"{self.view.width} x {self.view.height} pixels"
        lines = [
            f"plan of {self.scene}, {self.view.name}, {size}; what changes less than "
            f"{percent(self.tolerance)} of the light is left out"
        ]
        lines += [line for note in self.notes for line in _wrapped(f"note: {note}")]
        for decision in self.decisions:
            lines += _said(decision)
        lines += _listed("skipped", self.skipped)
        lines += _listed("not simulated", self.not_simulated)
        lines.append(f"planning cast {self.probe_rays:,} rays")
        return "\n".join(lines)


def _said(decision: Decision) -> list[str]:
    """A decision in a few lines."""
    head = f"{decision.light}: {decision.kind}"
    if decision.methods:
        head += f", {' + '.join(decision.methods)} ({decision.geometry})"
    if decision.samples > 1:
        head += f", {decision.samples} samples of the light"
    head += ", as was asked for" if decision.forced else ""
    lines = [head, *_wrapped(decision.reason)]
    if decision.quantity and not decision.forced:
        other = f"; the threshold is {decision.threshold:.3g}" if decision.threshold else ""
        lines += _wrapped(f"decided by: {decision.quantity} = {decision.number:.3g}{other}")
    return lines


def _listed(title: str, items: Sequence[Skipped | NotSimulated]) -> list[str]:
    lines = [f"{title}:"] if items else [f"{title}: nothing"]
    for item in items:
        whose = f" of {item.light}" if item.light else ""
        lines += _wrapped(f"{item.effect}{whose}: {with_error(item)}")
    return lines


def with_error(item: Skipped | NotSimulated) -> str:
    """Why something is left out, and how much of the light that changes."""
    much = percent(item.error)
    return item.reason if item.error == 0 or much in item.reason else f"{item.reason} ({much})"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, LINE, initial_indent="  ", subsequent_indent="    ")
