"""Effects of a light that no method has, by how much they change: not simulated, or too small."""

from asmjax.effects.records import Decision, LightNumbers, NotSimulated, Skipped, percent

VERY_LARGE_SR = 1.0
"""Steradians: one receiver sees parts of a larger light at such different angles that visibility
weighted by area is no share of its light."""


def transmittance(numbers: LightNumbers, tolerance: float) -> tuple[Decision, ...]:
    """The decision about light that passes through things, where that matters."""
    if numbers.transmitted == 0 or numbers.transmitted < tolerance:
        return ()
    decision = Decision(
        numbers.name, "transmittance", quantity="light that passes through casters",
        number=numbers.transmitted, threshold=tolerance, error=numbers.transmitted,
        reason=f"{percent(numbers.transmitted)} of the light passes through transmissive surfaces "
        "or media, which maps and shadow rays hold for opaque",
        simulated=False,
    )  # fmt: skip
    return (decision,)


def missing(numbers: LightNumbers, tolerance: float) -> list[NotSimulated]:
    """What no method has."""
    return [
        NotSimulated(numbers.name, effect, why, error)
        for effect, error, why in _nobody_has(numbers)
        if error > 0 and error >= tolerance
    ]


def _nobody_has(numbers: LightNumbers) -> list[tuple[str, float, str]]:
    """Effects that no method has, with what they change at most, and why."""
    varies = (
        "its radiance is of a kind that does not tell how it varies"
        if numbers.spread is None
        else f"its radiance varies by {percent(numbers.spread)} over it (standard deviation)"
    )
    large = numbers.solid_angle > VERY_LARGE_SR
    return [
        ("transmittance", numbers.transmitted, "no method lets light through: shadows too dark"),
        ("refraction", numbers.refracted, "refractive casters are opaque: no caustics (at most)"),
        ("textured light", numbers.texture_error, f"{varies}, and methods take it for even"),
        (
            "very large light",
            numbers.large_error if large else 0.0,
            f"{numbers.solid_angle:.2g} steradians of light: visibility is that of its area, not "
            "of what each part of it brings",
        ),
    ]


def small(numbers: LightNumbers, tolerance: float) -> list[Skipped]:
    """What else is left out of a light that gets a shadow."""
    skipped = []
    if numbers.fov_deg is not None and 1 < numbers.faces < 6:
        why = f"{6 - numbers.faces} of 6 see no receiver"
        skipped.append(Skipped(numbers.name, "cube faces", why))
    if numbers.facing < 1:
        why = (
            f"{percent(1 - numbers.facing)} of the pixels face away or are out of reach: no look-up"
        )
        skipped.append(Skipped(numbers.name, "pixels turned away", why))
    for effect, error, _ in _nobody_has(numbers):
        if 0 < error < tolerance:
            why = f"it is {percent(error)} of the light, below the tolerance"
            skipped.append(Skipped(numbers.name, effect, why, error))
    return skipped
