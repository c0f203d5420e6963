"""Over which settings each family of shadow algorithms is compared.

A new sibling of the registry needs nothing here if its class takes a `resolution`, and a line in
`VARIANTS` if other settings of it should be tried.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from asmjax.errors import UseError, unknown_name
from asmjax.experiment.methods import settings_of
from asmjax.shadow import (
    ALGORITHMS,
    MAPS,
    AdaptiveShadowMap,
    ShadowAlgorithm,
    of_resolution,
    resolution_for,
)

ADAPTIVE = "adaptive"
"""The family whose memory, and not its resolution, is chosen."""

MEMORY_FACTORS = (Fraction(1), Fraction(1, 16), Fraction(4), Fraction(1, 4))
"""Of the memory limit: the most telling first."""

VARIANTS: Mapping[str, Sequence[Mapping[str, Any]]] = {
    "adaptive": [
        *({"finest_ratio": 1 / side} for side in (1, 4, 64)),
        {"discontinuity": 0.01},
        {"least_profit": 1000.0},
    ],
    "subdivided": [{"parts": 1}],
}
"""Further settings of a family, at the memory limit itself."""

BETWEEN: Mapping[str, Sequence[Mapping[str, Any]]] = {
    "adaptive": [{"finest_ratio": 1 / side} for side in (2, 8, 32)],
    "light-space": [{"falloff": "sine"}],
    "logarithmic": [{"ratio": 16.0}, {"ratio": 4.0}],
    "partitioned": [{"warp": "light-space"}, {"blend": 0.5}],
    "subdivided": [{"parts": 4}, {"strength": -1.0}],
    "tuned": [{"partitions": 1}, {"power": 2.0}],
    "filtered": [{"kernel": kernel} for kernel in ("bilinear", "dithered", "original")],
}
"""Settings that tell less, and are tried with the first number of samples only. Lengths in scene
units, as `slide` and `focus` are, have no values that suit every scene: a settings file gives them.
"""

LAST = len(MEMORY_FACTORS) + 1
"""The rank of what is in `BETWEEN`."""


@dataclass(frozen=True)
class Candidate:
    """An algorithm with settings that is compared.

    Attributes:
        family: of the registry.
        label: what tells it from others of its family.
        algorithm: None where no such map is possible; `problem` says why.
        rank: 0 for the most telling of a family.
    """

    family: str
    label: str
    rank: int
    algorithm: ShadowAlgorithm | None
    problem: str = ""


def families_of(wanted: Sequence[str]) -> list[str]:
    """The families of those names in that order, each once; all maps of the registry without any,
    of which filters would only say the same again but for soft edges.

    Raises:
        UseError: an unknown name.
    """
    for name in wanted:
        if name not in ALGORITHMS:
            raise unknown_name("method", name, ALGORITHMS, "Name others with `methods`.")
    return list(dict.fromkeys(wanted or MAPS))


def candidates(
    families: Sequence[str], adaptive: AdaptiveShadowMap, faces: int
) -> list[Candidate]:  # fmt: skip
    """What is compared, the most telling first.

    Args:
        adaptive: with the settings from which its family starts; its memory is that of all others,
            whose texels fit into it for a light of so many `faces`.
    """
    found: list[Candidate] = []
    for rank in range(LAST + 1):
        for family in families:
            known = [_identity(item) for item in found]
            found += [
                item for item in _of_rank(rank, family, adaptive, faces)
                if _identity(item) not in known
            ]  # fmt: skip
    return found


def _of_rank(
    rank: int, family: str, adaptive: AdaptiveShadowMap, faces: int
) -> Iterator[Candidate]:  # fmt: skip
    if rank < len(MEMORY_FACTORS):
        memory = int(adaptive.memory_bytes * MEMORY_FACTORS[rank])
        yield _candidate(rank, family, {}, adaptive, memory, faces)
        return
    for changes in (BETWEEN if rank == LAST else VARIANTS).get(family, ()):
        yield _candidate(rank, family, changes, adaptive, adaptive.memory_bytes, faces)


def _candidate(
    rank: int,
    family: str,
    changes: Mapping[str, Any],
    adaptive: AdaptiveShadowMap,
    memory: int,
    faces: int,
) -> Candidate:
    parts = [f"{memory / 2**20:g} MB", *(_in_words(*item) for item in changes.items())]
    label = ", ".join(parts)
    try:
        if family == ADAPTIVE:
            algorithm = replace(adaptive, memory_bytes=memory, **changes)
            algorithm.tree_shape(faces)
        else:
            algorithm = of_resolution(family, resolution_for(memory, faces), **changes)
    except UseError as problem:
        return Candidate(family, label, rank, None, str(problem))
    return Candidate(family, label, rank, algorithm)


def _in_words(name: str, value: Any) -> str:
    """finest ratio 1/4, discontinuity 0.01, parts 2, warp light-space."""
    number = isinstance(value, float)
    # Halves of halves have one bit, and are well known as fractions.
    halved = number and 0 < value < 1 and math.frexp(value)[0] == 0.5
    text = f"1/{1 / value:.0f}" if halved else f"{value:g}" if number else str(value)
    return f"{name.replace('_', ' ')} {text}"


def _identity(item: Candidate) -> tuple:
    if item.algorithm is None:
        return item.family, item.label
    return item.family, tuple(sorted((k, str(v)) for k, v in settings_of(item.algorithm).items()))
