"""Scenes as plain data: built-in, analytic with closed-form shadows, or your own."""

from asmjax.scene.builtin import BUILTIN, SceneItem, list_scenes, load_builtin
from asmjax.scene.spec import (
    Disk,
    Instances,
    LightSpec,
    Mesh,
    Rectangle,
    SceneSpec,
    Sphere,
    ViewSpec,
)

__all__ = [
    "BUILTIN",
    "Disk",
    "Instances",
    "LightSpec",
    "Mesh",
    "Rectangle",
    "SceneItem",
    "SceneSpec",
    "Sphere",
    "ViewSpec",
    "list_scenes",
    "load_builtin",
]
