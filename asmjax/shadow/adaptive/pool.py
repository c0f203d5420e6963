"""The host's side of the tree: which nodes and pages exist, and where new ones go."""

from dataclasses import dataclass

import numpy as np

from asmjax.shadow.adaptive.tree import TreeShape


@dataclass(frozen=True)
class Requests:
    """Nodes that should get a page: each a square of a face at a level.

    Attributes:
        face, level, column, row: (k,) int64; column and row count nodes of that level.
        benefit: (k,) eye pixels that each page would help.
        n_required: (k,) texels that the square needs to match the eye.
    """

    face: np.ndarray
    level: np.ndarray
    column: np.ndarray
    row: np.ndarray
    benefit: np.ndarray
    n_required: np.ndarray

    @property
    def count(self) -> int:
        return self.face.size

    def take(self, which) -> "Requests":
        """The requests at the given positions, in that order."""
        return Requests(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


SQUARE_BYTES = 32
"""Bytes that say where a page lies: face, level, column, row."""


class NodePool:
    """Node and page tables of one tree, mutable, on the host.

    Attributes:
        child: (nodes * c * c,) int32, as `Tree.child`.
        page: (nodes,) int32, as `Tree.page`.
        used_nodes, used_pages: how many are taken; both fill from the start.
        squares: (4, pages) int64: face, level, column, row of each page.
    """

    def __init__(self, shape: TreeShape):
        self.shape = shape
        self.child = np.full(shape.nodes * shape.cells_per_node, -1, np.int32)
        self.page = np.full(shape.nodes, -1, np.int32)
        self.used_nodes = shape.roots
        self.used_pages = 0
        self.squares = np.zeros((4, shape.pages), np.int64)

    @property
    def bytes(self) -> int:
        """Bytes of the tables."""
        return self.child.nbytes + self.page.nbytes + self.squares.nbytes

    @property
    def free_pages(self) -> int:
        return self.shape.pages - self.used_pages

    def roots(self) -> Requests:
        """All level-0 nodes, in node order."""
        side = 1 << self.shape.log2_roots
        index = np.arange(self.shape.roots)
        zero, full = np.zeros(index.size, np.int64), np.full(index.size, np.inf)
        return Requests(
            index // side**2, zero, index % side, index // side % side, full, zero.astype(float)
        )

    def insert(self, requests: Requests) -> tuple[np.ndarray, int]:
        """Give requested nodes pages, in order, until pages or nodes run out.

        Returns:
            The pages (k',) of the first k' requests, and how many requests were left over because
            the node table is full. Raises nothing: what does not fit is counted.
        """
        requests = requests.take(slice(self.free_pages))
        nodes, fitting = self._nodes(requests)
        pages = self.used_pages + np.arange(fitting)
        self.page[nodes[:fitting]] = pages
        chosen = requests.take(slice(fitting))
        self.squares[:, pages] = [chosen.face, chosen.level, chosen.column, chosen.row]
        self.used_pages += fitting
        return pages, requests.count - fitting

    def _nodes(self, requests: Requests) -> tuple[np.ndarray, int]:
        """Node of each request, made with its ancestors where missing; and how many fit."""
        shape = self.shape
        deepest = int(requests.level.max(initial=0))
        node = self._at_level(requests, 0)
        fitting = requests.count
        for level in range(1, deepest + 1):
            mine = np.flatnonzero(requests.level[:fitting] >= level)
            column, row = self._ancestor(requests, mine, level)
            mask = (1 << shape.log2_cells) - 1
            cell = (
                node[mine].astype(np.int64) * shape.cells_per_node
                + ((row & mask) << shape.log2_cells)
                + (column & mask)
            )
            missing, first = np.unique(cell[self.child[cell] < 0], return_index=True)
            order = np.argsort(first, kind="stable")
            free = shape.nodes - self.used_nodes
            made = missing[order][:free]
            self.child[made] = self.used_nodes + np.arange(made.size)
            self.used_nodes += made.size
            found = self.child[cell]
            if (found < 0).any():
                fitting = int(mine[np.flatnonzero(found < 0)[0]])
                keep = mine < fitting
                mine, found = mine[keep], found[keep]
            node[mine] = found
        return node, fitting

    def _at_level(self, requests: Requests, level: int) -> np.ndarray:
        column, row = self._ancestor(requests, slice(None), level)
        log2 = self.shape.log2_roots
        return (((requests.face << log2) + row) << log2) + column

    def _ancestor(self, requests: Requests, which, level: int):
        shift = (requests.level[which] - level) * self.shape.log2_cells
        return requests.column[which] >> shift, requests.row[which] >> shift
