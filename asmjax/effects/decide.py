"""From the numbers of a light to decisions, each with the number that made it and its threshold.

Nothing is looked at here: the same numbers give the same decisions. docs/effects.md has the rules
in prose.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, get_args

from asmjax.effects.missing import missing, small, transmittance
from asmjax.effects.records import (
    Decision,
    LightNumbers,
    NotSimulated,
    Outcome,
    Rates,
    Skipped,
    percent,
    pixels,
)
from asmjax.errors import require, unknown_name
from asmjax.options import TOLERANCE, Force

SUBPIXEL, NARROW, WIDE = 1.0, 4.0, 64.0
"""Widths of penumbrae in pixels up to which a shadow is hard, a filter does, and one map does."""

LEAST_UMBRA = 0.002
"""Of the hard shadow's pixels; where fewer stay dark there is no umbra."""

SAMPLE_ERROR = 1 / 32
"""Largest error of visibility that light samples may leave: 1 / (2 m) for m x m of them."""

MAP_TEXELS = 2**22
"""Of a flat map of 16 MB, the default memory limit, all faces together."""

PCF_TAPS, BLOCKER_TAPS, FILTER_TAPS = 16, 32, 64
"""Texels that a pixel reads with a filter, or in search of blockers and then with one."""

HARD, FLAT, FILTERED, SOFT, WIDEST = (
    ("adaptive", "uniform"),
    ("uniform",),
    ("filtered",),
    ("pcss", "moment", "accumulated"),
    ("accumulated",),
)
"""Families of the registry for each kind of shadow; the first that is there is taken. Filters stand
on flat maps, whose texels are of one size."""

FAMILIES = frozenset((*HARD, *FILTERED, *SOFT))


def check_force(force: Mapping[str, str], lights: Collection[str]) -> None:
    """Raise `UseError` where `force` has a name that is no light ("*" is all of them), or a kind
    that is none of `Force`."""
    for name, kind in force.items():
        if name != "*" and name not in lights:
            raise unknown_name("light to force", name, lights, "Write NAME=soft, or soft for all.")
        if kind not in get_args(Force):
            raise unknown_name("effect to force", kind, get_args(Force))


def samples_worth(side: int, texels: float) -> int:
    """How many of `side` samples a side to take where their maps share the texels of one, in which
    penumbrae are so many wide (0 for unknown).

    m x m maps have texels m times as long, and leave steps of 1 / m of a penumbra: both are as long
    for m = sqrt(texels), and together the shortest.
    """
    return min(side, max(2, round(math.sqrt(texels)))) if texels > 0 else side


def decide_light(
    numbers: LightNumbers,
    tolerance: float = TOLERANCE,
    force: str | None = None,
    available: Collection[str] = FAMILIES,
    rates: Rates | None = None,
) -> Outcome:
    """What is done about one light.

    Args:
        tolerance: part of the light, mean over the picture; what changes less is left out.
        force: what to do whatever the numbers say, one of `Force`.
        available: families of the registry.

    Raises:
        UseError: a tolerance that is not finite or below 0.
    """
    require(
        math.isfinite(tolerance) and tolerance >= 0,
        f"the tolerance is {tolerance}; allowed: a finite part of the light, 0 or more.",
    )
    needless = left_out(numbers, tolerance, force)
    if needless is not None:
        return needless
    chosen = _Choice(numbers, tolerance, force, available, rates or Rates()).outcome()
    return Outcome(
        (*chosen.decisions, *transmittance(numbers, tolerance)),
        (*chosen.skipped, *small(numbers, tolerance)),
        (*chosen.not_simulated, *missing(numbers, tolerance)),
    )


def left_out(numbers: LightNumbers, tolerance: float, force: str | None) -> Outcome | None:
    """The outcome for a light whose shadow nobody looks for; None where it is needed."""
    asked_for = force in ("hard", "soft")
    if force == "none":
        return _none(numbers, "no shadow, as was asked for", error=numbers.share, forced=True)
    if numbers.facing == 0:
        why = "it shines on nothing that the view sees"
        why = f"{force} was asked for, but {why}" if asked_for else why
        return _none(numbers, why, "pixels that it shines on")
    if numbers.share < tolerance and not asked_for:
        return _none(
            numbers,
            f"it brings {percent(numbers.share)} of the light, below the tolerance of "
            f"{percent(tolerance)}: whether it is shaded cannot matter",
            "share of the light", numbers.share, tolerance, numbers.share,
        )  # fmt: skip
    if numbers.lone_convex and not asked_for:
        return _none(
            numbers,
            "one convex object is all there is, and shades itself only where it turns away",
            "objects", 1, 2,
        )  # fmt: skip
    return None


def _none(
    numbers: LightNumbers,
    reason: str,
    quantity: str = "",
    number: float = 0.0,
    threshold: float = 0.0,
    error: float = 0.0,
    forced: bool = False,
) -> Outcome:
    decision = Decision(
        numbers.name, "none", quantity=quantity, number=number, threshold=threshold,
        reason=reason, error=error, forced=forced,
    )  # fmt: skip
    return Outcome((decision,), (Skipped(numbers.name, "shadow", reason, error),))


@dataclass(frozen=True)
class _Choice:
    """How the shadow of one light is made."""

    numbers: LightNumbers
    tolerance: float
    force: str | None
    available: Collection[str]
    rates: Rates

    def outcome(self) -> Outcome:
        numbers = self.numbers
        width, error = numbers.width_p95, numbers.soft_error
        if numbers.shape is None:
            return self._without_size()
        if self.force == "hard":
            why = "hard edges, as was asked for"
            hard = replace(self._by_width(why, SUBPIXEL), forced=True)
            missed = NotSimulated(numbers.name, "penumbra", why, error)
            return Outcome((hard,), (), (missed,) if error >= self.tolerance else ())
        if self.force == "soft":
            return self._soft("as was asked for")
        if width <= SUBPIXEL:
            why = (
                f"penumbrae are {pixels(width)} wide or less (95 % of edges), below a pixel"
                if width > 0
                else "no penumbra is in view"
            )
            return self._without_penumbra(self._by_width(why, SUBPIXEL))
        if error < self.tolerance:
            why = (
                f"penumbrae are up to {pixels(width)} wide, but on {pixels(numbers.edge_px)} of "
                f"edge only: hard edges change {percent(error)} of the light, below the tolerance"
            )
            return self._without_penumbra(
                self._hard(why, "change by hard edges", error, self.tolerance)
            )
        if width <= NARROW:
            return self._filtered()
        return self._soft(f"hard edges would change {percent(error)} of the light")

    def _without_size(self) -> Outcome:
        """Hard; of a lamp that a point stands for, with what is missing."""
        numbers = self.numbers
        why = _WITHOUT_SIZE["lamp" if numbers.point_for_lamp else numbers.kind]
        why = f"soft was asked for, but {why}" if self.force == "soft" else why
        hard = self._hard(why, "size of the light, scene units", 0.0, 0.0)
        hard = replace(hard, forced=self.force == "hard")
        missed = numbers.soft_error if numbers.point_for_lamp else 0.0
        if missed >= self.tolerance and missed > 0 and numbers.width_p95 > SUBPIXEL:
            wide = f"{why}; as of a sphere of its area they are {pixels(numbers.width_p50)} wide"
            return Outcome((hard,), (), (NotSimulated(numbers.name, "penumbra", wide, missed),))
        return Outcome((hard,), (Skipped(numbers.name, "penumbra", why, missed),))

    def _without_penumbra(self, hard: Decision) -> Outcome:
        error = self.numbers.soft_error
        return Outcome((hard,), (Skipped(hard.light, "penumbra", hard.reason, error),))

    def _by_width(self, why: str, threshold: float) -> Decision:
        return self._hard(why, "width of penumbrae, px", self.numbers.width_p95, threshold)

    def _hard(self, why: str, quantity: str, number: float, threshold: float) -> Decision:
        numbers, base = self.numbers, self._first(HARD)
        if numbers.shadowed == 0:
            why += "; the probe saw no shadow, but has too few pixels to be sure"
        return Decision(
            **self._common(base),
            kind="hard",
            quantity=quantity,
            number=number,
            threshold=threshold,
            reason=why,
            error=numbers.shade,
            rays=MAP_TEXELS,
            seconds=self._seconds(look_ups=1),
        )

    def _filtered(self) -> Outcome:
        """A flat map whose answers are filtered over as much of it as penumbrae are wide there.

        Not over as many pixels: of a straight blocker above a floor the width in the light's image
        is the same from near to far.
        """
        numbers = self.numbers
        typical, width = numbers.width_p50, numbers.width_p95
        decision = Decision(
            **self._common(self._first(FLAT), self._first(FILTERED)),
            kind="hard",
            settings={"width_map": numbers.width_map},
            quantity="width of penumbrae, px",
            number=width,
            threshold=NARROW,
            reason=f"penumbrae are {pixels(typical)} wide (5 % of edges above {pixels(width)}): a "
            "filter of one width is as good as any",
            error=numbers.soft_error,
            rays=MAP_TEXELS,
            seconds=self._seconds(look_ups=1, taps=PCF_TAPS),
        )
        return self._if_registered(decision, FLAT, FILTERED)

    def _soft(self, why: str) -> Outcome:
        """One map with a filter of each pixel's own, or the mean of many maps where penumbrae are
        too wide for that or leave no umbra."""
        numbers, width = self.numbers, self.numbers.width_p95
        seen = (
            f"penumbrae are {pixels(numbers.width_p50)} wide (5 % of edges above {pixels(width)})"
        )
        no_umbra = numbers.umbra < LEAST_UMBRA and (numbers.shadowed or 0) > 0
        wanted = WIDEST if width > WIDE or no_umbra else SOFT
        by_width = {"quantity": "width of penumbrae, px", "number": width, "threshold": WIDE}
        if width > WIDE:
            how = "too wide for what one map sees from the centre: visibility from all over it"
        elif no_umbra:
            by_width = {
                "quantity": "part of the shadow that stays dark",
                "number": numbers.umbra,
                "threshold": LEAST_UMBRA,
            }
            how = (
                "no part of the shadow stays dark, and one map does not tell what is hidden from "
                "where: visibility from all over the light"
            )
        else:
            how = "one map, filtered as widely as each pixel's own penumbra"
        method = self._first(wanted)
        samples = self._sampled() if method == "accumulated" else self._one_map()
        decision = Decision(
            **self._common(method),
            kind="soft",
            **by_width,
            **samples,
            reason=f"{seen}, {why}; {how}",
            error=numbers.soft_error,
            forced=self.force == "soft",
        )
        return self._if_registered(decision, wanted)

    def _sampled(self) -> dict[str, Any]:
        """m x m samples of the light, m as many as a penumbra has pixels, as more are not seen, and
        no more than the texels of their maps are worth."""
        numbers = self.numbers
        side = math.ceil(min(max(numbers.width_p95, 2.0), 1 / (2 * SAMPLE_ERROR)))
        side = samples_worth(side, numbers.width_map * math.sqrt(MAP_TEXELS / numbers.faces))
        return {
            "settings": {"samples": side, "width_map": numbers.width_map},
            "samples": side * side,
            "sample_error": 1 / (2 * side),
            "rays": MAP_TEXELS,
            "seconds": self._seconds(look_ups=side * side),
        }

    def _one_map(self) -> dict[str, Any]:
        return {
            "settings": {
                "blocker_taps": BLOCKER_TAPS,
                "filter_taps": FILTER_TAPS,
            },
            "rays": MAP_TEXELS,
            "seconds": self._seconds(look_ups=1, taps=BLOCKER_TAPS + FILTER_TAPS),
        }

    def _seconds(self, look_ups: int, taps: int = 0) -> float:
        """What maps of `MAP_TEXELS` take in all, asked so often by each pixel."""
        return self.rates.seconds(MAP_TEXELS, self.numbers.pixels, look_ups, taps)

    def _if_registered(self, decision: Decision, *wanted: tuple[str, ...]) -> Outcome:
        """The decision, if of all that is `wanted` something is registered; else a hard map."""
        for families in wanted:
            if self._first(families) is None:
                why = (
                    f"no method for it is registered ({' or '.join(families)}); its edges are hard"
                )
                without = NotSimulated(decision.light, "penumbra", why, decision.error)
                hard = self._common(self._first(HARD))["methods"]
                left = replace(decision, methods=hard, simulated=False, forced=False)
                return Outcome((left,), (), (without,))
        return Outcome((decision,))

    def _common(self, *methods: str | None) -> dict[str, Any]:
        """What all decisions with a map say."""
        numbers = self.numbers
        if numbers.fov_deg is None:
            geometry = "parallel"
        elif numbers.faces == 1:
            geometry = f"one face of {numbers.fov_deg:.0f} degrees"
        else:
            geometry = f"{numbers.faces} of 6 cube faces"
        return {
            "light": numbers.name,
            "geometry": geometry,
            "faces": numbers.faces,
            "fov_deg": numbers.fov_deg,
            "methods": tuple(method for method in methods if method is not None),
            "width_p50": numbers.width_p50 if numbers.shape else 0.0,
            "width_p95": numbers.width_p95 if numbers.shape else 0.0,
        }

    def _first(self, wanted: tuple[str, ...]) -> str | None:
        return next((family for family in wanted if family in self.available), None)


_WITHOUT_SIZE = {
    "point": "a point has no penumbra",
    "spot": "the soft rim of a spot's cone is no penumbra",
    "directional": "parallel light has no penumbra",
    "lamp": "a point stands for it, without penumbrae, as it is no rectangle, disk or sphere that "
    "emits outwards",
}
