"""R7: the same scene, settings and seed give bit-equal maps, trees and errors in two processes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.digests import RENDERED
from helpers.registry import SIBLINGS, VARIANTS

CONFIGURATIONS = 27
"""R7 asks for 20."""


def renderer() -> bool:
    from asmjax.errors import UseError
    from asmjax.render.variant import activate

    try:
        activate()
    except UseError:
        return False
    return True


@pytest.mark.timeout(600)
def test_two_processes_make_the_same_maps():
    """27 of 27: every algorithm and variant, two of them cast by Mitsuba where it starts. The
    processes have other hash seeds, and the second one finds compiled what the first one compiled;
    builds with a limit of time are exempt."""
    with_mitsuba = renderer()
    tests = str(Path(__file__).parent)
    outputs = []
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-m", "helpers.digests", *(["--rendered"] if with_mitsuba else [])],
            env=os.environ | {
                "PYTHONPATH": os.pathsep.join(filter(None, [tests, os.environ.get("PYTHONPATH")])),
                "PYTHONHASHSEED": seed,
            },
            capture_output=True,
            text=True,
            timeout=280,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout.splitlines())
    one, other = outputs
    assert len(one) == CONFIGURATIONS - (0 if with_mitsuba else RENDERED)
    assert one == other
    assert len({line.split()[-1] for line in one}) == len(one), "digests tell states apart"
    named = {line.split()[0] for line in one}
    assert named == {sibling.name for sibling in (*SIBLINGS, *VARIANTS)}
