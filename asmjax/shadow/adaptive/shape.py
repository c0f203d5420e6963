"""The static sizes of an adaptive map's tree, and what its arrays take."""

from dataclasses import dataclass

import numpy as np

from asmjax.buffers import TexelWindows
from asmjax.errors import require
from asmjax.shadow.adaptive.address import DEEPEST_LOG2
from asmjax.shadow.comparison import Compare, texel_bytes

GUARD = 1
"""Texels of the guard band on each side of a page, so that a stencil never leaves the page."""

LOG2_TABLE = 3
"""log2 of the entries a side of a page table: one step of a lookup passes this many levels of 2."""

PAGES_PER_TABLE = 3
"""Room for page tables below the top one. Most scenes use one for 3.4 to 6 pages; light from a lamp
within a room, which has six faces, one for 2.2: the tables are full before the pages are."""

CHAIN_TABLES = 6
"""More of them where there are pages enough: one deep node takes one every three levels."""

TOP_SHARE = 1 / 24
"""Part of the memory that the top page table may take, on device and host together."""

TOP_LOG2 = 8
"""log2 of its entries a side of a face, at most: twice as many save no step of a lookup at the
usual sizes of nodes, and take twice as long to fill."""

ENTRY_BYTES = 2 * 4
"""A page table entry: on the device, and on the host."""

CAMERA_BYTES = 160
"""Room for the camera that a state remembers."""

PAGE_TABLES_BYTES = 50
"""Bytes of a page in the host's tables (`NodePool`): square, order, use, benefit and waiting, of
which there is room for a 32nd of the pages."""

PYRAMID_BYTES = 8
"""Bytes of a page's `Bounds` on the device."""

START_LOG2 = 9
"""log2 of the starting resolution of the 2001 paper, 512 x 512."""


@dataclass(frozen=True)
class TreeShape:
    """The static sizes of a tree.

    Attributes:
        log2_node: log2 of R, texels per node side.
        log2_cells: log2 of c, cells per node side; each level multiplies the resolution by c.
        log2_roots: log2 of the level-0 nodes per face side.
        levels: number of levels below level 0 that may exist.
        faces: faces of the light frame.
        pages: pages that fit, one more is kept for writing padding.
        log2_top: log2 of the top page table's entries per face side.
        tables: page tables below the top one that fit.
    """

    log2_node: int
    log2_cells: int
    log2_roots: int
    levels: int
    faces: int
    pages: int
    log2_top: int
    tables: int

    @property
    def side(self) -> int:
        """Texels per page side, guard band included."""
        return (1 << self.log2_node) + 2 * GUARD

    @property
    def roots(self) -> int:
        """Number of level-0 nodes over all faces."""
        return self.faces << (2 * self.log2_roots)

    @property
    def top_entries(self) -> int:
        return self.faces << (2 * self.log2_top)

    @property
    def entries(self) -> int:
        """Entries of all page tables."""
        return self.top_entries + (self.tables << (2 * LOG2_TABLE))

    @property
    def steps(self) -> int:
        """Page tables below the top one on the longest path that can be."""
        deepest = self.log2_nodes_at(self.levels)
        return max(0, -(-(deepest - self.log2_top) // LOG2_TABLE))

    def log2_nodes_at(self, level):
        """log2 of the nodes per face side at a level."""
        return self.log2_roots + level * self.log2_cells

    def log2_resolution(self, level):
        """log2 of the effective resolution at a level."""
        return self.log2_nodes_at(level) + self.log2_node


def shape_for(
    memory_bytes: int,
    faces: int,
    *,
    node_resolution: int,
    cells: int,
    start_resolution: int | None,
    compare: Compare,
) -> TreeShape:
    """The largest tree whose arrays, on device and host together, fit into `memory_bytes`.

    Raises:
        UseError: the limit is below one node per face or below the starting resolution, or the
            tree would need more addresses than one int32.
    """
    log2_node = node_resolution.bit_length() - 1
    log2_cells = cells.bit_length() - 1
    side = node_resolution + 2 * GUARD
    page_bytes = side**2 * texel_bytes(compare)
    table_bytes = ENTRY_BYTES << (2 * LOG2_TABLE)
    # One more page takes the padding of writes; one more table rounds their number up.
    fixed = page_bytes + table_bytes + CAMERA_BYTES
    per_page = page_bytes + PAGE_TABLES_BYTES + PYRAMID_BYTES + table_bytes / PAGES_PER_TABLE
    chain = CHAIN_TABLES if memory_bytes > 4 * CHAIN_TABLES * per_page else 0
    fixed += chain * table_bytes
    log2_top = 0
    while ENTRY_BYTES * (faces << 2 * (log2_top + 1)) <= memory_bytes * TOP_SHARE:
        log2_top += 1
    log2_top = min(log2_top, TOP_LOG2)

    def pages_beside(log2_top: int) -> int:
        return int((memory_bytes - fixed - ENTRY_BYTES * (faces << 2 * log2_top)) // per_page)

    # Pages go first where there is hardly room for one a face.
    while log2_top > 0 and pages_beside(log2_top) < faces:
        log2_top -= 1
    pages = pages_beside(log2_top)
    require(
        pages >= faces,
        f"a memory limit of {memory_bytes / 2**20:g} MB is below one node of "
        f"{node_resolution} x {node_resolution} texels for each of {faces} light "
        f"face(s); allowed is {(fixed + faces * (per_page + ENTRY_BYTES)) / 2**20:.3g} MB or more: "
        "raise `memory_bytes` or lower `node_resolution`.",
    )
    # Texels are addressed by one int32 each: page * side^2 + local.
    require(
        (pages + 1) * side**2 < 2**31,
        f"a memory limit of {memory_bytes / 2**20:g} MB holds more texels than can be addressed; "
        f"allowed are 2^31, which {node_resolution} x {node_resolution} nodes reach with "
        f"{(2**31 // side**2) * page_bytes / 2**20:.0f} MB of texels: lower `memory_bytes`.",
    )
    if start_resolution is None:
        log2_roots = max(START_LOG2 - log2_node, 0)
        while log2_roots > 0 and 4 * (faces << 2 * log2_roots) > pages:
            log2_roots -= 1
    else:
        log2_roots = start_resolution.bit_length() - 1 - log2_node
    levels = (DEEPEST_LOG2 - log2_node - log2_roots) // log2_cells
    # The top table has an entry per level-0 node at least, per deepest node at most.
    log2_top = min(max(log2_top, log2_roots), log2_roots + levels * log2_cells)
    pages = pages_beside(log2_top)
    require(
        faces << 2 * log2_roots <= pages,
        f"a starting resolution of {start_resolution} needs {faces << 2 * log2_roots} nodes, but "
        f"{memory_bytes / 2**20:g} MB hold {max(pages, 0)}: raise `memory_bytes` or lower the "
        "starting resolution.",
    )
    return TreeShape(
        log2_node=log2_node,
        log2_cells=log2_cells,
        log2_roots=log2_roots,
        levels=levels,
        faces=faces,
        pages=pages,
        log2_top=log2_top,
        tables=pages // PAGES_PER_TABLE + 1 + chain,
    )


def page_windows(shape: TreeShape, squares: np.ndarray) -> TexelWindows:
    """The texel windows of nodes, guard bands included, for one launch of light rays.

    `squares` (4, k) are face, level, column and row.
    """
    face, level, column, row = squares.astype(np.int64)
    texel = np.ldexp(1.0, -(shape.log2_resolution(level)))
    corner = np.stack([column, row]) * np.ldexp(1.0, -shape.log2_nodes_at(level)) - GUARD * texel
    return TexelWindows(face=face, corner=corner, texel=np.stack([texel, texel]), side=shape.side)
