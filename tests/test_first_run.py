"""Soft and filtered maps are free where a plan skips them, from the first run of a process on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest


def first_run(arm: str) -> dict:
    """What the first run of a process casts, traces and calls (`helpers.first_run`)."""
    done = subprocess.run(
        [sys.executable, "-m", "helpers.first_run", arm],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.mitsuba
@pytest.mark.slow
def test_a_point_light_pays_nothing_for_softness():
    """Rays and traces with the soft and filtered families, and without any of them registered, each
    in a process of its own, where nothing is compiled before. No line of theirs is reached."""
    with_them, without = first_run("registered"), first_run("removed")
    for key in ("rays", "traces", "names"):
        assert with_them[key] == without[key], key
    assert with_them["reached"] == [] and len(with_them["traces"]) > 10
    names = [name.split("-")[0] for name in with_them["names"]]
    assert names == ["uniform", "adaptive", "rays"]
    # All that planning costs is what the plan says: its small image, and rays from the light.
    planning = {
        name: count - without["unplanned"].get(name, 0) for name, count in without["rays"].items()
    }
    assert sum(planning.values()) == without["probe_rays"] > 0
    assert planning["light_buffer"] == 0
