"""What do scenes of many million triangles cost: to build, in memory, and for each kind of ray?

The plant with 12 million triangles of its own, and statues of which 82 and 370 million stand but
1.6 million are kept, each in a process of its own: seconds to make and to load, most memory in use,
and milliseconds of an eye buffer, a flat shadow map and one shadow ray per pixel under the sun.

    python experiments/large_scenes.py [--smoke] [--scene NAME ...]
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

from asmjax.experiment.clock import repeated
from asmjax.render.load import load_scene
from asmjax.report.provenance import provenance
from asmjax.scene.builtin import load_builtin
from asmjax.shadow import UniformShadowMap

SCENES = ("plant:12m", "statues:82m", "statues:370m")
SMOKE = ("plant:20k", "statues:100k")
RESULTS = Path(__file__).parent / "results"

HEAD = (
    "scene", "triangles (kept), M", "make, load, s", "memory, GB", "view",
    "eye buffer, ms", "map, ms", "ray per pixel, ms",
)  # fmt: skip


def peak_bytes() -> int:
    """The most memory that this process ever had in use; Linux counts it in kilobytes."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def measured(name: str, size: int, resolution: int, repeats: int) -> dict:
    """All figures of one scene: medians of `repeats` runs after a warm-up, for its first two views.

    `make_s` is NumPy's making of the triangles, `load_s` their way into Mitsuba with the tree that
    rays are cast against, and the copy for the host.
    """
    scene = load_scene("letter_f")
    before = peak_bytes()
    start = time.perf_counter()
    spec = load_builtin(name)
    made = time.perf_counter()
    scene = load_scene(spec)
    loaded = time.perf_counter()
    del spec
    result = {
        "scene": name,
        "triangles": scene.geometry.triangles,
        "kept_triangles": int((scene.geometry.faces[0] >= 0).sum()),
        "make_s": made - start,
        "load_s": loaded - made,
        "before_bytes": before,
        "views": [],
        **provenance(scene.variant),
        "load_average": os.getloadavg()[0],
    }
    flat = UniformShadowMap(resolution)
    for name in list(scene.views)[:2]:
        view = scene.view(name).resized(size, size)
        eye, eye_s = repeated(lambda view=view: scene.eye(view), repeats)
        frame, rays = scene.light_frame(eye), scene.light_rays()
        build = (eye, frame, rays)
        state, map_s = repeated(lambda build=build: flat.build(*build), repeats)
        shadow = scene.shadow_rays(eye, frame, rays)
        lit, rays_s = repeated(shadow.trace, repeats)
        result["views"].append(
            {
                "view": name,
                "eye_ms": 1e3 * eye_s,
                "map_ms": 1e3 * map_s,
                "rays_ms": 1e3 * rays_s,
                "shadow_rays": shadow.count,
                "lit": float(lit[eye.valid].mean()),
            }
        )
        del state
    return result | {"peak_bytes": peak_bytes()}


def in_a_process(name: str, options: argparse.Namespace) -> dict:
    """`measured` in a process of its own, whose peak of memory is the scene's."""
    words = [sys.executable, __file__, "--child", name, *(["--smoke"] if options.smoke else [])]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{name}: {done.stderr.strip().splitlines()[-1:]}")
    return json.loads(done.stdout.splitlines()[-1])


def table(results: list[dict]) -> str:
    """The figures as Markdown, a row for each view."""
    lines = ["| " + " | ".join(HEAD) + " |", "| " + " | ".join(["---"] * len(HEAD)) + " |"]
    for found in results:
        scene = [
            f"`{found['scene']}`",
            f"{found['triangles'] / 1e6:.4g} ({found['kept_triangles'] / 1e6:.3g})",
            f"{found['make_s']:.1f}, {found['load_s']:.1f}",
            f"{found['peak_bytes'] / 1e9:.2f}",
        ]
        for view in found["views"]:
            row = [f"{view[key]:.3g}" for key in ("eye_ms", "map_ms", "rays_ms")]
            lines.append("| " + " | ".join([*scene, f"`{view['view']}`", *row]) + " |")
            scene = [""] * len(scene)
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="small scenes, a few seconds")
    parser.add_argument("--scene", action="append", help="scenes instead of the three")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        sizes = (64, 256, 2) if options.smoke else (512, 2048, 9)
        print(json.dumps(measured(options.child, *sizes)))
        return
    names = options.scene or (SMOKE if options.smoke else SCENES)
    results = [in_a_process(name, options) for name in names]
    machine = results[0]["machine"]
    print(f"{machine['cpu']}, {machine['cores']} cores, {machine['variant']}")
    print(f"memory before a scene: {results[0]['before_bytes'] / 1e9:.2f} GB\n")
    print(table(results))
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"large_scenes{'-smoke' if options.smoke else ''}.json"
    path.write_text(json.dumps(results, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
