"""How long the per-pixel kernels take on each device of this machine.

    python analysis/kernel_times.py [--out DIR] [--docs] [--quick]

A square over a plane (closed form, no renderer), its adaptive map of 16 MB, and images of growing
size: wall time of projection with footprint, and of visibility, with all arrays on the device.
Writes benchmarks.md, and with --docs also docs/benchmarks.md.
"""

import argparse
import os
from datetime import UTC, datetime
from pathlib import Path

import jax

from asmjax.experiment.devices import (
    KERNELS,
    KernelTime,
    available_devices,
    device_name,
    kernel_times,
)
from asmjax.experiment.stored_view import StoredView, stored_view
from asmjax.scene.analytic_rays import AnalyticRays, analytic_eye, scene_bounds
from asmjax.scene.analytic_scenes import a1_square
from asmjax.scene.lights import light_frame
from asmjax.shadow import AdaptiveShadowMap

DOCS = Path(__file__).parents[1] / "docs/benchmarks.md"

HEAD = """# Benchmarks

Wall time of the JAX kernels that run once per eye pixel, arrays already on the device, after
warm-up: median (least) milliseconds of {repeats} runs. float32; a square over a plane under a point
light, and its adaptive map of 16 MB. `project + footprint` takes surface points to the light's
image, Jacobian, area ratio and m; `visibility` is the query of the adaptive map. Casting rays is
Mitsuba's and not in here.

Written by `python analysis/kernel_times.py --docs` on {date} with JAX {jax}. Before it started the
machine's load was {load:.1f} (0 is a quiet one; other work on all cores slows the CPU column).
"""

NO_GPU = """
There is no column for a GPU: JAX found none where this was measured.
"""


def view_of(side: int) -> StoredView:
    """The scene at `side` x `side` pixels with its adaptive map."""
    spec = a1_square().spec
    eye = analytic_eye(spec.shapes, next(iter(spec.views.values())).resized(side, side))
    frame = light_frame(next(iter(spec.lights.values())), eye, scene_bounds(spec.shapes))
    algorithm = AdaptiveShadowMap()
    state = algorithm.build(eye, frame, AnalyticRays(spec.shapes))
    return stored_view(algorithm, state, eye)


def document(times: list[KernelTime], repeats: int, load: float) -> str:
    """The Markdown page: a row for each kernel and image size, a column for each device."""
    devices = list(dict.fromkeys(time.device for time in times))
    lines = [
        HEAD.format(
            repeats=repeats, date=f"{datetime.now(UTC):%Y-%m-%d}", jax=jax.__version__, load=load
        ),
        "| kernel | pixels | " + " | ".join(devices) + " |",
        "| --- | --- |" + " --- |" * len(devices),
    ]
    found = {(time.kernel, time.pixels, time.device): time for time in times}
    for kernel in KERNELS:
        for pixels in dict.fromkeys(time.pixels for time in times):
            row = [f"| {kernel} | {pixels:,}"]
            for device in devices:
                time = found[kernel, pixels, device]
                row.append(f"{1e3 * time.median:.3g} ({1e3 * time.least:.3g})")
            lines.append(" | ".join(row) + " |")
    text = "\n".join(lines) + "\n"
    return text if len(devices) > 1 else text + NO_GPU


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/kernel_times"), help="folder")
    parser.add_argument("--docs", action="store_true", help="also write docs/benchmarks.md")
    parser.add_argument("--quick", action="store_true", help="tiny images, a few seconds")
    options = parser.parse_args()
    sides, repeats = ((32, 64), 5) if options.quick else ((256, 512, 1024), 100)
    load, times = os.getloadavg()[0], []
    for side in sides:
        view = view_of(side)
        for device in available_devices():
            print(f"{side} x {side} on {device_name(device)}")
            times += kernel_times(view, device, repeats)
    text = document(times, repeats, load)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "benchmarks.md").write_text(text, encoding="utf-8")
    if options.docs:
        # The sections below the first are others'.
        _, heading, others = DOCS.read_text(encoding="utf-8").partition("\n## ")
        DOCS.write_text(text + heading + others, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
