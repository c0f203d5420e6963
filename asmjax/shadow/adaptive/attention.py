"""Whom to look at again in a view at rest: those who asked, then those whose answer may differ."""

import jax
import numpy as np
from jaxtyping import Int

from asmjax.shadow.adaptive.look import Analysis, Audience
from asmjax.shadow.adaptive.shape import TreeShape
from asmjax.shadow.adaptive.tree import Tree, serve

_serve = jax.jit(serve, static_argnums=0)


class Attention:
    """All receivers of a view, and the page that each was served by when it was last looked at.

    What a look finds about a receiver depends on that page alone, and texels do not change while a
    view is refined. So after one look at everyone, looks at those who asked for more, and in the
    end at those who are served by another page than before, find all that looks at everyone would.

    Attributes:
        everyone: the receivers.
    """

    def __init__(self, everyone: Audience, tree: Tree, analysis: Analysis):
        self.everyone, self._entries = everyone, tree.entries
        self._facing = np.asarray(everyone.receivers.facing)
        self._served_by = np.array(analysis.entry)

    def note(self, who: Int[np.ndarray, " k"], analysis: Analysis) -> None:
        """That `who`, the first k receivers of a look, were looked at."""
        self._served_by[who] = np.asarray(analysis.entry)[: who.size]

    def unsettled(self, shape: TreeShape, tree: Tree) -> Int[np.ndarray, " k"]:
        """Receivers that another page serves than when they were last looked at."""
        if tree.entries is self._entries:
            return np.zeros(0, np.int64)
        entry = np.asarray(_serve(shape, tree, self.everyone.receivers, self.everyone.address))
        found = np.flatnonzero(self._facing & (entry != self._served_by))
        if not found.size:
            self._entries = tree.entries
        return found

    def some(self, who: Int[np.ndarray, " k"]) -> tuple[Audience, Int[np.ndarray, " m"]]:
        """An audience of the receivers `who`, or of everyone where they are many; and who is in it,
        without the padding."""
        audience = self.everyone.picked(who)
        return audience, np.arange(self.everyone.count) if audience is self.everyone else who


def compile_attention(shape: TreeShape, tree: Tree, everyone: Audience) -> None:
    """Have the search for who is unsettled compiled."""
    _serve(shape, tree, everyone.receivers, everyone.address)
