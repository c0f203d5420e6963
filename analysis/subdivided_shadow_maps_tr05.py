"""Sections 3 to 5 of "Subdivided Shadow Maps" (Lloyd, Yoon, Tuft, Manocha, TR05-024), done again.

    python analysis/subdivided_shadow_maps_tr05.py [--out DIR] [--quick]

The theory: figures 4 and 7, checks of the equations as printed, storage factors under an overhead
light and by light direction. The measurements: figures 1, 9 and 10, light along the view, the
overdraw of table 2, maps of equal bytes, predicted against measured displacement. A table of
bounds, as report.json, report.md and PNG files; what is done is written after each step.
"""

import argparse
import functools
import sys
from collections.abc import Callable
from pathlib import Path

import jax
from tr05 import accuracy_steps, aliasing_steps, cost_steps, gradient_steps, theory_steps
from tr05.paper import bounds_of, bounds_table
from tr05.sizes import QUICK, Analysis, Sizes

from asmjax.cli import prepare_to_measure
from asmjax.report.stepwise import exit_code

THEORY: dict[str, Callable[[Analysis], None]] = {
    "equations": theory_steps.equations,
    "figure 4": theory_steps.figure_4,
    "figure 7 and equation 7": theory_steps.figure_7,
    "storage under an overhead light": theory_steps.storage,
    "storage by light direction": theory_steps.light_directions,
    "gradients of the error": gradient_steps.gradients,
    "optimum by gradient": gradient_steps.optimum,
}
"""Steps in float64."""

MEASURED: dict[str, Callable[[Analysis], None]] = {
    "figures 1 and 9: aliasing in the alley": aliasing_steps.alley,
    "figure 10: frame times": cost_steps.frame_times,
    "table 2: overdraw": cost_steps.overdrawn,
    "maps of equal bytes": accuracy_steps.equal_bytes,
    "predicted and measured displacement": accuracy_steps.displacements,
}
"""Steps in the precision that users have; a later one may read what an earlier one recorded."""


def run(folder: Path, sizes: Sizes, quiet: bool = False) -> dict:
    """All steps; returns the record."""
    analysis = Analysis(folder, sizes, quiet)
    with jax.enable_x64(True):
        analysis.kept.run(_bound(THEORY, analysis))
    analysis.kept.run(_bound(MEASURED, analysis))
    return analysis.record


def _bound(steps: dict, analysis: Analysis) -> dict[str, Callable[[], None]]:
    return {name: functools.partial(step, analysis) for name, step in steps.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/subdivided_shadow_maps_tr05"))
    parser.add_argument("--quick", action="store_true", help="small sizes: tries it out")
    options = parser.parse_args()
    prepare_to_measure()
    record = run(options.out, QUICK if options.quick else Sizes())
    print(bounds_table(bounds_of(record)))
    print(f"report and figures: {options.out}/report.md")
    return exit_code(record)


if __name__ == "__main__":
    sys.exit(main())
