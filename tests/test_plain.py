"""Plain values: of whatever library, and what becomes of numbers that are not finite."""

import enum
import json
import math
from pathlib import Path

import numpy as np
import pytest

from asmjax.plain import NonFinite, plain
from asmjax.sweep.identity import canonical

ENDLESS = {
    "limit": math.inf,
    "inner": [-math.inf, {"x": math.nan}],
    "array": np.array([1.0, np.inf]),
}


class Word(enum.StrEnum):
    SOFT = "soft"


@pytest.mark.parametrize(
    ("policy", "expected"),
    [
        (NonFinite.NAMED, {"limit": "inf", "inner": ["-inf", {"x": "nan"}], "array": [1.0, "inf"]}),
        (NonFinite.NONE, {"limit": None, "inner": [None, {"x": None}], "array": [1.0, None]}),
    ],
)
def test_numbers_that_are_not_finite_are_named_or_none(policy, expected):
    """At any depth; what is given stays as it is."""
    assert plain(ENDLESS, policy) == expected
    assert json.loads(json.dumps(plain(ENDLESS, policy), allow_nan=False)) == expected
    assert ENDLESS["limit"] == math.inf


def test_whoever_refuses_them_gets_them():
    assert math.isinf(plain(ENDLESS, NonFinite.KEPT)["limit"])


@pytest.mark.parametrize("policy", NonFinite)
def test_what_has_a_word_in_json_is_that_word(policy):
    """Keys of trials depend on it: the text of plain values is the same as before."""
    values = {"f": 0.1, "i": 3, "b": True, "n": None, "t": "a", "l": [1, 2.5], "d": {"x": []}}
    assert plain(values, policy) == values
    assert canonical(plain(values, policy)) == canonical(values)
    made = plain(
        {"f": np.float32(0.5), "i": np.int64(3), "b": np.bool_(True), 7: (Word.SOFT, Path("a"))},
        policy,
    )
    assert made == {"f": 0.5, "i": 3, "b": True, "7": ["soft", "a"]}
    kinds = [type(value) for value in (*list(made.values())[:3], *made["7"])]
    assert kinds == [float, int, bool, str, str]
