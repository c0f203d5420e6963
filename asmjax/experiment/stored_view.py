"""A view with its adaptive map as plain arrays: kernels run from a file, on any device."""

import dataclasses
import json
import zipfile
import zlib
from pathlib import Path
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from asmjax.buffers import EyeBuffer, SurfacePoints
from asmjax.errors import UseError
from asmjax.geometry import Camera, LightFrame
from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.adaptive import AdaptiveState
from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.tree import Tree

_PARTS: dict[str, Any] = {
    "points": SurfacePoints,
    "camera": Camera,
    "frame": LightFrame,
    "tree": Tree,
}

_ON_DEVICE = ("points", "tree")

_OPTIONAL = (("tree", "depth"), ("tree", "prim"), ("frame", "area"))
"""What may be None; the area of a light is left out, as an adaptive map's answers do not ask it."""

Device = Any
"""A `jax.Device`, which type checkers take for a variable."""


class StoredView(eqx.Module):
    """What the kernels of one view read; no renderer and no tables of the host.

    Attributes:
        points: what the eye sees.
        tree: the pages of the adaptive map.
        bias: of the shadow test.
    """

    points: SurfacePoints
    camera: Camera
    frame: LightFrame
    tree: Tree
    shape: TreeShape = eqx.field(static=True)
    bias: float = eqx.field(static=True)


def stored_view(algorithm: AdaptiveShadowMap, state: AdaptiveState, eye: EyeBuffer) -> StoredView:
    """The arrays by which `algorithm` answers for the pixels of `eye`; good until `update` takes
    `state` over."""
    state.check_owned()
    return StoredView(eye.points, eye.camera, state.frame, state.tree, state.shape, algorithm.bias)


def save_view(path: Path, view: StoredView) -> None:
    """Write a view as .npz; arrays are named by part and attribute, as "points.position"."""
    arrays = {
        f"{part}.{name}": np.asarray(value)
        for part, kind in _PARTS.items()
        for name in _attributes(kind)
        if (value := getattr(getattr(view, part), name)) is not None and name != "area"
    }
    settings = json.dumps({"shape": dataclasses.asdict(view.shape), "bias": view.bias})
    arrays["settings"] = np.array(settings)
    with path.open("wb") as file:
        np.savez_compressed(file, **cast(dict[str, Any], arrays))


def load_view(path: Path) -> StoredView:
    """The view in a file of `save_view`.

    Raises:
        UseError: the file cannot be read, or does not hold a view.
    """
    try:
        # NumPy leaves a file open that is no archive.
        with path.open("rb") as file, np.load(file) as archive:
            arrays = dict(archive)
        settings = json.loads(arrays["settings"].item())
        parts = {part: _part(part, kind, arrays) for part, kind in _PARTS.items()}
        return StoredView(**parts, shape=TreeShape(**settings["shape"]), bias=settings["bias"])
    except (
        OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error,
    ) as problem:  # fmt: skip
        raise UseError(
            f"'{path}' holds no stored view ({problem}); write one with `save_view`."
        ) from problem


def _part(part: str, kind: Any, arrays: dict[str, np.ndarray]):
    values: dict[str, Any] = {}
    for name in _attributes(kind):
        value = arrays.get(f"{part}.{name}")
        if value is None and (part, name) not in _OPTIONAL:
            raise KeyError(f"no array {part}.{name}")
        if value is not None and value.ndim == 0:
            values[name] = value.item()
        elif part in _ON_DEVICE and value is not None and name != "origin":
            values[name] = jnp.asarray(value)
        else:
            values[name] = value
    return kind(**values)


def _attributes(kind: Any) -> list[str]:
    """Names of what a dataclass or a named tuple holds."""
    if dataclasses.is_dataclass(kind):
        return [field.name for field in dataclasses.fields(kind)]
    return list(kind._fields)


def on_device(view: StoredView, device: Device) -> StoredView:
    """The view with its points and pages in the memory of `device`; the rest stays on the host."""
    origin = view.points.origin
    points = jax.device_put(eqx.tree_at(lambda p: p.origin, view.points, None), device)
    points = eqx.tree_at(lambda p: p.origin, points, origin, is_leaf=lambda x: x is None)
    return eqx.tree_at(
        lambda v: (v.points, v.tree), view, (points, jax.device_put(view.tree, device))
    )
