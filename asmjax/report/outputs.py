"""Which files belong to which kind of run: a folder holds one run, and nothing of another."""

from pathlib import Path

SEEN = ("seen_*.png", "wrong_*.png")
"""The pictures of a run's view, named after its methods."""

SINGLE_RUN = (
    "methods.csv",
    "arrays.npz",
    "shadows.png",
    "errors.png",
    "maps.png",
    "tree.png",
    "levels.png",
    "accuracy_time.png",
    *SEEN,
)
"""What a run of one view writes, beside report.json."""

WALKTHROUGH = (
    "frames.csv",
    "frame_[0-9][0-9][0-9][0-9]*.npz",
    "walkthrough.png",
    "frames.png",
    "walkthrough.gif",
)
"""What a walkthrough writes, beside report.json."""

ANALYSIS = (
    "methods.csv",
    "arrays.npz",
    "aliasing.png",
    "light_angles.png",
    "displacement.png",
)
"""What `asmjax analyze` writes, beside report.json."""

COMPARISON = ("trials.csv", "costs_[0-9]*.png")
"""What `asmjax compare` writes, beside report.json and the measurements."""

TUNING = ("tuned.toml", "tried.csv", "tried.png", "surrogate.png", "sensitivity.png")
"""What `asmjax tune` writes, beside report.json and the measurements."""

PLAN = ("plan.png",)
"""What `asmjax plan` writes, beside report.json."""


PAGE = "report.html"
"""The page of a folder, by `asmjax report`."""


def remove(folder: Path, patterns: tuple[str, ...]) -> None:
    """Delete the files in `folder` of those names, and its page: of an earlier run, they would not
    belong to the report that is about to be written."""
    for pattern in (*patterns, PAGE):
        for path in folder.glob(pattern):
            path.unlink(missing_ok=True)
