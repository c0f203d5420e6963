"""Scenes of any size: the number of triangles behind the colon of their name."""

import re
from typing import NamedTuple

from asmjax.errors import UseError, require


class SizeRange(NamedTuple):
    """The numbers of triangles, `fewest` to `most`, that a scene can be had with.

    `small` is a size to show as an example, beside 12m.
    """

    scene: str
    fewest: int
    most: int
    small: str = "10k"

    def parse(self, text: str) -> int:
        """Triangles from "250000", "10k", "2.5m" or "12M"; `UseError` for anything else.

        Whether the scene can have that many is for `check`.
        """
        number = re.fullmatch(r"(\d{1,12}|\d{1,9}\.\d{1,9})([km]?)", text.strip().lower())
        if number is None:
            raise UseError(
                f"'{text[:40]}' is no number of triangles; allowed: {self.fewest} to {self.most}, "
                f"with k for thousands and m for millions; write for example {self._examples}."
            )
        return round(float(number[1]) * {"": 1, "k": 1_000, "m": 1_000_000}[number[2]])

    def check(self, triangles: int) -> None:
        """Raise `UseError` for a number of triangles outside the range."""
        require(
            self.fewest <= triangles <= self.most,
            f"'{self.scene}' with {triangles} triangles is not possible; allowed is {self.fewest} "
            f"to {self.most}: choose another size, such as {self._examples}.",
        )

    @property
    def _examples(self) -> str:
        return f"{self.scene}:{self.small} or {self.scene}:12m"
