"""The protocol that all shadow algorithms share."""

import abc
import enum
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from asmjax.buffers import EyeBuffer, LightRays, SurfacePoints
from asmjax.geometry import LightFrame
from asmjax.memory import Memory
from asmjax.shadow.neighbourhood import Neighbourhood

State = TypeVar("State")


class Status(enum.Enum):
    """How a build or update ended. Limits say what to change.

    `COMPLETE`: a look at every pixel found no edge that by the settings could gain, as far as the
    texels can tell. `FOLLOWED`: a moving view, of which an update looks at a part.
    """

    COMPLETE = "complete"
    FOLLOWED = "followed with part of the pixels: update again, or once more when the view rests"
    MEMORY_LIMIT = (
        "the memory limit ended refinement: raise `memory_bytes`, or accept coarser shadows"
    )
    TIME_LIMIT = "the time limit ended refinement: raise `time_limit`, or call update again"
    NODE_CAPACITY = (
        "the node table is full before the memory is: use larger nodes (`node_resolution`)"
    )
    PASS_LIMIT = (
        "refinement did not settle within its passes: raise max_passes of AdaptiveShadowMap"
    )

    MARGIN_LIMIT = (
        "rays to the light leave the map, and casters beyond it are taken for those at its border: "
        "trust wide penumbrae less, or accumulate hard shadows from samples of the light"
    )
    UNSETTLED = (
        "the search for the charts did not come to rest: they are the best so far; fewer "
        "partitions settle sooner"
    )
    FALLBACK = (
        "the charts that the settings ask for cannot be had for this view, and plainer ones stand "
        "in: those in closed form, or one for each face of a lamp"
    )

    @property
    def is_limit(self) -> bool:
        """Whether a limit ended refinement, or answers are less than they could be."""
        return self not in (Status.COMPLETE, Status.FOLLOWED)


@dataclass(frozen=True)
class NodeCounts:
    """What the last build or update did to the nodes of an adaptive map.

    Attributes:
        held: nodes with texels after it.
        made: nodes cast.
        evicted: nodes given up for others.
        recast: nodes cast again because light or casters moved.
        dropped: nodes given up because light or casters moved.
        reused: nodes that answered and were there before.
    """

    held: int
    made: int = 0
    evicted: int = 0
    recast: int = 0
    dropped: int = 0
    reused: int = 0


@dataclass(frozen=True)
class Cost:
    """What a state holds in memory, and what the `build` or `update` that returned it cost: that
    one alone, of every algorithm. A map that was kept as it was cast no rays, in no passes.

    Attributes:
        texels: texels stored.
        bytes: bytes of all arrays of the state.
        rays: light rays cast.
        passes: launches of light rays.
        seconds: wall time by stage, `build` (light rays, storing) and `analysis` (deciding).
        nodes: what became of the nodes; None for a map that has none.
    """

    texels: int
    bytes: int
    rays: int
    passes: int
    seconds: dict[str, float] = field(default_factory=dict)
    nodes: NodeCounts | None = None


class MapMemory(NamedTuple):
    """Main memory that a map takes at the most.

    Attributes:
        state: all arrays that it keeps.
        build: what there is while they are made, `state` among it.
        pixel: of a pixel of the view, besides `build`, while the map is made.
    """

    state: Memory
    build: Memory
    pixel: Memory = Memory()


class ShadowAlgorithm(eqx.Module, Generic[State]):
    """A shadow algorithm: frozen settings. Subclasses are final and hold all their fields.

    `build` and `update` run on the host, may look at values, and choose shapes; `visibility` is
    JAX, with one trace per shape, and may be jitted with the state as an argument; a jitted
    function must not return a state. `update` takes over the state that it is given, arrays
    included: go on with the one it returns.
    """

    reference: eqx.AbstractClassVar[str]
    """Where the algorithm comes from."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """Short name for tables, made of the family and its main setting."""

    @abc.abstractmethod
    def build(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> State:
        """A state from nothing, for this view and light."""

    @abc.abstractmethod
    def update(
        self,
        state: State,
        view: EyeBuffer,
        frame: LightFrame,
        rays: LightRays,
        moved: Float64[np.ndarray, "boxes 3 2"] | None = None,
    ) -> State:
        """The state for the next frame: what is still good is kept.

        `moved` are world boxes, min and max per axis, that hold all casters that moved since the
        state was made, where they were and where they are; None if none did.
        """

    @abc.abstractmethod
    def warm_up(self, state: State, view: EyeBuffer, frame: LightFrame) -> None:
        """Compile what later updates for views of this size may call, so that none waits for it;
        queries compile once for each number of points."""

    @abc.abstractmethod
    def program(self, frame: LightFrame) -> Hashable:
        """Equal for settings that run the same compiled code."""

    @abc.abstractmethod
    def rehearse(self, view: EyeBuffer, frame: LightFrame, rays: LightRays) -> State:
        """A state for this view, after which no `build` of the same program compiles anything."""

    @abc.abstractmethod
    def copied(self, state: State) -> State:
        """A state like `state` that may be handed to `update` while `state` stays good."""

    @abc.abstractmethod
    def visibility(self, state: State, points: SurfacePoints) -> Float[Array, " n"]:
        """1 where a point is lit; 0 where it is in shadow, not valid, or answered by no texel, as
        points may be that the state's view does not see."""

    @abc.abstractmethod
    def around(self, state: State, points: SurfacePoints) -> Neighbourhood:
        """The texels around each point, for filters of this map. Nothing is made before it is asked
        for."""

    @abc.abstractmethod
    def density(self, state: State, points: SurfacePoints) -> Float[Array, "2 2 n"]:
        """Texels per image size at each point: [i, k] is d(texel)_i / d(u, v)_k of what answers it.

        Times `uv_jacobian` it is texels per eye pixel. 0 where the light does not reach.
        """

    @abc.abstractmethod
    def cost(self, state: State) -> Cost:
        """What the state holds, read from its arrays, and what the last build or update cost."""

    @abc.abstractmethod
    def memory(self, faces: int) -> MapMemory:
        """What a map for a light of so many faces will take, before anything is made."""

    @abc.abstractmethod
    def status(self, state: State) -> Status:
        """Whether the build reached what the settings ask for."""

    @abc.abstractmethod
    def effective_resolution(self, state: State) -> int:
        """Texels per side of the flat map that would have the state's finest texels throughout."""


def isotropic(texels: Float[Array, " n"]) -> Float[Array, "2 2 n"]:
    """The density of a map of square texels in u and v, `texels` (n,) of them a side."""
    none = jnp.zeros_like(texels)
    return jnp.stack([jnp.stack([texels, none]), jnp.stack([none, texels])])


def array_bytes(*trees) -> int:
    """Bytes of all arrays in pytrees."""
    return sum(leaf.nbytes for leaf in jax.tree.leaves(trees) if hasattr(leaf, "nbytes"))
