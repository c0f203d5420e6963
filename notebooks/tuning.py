# %% [markdown]
# # What accuracy costs, and settings for a price
# Shadow algorithms over their settings, on the same pixels and beside the same truth: error
# against time. Then the settings of the adaptive map that suit what time is worth, found with
# gradients and chosen by measurement. `asmjax compare` and `asmjax tune` do the same and write
# reports; `docs/accuracy_and_time.md` explains metrics, goal and search.

# %%
import os

import numpy as np

import asmjax
from asmjax.report.figures.board import CAPTION, EDGE, HEAD, Board
from asmjax.report.figures.fronts import log_ticks
from asmjax.report.figures.labels import Label, write_labels
from asmjax.report.figures.style import FALSE_LIT, INK, KIND_COLOURS, styled

SMOKE = "ASMJAX_SMOKE" in os.environ
SCENE, VIEW = ("letter_f", "angle") if SMOKE else ("paper_room", "overview")
SIZE = (48, 48) if SMOKE else (512, 512)
MEMORY_MB = 1.0 if SMOKE else 16.0
METHODS = ("uniform", "adaptive") if SMOKE else ("uniform", "light-space", "subdivided", "adaptive")

# %% [markdown]
# ## What accuracy costs
# Memory from 1/16 to 4 times `memory_mb`, and settings of each family. Every map is built from
# nothing, in turns with the yardstick: traced shadow rays, which need no memory and are exact.

# %%
comparison = asmjax.compare(
    SCENE, view=VIEW, size=SIZE, methods=METHODS, memory_mb=MEMORY_MB, samples=(1,)
)
print(comparison.table())

# %% [markdown]
# Left of the first dashed line a map is quicker than one ray from each pixel, left of the second
# than sixteen, which is what a picture without jagged edges takes.

# %%
comparison.plot()

# %% [markdown]
# The cheapest map within a limit, in wrong pixels per pixel of shadow edge. What nothing keeps to
# is refused, with what could be had.

# %%
for error in (0.5, 0.1, 0.02):
    try:
        found = comparison.best(error=error)
    except asmjax.UseError as problem:
        print(f"{error} px: refused, {problem}")
        continue
    print(
        f"{error} px: {found.name}, {1e3 * found.seconds.value:.3g} ms, "
        f"{found.trial.ratio.value:.3g} times one ray a pixel"
    )

try:
    comparison.best(error=0.1, seconds=1e-9)
except asmjax.UseError as problem:
    print(f"0.1 px within a nanosecond: refused, {problem}")

# %% [markdown]
# ## Tuning for a price
# A second is worth `price` pixels of edge: what is minimised is error + price x seconds. A
# surrogate, which is fitted to real maps, proposes; the real map is measured; two views that were
# not tuned on choose. Its rivals stand beside it: the default, the best of a grid of 32, and the
# best of a random search with as many measurements.

# %%
PRICE = 10.0
tuning = asmjax.tune(
    SCENE,
    view=VIEW,
    size=SIZE,
    memory_mb=MEMORY_MB,
    price=PRICE,
    evaluations=60 if SMOKE else 70,
    repeats=2 if SMOKE else 5,
)
print(tuning.table())

# %%
tuning.plot("tried")

# %% [markdown]
# Why to believe what proposed it: the surrogate beside what was measured, also of settings that
# it never saw.

# %%
tuning.plot("surrogate")

# %% [markdown]
# ## How the best settings move with the price
# By implicit differentiation of the surrogate at its optimum, without another search: what is
# steep is worth setting, what is flat may stay as it is.

# %%
tuning.plot("sensitivity")

# %%
bend = tuning.found.sensitivity
print(f"at {bend.price:g} px/s, when a second becomes twice as dear:")
print(f"  error x {2**bend.log_edge:.2f}, time x {2**bend.log_seconds:.2f}")
for name, slope in sorted(bend.log_settings.items(), key=lambda item: -abs(item[1]))[:3]:
    print(f"  {name} x {2**slope:.2f}")
if not bend.settled:
    print("the optimum is not at rest: read these with care")

# %% [markdown]
# ## The front by continuation
# From one price to the next the optimum is predicted by its derivative and corrected by searches.
# That may miss a better valley, so each price is also searched anew as tuning does, of which the
# curve knows the middle alone. Where that is better, the point is its.

# %%
MISS = 1e-3
"""Part of the objective by which searching anew must be better to count."""


@styled
def draw_front(points):
    """The front, and by how much its objectives are above those of searching anew."""
    width, height, left, below = 640, 440, 110, 70
    board = Board(2 * EDGE + 2 * (left + width), 2 * EDGE + HEAD + height + below + 2 * CAPTION)
    colours = [FALSE_LIT if point.gap > MISS else KIND_COLOURS["adaptive"] for point in points]
    x, y = EDGE + left, EDGE + HEAD
    board.heading(x, EDGE, width, "The front", "by the surrogate, the best known for each price")
    axes = board.axes(x, y, width, height)
    places = np.array([(1e3 * point.seconds, point.edge_px) for point in points])
    axes.set(xscale="log", yscale="log", xlabel="time, milliseconds")
    axes.set_ylabel("wrong pixels per pixel of shadow edge")
    (least, low), (most, high) = places.min(axis=0), places.max(axis=0)
    axes.set(xlim=(least / 1.3, most * 1.5), ylim=(low / 1.5, high * 1.6))
    axes.plot(*places.T, color=KIND_COLOURS["adaptive"], linewidth=1.4)
    axes.scatter(*places.T, color=colours, s=36, zorder=3)
    log_ticks(axes, low, False)
    axes.grid(which="major", color="#ECECEC", linewidth=0.6)
    labels = [
        Label(*place, f"{point.price:g} px/s", INK)
        for place, point in zip(places, points, strict=True)
    ]
    write_labels(axes, labels, places, [places])

    x += left + width
    board.heading(
        x, EDGE, width, "Continuation against searching anew",
        "its objective above the other's; below 0 continuation is better",
    )  # fmt: skip
    axes = board.axes(x, y, width, height)
    gaps = np.array([100 * point.gap for point in points])
    axes.bar(range(len(gaps)), gaps, 0.6, color=colours)
    axes.axhline(0, color="#444444", linewidth=0.8)
    for k, gap in enumerate(gaps):
        side = 1 if gap > 0 else -1
        axes.annotate(
            f"{round(gap, 2) + 0.0:+.2f} %", (k, gap), xytext=(0, 3 * side), fontsize=8,
            textcoords="offset points", ha="center", va="bottom" if gap > 0 else "top",
        )  # fmt: skip
    axes.set_xticks(range(len(gaps)), [f"{point.price:g}" for point in points])
    low, high = min(gaps.min(), -0.1), max(gaps.max(), 0.1)
    pad = 0.12 * (high - low)
    axes.set(xlabel="price, px/s", ylabel="gap, %", ylim=(low - pad, high + pad))
    board.caption(tuning.title, line=1)
    board.caption(f"Orange: searching anew was better by more than {MISS:.1%}; the point is its.")
    return board.figure


front = tuning.found.front
draw_front(front)

# %%
kept = sum(point.gap <= MISS for point in front)
worst = max(front, key=lambda point: point.gap)
print(f"at {kept} of {len(front)} prices continuation is as good as searching anew, or better;")
print(f"its worst objective is {100 * worst.gap:+.2g} % from the other's, at {worst.price:g} px/s")

# %% [markdown]
# ## To use it
# The tuned map is an algorithm like any other, and its settings a file for `--settings`.

# %%
print(tuning.outcome.value)
print(asmjax.settings_text(tuning.algorithm))
