"""Estimates of memory: told before anything is made, refused above the limit, with the numbers."""

import mmap
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from helpers.analytic_cases import analytic_case

from asmjax import machine
from asmjax.errors import UseError
from asmjax.job_memory import (
    EYE,
    Sight,
    analyze_stages,
    run_stages,
    trial_stages,
    walk_stages,
)
from asmjax.memory import MEGABYTE, Limit, Memory, Stage, check, limit_of, peak_of
from asmjax.shadow import (
    MAPS,
    AdaptiveShadowMap,
    LightSpaceShadowMap,
    ShadowAlgorithm,
    UniformShadowMap,
)
from asmjax.shadow.uniform import ONE_LAUNCH

GB = 2**30


def test_parties_keep_what_they_had():
    """The host's largest stage and the device's are not the same, and both count."""
    stages = [Stage("a", Memory(5, 1, 0)), Stage("b", Memory(2, 7, 0)), Stage("c", Memory(0, 0, 3))]
    assert peak_of(stages) == Memory(5, 7, 3) and peak_of(stages).bytes == 15


def test_memory_adds_and_scales():
    assert Memory(1, 2, 3) + 2 * Memory(1, 0, 1) == Memory(3, 2, 5)
    assert (0.5 * Memory(host=3)).bytes == 1


def test_refusal_tells_all_numbers_and_what_to_do():
    stages = [
        Stage("the eye's image", Memory(host=3 * GB), ("size",)),
        Stage("building the map", Memory(device=2 * GB), ("memory_mb", "size")),
    ]
    with pytest.raises(UseError) as refused:
        check(stages, Limit(4 * GB, GB, "`max_memory_mb`"))
    said = str(refused.value)
    assert "\n" not in said
    for words in (
        "about 5,120 MB",
        "3,072 MB of host memory for the eye's image",
        "2,048 MB of device memory for building the map",
        "besides the 1,024 MB that the process holds",
        "allowed are 4,096 MB in all (`max_memory_mb`)",
        "lower `size` or `memory_mb`, or raise `max_memory_mb`.",
    ):
        assert words in said


@pytest.mark.parametrize(("limit", "fits"), [(6 * GB, True), (6 * GB - 1, False), (None, True)])
def test_limit_is_of_what_is_held_and_what_is_added(limit, fits):
    stages = [Stage("all", Memory(host=5 * GB))]
    if fits:
        forecast = check(stages, Limit(limit, GB, "test"))
        assert forecast.record() == {
            "estimate_bytes": 5 * GB, "held_bytes": GB, "limit_bytes": limit
        }  # fmt: skip
    else:
        with pytest.raises(UseError):
            check(stages, Limit(limit, GB, "test"))


def test_no_stages_is_wrong_use():
    with pytest.raises(UseError, match="name one at least"):
        check([], limit_of())


def test_limit_without_a_wish_is_a_share_of_what_is_free(monkeypatch):
    monkeypatch.setattr(machine, "process_bytes", lambda: GB)
    monkeypatch.setattr(machine, "free_memory_bytes", lambda: 10 * GB)
    assert limit_of().bytes == 9 * GB
    assert limit_of(512).bytes == 512 * MEGABYTE
    monkeypatch.setattr(machine, "free_memory_bytes", lambda: None)
    assert limit_of().bytes is None


def write(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


MEMINFO = {"proc/meminfo": "MemTotal: 9000 kB\nMemAvailable: 8000 kB\n"}


@pytest.mark.parametrize(
    ("files", "kilobytes"),
    [
        ({}, 8000),
        # A group of the second version, and the one around it, which leaves less.
        (
            {
                "proc/self/cgroup": "0::/job/step\n",
                "sys/fs/cgroup/job/step/memory.max": "max\n",
                "sys/fs/cgroup/job/step/memory.current": "1024\n",
                "sys/fs/cgroup/job/memory.max": f"{3000 << 10}\n",
                "sys/fs/cgroup/job/memory.current": f"{2000 << 10}\n",
                "sys/fs/cgroup/job/memory.stat": f"anon 5\ninactive_file {500 << 10}\n",
            },
            1500,
        ),
        # The first version, in a container that sees its own group as the root.
        (
            {
                "proc/self/cgroup": "5:cpu:/\n4:memory:/host/name\n",
                "sys/fs/cgroup/memory/memory.limit_in_bytes": f"{4000 << 10}\n",
                "sys/fs/cgroup/memory/memory.usage_in_bytes": f"{1000 << 10}\n",
            },
            3000,
        ),
        # More is taken than allowed.
        (
            {
                "proc/self/cgroup": "0::/\n",
                "sys/fs/cgroup/memory.max": "1000\n",
                "sys/fs/cgroup/memory.current": "2000\n",
            },
            0,
        ),
    ],
)
def test_free_memory_is_the_least_that_anyone_leaves(tmp_path, files, kilobytes):
    write(tmp_path, MEMINFO | files)
    assert machine.free_memory_bytes(tmp_path) == kilobytes << 10


def test_ulimit_counts_as_free_memory():
    code = (
        "import resource; from asmjax import machine\n"
        "resource.setrlimit(resource.RLIMIT_AS, (1 << 30, resource.RLIM_INFINITY))\n"
        "print(machine.free_memory_bytes())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert 0 < int(done.stdout) < 1 << 30


def test_the_process_knows_its_own_size():
    before = machine.process_bytes()
    # Not from the heap, which may have room that was freed before.
    with mmap.mmap(-1, 64 * MEGABYTE) as block:
        block.write(b"\1" * (64 * MEGABYTE))
        held = machine.process_bytes() - before
    assert 32 * MEGABYTE < held < 192 * MEGABYTE


@pytest.mark.parametrize("kind", list(MAPS.values()), ids=list(MAPS))
def test_a_larger_map_takes_more_and_keeps_less_than_its_making(kind: Any):
    adaptive = kind is AdaptiveShadowMap
    name, sizes = ("memory_bytes", (2**20, 2**28)) if adaptive else ("resolution", (512, 8192))
    settings: list[dict[str, Any]] = [{name: size} for size in sizes]
    small, large = (kind(**given).memory(1) for given in settings)
    for need in (small, large):
        assert 0 < need.state.bytes <= need.build.bytes
    assert small.state.bytes < large.state.bytes and small.build.bytes < large.build.bytes


def test_flat_map_keeps_what_its_arrays_take():
    for kind in (UniformShadowMap, LightSpaceShadowMap):
        assert kind(resolution=1024).memory(6).state.bytes == 6 * 2**20 * 4
        assert kind(resolution=1024, compare="both").memory(1).state.bytes == 2**20 * 6


def test_one_launch_is_the_renderers():
    caster = pytest.importorskip("asmjax.render.caster")
    assert ONE_LAUNCH == caster.LANES


def test_what_is_counted_of_an_eye_buffer_is_what_its_arrays_take():
    eye = analytic_case("a1_square", 64).eye
    host = (eye.world, eye.normal, eye.depth, eye.prim, eye.shape, eye.albedo)
    points = eye.points
    device = (points.position, points.normal, points.prim, points.valid)
    counted = 64**2 * EYE
    assert sum(array.nbytes for array in host) == counted.host
    assert sum(array.nbytes for array in device) == counted.device


STAGES = [
    lambda sight, maps: run_stages(sight, maps, 1),
    lambda sight, maps: analyze_stages(sight, maps, 1),
    lambda sight, maps: walk_stages(sight, maps, 1),
    lambda sight, maps: trial_stages([sight, sight], maps, 1, evidence=True),
]
TWO: list[ShadowAlgorithm] = [UniformShadowMap(resolution=1024), AdaptiveShadowMap()]
SIGHT = Sight(640, 480, samples=4)


@pytest.mark.parametrize("stages", STAGES, ids=["run", "analyze", "walk", "trials"])
@pytest.mark.parametrize(
    "more",
    [
        lambda sight, maps: (replace(sight, width=6400), maps),
        lambda sight, maps: (replace(sight, samples=16), maps),
        lambda sight, maps: (replace(sight, one_by_one=True), maps),
        lambda sight, maps: (sight, [*maps, UniformShadowMap(resolution=4096)]),
        lambda sight, maps: (sight, [maps[0], AdaptiveShadowMap(memory_bytes=2**30)]),
    ],
    ids=["size", "samples", "scalar", "maps", "limit"],
)
def test_a_job_that_asks_for_more_takes_more(stages, more):
    assert peak_of(stages(*more(SIGHT, TWO))).bytes > peak_of(stages(SIGHT, TWO)).bytes


def test_eye_buffers_of_all_samples_are_in_every_stage():
    for stage in run_stages(SIGHT, TWO, 1):
        assert stage.memory.bytes >= 640 * 480 * 4 * EYE.bytes
        assert "size" in stage.options and "samples" in stage.options


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("command", "words", "said"),
    [
        ("run", "--size 16384 16384", "16,384 x 16,384 pixels"),
        ("run", "--memory-mb 3000", "lower --memory-mb"),
        ("run", "--samples 500 --frames 3", "500 samples each"),
        ("analyze", "--size 8000 8000 --angles 0", "8,000 x 8,000 pixels"),
        ("compare", "--size 8000 8000", "8,000 x 8,000 pixels"),
        ("tune", "--size 8000 8000", "8,000 x 8,000 pixels"),
    ],
)
def test_what_cannot_fit_is_refused_before_it_is_made(
    command, words, said, capsys, tmp_path, monkeypatch
):
    """R14: one line with the numbers, exit code 2, nothing written, nothing large made."""
    from asmjax import cli

    monkeypatch.setattr("asmjax.cli.prepare_to_measure", lambda: None)
    before = machine.process_bytes()
    # Beside what earlier tests of this process left behind.
    allowed = str(before // MEGABYTE + 1900)
    asked = [command, "letter_f", *words.split(), "--max-memory", allowed]
    assert cli.main([*asked, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("asmjax: error: this would take about ") and told.count("\n") == 1
    assert said in told and "(--max-memory)" in told and "raise --max-memory" in told
    assert not (tmp_path / "out").exists()
    assert machine.process_bytes() - before < 200 * MEGABYTE
