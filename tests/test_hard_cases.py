"""The catalogue of hard cases: complete, its truths right, and no kernel of it fails in silence.

`ASMJAX_TEST_HARD=1` asks for all severities instead of three of each case.
"""

import re
from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.effort import HARD
from helpers.hard_oracles import ORACLES, area_oracle, mp

from asmjax.errors import UseError
from asmjax.hard_cases import CASES, ROWS, THEMES, Kernel, families_of, measure, page
from asmjax.hard_cases.exact import digits, dot, fifty, floats, ln, power, slope, tan
from asmjax.hard_cases.projections import AXIS, FOCAL

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/stability.md"

KERNELS = [case for case in CASES.values() if not case.is_scene]
each_kernel = pytest.mark.parametrize("case", KERNELS, ids=lambda case: case.name)


def test_every_row_has_a_case():
    assert list(ROWS) == list(range(1, 37))
    assert {row for case in CASES.values() for row in case.rows} == set(ROWS)
    assert {case.theme for case in CASES.values()} == set(THEMES)
    assert len({case.name for case in CASES.values()}) == len(CASES)


@pytest.mark.parametrize("case", CASES.values(), ids=lambda case: case.name)
def test_a_case_says_what_it_is(case):
    for words in (case.breaks, case.source, case.truth, case.axis, case.bound.unit):
        assert words and words == words.strip()
    assert list(case.severities) == sorted(set(case.severities)) and len(case.severities) >= 4
    assert (case.fails_from is None) == (case.announced == "")
    if case.fails_from is not None:
        assert case.severities[0] < case.fails_from <= case.severities[-1]
    assert case.few[0] == case.severities[0] and case.few[-1] == case.severities[-1]


@each_kernel
def test_no_kernel_fails_in_silence(case):
    """Stable up to where the case says that it may fail, and from there on announced."""
    records = measure(case, severities=case.severities if HARD else case.few)
    for record in records:
        expected = {"stable"}
        if case.fails_from is not None and record.severity >= case.fails_from:
            expected = {"stable", "announced"}
        assert record.verdict in expected, record
        assert record.error <= case.bound.of(record.precision) or record.how, record
    assert case.fails_from is None or any(record.verdict == "announced" for record in records)


@pytest.mark.parametrize("name", ORACLES)
def test_truths_of_kernels(name):
    """Fifty digits of what the papers print, beside another way to the same number."""
    kernel = CASES[name].build(CASES[name].severities[0])
    assert isinstance(kernel, Kernel)
    np.testing.assert_allclose(kernel.truth(*kernel.inputs), ORACLES[name](*kernel.inputs), 1e-11)


def test_truth_of_areas():
    kernel = CASES["area of a pixel on a surface seen edge-on"].build(60.0)
    assert isinstance(kernel, Kernel)
    position, normal = kernel.inputs
    other = area_oracle(position, normal, AXIS, FOCAL[0])
    np.testing.assert_allclose(kernel.truth(*kernel.inputs), other, 1e-9)


@pytest.mark.parametrize(
    "name",
    [
        "image coordinates in float32", "addresses in tiles", "addresses far from the origin",
        "points beside borders of pages", "one plane for a wide field of view",
        "image coordinates from a lamp far away",
    ],
)  # fmt: skip
def test_truths_of_places(name, x64):
    """The kernel in float64, which shares no line with decimals, has them to twelve digits; the
    anchors of the two forms of a projection differ too."""
    kernel = CASES[name].build(CASES[name].severities[0])
    assert isinstance(kernel, Kernel)
    value = np.asarray(kernel.value(*map(jnp.asarray, kernel.inputs)))
    truth = kernel.truth(*kernel.inputs)
    np.testing.assert_allclose(value, truth, rtol=0, atol=1e-12)
    assert np.ptp(truth) > 0.1


def test_truth_about_the_light_is_a_quotient_in_front_of_it():
    kernel = CASES["points about the light's plane"].build(1.0)
    assert isinstance(kernel, Kernel)
    x, _, z = kernel.inputs[0]
    np.testing.assert_array_equal(kernel.truth(*kernel.inputs), np.where(z > 0, x / z, -1))
    assert (z > 0).sum() == (z < 0).sum() == 8


def test_gradients_in_truth_are_slopes():
    """Of the closed forms that some cases give, beside differences of their values."""
    for name in ("points about the light's plane", "gradient of a maximum"):
        kernel = CASES[name].build(CASES[name].severities[0])
        assert isinstance(kernel, Kernel) and kernel.gradient_truth is not None
        inputs, found = [x.copy() for x in kernel.inputs], kernel.gradient_truth(*kernel.inputs)
        at = (0, 2) if found.ndim == 2 else (2,)
        step = 1e-6
        inputs[0][at] += step
        above = kernel.truth(*inputs).sum()
        inputs[0][at] -= 2 * step
        assert (above - kernel.truth(*inputs).sum()) / (2 * step) == pytest.approx(found[at], 1e-6)


def test_fifty_digits_are_those_of_mpmath():
    # The default context of decimals has 28 digits, and `fifty` another.
    assert abs(mp.mpf(str(tan(digits(0.7))[()])) - mp.tan(mp.mpf(0.7))) < mp.mpf("1e-27")
    x = np.array([0.3, 1.0, 1.5])
    np.testing.assert_array_equal(fifty(tan)(x), [float(mp.tan(v)) for v in x.tolist()])
    np.testing.assert_array_equal(fifty(ln)(x), np.log(x))
    np.testing.assert_allclose(fifty(power)(x, 2 * x), x ** (2 * x), 1e-15)
    np.testing.assert_array_equal(floats(digits(x)), x)
    np.testing.assert_allclose(slope(lambda a: a**3, 0)(x), 3 * x**2, 1e-15)
    assert fifty(dot)(x, x) == pytest.approx(x @ x)
    # What float64 cannot: the slope of a difference that cancels.
    np.testing.assert_allclose(slope(lambda a: (1 + a) - 1, 0)(x * 1e-30), 1.0)


def _naive(alpha, theta):
    root = alpha ** (1 / 4)
    return 4 * (root - 1) * (1 + 0.5 * (jnp.sqrt(root) - 1)) / jnp.sqrt(root) / 2 / jnp.tan(theta)


def test_a_naive_formula_fails_in_silence():
    """What the catalogue is there to find: the same case with the formula as it is printed."""
    case = CASES["splits as far / near goes to 1"]

    def build(severity):
        kernel = case.build(severity)
        assert isinstance(kernel, Kernel)
        return replace(kernel, value=_naive, gradient=None)

    mild, hard = measure(
        replace(case, build=build), severities=(10.0, 1e5), precisions=("float32",)
    )
    assert mild.verdict == "stable" and hard.verdict == "silent" and hard.error > 1e-3


def test_wrong_use_is_one_line():
    with pytest.raises(UseError, match="unknown algorithm 'unifrom'.*Did you mean 'uniform'"):
        measure(CASES["light at the eye"], algorithms=["unifrom"])
    with pytest.raises(UseError, match="16385 cells a side .* allowed: 1 to 16384"):
        from asmjax.footprint import cell_index

        cell_index(jnp.zeros((2, 1)), jnp.zeros(1, jnp.int32), 16385)


def test_the_page_lists_every_case():
    """With its severities, in the table of all cases, and with an image for each theme."""
    text = PAGE.read_text(encoding="utf-8")
    rows = {}
    for line in text.split("## All cases")[1].split("\n## ")[0].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 7 and cells[0][0].isdigit():
            rows[cells[1]] = cells
    assert set(rows) == set(CASES)
    for name, case in CASES.items():
        assert rows[name][0] == ", ".join(map(str, case.rows))
        assert rows[name][2] == f"{page.severities_text(case)} ({case.axis})"
        assert rows[name][6].startswith("stable")
        assert text.count(f"| {name} |") >= 2
        if case.is_scene:
            # The theme's table has a column of both precisions for each algorithm.
            section = text.split(f"## {THEMES[case.theme]}\n")[1]
            assert f"| case | {' | '.join(families_of(case))} |\n" in section
            found = next(line for line in section.splitlines() if line.startswith(f"| {name} |"))
            cells = [cell.strip() for cell in found.strip("| ").split(" | ")][1:]
            assert len(cells) == len(families_of(case))
            assert all(re.match(r"-( |$)|\S+( %)? / \S+( %)? \(", cell) for cell in cells), cells
    assert "silent" not in text.split(page.BEGIN)[1].lower()
    for theme in THEMES:
        assert (PAGE.parent / f"images/stability_{theme}.png").stat().st_size > 10_000


def test_the_page_is_written_between_its_markers():
    text = PAGE.read_text(encoding="utf-8")
    written = page.written_into(text, [])
    assert page.BEGIN in written and written.split(page.BEGIN)[0] == text.split(page.BEGIN)[0]
    assert re.search(r"\| 26 \| numbers of texels in 32 bits \|", written)
    with pytest.raises(UseError, match="put the lines"):
        page.written_into("# Stability\n", [])
