"""What an adaptive shadow map remembers between frames."""

import itertools
from dataclasses import dataclass

import equinox as eqx
import numpy as np
from jax.core import Tracer
from jaxtyping import Array

from asmjax.errors import require
from asmjax.geometry import Camera, LightFrame
from asmjax.shadow.adaptive.bounds import Bounds, page_bounds, pyramid
from asmjax.shadow.adaptive.cost_model import CostModel
from asmjax.shadow.adaptive.pool import NodePool
from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.tree import Tree
from asmjax.shadow.base import Status

_serials = itertools.count()


@dataclass
class BuildLog:
    """What one build or update took, how it ended, and what is counted from the first one on.

    Attributes:
        build, analysis: seconds of wall time: light rays and storing, and deciding.
        rays, passes: light rays, and launches of them.
        made, evicted, recast, dropped, reused: as `asmjax.shadow.NodeCounts`.
        frame: builds and updates so far; pages are stamped with it.
        slowness: measured / predicted seconds of the launches so far, 1 before the first.
        status: how it ended; before it did, how the one before ended.
    """

    build: float = 0.0
    analysis: float = 0.0
    rays: int = 0
    passes: int = 0
    made: int = 0
    evicted: int = 0
    recast: int = 0
    dropped: int = 0
    reused: int = 0
    frame: int = 0
    slowness: float = 1.0
    status: Status = Status.COMPLETE

    def next(self) -> "BuildLog":
        """The log that the next update begins with."""
        return BuildLog(frame=self.frame, slowness=self.slowness, status=self.status)


class HostSide:
    """What a state keeps on the host: tables, costs and log; and whether `update` took it over.

    All are equal: a jitted function of a state depends on its arrays and shapes alone.

    Attributes:
        camera: the camera that the state was refined for last.
        pyramid: bounds of the tree's pages, once they were asked for.
        serial: a number that no other has.
    """

    def __init__(self, pool: NodePool, cost_model: CostModel, log: BuildLog, camera: Camera):
        self.pool, self.cost_model, self.log, self.camera = pool, cost_model, log, camera
        self.taken = False
        self.serial = next(_serials)
        self.pyramid: Bounds | None = None

    def __eq__(self, other):
        return isinstance(other, HostSide)

    def __hash__(self):
        return hash(HostSide)


class AdaptiveState(eqx.Module):
    """A tree on the device, its tables on the host, and the light frame that it was built for.

    Attributes:
        serial: () int32, the same as the host side's: they belong together.
    """

    tree: Tree
    frame: LightFrame
    serial: np.ndarray | Array
    shape: TreeShape = eqx.field(static=True)
    host: HostSide = eqx.field(static=True)

    def __init__(self, tree: Tree, frame: LightFrame, shape: TreeShape, host: HostSide):
        self.tree, self.frame, self.shape, self.host = tree, frame, shape, host
        self.serial = np.array(host.serial, np.int32)

    @property
    def pool(self) -> NodePool:
        self.check_owned()
        return self.host.pool

    @property
    def log(self) -> BuildLog:
        self.check_owned()
        return self.host.log

    def pyramid(self) -> Bounds:
        """Bounds of the texels of all pages; made when first asked for, then kept."""
        self.check_owned()
        if self.host.pyramid is None:
            pool = self.host.pool
            self.host.pyramid = pyramid(page_bounds(self.tree), pool.held(), pool.ends())
        return self.host.pyramid

    def check_owned(self) -> None:
        """Raise `UseError` if `update` has taken this state over, or it came out of a jitted
        function, which gives back new arrays with the host's side of the first state it met."""
        require(
            isinstance(self.serial, Tracer) or int(self.serial) == self.host.serial,
            "this state came out of a jitted function; return arrays from it, and go on with the "
            "state that build or update gave.",
        )
        require(
            not self.host.taken,
            "this state was handed to update, which reuses its arrays; go on with the state that "
            "update returned.",
        )
