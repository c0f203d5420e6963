"""`asmjax scenes`: what can be named where SCENE is asked for."""

import json
import textwrap

from asmjax.options import ScenesOptions


def print_scenes(options: ScenesOptions) -> None:
    """Print name, summary, views and lights of every built-in scene."""
    from asmjax.scene import list_scenes

    scenes = [
        {
            "name": scene.name,
            "summary": scene.summary,
            "views": list(scene.views),
            "lights": list(scene.lights),
        }
        for scene in list_scenes()
    ]
    if options.json:
        print(json.dumps(scenes, indent=2))
        return
    for scene in scenes:
        print(scene["name"])
        print(textwrap.indent(textwrap.fill(scene["summary"], 90), "  "))
        print(f"  views   {', '.join(scene['views'])}")
        print(f"  lights  {', '.join(scene['lights'])}")
    print("A path of a Mitsuba scene file works wherever a scene is asked for.")
