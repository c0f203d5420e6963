"""The child process that loads scenes first: what ends it ends nobody else.

`python -m asmjax.render.trial VARIANT` reads requests from standard input, one JSON object a line:
`path` of a scene file, `memory` in bytes of address space, `seconds` of processor time. It answers
each by a line on standard output: `refused` is null, or what is wrong in words; `bytes` of main
memory are what loading took at its peak. `room` of a request, or null, are the bytes of addresses
that it may take besides those of the process.
`asmjax.render.untrusted` is the other end.
"""

import json
import os
import re
import resource
import sys
from pathlib import Path

import numpy as np

from asmjax.errors import UseError, require
from asmjax.machine import address_bytes, forget_peak, peak_bytes, process_bytes
from asmjax.render.search_path import only_beside
from asmjax.render.untrusted import shipped_plugins
from asmjax.scene.file_names import Folder, shown
from asmjax.scene.spec import MAX_SIDE

CODE = 2**28
"""Bytes of addresses for the plugins that a scene loads, besides the memory that it may take."""

LONGEST_REASON = 300
"""Characters of what Mitsuba says that are passed on."""


def main(variant: str) -> int:
    """Answer requests until there are no more."""
    # Mitsuba and its plugins may print; the answers need a channel of their own.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        from asmjax.render.variant import activate

        mi = activate(variant)
        mi.set_log_level(mi.LogLevel.Error)
        started = None
    except (UseError, ImportError) as problem:
        mi, started = None, str(problem)
    print(json.dumps({"refused": started}), file=answers, flush=True)
    if mi is None:
        return 1
    for line in sys.stdin:
        request = json.loads(line)
        memory, room = request["memory"], request["room"]
        if room is not None:
            memory = min(memory, address_bytes() + CODE + room)
        _limit(memory, request["seconds"])
        forget_peak()
        before = process_bytes()
        try:
            load(mi, Path(request["path"]))
            refused = None
        except UseError as problem:
            refused = str(problem)
        took = max(0, peak_bytes() - before)
        print(json.dumps({"refused": refused, "bytes": took}), file=answers, flush=True)
    return 0


def _limit(memory: int, seconds: float) -> None:
    """Set the limits for one request; an orphan ends by the second."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    cores = os.cpu_count() or 1
    ends = int(used.ru_utime + used.ru_stime + seconds * cores) + 1
    for kind, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, ends)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (most if hard < 0 else min(most, hard), hard))


def load(mi, path: Path) -> None:
    """Load a scene as `asmjax.render.load` does, and look at what came of it.

    Raises:
        UseError: Mitsuba cannot load it, or what it made cannot be used.
    """
    config = mi.parser.ParserConfig(mi.variant())
    config.merge_meshes = config.merge_equivalent = False
    try:
        with only_beside(mi, path):
            # A copy of its own: properties that were looked at count as used ever after.
            _check_parsed(mi.parser.parse_file(config, str(path)), Folder(path.parent))
            state = mi.parser.parse_file(config, str(path))
            mi.parser.transform_all(config, state)
            scene = mi.parser.instantiate(config, state)
    except UseError:
        raise
    except MemoryError as problem:
        raise UseError(
            "needs too much memory to load; make it smaller, or raise `max_memory_mb`."
        ) from problem
    except Exception as problem:
        raise UseError(
            f"is not a scene that Mitsuba can load: {_reason(problem)}; mend the scene."
        ) from problem
    if not hasattr(scene, "shapes") or not scene.shapes():
        return  # which `load_scene` says better
    _check_faces(mi, scene)
    box = scene.bbox()
    low, high = np.array(box.min, np.float64).ravel(), np.array(box.max, np.float64).ravel()
    require(
        bool(np.isfinite([low, high]).all() and (low <= high).all()),
        "has no finite bounding box; mend its vertices and transforms.",
    )
    for sensor in scene.sensors():
        width, height = (int(side) for side in sensor.film().size())
        require(
            1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE,
            f"has a film of {width} x {height} pixels; allowed is 1 to {MAX_SIDE} on each side.",
        )


def _check_parsed(state, folder: Folder) -> None:
    """Mitsuba's reader found no other plugins and files than the scan may let through, were the two
    ever to read a text differently; nothing is loaded yet."""
    plugins = shipped_plugins() | {"scene"}
    for node in state.nodes:
        plugin = node.props.plugin_name()
        require(plugin in plugins, f"has the unknown plugin type {shown(plugin)}; mend the scene.")
        for name, value in node.props.items():
            require(
                not isinstance(value, str)
                or not folder.is_named_by(name, value)
                or folder.real_path(value) is not None,
                f"names the file {shown(str(value))}, which is outside its folder; mend the scene.",
            )
    for file in state.files:
        require(
            folder.real_path(str(file)) is not None,
            f"includes {shown(str(file))}, which is outside its folder; mend the scene.",
        )


def _reason(problem: Exception) -> str:
    """What Mitsuba says, on one line, without places in its own source."""
    text = re.sub(r"\[[\w.]+\.cpp:\d+\]", "", str(problem))
    words = text.split() or [type(problem).__name__]
    return " ".join(words)[:LONGEST_REASON].rstrip(" .;")


def _check_faces(mi, scene) -> None:
    """Every face of every mesh, those in shape groups too, has vertices that exist."""
    values = mi.traverse(scene)
    for name in values.keys():
        mesh, _, last = name.rpartition("faces")
        if last or (mesh and not mesh.endswith(".")):
            continue
        faces = np.array(values[name]).ravel()
        vertices = len(values[f"{mesh}vertex_positions"]) // 3
        require(
            len(faces) == 0 or int(faces.max()) < vertices,
            f"has a mesh with vertex {int(faces.max(initial=0))} of {vertices}; mend the mesh.",
        )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
