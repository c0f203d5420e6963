"""What is planned for: a view of a scene and its lights, whoever casts the rays."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from asmjax.buffers import EyeBuffer, LightRays
from asmjax.geometry import AreaLight, LightFrame
from asmjax.scene.materials import Materials, Surroundings
from asmjax.scene.spec import LightSpec, ViewSpec


@dataclass(frozen=True, eq=False)
class LightAsked:
    """A light that is planned for.

    Attributes:
        spec: what it is.
        frame: for what the probe sees; None where it shines on nothing there.
        rays: makes what casts its rays, when they are needed.
        why: there is no frame.
        stand_in: of a lamp that is represented by a point, a light of about its size; None of all
            others.
        spread: of its radiance over it, standard deviation in parts of the mean; None where nobody
            knows how bright it is, and 1 is taken.
    """

    spec: LightSpec
    frame: LightFrame | None
    rays: Callable[[], LightRays]
    why: str = ""
    stand_in: AreaLight | None = None
    spread: float | None = 0.0


@dataclass(frozen=True, eq=False)
class SceneAsked:
    """A view of a scene that is planned for.

    Attributes:
        name: of the scene.
        view: at the size of the picture.
        eye: the probe's image of it (`probe_size`).
        lights: all of the scene's, as each is a part of their light.
        rays: against everything, for the surroundings.
        first_prim: (n_shapes + 1,) first primitive of each shape, and their number.
        materials: of the shapes.
        surroundings: emitters all around.
        unknown: names of emitters that are left out of the scene.
        lone_convex: whether one convex object is all there is.
        moving: whether anything moves between frames.
        chosen: names of the lights that are decided about; all without.
    """

    name: str
    view: ViewSpec
    eye: EyeBuffer
    lights: Sequence[LightAsked]
    rays: LightRays
    first_prim: np.ndarray
    materials: Materials
    surroundings: Sequence[Surroundings] = ()
    unknown: Sequence[str] = ()
    lone_convex: bool = False
    moving: bool = False
    chosen: Collection[str] = ()
