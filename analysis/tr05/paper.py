"""The paper TR05-024 as a report: its numbers and a reference's, our bounds, and one document.

Everything here reads the record that `analysis/subdivided_shadow_maps_tr05.py` writes step by step;
what a step did not compute is left out of the tables, and its bounds are skipped. What was measured
is in `tr05.paper_measured`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from asmjax.experiment.bounds import Bound
from asmjax.report.table import significant
from tr05.paper_measured import (
    PAPER_MEASURED,
    measured_bounds,
    measured_sections,
)

PAPER = {
    "source": "Lloyd, Yoon, Tuft, Manocha: Subdivided Shadow Maps, UNC TR05-024, 2005, 3 to 5.2",
    "n_opt": "1 + sqrt(alpha)",
    "least_largest_g": "1 / sqrt(alpha)",
    "figure 7": "2 or 3 subdivisions bring the largest reduction in error",
    **PAPER_MEASURED,
}
"""What the paper says."""

EXACT = 1e-12
"""Largest relative deviation of a float64 kernel from an equation as printed."""

SINGLE = 2e-6
"""The same of a float32 kernel."""


@dataclass(frozen=True)
class Method:
    """A shadow map of the tables, with a reference's storage factors as they were printed.

    Attributes:
        words: for the table.
        warp: of `asmjax.theory.overhead_factors` or `direction_storage`.
        k: parts along z.
        printed: by alpha, or by the angle between light and view in degrees.
    """

    words: str
    warp: str
    k: int
    printed: Mapping[float, str]


STORAGE = (
    Method("uniform", "uniform", 1, {10: "77.94", 100: "8574", 1000: "8.652e5", 1e6: "8.66e11"}),
    Method("any warp from LiSPSM to PSM", "perspective", 1,
           {10: "7.794", 100: "85.74", 1000: "865.2", 1e6: "8.66e5"}),
    Method("logarithmic in z only", "logarithmic", 1,
           {10: "19.94", 100: "398.8", 1000: "5982", 1e6: "1.2e7"}),
    Method("logarithmic perspective", "log_perspective", 1,
           {10: "1.994", 100: "3.988", 1000: "5.982", 1e6: "11.96"}),
    Method("2 parts, uniform", "uniform", 2,
           {10: "11.8", 100: "156", 1000: "1677", 1e6: "1.73e6"}),
    Method("3 parts, uniform", "uniform", 3, {10: "6.46", 100: "43.9", 1000: "234", 1e6: "25721"}),
    Method("4 parts, uniform", "uniform", 4, {10: "4.79", 100: "23.7", 1000: "90.1", 1e6: "3355"}),
    Method("8 parts, uniform", "uniform", 8, {10: "3.08", 100: "9.59", 1000: "22.5", 1e6: "180"}),
    Method("2 parts, warped", "perspective", 2,
           {10: "3.75", 100: "15.6", 1000: "53.0", 1e6: "1730"}),
    Method("3 parts, warped", "perspective", 3,
           {10: "3.00", 100: "9.46", 1000: "23.4", 1e6: "257"}),
    Method("4 parts, warped", "perspective", 4,
           {10: "2.70", 100: "7.49", 1000: "16.0", 1e6: "106"}),
    Method("8 parts, warped", "perspective", 8,
           {10: "2.31", 100: "5.39", 1000: "9.50", 1e6: "32.0"}),
)  # fmt: skip
"""Storage factors under an overhead light, theta = 30 degrees, by alpha: from closed forms."""

DIRECTIONS = (
    Method("uniform", "uniform", 1,
           {90: "8.65e5", 60: "1.00e6", 45: "9.66e5", 35: "9.06e5", 30: "8.66e5", 20: "9.40e5",
            10: "9.85e5", 0: "1e6"}),
    Method("LiSPSM", "lispsm", 1,
           {90: "865", 60: "2028", 45: "4416", 35: "1.21e4", 30: "4.12e4", 20: "4.14e6",
            10: "1.20e7"}),
    Method("best perspective warp", "perspective", 1,
           {90: "865", 60: "1971", 45: "3403", 35: "7545", 30: "2.94e4", 20: "7.81e5",
            10: "9.85e5", 0: "1e6"}),
    Method("best logarithmic perspective", "log_perspective", 1,
           {90: "6.07", 60: "15.3", 45: "29.8", 35: "87.3", 30: "2.34e4", 20: "9.09e5",
            10: "9.85e5", 0: "1e6"}),
    Method("4 parts, uniform", "uniform", 4,
           {90: "90.1", 60: "115", 45: "116", 35: "113", 30: "110", 20: "119", 10: "125",
            0: "126.5"}),
    Method("4 parts, best perspective warp", "perspective", 4,
           {90: "16.0", 45: "54.6", 30: "88.9", 10: "125", 0: "126.5"}),
)  # fmt: skip
"""Storage factors by gamma in degrees, alpha = 1000, theta = 30 degrees: from an independent script
that searched a grid of n, hence above the least by up to 1.5 %."""

EQUATIONS = {
    "equation 3": "g against the printed form in n, relative",
    "equation 4": "n(xi) against the printed form, and xi back again",
    "equation 5": "largest m over depth against the printed maximum and ours in u",
    "equation 7": "the same for a face in k parts",
    "equation 8": "m_x against the printed form in n",
    "equation 9": "largest m_x over depth against the printed maximum and ours in u",
    "g at n_opt": "g on both planes at n = 1 + sqrt(alpha) against 1 / sqrt(alpha)",
    "s(z)": "s on both planes against 0 and 1, and ds/dz against equation 1",
    "float32": "g, m_x and its maximum in float32 against float64",
}
"""Checks of the equations by name: what is compared."""

EQUATION_7 = {
    100: {1: ("9.9", "99"), 2: ("5.692", "18"), 3: ("5.071", "10.92"), 4: ("4.864", "8.649")},
    1000: {1: ("31.59", "999"), 2: ("10.89", "61.25"), 3: ("8.538", "27"), 4: ("7.799", "18.49")},
    1e6: {1: ("1000", "1e6"), 2: ("63.18", "1998"), 3: ("29.7", "297")},
}
"""The reference's values of equation 7 in units of r_p / (2 r_s tan theta), by alpha and k, at
xi = 0 and at |xi| = 1."""

EQUATION_7_LIMIT = {100: "4.605", 1000: "6.908", 1e6: "13.82"}

CROSSING_DEG = 25.5
"""Where LiSPSM becomes worse than no warp, alpha = 1000, theta = 30 degrees (the reference)."""


def last_digits(text: str, value: float) -> float:
    """How far a value is from a printed one, in halves of its last digit: at most 1 if it rounds
    to it."""
    mantissa, _, power = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return abs(value - float(text)) / (0.5 * 10.0 ** (int(power or 0) - decimals))


def bounds_of(record: Mapping) -> list[Bound]:
    """Every requirement, with the figure that the record has for it."""
    return [*_equation_bounds(record), *_table_bounds(record), *measured_bounds(record)]


def _equation_bounds(record: Mapping) -> Iterator[Bound]:
    found = record.get("equations", {})
    for name, words in EQUATIONS.items():
        limit = SINGLE if name == "float32" else EXACT
        yield Bound(name, f"{name}: {words}", found.get(name), limit)


def _table_bounds(record: Mapping) -> Iterator[Bound]:
    for name, words in (
        ("equation_7_table", "equation 7, 22 values and 3 limits"),
        ("storage", "storage factors under an overhead light"),
    ):
        yield Bound(
            name.replace("_", " "),
            f"{words}: largest deviation from the reference, halves of its last printed digit",
            _largest(record.get(name, ())),
            # The printed digit itself was rounded from a number that was rounded.
            1.001,
        )
    yield Bound(
        "light directions",
        "storage factors by light direction: largest relative deviation from the reference",
        _largest(record.get("directions", ())),
        0.02,
    )
    crossing = record.get("crossing_deg")
    yield Bound(
        "crossing",
        f"angle at which LiSPSM becomes worse than no warp, from the reference's {CROSSING_DEG:g}, "
        "degrees",
        None if crossing is None else abs(crossing - CROSSING_DEG),
        0.5,
        reason="" if crossing is None else f"found {crossing:.2f}",
    )
    gains = record.get("figure_9", {})
    yield Bound(
        "figure 9",
        "gain of one face subdivision at alpha = 100, xi = 0.673, from the 5 that figure 9 claims",
        abs(gains["0.673"] - 5) if gains else None,
        0.05,
        reason=f"at xi = 0 it is {gains['0']:.2f}" if gains else "",
    )
    slopes = record.get("gradients", {})
    yield Bound(
        "gradients",
        "log m of each receiver by xi, u, splits and light direction: derivative against central "
        "differences, largest deviation / largest derivative",
        max(slopes.values(), default=None),
        1e-4,
        reason="; ".join(f"{name} {deviation(value)}" for name, value in slopes.items()),
    )
    yield Bound(
        "optimum",
        "n of the least error found by gradient, from 1 + sqrt(alpha), relative",
        _largest(record.get("optimum", ())),
        1e-6,
    )


def _largest(rows) -> float | None:
    return max((row["deviation"] for row in rows), default=None)


def bounds_table(bounds: list[Bound]) -> str:
    """The requirements as a Markdown table; small deviations as powers of ten."""
    lines = ["| requirement | measured | bound | |", "| --- | ---: | ---: | --- |"]
    for bound in bounds:
        verdict = {"pass": "pass", "fail": "**fail**", "skipped": "not computed"}[bound.verdict]
        note = f" ({bound.reason})" if bound.reason else ""
        measured = "–" if bound.measured is None else deviation(bound.measured)
        lines.append(f"| {bound.what}{note} | {measured} | {deviation(bound.limit)} | {verdict} |")
    return "\n".join(lines)


def deviation(value: float) -> str:
    """0.0143, 2.4e-13."""
    return f"{value:.1e}" if 0 < value < 1e-3 else significant(value)


def distribution_table(record: Mapping) -> str:
    """What figure 4 shows, as numbers."""
    found = record.get("figure_4")
    if not found:
        return ""
    lines = [
        "| n | xi | g near | g far | least g, at depth |",
        "| ---: | ---: | ---: | ---: | --- |",
    ]
    for row in found["curves"]:
        n = "∞" if row["u"] == 0 else f"{1 / row['u']:.3g}"
        lines.append(
            f"| {n} | {signed(row['xi'])} | {row['near']:.4g} | {row['far']:.4g} "
            f"| {row['least']:.3g} at {row['least_at']:.3g} |"
        )
    return "\n".join(lines)


def subdivision_table(record: Mapping) -> str:
    """Equation 7: ours, and in brackets what the reference printed."""
    rows = record.get("equation_7_table", ())
    if not rows:
        return ""
    alphas = sorted({row["alpha"] for row in rows})
    lines = [
        "| k | "
        + " | ".join(f"alpha = {plain_number(alpha)}, xi = 0 | abs(xi) = 1" for alpha in alphas)
        + " |",
        "| --- | " + " | ".join("---: | ---:" for _ in alphas) + " |",
    ]
    for k in dict.fromkeys(row["k"] for row in rows):
        cells = []
        for alpha in alphas:
            for xi in (0, 1):
                cells.append(next(
                    (_beside(row) for row in rows
                     if (row["k"], row["alpha"]) == (k, alpha) and row["xi"] in (xi, None)), "–",
                ))  # fmt: skip
        lines.append(f"| {'limit' if k is None else k} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def gain_table(record: Mapping) -> str:
    """What one face subdivision gains, by xi."""
    gains = record.get("figure_9", {})
    if not gains:
        return ""
    return "\n".join([
        "| abs(xi) | " + " | ".join(gains) + " | figure 9 |",
        "| --- | " + " | ".join("---:" for _ in gains) + " | --- |",
        "| error whole / error in two parts | "
        + " | ".join(f"{gain:.2f}" for gain in gains.values())
        + f" | {PAPER_MEASURED['figure 9']['gain']} |",
    ])  # fmt: skip


def storage_table(record: Mapping) -> str:
    """Storage factors by alpha, ours and the reference's."""
    return _method_table(record.get("storage", ()), "alpha", "alpha = {}")


def direction_table(record: Mapping) -> str:
    """Storage factors by light direction, ours and the reference's."""
    return _method_table(record.get("directions", ()), "gamma_deg", "{}°")


def _method_table(rows, key: str, head: str) -> str:
    if not rows:
        return ""
    places = list(dict.fromkeys(row[key] for row in rows))
    lines = [
        "| map | " + " | ".join(head.format(plain_number(place)) for place in places) + " |",
        "| --- | " + " | ".join("---:" for _ in places) + " |",
    ]
    for words in dict.fromkeys(row["words"] for row in rows):
        by_place = {row[key]: row for row in rows if row["words"] == words}
        cells = [_beside(by_place[place]) if place in by_place else "–" for place in places]
        lines.append(f"| {words} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _beside(row: Mapping) -> str:
    return f"{four_digits(row['value'])} ({row['printed']})"


def four_digits(value: float) -> str:
    """25720, 8.652e5."""
    return plain_number(float(f"{value:.4g}"))


def plain_number(value: float) -> str:
    """12.5, 25720, 1e6: no zeros that say nothing."""
    if value < 1e5:
        return f"{value:g}"
    mantissa, _, power = f"{value:.3e}".partition("e")
    return f"{float(mantissa):g}e{int(power)}"


def signed(value: float) -> str:
    """Three digits with a proper minus; no sign for what rounds to 0."""
    text = f"{abs(value):.3g}"
    return f"−{text}" if value < 0 and float(text) else text


def document(record: Mapping) -> str:
    """The record as Markdown, with the figures of its folder."""
    parts = [f"# {record['title']}", f"Paper: {PAPER['source']}.\n\n`{record['command']}`"]
    words = (
        "Smaller is better: largest deviations from the theory, and ratios of what was measured. "
        "Equations are those of the paper as printed, with the errata of docs/theory.md; kernels "
        "are in u = 1/n."
    )
    parts += ["## Bounds", words, bounds_table(bounds_of(record))]
    for title, words, table, figures in (
        ("Figure 4: where the error is",
         "g is convex, so largest on the near or on the far plane; the least largest value, on "
         "both, is 1/sqrt(alpha) at n = 1 + sqrt(alpha).",
         distribution_table(record), ("figure_4",)),
        ("Figure 7: subdividing a face",
         f"Equation 7 in units of r_p / (2 r_s tan theta); in brackets the reference's digits. The "
         f"paper: {PAPER['figure 7']}.",
         subdivision_table(record), ("figure_7",)),
        ("Figure 9: what one subdivision gains",
         "At alpha = 100. The factor of the paper needs a warp other than the best one.",
         gain_table(record), ()),
        ("Storage under an overhead light",
         "Texels / pixels at which no error is above 1, theta = 30°; in brackets the reference's "
         "digits.",
         storage_table(record), ()),
        ("Storage by light direction",
         "The same by the angle between light and view, alpha = 1000; maxima over the view volume.",
         direction_table(record), ("light_directions",)),
        *measured_sections(record),
    ):  # fmt: skip
        known = record["figures"]
        shown = [f"![{known[name]}]({name}.png)" for name in figures if name in known]
        if table or shown:
            parts += [f"## {title}", words, *([table] if table else []), *shown]
    skipped = [f"- {name}: {reason}" for name, reason in record.get("skipped", {}).items()]
    parts += ["## Left out", "\n".join(skipped)] if skipped else []
    parts += ["## Steps", _steps(record)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _steps(record: Mapping) -> str:
    lines = ["| step | ended | seconds |", "| --- | --- | ---: |"]
    for name, step in record["steps"].items():
        reason = f": {step['reason']}" if step.get("reason") else ""
        lines.append(f"| {name} | {step['status']}{reason} | {step['seconds']:.1f} |")
    return "\n".join(lines)
