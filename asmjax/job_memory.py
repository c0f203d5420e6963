"""What the jobs will have in memory, stage by stage, from the sizes that were asked for.

Bytes of a pixel are those of the arrays that are there; docs/memory.md tells how they agree with
what was measured, and tests/test_memory_peak.py holds them to a quarter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from asmjax.memory import MEGABYTE, Memory, Stage
from asmjax.shadow import ShadowAlgorithm

EYE = Memory(host=76, device=29)
"""Of a sample of the eye buffer, as long as it is there."""

CASTING = Memory(host=116, renderer=60)
"""Of a pixel while a sample of it is cast: directions, origins, hits, float64 temporaries."""

RAY = Memory(host=10, renderer=28)
"""Of a sample: its shadow ray, prepared, and whether it is lit."""

AIMING = Memory(host=190)
"""Of a pixel while the shadow ray of a sample is prepared."""

ANSWER = Memory(host=26, device=28)
"""Of a sample: a copy of its point where others see nothing, and while the answers of a map, or of
shadow rays, become those of its pixel."""

ASKING = Memory(host=20, device=100)
"""Of a pixel while a map is asked about a sample of it."""

MAPS = Memory(host=80, device=120)
"""Of a pixel: area ratios, m and benefit, and what they are made from."""

ALIASING = Memory(host=24, device=16)
"""Of a pixel: what is kept of each family's texels beside the eye's pixels."""

FIGURES = Memory(host=260)
"""Of a pixel: the images that are drawn, and drawing them."""

SOFT_AIMING = Memory(host=230, renderer=40)
"""Of a pixel while the soft truth of a sample is cast: points, normals and origins, a place on the
light and the way to it in float64, sums of two kinds, a ray."""

SOFT = Memory(host=17)
"""Of a sample: its visibility in soft truth, the standard error, and both on their way to the
pixel's."""

PROBING = 10 * MEGABYTE * Memory(host=1)
"""Of the plan of one light: pairs of receivers and blockers of a small image."""

PLANNING = 150 * MEGABYTE * Memory(host=1)
"""Of a plan: pairs of receivers and blockers, what six faces of a light meet, a figure."""

EVIDENCE = Memory(host=450, device=60)
"""Of a pixel: the nodes on every level that hold it, and how many share them."""

ONE_BY_ONE = Memory(host=200)
"""Of a ray of a scalar variant, whose rays are Python's numbers."""

BEGUN = MEGABYTE * Memory(host=40, device=70)
"""Whatever the sizes: small arrays, compiled programs."""


@dataclass(frozen=True)
class Sight:
    """An image that a job looks at.

    Attributes:
        width, height: pixels.
        samples: of each pixel.
        one_by_one: whether the renderer's variant is a scalar one.
    """

    width: int
    height: int
    samples: int = 1
    one_by_one: bool = False

    def of(self, pixel: Memory, sample: Memory | None = None) -> Memory:
        """So much for each pixel, and for each of its samples."""
        pixels = self.width * self.height
        return pixels * pixel + pixels * self.samples * (sample or Memory())

    @property
    def held(self) -> Memory:
        """Its eye buffers."""
        return self.of(Memory(), EYE)

    @property
    def ray(self) -> Memory:
        """Of a ray that is cast, besides its results."""
        return ONE_BY_ONE if self.one_by_one else Memory()

    @property
    def options(self) -> tuple[str, ...]:
        """Smaller ones make it smaller."""
        return ("size", "samples") if self.samples > 1 else ("size",)

    def __str__(self) -> str:
        each = f", {self.samples} samples each" if self.samples > 1 else ""
        return f"{self.width:,} x {self.height:,} pixels{each}"


def run_stages(
    sight: Sight, maps: Sequence[ShadowAlgorithm], faces: int, soft: bool = False
) -> list[Stage]:
    """Of `asmjax run`: all maps are kept for the figures, and truth may be `soft`."""
    held = BEGUN + sight.held
    kept = sum((item.memory(faces).state for item in maps), Memory())
    return [
        *_seen(sight, held),
        Stage("the plan", held + PROBING, sight.options),
        *(soft_stages(sight, held) if soft else []),
        *_built(sight, maps, faces, held, keeps=True),
        Stage("maps of the pixels", held + sight.of(MAPS), sight.options),
        Stage("figures", held + kept + sight.of(FIGURES), sight.options),
    ]


def analyze_stages(
    sight: Sight, maps: Sequence[ShadowAlgorithm], faces: int, soft: bool = False
) -> list[Stage]:
    """Of `asmjax analyze`: all maps are kept, and what is known of each one's texels; truth may be
    `soft`."""
    held = BEGUN + sight.held + sight.of(len(maps) * ALIASING)
    kept = sum((item.memory(faces).state for item in maps), Memory())
    return [
        *_seen(sight, BEGUN + sight.held),
        *(soft_stages(sight, BEGUN + sight.held) if soft else []),
        *_built(sight, maps, faces, held, keeps=True),
        Stage("texels beside pixels", held + kept + sight.of(MAPS), sight.options),
        Stage("figures", held + kept + sight.of(FIGURES), sight.options),
    ]


def walk_stages(sight: Sight, maps: Sequence[ShadowAlgorithm], faces: int) -> list[Stage]:
    """Of a walkthrough: the eye buffer and the shadow rays of a frame are there until those of the
    next one are, and each map while it is updated, as it was and as a copy."""
    before = BEGUN + sight.held + sight.of(Memory(), RAY)
    held = before + sight.held + sight.of(Memory(), RAY)
    kept = sum((2 * item.memory(faces).state for item in maps), Memory())
    return [
        *_seen(sight, before + sight.held),
        *_built(sight, maps, faces, held + kept, keeps=False),
        Stage("pictures of a frame", held + kept + sight.of(FIGURES), sight.options),
    ]


def trial_stages(
    sights: Sequence[Sight],
    maps: Sequence[ShadowAlgorithm],
    faces: int,
    evidence: bool = False,
    soft: bool = False,
) -> list[Stage]:
    """Of `asmjax compare` and `asmjax tune`: all views with their shadow rays are there throughout,
    of all maps one at a time; with `evidence`, what a view tells of its nodes. Truth may be
    `soft`."""
    held = sum((sight.held + sight.of(Memory(), RAY) for sight in sights), BEGUN)
    largest = max(sights, key=lambda sight: sight.held.bytes)
    stages = [
        *_seen(largest, held),
        *_built(largest, maps, faces, held, keeps=False),
        Stage("texels beside pixels", held + largest.of(MAPS), largest.options),
    ]
    if soft:
        stages += soft_stages(largest, held)
    if evidence:
        stages.append(Stage("evidence", held + largest.of(EVIDENCE), largest.options))
    return stages


def soft_stages(sight: Sight, held: Memory) -> list[Stage]:
    """Of soft truth, one sample of the pixels after the other."""
    return [
        Stage(
            f"soft truth for {sight}",
            held + sight.of(SOFT_AIMING + sight.ray, SOFT + ANSWER),
            sight.options,
        )
    ]


def held_besides(memory: Memory, stages: Sequence[Stage]) -> list[Stage]:
    """The stages of a job that holds `memory` throughout."""
    return [replace(stage, memory=stage.memory + memory) for stage in stages]


def plan_stages(sight: Sight) -> list[Stage]:
    """Of `asmjax plan`, which looks at a small image whatever the picture's size."""
    held = BEGUN + sight.held + PLANNING
    return [Stage("the probe of a plan", held + sight.of(CASTING + sight.ray, FIGURES))]


def _seen(sight: Sight, held: Memory) -> list[Stage]:
    """Casting the eye's image, and its shadow rays."""
    return [
        Stage(f"the eye's image of {sight}", held + sight.of(CASTING + sight.ray), sight.options),
        Stage(
            f"shadow rays for {sight}",
            held + sight.of(AIMING + sight.ray, RAY + ANSWER),
            sight.options,
        ),
    ]


def _built(
    sight: Sight, maps: Sequence[ShadowAlgorithm], faces: int, held: Memory, keeps: bool
) -> list[Stage]:
    """Building maps one after the other, and asking each about all samples."""
    stages = []
    for algorithm in maps:
        need = algorithm.memory(faces)
        # Depth and primitive of a texel that is cast are 8 bytes of the renderer's.
        cast = need.build.renderer / 8 * sight.ray
        stages += [
            Stage(
                f"building {algorithm.name}",
                held + need.build + cast + sight.of(need.pixel),
                ("memory_mb", *sight.options),
            ),
            Stage(
                f"asking {algorithm.name} about {sight}",
                held + need.state + sight.of(ASKING, ANSWER),
                sight.options,
            ),
        ]
        held = held + need.state if keeps else held
    return stages
