"""What the analysis computes and measures, how finely, and the record that it goes to."""

from dataclasses import dataclass
from pathlib import Path

from asmjax.report.stepwise import StepwiseRecord
from tr05.paper import PAPER, bounds_of, document


@dataclass(frozen=True)
class Sizes:
    """What is computed and measured, and how finely.

    Attributes:
        alley: the plant of figures 1, 9 and 10.
        sides: texels a side of the small and of the large maps of figures 1, 9 and 10.
        memory_mb: of each map that is compared at equal bytes.
        resolutions: of the maps whose displacement is predicted.
        chunk: triangles of an object where a scene has few shapes.
    """

    depths: int = 1001
    check_alphas: tuple[float, ...] = (1.001, 1.5, 10.0, 100.0, 1e3, 1e4, 1e6)
    check_xis: tuple[float, ...] = (-1.0, -0.7, -0.3, 0.0, 0.2, 0.6, 1.0)
    check_parts: tuple[int, ...] = (1, 2, 3, 5, 9)
    figure_alpha: float = 10.0
    figure_alphas: tuple[float, ...] = (10.0, 100.0, 1e3, 1e6)
    most_parts: int = 10
    direction_alpha: float = 1000.0
    directions: int = 361
    pixels: int = 512
    repeats: int = 5
    alley: str = "plant:1m"
    sides: tuple[int, int] = (1024, 4096)
    memory_mb: float = 16.0
    compared: tuple[str, ...] = ("shadow_columns", "munich", "terrain")
    resolutions: tuple[int, ...] = (256, 512, 1024, 2048, 4096)
    overdrawn: tuple[str, ...] = ("munich", "victorian_house")
    chunk: int = 1000


QUICK = Sizes(
    depths=101, check_alphas=(1.5, 1e3), check_xis=(-1.0, 0.0, 0.6), check_parts=(1, 3),
    figure_alphas=(10.0, 1e3), most_parts=4, directions=31,
    pixels=48, repeats=1, alley="plant:10k", sides=(32, 128), memory_mb=0.082,
    compared=("plant:10k",), resolutions=(32,), overdrawn=("plant:10k",),
    chunk=100,
)  # fmt: skip


class Analysis:
    """What is done, and the record that it goes to."""

    def __init__(self, folder: Path, sizes: Sizes, quiet: bool = False):
        title = "Subdivided Shadow Maps (TR05-024): computed and measured again"
        self.kept = StepwiseRecord(folder, title, vars(sizes), bounds_of, document, quiet)
        self.sizes, self.record = sizes, self.kept.record
        self.record |= {"paper": PAPER, "skipped": {}}
