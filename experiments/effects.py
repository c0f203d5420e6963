"""Is what a plan skips missed, what does forcing it cost, and is what is skipped really free?

For each scene the plan of its light; how much hard edges change (predicted by the plan, and
measured against 64 shadow rays a pixel to all of the light); how near the planned method comes; and
what the method that takes everything into account costs beside the planned one, as estimated and as
measured. Suns that the scene files have without a disk are planned with one too. Then pictures of
what is simulated, of everything, and of their difference; and a run of a point light with the soft
families registered, and without, in turns.

    python experiments/effects.py [--smoke] [--out DIR] [--only STEP ...] [--docs]

Takes about 5 minutes on 2 cores. Times are compared, so nothing else may run beside it. Scenes that
the project did not make are left out where absent (docs/other_scenes.md). `--docs` writes
docs/images/skipped.png.
"""

import argparse
import io
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from asmjax.buffers import EyeBuffer, seen_points
from asmjax.cli import prepare_to_measure
from asmjax.effects import TOLERANCE
from asmjax.effects.decide import MAP_TEXELS
from asmjax.effects.methods import soft_methods
from asmjax.effects.planning import parts_of
from asmjax.effects.probe import light_paths
from asmjax.effects.records import percent
from asmjax.experiment import in_turns, median_of, ratio_of, timed
from asmjax.experiment.bounds import Bound
from asmjax.experiment.traces import counted_traces
from asmjax.geometry.area_light import sun_light
from asmjax.main_job import measure_scene
from asmjax.options import RunOptions
from asmjax.planning import asked_of, plan_effects
from asmjax.render.load import Scene, load_scene
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board, png
from asmjax.report.figures.shading import shade
from asmjax.report.figures.style import BACKGROUND, styled
from asmjax.report.stepwise import StepwiseRecord, exit_code, head_of
from asmjax.scene.other_scenes import OTHER_SCENES, other_scene, why_left_out
from asmjax.scene.spec import ViewSpec
from asmjax.shadow import ALGORITHMS, AccumulatedShadowMap, ShadowAlgorithm, UniformShadowMap
from asmjax.shadow.registry import FILTERS, SOFT

ROOT = Path(__file__).parents[1]

SUN = np.radians(0.5338)
"""The sun's angular diameter, radians."""

RESOLUTION, EVERYTHING = 2048, 8
"""Texels a side of all maps, and samples a side of the light where everything is asked for."""

WIDEST = 0.1
"""Part of the light at the ends of the pictures' colour scale."""

SKIPPED = f"what is skipped; the tolerance is {percent(TOLERANCE)}"

_BAR, _BAR_LABELS = 18, 84


class Subject(NamedTuple):
    """A scene whose first light is planned for; with `disk`, a sun that gets the real one's."""

    scene: str
    disk: bool = False

    @property
    def name(self) -> str:
        return f"{self.scene}, sun's disk" if self.disk else self.scene


class Pictured(NamedTuple):
    """A scene in pictures.

    Attributes:
        title: its name and what is planned.
        method: what made the first picture.
        planned, everything: (height, width, 3) uint8, what the plan simulates, and all there is.
        difference: (height, width) of the first - the second, parts of the light.
        off: mean of what it is in size.
        skipped: what it is, in words.
    """

    title: str
    method: str
    planned: np.ndarray
    everything: np.ndarray
    difference: np.ndarray
    off: float
    skipped: str


SUBJECTS = (
    Subject("paper_room"),
    Subject("cornell_box"),
    Subject("breakfast_room"),
    Subject("breakfast_room", disk=True),
    Subject("munich"),
    Subject("munich", disk=True),
)


def scene_of(subject: Subject) -> Scene | None:
    """The scene of that name; None where its file is not there."""
    where = other_scene(subject.scene) if subject.scene in OTHER_SCENES else subject.scene
    if where is None:
        return None
    scene = load_scene(where)
    if not subject.disk:
        return scene
    light = scene.light()
    return scene.with_light(replace(light, area=sun_light(light.direction, SUN)))


def part_of(scene: Scene, view: ViewSpec, eye: EyeBuffer, name: str) -> np.ndarray:
    """What part of the light each pixel (n,) gets from a light where nothing shades it, as the plan
    has it of its probe."""
    asked = asked_of(scene, view)
    frames = [scene.light_frame(eye, one.spec.name) for one in asked.lights]
    lights = [replace(one, frame=frame) for one, frame in zip(asked.lights, frames, strict=True)]
    paths = [light_paths(eye, frame) for frame in frames]
    parts, _ = parts_of(replace(asked, eye=eye, lights=lights), paths)
    return parts[[one.spec.name for one in lights].index(name)]


class Study:
    """The steps of the experiment; each adds to the record."""

    def __init__(self, folder: Path, smoke: bool):
        self.width, self.rounds = (96, 1) if smoke else (512, 5)
        self.resolution = 256 if smoke else RESOLUTION
        self.pairs = 2 if smoke else 30
        self.pictured: list[Pictured] = []
        self.record = StepwiseRecord(
            folder, "Effects that are skipped", {"smoke": smoke, "tolerance": TOLERANCE},
            bounds, document,
        )  # fmt: skip

    def steps(self) -> dict:
        """Names to what is done, in order."""
        steps = {s.name: (lambda s=s: self.subject(s)) for s in SUBJECTS}
        return steps | {"pictures": self.pictures, "free": self.free}

    def subject(self, subject: Subject) -> None:
        """One plan, carried out, and everything in its place."""
        scene = scene_of(subject)
        if scene is None:
            why = f"{subject.name}: {why_left_out(subject.scene)}"
            self.record.record.setdefault("left_out", []).append(why)
            return
        view = scene.view()
        view = view.resized(self.width, round(self.width * view.height / view.width))
        light = scene.light()
        plan = plan_effects(scene, view, lights=[light.name])
        decision, known = plan.decision(light.name), plan.numbers[0]
        eye = scene.eye(view)
        frame, rays = scene.light_frame(eye), scene.light_rays()
        hard = scene.shadow_rays(eye, frame, rays).trace().astype(float)
        soft = None if frame.area is None else scene.soft_rays(eye, frame, rays, 4, 4).estimate()
        truth = hard if soft is None else soft.visibility
        seen, part = seen_points(eye), part_of(scene, view, eye, light.name)

        def run(algorithm: ShadowAlgorithm):
            state = algorithm.build(eye, frame, rays)
            return seen.image(algorithm.visibility(state, seen.points))

        flat = UniformShadowMap(self.resolution)
        soft_ones = soft_methods(decision, self.resolution)
        (planned,) = soft_ones or [flat]
        everything = AccumulatedShadowMap(self.resolution, EVERYTHING)
        calls = {"planned": planned, "everything": everything}
        turns = in_turns({name: (lambda a=a: timed(lambda: run(a))) for name, a in calls.items()},
                         self.rounds)  # fmt: skip
        images = {name: np.asarray(found[-1][0]) for name, found in turns.items()}
        seconds = {name: [run[1] for run in found] for name, found in turns.items()}

        def off(image: np.ndarray) -> float:
            return float((part * np.abs(image - truth))[eye.valid].mean())

        if light.kind != "directional" or frame.area is not None:
            # Where edges are hard, by rays: of a map its own error would be seen as well.
            shown = images["planned"] if soft_ones else hard
            albedo, valid = eye.albedo.reshape(3, *eye.size), eye.valid.reshape(eye.size)
            cosine = light_paths(eye, frame).cosine.reshape(eye.size)
            pair = [shade(albedo, cosine, lit.reshape(eye.size), valid) for lit in (shown, truth)]
            apart = np.where(eye.valid, part * (shown - truth), np.nan)
            self.pictured.append(Pictured(
                f"{subject.name}: {decision.kind}",
                f"by {planned.name}" if soft_ones else "by a shadow ray to its centre",
                *pair, apart.reshape(eye.size), off(shown),
                "nothing is skipped: the error of the method" if soft_ones else SKIPPED,
            ))  # fmt: skip
        samples = 1 if frame.area is None else EVERYTHING**2
        stated = plan.rates.seconds(MAP_TEXELS, known.pixels, samples)
        self.record.record.setdefault("plans", []).append({
            "subject": subject.name,
            "light": light.name,
            "kind": decision.kind,
            "method": planned.name,
            "softened": bool(soft_ones),
            "reason": decision.reason,
            "widths_px": [decision.width_p50, decision.width_p95],
            "hard_edges_predicted": known.soft_error if frame.area is not None else 0.0,
            "hard_edges_measured": off(hard),
            "truth_error": None if soft is None else float(soft.error[eye.valid].mean()),
            "planned_error": off(images["planned"]),
            "everything_error": off(images["everything"]),
            "planned_seconds": median_of(seconds["planned"]).value,
            "planned_stated": decision.seconds,
            "everything_seconds": median_of(seconds["everything"]).value,
            "everything_stated": stated,
            "everything_ratio": ratio_of(seconds["everything"], seconds["planned"]).record(),
        })  # fmt: skip

    def pictures(self) -> None:
        """What the plans simulate beside everything."""
        if self.pictured:
            words = "what the plan simulates, everything, and their difference, for each scene"
            self.record.figure("pictures", draw(self.pictured), words)

    def free(self) -> None:
        """A run of a point light, with soft families and without, in turns."""
        options = RunOptions(scene="letter_f", size=(256, 256), memory_mb=4.0, repeats=1)

        def run(families: Mapping) -> float:
            before = dict(ALGORITHMS)
            ALGORITHMS.clear()
            ALGORITHMS.update(families)
            try:
                return timed(lambda: measure_scene(options) and None)[1]
            finally:
                ALGORITHMS.clear()
                ALGORITHMS.update(before)

        every = dict(ALGORITHMS)
        hard = {name: kind for name, kind in every.items() if name not in (*SOFT, *FILTERS)}
        turns = in_turns(
            {"with": lambda: run(every), "without": lambda: run(hard)}, self.pairs, warm_ups=2
        )
        with counted_traces() as traces:
            run(every)
        self.record.record["free"] = {
            "ratio": ratio_of(turns["with"], turns["without"]).record(),
            "seconds": median_of(turns["with"]).value,
            "traces": len(list(traces)),
        }


def bounds(record: Mapping) -> list[Bound]:
    """The requirements; smaller is better."""
    plans = record.get("plans", [])
    skipped = [one for one in plans if not one["softened"]]
    free = record.get("free")
    return [
        Bound(
            "not missed",
            "what skipped penumbrae would change, part of the light, largest",
            max((one["hard_edges_measured"] for one in skipped), default=None),
            TOLERANCE,
        ),
        Bound(
            "better than hard",
            "error of planned soft methods / of hard edges, largest",
            max(
                (one["planned_error"] / one["hard_edges_measured"]
                 for one in plans if one["softened"]),
                default=None,
            ),
            1.0,
        ),
        Bound(
            "stated cost",
            "extra time of everything, stated - measured, part of the lesser, largest",
            max(map(_apart, [one for one in plans if one["truth_error"] is not None]),
                default=None),
            1.0,
        ),
        Bound(
            "free",
            "time of a point light's run with soft families / without, off 1",
            None if free is None else abs(free["ratio"]["median"] - 1),
            0.02,
        ),
        Bound(
            "traces",
            "functions traced by such a run after the first",
            None if free is None else free["traces"],
            0.0,
        ),
    ]  # fmt: skip


def _extra(one: Mapping) -> tuple[float, float]:
    """Seconds that everything takes beyond the planned method: as stated, as measured."""
    return (
        one["everything_stated"] - one["planned_stated"],
        one["everything_seconds"] - one["planned_seconds"],
    )


def _apart(one: Mapping) -> float:
    """By how much of the lesser those two differ: 1 where one is twice the other."""
    stated, measured = _extra(one)
    return abs(stated - measured) / max(min(abs(stated), abs(measured)), 1e-9)


@styled
def draw(pictured: Sequence[Pictured]) -> Figure:
    """A row for each scene: what the plan simulates, everything, and the difference."""
    width = max(one.difference.shape[1] for one in pictured)
    heights = [one.difference.shape[0] for one in pictured]
    board = Board(
        2 * EDGE + 3 * width + 3 * GAP + _BAR + _BAR_LABELS,
        2 * EDGE + sum(HEAD + height + GAP for height in heights) + CAPTION,
    )
    norm, colours = Normalize(-WIDEST, WIDEST), matplotlib.colormaps["PuOr_r"]
    marks = WIDEST * np.linspace(-1, 1, 5)
    ticks = {part: f"{100 * part:+.0f} %" if part else "0" for part in marks}
    y = EDGE
    for one, height in zip(pictured, heights, strict=True):
        columns = (
            (one.title, one.method, one.planned),
            ("everything forced on", "64 shadow rays a pixel to all of the light", one.everything),
            (f"difference: {percent(one.off)}, mean", one.skipped, one.difference),
        )
        for column, (title, small, image) in enumerate(columns):
            x = EDGE + column * (width + GAP)
            board.heading(x, y, width, title, small)
            axes = board.image(
                x, y + HEAD, width, height, image, norm=norm, cmap=colours, interpolation="nearest"
            )
            axes.set_facecolor(BACKGROUND)
        x = EDGE + 3 * (width + GAP)
        board.scale_bar(colours, norm, x, y + HEAD, _BAR, height, ticks, "both")
        y += HEAD + height + GAP
    board.caption(
        "Differences are parts of the light. Orange: brighter by the plan than with everything; "
        f"violet: darker. The tolerance of what is skipped is {percent(TOLERANCE)}, mean."
    )
    return board.figure


def in_few_colours(drawn: Figure) -> Image.Image:
    """A figure in 256 colours: a page of pictures in a third of the bytes."""
    image = Image.open(io.BytesIO(png(drawn))).convert("RGB")
    return image.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)


def document(record: Mapping) -> str:
    """The record as Markdown."""
    lines = head_of(record)
    lines += ["", "## Plans, and what they leave out", ""]
    lines += [
        "Errors are parts of the light in per cent, mean over the picture, beside 64 rays a pixel.",
        "",
        "| scene | plan | penumbrae, px | hard edges: predicted, measured | planned: error; ms "
        f"stated, measured | {EVERYTHING} x {EVERYTHING} samples: error; ms stated, measured | "
        "extra ms: stated, measured |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in record.get("plans", []):
        p50, p95 = one["widths_px"]
        cells = [
            one["subject"],
            f"{one['kind']}, {one['method']}",
            f"{p50:.2g}, {p95:.2g}",
            f"{100 * one['hard_edges_predicted']:.3g}, {100 * one['hard_edges_measured']:.3g}",
            *(
                f"{100 * one[f'{what}_error']:.3g}; {1e3 * one[f'{what}_stated']:.3g}, "
                f"{1e3 * one[f'{what}_seconds']:.3g}"
                for what in ("planned", "everything")
            ),
            ", ".join(f"{1e3 * seconds:.3g}" for seconds in _extra(one)),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    for name, words in record.get("figures", {}).items():
        lines += ["", f"![{words}]({name}.png)"]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="tiny sizes, under a minute")
    parser.add_argument("--out", type=Path, default=Path("out/effects"))
    parser.add_argument("--only", nargs="+", metavar="STEP", help="these steps alone")
    parser.add_argument("--docs", action="store_true", help="write docs/images/skipped.png too")
    arguments = parser.parse_args()
    if arguments.docs and arguments.smoke:
        parser.error("--docs is for a whole run; leave out --smoke.")
    prepare_to_measure()
    study = Study(arguments.out, arguments.smoke)
    steps = study.steps()
    chosen = {name: steps[name] for name in arguments.only or steps}
    study.record.run(chosen)
    failed = exit_code(study.record.record)
    if arguments.docs and study.pictured and not failed:
        image = in_few_colours(draw(study.pictured))
        image.save(ROOT / "docs" / "images" / "skipped.png", optimize=True)
    print((arguments.out / "report.md").read_text(encoding="utf-8"))
    return failed


if __name__ == "__main__":
    sys.exit(main())
