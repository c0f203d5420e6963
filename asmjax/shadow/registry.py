"""All shadow algorithms by family name; a new sibling is one line here."""

from asmjax.shadow.adaptive import AdaptiveShadowMap
from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.uniform import UniformShadowMap

ALGORITHMS: dict[str, type[ShadowAlgorithm]] = {
    "uniform": UniformShadowMap,
    "adaptive": AdaptiveShadowMap,
}
"""Family name, with which the names of its results begin, to class."""
