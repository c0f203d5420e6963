"""Pictures of one view from arrays that are at hand, for the figures of notebooks and of runs."""

from collections.abc import Mapping, Sequence

import numpy as np
from jax.typing import ArrayLike

from asmjax.buffers import EyeBuffer, LightRays, TexelWindows
from asmjax.geometry import LightFrame
from asmjax.report.figures.pictures import RunPictures, TreePicture
from asmjax.report.measured import light_parts
from asmjax.shadow import AdaptiveShadowMap
from asmjax.shadow.adaptive import AdaptiveState


def view_pictures(
    title: str,
    eye: EyeBuffer,
    frame: LightFrame,
    truth: ArrayLike,
    visibilities: Mapping[str, ArrayLike] | None = None,
    *,
    maps: Mapping[str, np.ndarray] | None = None,
    methods: Sequence[Mapping] = (),
    log2_resolution: np.ndarray | None = None,
    tree: TreePicture | None = None,
) -> RunPictures:
    """What `asmjax.report.figures` draws from, of arrays (n,) with a value for each eye pixel.

    Args:
        title: scene and view, for headings.
        truth: visibility in truth, 1 lit to 0 shadowed.
        visibilities: of methods, by name; none without.
        maps, methods, log2_resolution, tree: as of `RunPictures`; left out, they are not drawn.

    Raises:
        UseError: an unknown map.
    """
    size = eye.size

    def images(arrays: Mapping[str, ArrayLike] | None) -> dict[str, np.ndarray]:
        return {name: np.asarray(values).reshape(size) for name, values in (arrays or {}).items()}

    direct, ambient = light_parts(eye, frame)
    return RunPictures(
        title=title,
        direct=direct,
        ambient=ambient,
        valid=eye.valid.reshape(size),
        truth=np.asarray(truth).reshape(size),
        visibilities=images(visibilities),
        methods=methods,
        maps=images(maps),
        log2_resolution=None if log2_resolution is None else log2_resolution.reshape(size),
        tree=tree,
    )


def tree_picture(
    algorithm: AdaptiveShadowMap, state: AdaptiveState, frame: LightFrame, rays: LightRays
) -> TreePicture:
    """The nodes of an adaptive map over what the light of `frame` sees."""
    nodes = algorithm.nodes(state)

    def cast(face: int, u: float, v: float, size: float, side: int) -> np.ndarray:
        corner, texel = np.array([[u], [v]]), np.full((2, 1), size / side)
        windows = TexelWindows(np.array([face]), corner, texel, side)
        return rays.light_buffer(frame, windows).depth[0]

    return TreePicture(
        level=nodes.level,
        face=nodes.face,
        lo=nodes.lo,
        size=nodes.size,
        node_resolution=algorithm.node_resolution,
        faces=frame.faces,
        cast=cast,
    )
