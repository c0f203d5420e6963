"""A quadtree (and its c x c kin) in dictionaries: the slow, obvious twin of pool and lookup."""

from dataclasses import dataclass, field
from fractions import Fraction
from math import floor

import jax.numpy as jnp
import numpy as np

from asmjax.buffers import Receivers
from asmjax.shadow.adaptive.pool import NodePool, Requests
from asmjax.shadow.adaptive.tree import TreeShape

Square = tuple[int, int, int, int]
"""face, level, column, row."""


def tree_shape(
    log2_node=4, log2_cells=1, log2_roots=1, levels=4, faces=1, pages=40, nodes=160
) -> TreeShape:
    """A small tree; by default 2 x 2 roots, 2 x 2 cells, 16 x 16 texels."""
    return TreeShape(log2_node, log2_cells, log2_roots, levels, faces, pages, nodes)


def requests_for(squares: list[Square]) -> Requests:
    """Requests for squares, in their order."""
    face, level, column, row = np.array(squares, np.int64).reshape(-1, 4).T
    one = np.ones(face.size)
    return Requests(face, level, column, row, one, one)


@dataclass
class SlowTree:
    """Nodes and pages by square.

    Nodes are made level by level over all requests of one call, in the order of requests; the
    first request that finds the node table full ends the call's list there.
    """

    shape: TreeShape
    nodes: set[Square] = field(default_factory=set)
    pages: dict[Square, int] = field(default_factory=dict)

    def ancestor(self, square: Square, level: int) -> Square:
        face, own, column, row = square
        c = 2**self.shape.log2_cells
        for _ in range(own - level):
            column, row = column // c, row // c
        return face, level, column, row

    def insert(self, squares: list[Square]) -> tuple[list[int], int]:
        """As `NodePool.insert`: pages of the first requests, and how many were left over."""
        squares = squares[: self.shape.pages - len(self.pages)]
        fitting = list(squares)
        for level in range(max((s[1] for s in squares), default=0) + 1):
            for k, square in enumerate(fitting):
                if square[1] < level:
                    continue
                node = self.ancestor(square, level)
                if level > 0 and node not in self.nodes:
                    if len(self.nodes) == self.shape.nodes:
                        fitting = fitting[:k]
                        break
                    self.nodes.add(node)
                self.nodes.add(node)
        given = []
        for square in fitting:
            given.append(len(self.pages))
            self.pages[square] = given[-1]
        return given, len(squares) - len(fitting)

    def find(self, face: int, x: Fraction, y: Fraction) -> int:
        """The deepest page over a point of a face: from the deepest level up."""
        for level in range(self.shape.levels, -1, -1):
            side = 2 ** int(self.shape.log2_nodes_at(level))
            square = (face, level, floor(x * side), floor(y * side))
            if square in self.pages:
                return self.pages[square]
        raise LookupError("a face without roots")


def walked(pool: NodePool) -> dict[Square, int]:
    """Page of every node of a pool by square (-1 for none), found by walking from the roots.

    Fails where a node is reached twice or a child lies beyond the used nodes.
    """
    shape = pool.shape
    c, side = 2**shape.log2_cells, 2**shape.log2_roots
    at = {
        node: (node // side**2, 0, node % side, node // side % side) for node in range(shape.roots)
    }
    stack = list(at)
    while stack:
        node = stack.pop()
        face, level, column, row = at[node]
        for cell in range(c * c):
            child = int(pool.child[node * c * c + cell])
            if child < 0:
                continue
            assert child not in at, "two parents"
            assert child < pool.used_nodes, "an unused node"
            at[child] = (face, level + 1, column * c + cell % c, row * c + cell // c)
            stack.append(child)
    assert len(at) == pool.used_nodes, "a lost node"
    return {square: int(pool.page[node]) for node, square in at.items()}


def random_squares(rng: np.random.Generator, shape: TreeShape, count: int) -> list[Square]:
    """Different squares at random levels, clustered so that many share ancestors."""
    chosen: dict[Square, None] = {}
    while len(chosen) < count:
        level = int(rng.integers(1, shape.levels + 1))
        side = 2 ** int(shape.log2_nodes_at(level))
        column, row = np.minimum((rng.random(2) ** 3 * side).astype(int), side - 1)
        chosen[int(rng.integers(shape.faces)), level, int(column), int(row)] = None
    return list(chosen)


def receivers_at(face, uv) -> Receivers:
    """Receivers at image coordinates, on planes across the light ray at depth 1."""
    n = len(face)
    uv = jnp.asarray(uv)
    one = jnp.ones(n, uv.dtype)
    return Receivers(
        face=jnp.asarray(face, jnp.int32),
        uv=uv,
        depth=one,
        slope=jnp.zeros((2, n), uv.dtype),
        secant=one,
        reach=one,
        prim=jnp.full(n, 7, jnp.int32),
        facing=jnp.ones(n, bool),
    )
