"""Section 5 of "Adaptive Shadow Maps" (Fernando, Fernandez, Bala, Greenberg, 2001), measured again.

    python analysis/adaptive_shadow_maps_2001.py [--out DIR] [--quick]

Figures 2, 3 and 4, the timing table, effective resolutions, growth curves, and a table of bounds,
as report.json, report.md and PNG files. What is done is written after each step, so a run that
fails or is interrupted keeps it.
"""

import argparse
import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np
from asm2001.paper import PAPER, bounds_of, bounds_table, document

from asmjax.cli import prepare_to_measure
from asmjax.experiment import measure, measure_rays
from asmjax.experiment.growth import Growth, GrowthPoint, growth_point, with_cold_in_turns
from asmjax.experiment.maps import answered_resolution
from asmjax.experiment.traces import counted_traces
from asmjax.options import RunOptions
from asmjax.report.figures import RunPictures
from asmjax.report.figures.beside import draw_beside
from asmjax.report.figures.growth import draw_growth
from asmjax.report.measured import light_parts, method_records
from asmjax.report.provenance import provenance
from asmjax.report.stepwise import StepwiseRecord, exit_code
from asmjax.report.table import MB
from asmjax.report.walk_record import COMPLETE, WalkRecord
from asmjax.scene.other_scenes import OTHER_SCENES, other_scene, why_left_out
from asmjax.shadow import AdaptiveShadowMap, UniformShadowMap, resolution_for
from asmjax.walkthrough_job import Walk


@dataclass(frozen=True)
class Sizes:
    """What is measured, and how large."""

    pixels: int = 512
    memory_mb: float = 16.0
    frames: int = 200
    repeats: int = 3
    large_frames: int = 24
    many_samples: int = 16
    views: tuple[str, ...] = ("overview", "closeup", "macro")
    house: str = "victorian_house"
    large: str = "surface:12m"
    pixel_sides: tuple[int, ...] = (256, 512, 1024, 2048)
    triangles: tuple[int, ...] = (10_000, 100_000, 1_000_000, 10_000_000)
    memories_mb: tuple[float, ...] = (2, 4, 8, 16, 32, 64)
    memory_pixels: int = 256
    growth_triangles: int = 250_000
    growth_frames: int = 10
    growth_repeats: int = 7


QUICK = Sizes(
    pixels=64, memory_mb=1.0, frames=6, repeats=1, large_frames=3, many_samples=2,
    views=("closeup",), house="letter_f", large="surface:10k",
    pixel_sides=(64,), triangles=(5_000, 20_000), memories_mb=(1.0,), memory_pixels=64,
    growth_triangles=10_000, growth_frames=3, growth_repeats=1,
)  # fmt: skip


class Analysis:
    """What is measured, and the record that it goes to."""

    def __init__(self, folder: Path, sizes: Sizes, quiet: bool = False):
        title = "Adaptive Shadow Maps (2001), section 5, measured again"
        self.kept = StepwiseRecord(folder, title, vars(sizes), bounds_of, document, quiet)
        self.sizes, self.record = sizes, self.kept.record
        self.record |= {"seed": 0, "paper": PAPER}
        self.record |= {key: {} for key in ("walkthroughs", "views", "growth", "skipped")}

    def walk(self, scene: str, progress=lambda _: None, **options) -> Walk:
        """A walk of the analysis's size; `options` are those of `asmjax run`."""
        sizes = self.sizes
        usual = {
            "size": (sizes.pixels, sizes.pixels),
            "memory_mb": sizes.memory_mb,
            "repeats": sizes.repeats,
        }
        walk = Walk(RunOptions(scene=scene, **(usual | options)), progress)
        self.record |= provenance(walk.setting.variant, jax.devices()[0].device_kind)
        return walk


def walkthrough(analysis: Analysis, name: str, scene: str, **options) -> dict:
    """Measure a walkthrough, and keep its report under `name`, finished or not.

    Returns the report, with the names of what was traced after the warm-up under "traced".
    """
    report: dict = {}
    with counted_traces() as traced:
        # Each step is announced when it begins: "frames" ends the warm-up.
        walk = analysis.walk(scene, lambda step: traced.clear(), **options)
        taken, ended = WalkRecord(walk.setting), "interrupted"
        try:
            for result in analysis.kept.bar(walk.frames(), name, total=walk.setting.frames):
                taken.add(result)
            ended = COMPLETE
        finally:
            if taken.frames:
                report = taken.report(ended)
                kept = {key: value for key, value in report.items() if key != "frames"}
                analysis.record["walkthroughs"][name] = kept
    return report | {"traced": list(traced)}


def paper_walk(analysis: Analysis) -> None:
    """The walkthrough of the paper's room, frame by frame."""
    frames = analysis.sizes.frames
    report = walkthrough(analysis, "paper_room", "paper_room", frames=frames)
    analysis.record["frames"] = report["frames"]
    analysis.record["methods"] = report["summary"]["methods"]
    names = report["traced"]
    analysis.record["retraces"] = {"frames": frames, "count": len(names), "names": names}


def views(analysis: Analysis) -> None:
    """Each view of the room from nothing: errors, resolutions, and the paper's figures."""
    sizes = analysis.sizes
    for name in analysis.kept.bar(sizes.views, "views"):
        walk = analysis.walk("paper_room", view=name, frames=1, motion="still")
        frame, adaptive = next(walk.frames()).input, walk.setting.adaptive
        eye = frame.eyes[0]
        maps = [
            UniformShadowMap(resolution_for(adaptive.memory_bytes, frame.fitted.faces)),
            replace(adaptive, memory_bytes=adaptive.memory_bytes // 2),
            adaptive,
        ]
        truth = measure_rays(frame.shadow_rays, frame.eyes, sizes.repeats)
        methods = [
            *(measure(m, frame.eyes, frame.fitted, frame.rays, sizes.repeats) for m in maps),
            truth,
        ]
        records = method_records(eye, truth, methods, adaptive)
        answered = {
            method.name: float(
                np.nanmedian(answered_resolution(eye, frame.fitted, m, method.state))
            )
            for m, method in zip(maps, methods, strict=False)
            if isinstance(m, AdaptiveShadowMap)
        }
        analysis.record["views"][name] = {"methods": records, "answered_texels_p50": answered}
        size = eye.size
        direct, ambient = light_parts(eye, frame.fitted)
        pictures = RunPictures(
            title=f"paper_room, {name}", direct=direct, ambient=ambient,
            valid=eye.valid.reshape(size), truth=truth.visibility.reshape(size),
            visibilities={m.name: m.visibility.reshape(size) for m in methods}, methods=records,
        )  # fmt: skip
        flat, half, whole = (m.name for m in maps)
        analysis.kept.figure(
            name, draw_beside(pictures, [flat, whole]), f"{name}: {flat} and {whole}"
        )
        analysis.kept.figure(
            f"{name}_memory", draw_beside(pictures, [flat, half, whole], worst=half),
            f"{name}: {flat}, {half} and {whole}",
        )  # fmt: skip
        analysis.kept.write()


def house_walk(analysis: Analysis, samples: int) -> None:
    """A scene of a million triangles that this project did not make, where it is at hand."""
    house, frames = analysis.sizes.house, analysis.sizes.large_frames
    name = house + (f", {samples} samples" if samples > 1 else "")
    where = other_scene(house) if house in OTHER_SCENES else house
    if where is None:
        analysis.record["skipped"][name] = why_left_out(house)
        return
    walkthrough(analysis, name, str(where), frames=frames, samples=samples)


def surface_walk(analysis: Analysis) -> None:
    """The procedural surface at twelve million triangles."""
    name = analysis.sizes.large
    walkthrough(analysis, name, name, frames=analysis.sizes.large_frames)


def growth(analysis: Analysis, axis: str) -> None:
    """Times along one axis, one point after the other, each written before the next."""
    sizes, points, maps = analysis.sizes, [], []
    along = {
        "pixels": sizes.pixel_sides, "triangles": sizes.triangles, "memory": sizes.memories_mb,
    }[axis]  # fmt: skip
    walk = None
    for value in analysis.kept.bar(along, f"growth with {axis}"):
        varied = {
            "pixels": {"size": (value, value)},
            "triangles": {},
            "memory": {"memory_mb": value, "size": (sizes.memory_pixels, sizes.memory_pixels)},
        }[axis]  # fmt: skip
        triangles = value if axis == "triangles" else sizes.growth_triangles
        walk = analysis.walk(
            f"surface:{triangles}", view="rings", frames=sizes.growth_frames, **varied
        )
        size = {"pixels": value**2, "triangles": value, "memory": int(value * MB)}[axis]
        maps.append(walk.setting.adaptive)
        points.append(growth_point(size, walk.frames(), maps[-1], sizes.growth_repeats))
        limit = {} if axis == "memory" else {"memory_bytes": walk.setting.adaptive.memory_bytes}
        analysis.record["growth"][axis] = Growth(axis, tuple(points)).record() | limit
        analysis.kept.write()
    if axis == "memory" and walk is not None:
        # What is sought is a flat line, and all points see the same frame.
        first = next(walk.frames()).input
        turned = with_cold_in_turns(Growth(axis, tuple(points)), maps, first, sizes.growth_repeats)
        analysis.record["growth"][axis] = turned.record()


def growth_figure(analysis: Analysis) -> None:
    """All axes that were measured, side by side."""
    sizes = analysis.sizes
    grown = [
        Growth(axis, tuple(GrowthPoint(**point) for point in entry["points"]))
        for axis, entry in analysis.record["growth"].items()
    ]
    words = (
        f"surface, rings: {sizes.pixels}² pixels ({sizes.memory_pixels}² against memory), "
        f"{sizes.growth_triangles:,} triangles and {sizes.memory_mb:g} MB where they do not vary"
    )
    analysis.kept.figure("growth", draw_growth(grown, words), "growth of time")


def steps(analysis: Analysis) -> dict[str, Callable[[], None]]:
    """The steps in order, by name."""
    sizes = analysis.sizes
    house = sizes.house
    every: dict[str, Callable[..., None]] = {
        "views and figures": views,
        "walkthrough of paper_room": paper_walk,
        house: functools.partial(house_walk, samples=1),
        f"{house}, {sizes.many_samples} samples": functools.partial(
            house_walk, samples=sizes.many_samples
        ),
        sizes.large: surface_walk,
        **{
            f"growth with {axis}": functools.partial(growth, axis=axis)
            for axis in ("pixels", "triangles", "memory")
        },
        "growth figure": growth_figure,
    }
    return {name: functools.partial(step, analysis) for name, step in every.items()}


def run(folder: Path, sizes: Sizes, quiet: bool = False) -> dict:
    """All steps; returns the record."""
    analysis = Analysis(folder, sizes, quiet)
    analysis.kept.run(steps(analysis))
    return analysis.record


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/adaptive_shadow_maps_2001"))
    parser.add_argument("--quick", action="store_true", help="tiny sizes: tries it out in seconds")
    options = parser.parse_args()
    prepare_to_measure()
    record = run(options.out, QUICK if options.quick else Sizes())
    print(bounds_table(bounds_of(record)))
    print(f"report and figures: {options.out}/report.md")
    return exit_code(record)


if __name__ == "__main__":
    sys.exit(main())
