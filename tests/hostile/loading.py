"""Scenes that were let through, loaded as a job loads them, in a process that may end by it."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

CODE = """
import json, sys
import numpy as np
from asmjax.errors import UseError
from asmjax.render.load import load_scene
for path in json.load(sys.stdin):
    try:
        scene = load_scene(path, "scalar_rgb")
        assert np.isfinite(scene.geometry.bounds).all() and scene.geometry.first_prim[-1] > 0
        end = "loaded"
    except UseError as problem:
        end = str(problem)
    # Mitsuba prints warnings of its own.
    print("\\nEND", json.dumps(end), flush=True)
"""


def loaded_apart(scenes: Sequence[Path]) -> list[str]:
    """How each of them ends in `load_scene`: "loaded", or with what it is refused."""
    given = json.dumps([str(path) for path in scenes])
    end = subprocess.run([sys.executable, "-c", CODE], input=given, capture_output=True, text=True)
    told = [
        json.loads(line.removeprefix("END "))
        for line in end.stdout.splitlines()
        if line.startswith("END ")
    ]
    assert end.returncode == 0 and len(told) == len(scenes), (end.returncode, told, end.stderr)
    return told
