"""What was compared: trials of one setting on all views taken together, and equal errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from asmjax.errors import require
from asmjax.experiment.clock import Median
from asmjax.experiment.trial import Trial
from asmjax.fronts import Reach, cost_of_error, front
from asmjax.shadow import ShadowAlgorithm, Status

COSTS = ("seconds", "bytes")
"""What accuracy is paid with."""

ROUND_ERRORS = (20, 10, 5, 2, 1, 0.5, 0.25, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Wrong pixels per pixel of edge, of which those are told that something measured lies about."""

MOST_ERRORS = 6
"""How many of them."""


@dataclass(frozen=True)
class Compared:
    """A setting, tried on all views.

    Attributes:
        label: what tells it from others of its family.
        trial: of all views together; see `pooled`.
        views: of each view.
        yardstick: seconds of one shadow ray for each sample, by all turns of all that is compared.
            Trials are minutes apart, while a shared machine is now slower and now quicker: what
            they have in common are the rays that each was measured beside.
        algorithm: that was tried; None for traced rays.
    """

    label: str
    trial: Trial
    views: Sequence[Trial]
    yardstick: float
    algorithm: ShadowAlgorithm | None = None

    @property
    def name(self) -> str:
        """Family and label."""
        return f"{self.trial.family} {self.label}"

    @property
    def seconds(self) -> Median:
        """From nothing, as on a machine that always traces rays as fast as it mostly did: its time
        in rays, turn by turn, x the yardstick. By this it is ranked and drawn."""
        return self.trial.ratio.scaled(self.yardstick)

    def cost(self, kind: str) -> float:
        """Median `seconds`, or bytes."""
        return self.seconds.value if kind == "seconds" else float(self.trial.bytes)


@dataclass(frozen=True)
class EqualError:
    """What one family needs for an error.

    Attributes:
        error_px: wrong pixels per pixel of truth's edge.
        family: of the registry.
        reach: seconds or bytes; None where no setting of it is that good.
        ratio: `reach` / the least of all families, which may be more if that least is a bound;
            None where the error is not reached, or `reach` is a bound and not the least.
    """

    error_px: float
    family: str
    reach: Reach | None
    ratio: float | None


def common_yardstick(trials: Sequence[Trial]) -> float:
    """Median seconds of the yardstick over all turns of all those trials."""
    return float(np.median([turn for trial in trials for turn in trial.yardstick]))


def pooled(trials: Sequence[Trial], edges: Sequence[float], pixels: Sequence[int]) -> Trial:
    """Several views taken for one large image.

    Fractions of pixels are means weighted by the views' valid pixels, errors per edge and mean
    distances by the length of their edges: both are those of all wrong pixels together. Of the
    other distances and of bytes it is the largest; seconds, rays and texels are means over views,
    turn by turn.

    Args:
        edges: length of each view's shadow edges, pixels.
        pixels: valid pixels of each view.
    """
    first = trials[0]
    if len(trials) == 1:
        return first
    by_edges, by_pixels = np.array(edges) / sum(edges), np.array(pixels) / sum(pixels)
    moved = [trial.error["boundary_displacement_px"] for trial in trials]
    shares = {
        name: float(by_pixels @ [trial.error[name] for trial in trials])
        for name in ("misclassified_fraction", "false_lit_fraction", "false_dark_fraction")
    }
    # Rounding must not part the whole from its two parts.
    shares["misclassified_fraction"] = shares["false_lit_fraction"] + shares["false_dark_fraction"]
    distances = {
        name: max(some[name] for some in moved)
        if name in ("p95", "hausdorff")
        else float(by_edges @ [some[name] for some in moved])
        for name in moved[0]
    }
    predictions = [trial.predicted_px for trial in trials if trial.predicted_px is not None]
    whole = len(predictions) == len(trials)
    nodes = [trial.nodes for trial in trials if trial.nodes is not None]
    return replace(
        first,
        view=f"{len(trials)} views",
        error=shares | {"boundary_displacement_px": distances},
        predicted_px=float(by_edges @ predictions) if whole else None,
        seconds={stage: _mean([t.seconds[stage] for t in trials]) for stage in first.seconds},
        yardstick=_mean([trial.yardstick for trial in trials]),
        bytes=max(trial.bytes for trial in trials),
        texels=round(np.mean([trial.texels for trial in trials])),
        rays=round(np.mean([trial.rays for trial in trials])),
        status=next((t.status for t in trials if Status[t.status.upper()].is_limit), first.status),
        nodes=max(nodes) if nodes else None,
    )


def _mean(runs: Sequence[Sequence[float]]) -> list[float]:
    return [float(turn) for turn in np.mean(runs, axis=0)]


def front_of(items: Sequence[Compared], kind: str) -> list[Compared]:
    """What nothing else beats in both error and that cost, by rising cost."""
    costs, errors = [item.cost(kind) for item in items], [item.trial.edge_px for item in items]
    return [items[i] for i in front(costs, errors)]


def equal_errors(
    items: Sequence[Compared], kind: str, wanted: Sequence[float]
) -> list[EqualError]:  # fmt: skip
    """What every family needs for each of those errors, along its own front."""
    found = []
    for error in wanted:
        reached = {
            family: cost_of_error(
                [item.cost(kind) for item in own], [item.trial.edge_px for item in own], error
            )
            for family, own in by_family(items).items()
        }
        least = min((reach.cost for reach in reached.values() if reach), default=0.0)
        for family, reach in reached.items():
            ratio = None
            if reach is not None and (not reach.bound or reach.cost == least):
                ratio = reach.cost / least
            found.append(EqualError(error, family, reach, ratio))
    return found


def by_family(items: Sequence[Compared]) -> dict[str, list[Compared]]:
    """The same by family, in the order of their first."""
    families: dict[str, list[Compared]] = {}
    for item in items:
        families.setdefault(item.trial.family, []).append(item)
    return families


def telling_errors(items: Sequence[Compared]) -> list[float]:
    """Round errors that some family passes through, at most `MOST_ERRORS`, falling; on its way to
    no error at all a family passes through none."""
    spans = [
        (max(errors), min(errors))
        for own in by_family(items).values()
        for errors in [[item.trial.edge_px for item in own if item.trial.edge_px > 0]]
        if errors
    ]
    found = [e for e in ROUND_ERRORS if any(low <= e <= high for high, low in spans)]
    if len(found) <= MOST_ERRORS:
        return found
    chosen = np.linspace(0, len(found) - 1, MOST_ERRORS).round().astype(int)
    return [found[i] for i in chosen]


def cheapest(
    items: Sequence[Compared],
    error: float | None = None,
    seconds: float | None = None,
    bytes: float | None = None,
) -> Compared:
    """Within all limits, the one that takes the least time, or without a limit of its error the
    one that errs least.

    Args:
        error: wrong pixels per pixel of edge.

    Raises:
        UseError: none keeps to them; says what the best is by each of them.
    """
    require(len(items) > 0, "nothing was tried; give more `minutes`, or other `methods`.")
    limits = [
        _Limit("error", error, lambda item: item.trial.edge_px, "{:.3g} px"),
        _Limit("time", seconds, lambda item: item.cost("seconds"), "{:.3g} s"),
        _Limit("memory", bytes, lambda item: item.cost("bytes"), "{:.0f} bytes"),
    ]
    asked = [limit for limit in limits if limit.most is not None]
    within = [item for item in items if all(limit.holds(item) for limit in asked)]
    require(
        len(within) > 0,
        f"nothing that was tried keeps to the limits: {_least(items, asked)}; allow more.",
    )
    if error is None:
        return min(within, key=lambda item: (item.trial.edge_px, item.cost("seconds")))
    return min(within, key=lambda item: (item.cost("seconds"), item.trial.edge_px))


class _Limit(NamedTuple):
    """A limit, what of a trial it is on, and how that is written."""

    name: str
    most: float | None
    of: Callable[[Compared], float]
    unit: str

    def holds(self, item: Compared) -> bool:
        return self.most is not None and self.of(item) <= self.most


def _least(items: Sequence[Compared], asked: Sequence[_Limit]) -> str:
    """What could be had of each, given the others."""
    told = []
    for limit in asked:
        others = [other for other in asked if other is not limit]
        able = [item for item in items if all(other.holds(item) for other in others)]
        if able:
            best = min(able, key=limit.of)
            where = "within the others " if others else ""
            least, most = limit.unit.format(limit.of(best)), limit.unit.format(limit.most)
            told.append(f"{where}the least {limit.name} was {least} ({best.name}), asked {most}")
    return "; ".join(told) or "no two of them can be kept together"
