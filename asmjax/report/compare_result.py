"""What a comparison gave, for notebooks, tables, figures and the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from asmjax.errors import require
from asmjax.experiment.comparison import Compared, cheapest
from asmjax.memory import Forecast
from asmjax.shadow import CostModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class SeenView:
    """A view on which all was tried.

    Attributes:
        size: (width, height) of its image, pixels.
        valid_pixels: that see a surface.
        edges: length of truth's shadow edges in pixels, by samples per pixel.
    """

    name: str
    size: tuple[int, int]
    valid_pixels: int
    edges: dict[int, float]


@dataclass(frozen=True, eq=False)
class ComparisonResult:
    """All that a comparison measured.

    Attributes:
        scene: name of the scene.
        variant: the Mitsuba variant that cast the rays.
        light: which light, its type, and how many faces its maps have.
        lit_by: which light, and its type.
        notices: what is simulated differently from what the scene says, and what was left out and
            why, one line each.
        samples: per pixel; each number is a comparison of its own.
        trials: the settings that were tried, on all views.
        yardsticks: traced rays by samples per pixel, 1 and 16 among them.
        memory_bytes: the limit about which settings range.
        cost_model: None without adaptive maps.
        ended: "complete", "time limit" or "interrupted".
        asked: how many trials were asked for.
        made, reused: measurements that were made, and taken from an earlier run.
        memory: what it was estimated to take; None where nobody asked.
    """

    scene: str
    variant: str
    light: str
    lit_by: str
    notices: Sequence[str]
    views: Sequence[SeenView]
    samples: Sequence[int]
    trials: Sequence[Compared]
    yardsticks: Sequence[Compared]
    memory_bytes: int
    cost_model: CostModel | None
    ended: str
    asked: int
    made: int
    reused: int
    memory: Forecast | None = None

    @property
    def title(self) -> str:
        """Scene, views, light and size, for figures."""
        names = [view.name for view in self.views]
        seen = names[0] if len(names) == 1 else f"{len(names)} views ({', '.join(names)})"
        sizes = dict.fromkeys(f"{width} x {height}" for width, height in self._sizes)
        return f"{self.scene}, {seen}, {self.lit_by}, {' and '.join(sizes)} pixels"

    @property
    def _sizes(self) -> list[tuple[int, int]]:
        return [view.size for view in self.views]

    def of(self, samples: int) -> list[Compared]:
        """The trials with so many samples per pixel.

        Raises:
            UseError: that number was not asked for.
        """
        require(
            samples in self.samples,
            f"{samples} samples per pixel were not tried; tried: "
            f"{', '.join(map(str, self.samples))}.",
        )
        return [item for item in self.trials if item.trial.samples == samples]

    def best(
        self,
        error: float | None = None,
        seconds: float | None = None,
        bytes: float | None = None,
        samples: int | None = None,
    ) -> Compared:
        """The shadow map that keeps to all limits in the least time, or, without a limit of its
        error, with the least error. Traced rays do not count: they stand in `yardsticks`.

        Args:
            error: wrong pixels per pixel of truth's shadow edge.
            samples: per pixel; the first of `samples` if None.

        Raises:
            UseError: none keeps to them; says what the best is.
        """
        chosen = self.samples[0] if samples is None else samples
        return cheapest(self.of(chosen), error, seconds, bytes)

    def table(self) -> str:
        """What is on the front, and what each family needs for a given error, as text."""
        from asmjax.report.compare_table import comparison_text

        return comparison_text(self)

    def plot(self, samples: int | None = None) -> "Figure":
        """Error against time and memory; `samples` as in `best`."""
        from asmjax.report.compare_files import draw_comparison

        return draw_comparison(self, self.samples[0] if samples is None else samples)

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(self.table())}</pre>"
