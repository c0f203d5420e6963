"""R14: estimates of memory against the peak that is measured, within a quarter for 16 jobs.

Rationale: an estimate that is too small lets a job be killed that should have been refused, one
that is too large refuses what would fit. Setup: a child process for each size, which runs a small
job of the same kind first, so that programs and compiled code do not count.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.effort import effort
from test_main_job import SENSOR
from test_soft_run import LAMP

from asmjax.shadow import UniformShadowMap, write_settings

TOLERANCE = 0.25

ROOM, F = {"scene": "paper_room"}, {"scene": "letter_f"}

SIZES: dict[str, tuple[str, dict]] = {
    "one map": (
        "analyze",
        F | {"size": (768, 768), "angles": 0, "memory_mb": 64, "methods": ("uniform",)},
    ),
    "letter_f": ("run", F | {"size": (512, 512)}),
    "512 x 512": ("run", ROOM | {"size": (512, 512)}),
    "1024 x 1024": ("run", ROOM | {"size": (1024, 1024)}),
    "2560 x 1440": ("run", {"scene": "terrain", "size": (2560, 1440), "memory_mb": 64}),
    "3072 x 3072": ("run", ROOM | {"size": (3072, 3072)}),
    "4 samples": ("run", ROOM | {"size": (1920, 1080), "samples": 4, "memory_mb": 4}),
    "16 samples": ("run", F | {"size": (1024, 1024), "samples": 16, "memory_mb": 4}),
    "128 MB": ("run", ROOM | {"size": (1024, 1024), "memory_mb": 128}),
    "256 MB": ("run", ROOM | {"size": (256, 256), "memory_mb": 256}),
    "flat 8192": ("run", ROOM | {"size": (256, 256), "memory_mb": 4, "settings": "flat.toml"}),
    "walk": ("walk", ROOM | {"size": (1024, 1024), "frames": 3}),
    "analyze": (
        "analyze",
        ROOM | {
            "size": (512, 512), "angles": 0, "memory_mb": 64,
            "methods": ("uniform", "light-space", "adaptive"),
        },
    ),
    "soft": ("run", {"scene": "lamp.xml", "size": (1024, 1024), "memory_mb": 4}),
    "soft, 4 samples": (
        "run", {"scene": "lamp.xml", "size": (1024, 1024), "samples": 4, "memory_mb": 4}
    ),
    "compare": ("compare", ROOM | {"size": (512, 512), "methods": ("uniform",), "samples": (1,)}),
}  # fmt: skip
"""Eye images, samples, limits, a flat map of its own resolution, soft truth, jobs; first the quick
one."""


@pytest.mark.mitsuba
@pytest.mark.parametrize("name", effort(quick=list(SIZES)[:1], hard=list(SIZES)))
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process's peak")
def test_estimate_is_within_a_quarter_of_the_peak(name, tmp_path):
    command, options = SIZES[name]
    write_settings(tmp_path / "flat.toml", UniformShadowMap(resolution=8192))
    lamp = LAMP.format(sensor=SENSOR)
    (tmp_path / "lamp.xml").write_text(lamp, encoding="utf-8")
    tests = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-m", "helpers.peak_memory", command, json.dumps(options)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tests)},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    ratio = told["estimate"] / told["measured"]
    in_mb = {what: round(count / 2**20) for what, count in told.items()}
    assert abs(ratio - 1) <= TOLERANCE, f"{name}: {in_mb} MB, {ratio:.2f} times"
