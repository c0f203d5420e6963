"""Measurements outlive a crash at any byte, and are found again whatever the order of their key."""

import json
import logging
import math
import os
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.experiment.ledger import FORMAT, Ledger, digest

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)
RECORDS = st.dictionaries(st.text(max_size=8), PLAIN, max_size=4)


def key(number: int) -> dict:
    return {
        "scene": "room",
        "number": number,
        "settings": {"ratio": 0.5, "name": "Größe \u2028 影"},
    }


def measured(number: int) -> dict:
    return {"seconds": [0.1 * number, 1e-9], "status": "complete", "name": "Größe \u2028 影"}


def filled(path: Path, count: int) -> Ledger:
    ledger = Ledger(path)
    for number in range(count):
        ledger.add(key(number), measured(number))
    return ledger


def same(a, b) -> bool:
    """Equal, with NaN equal to itself and 1 other than True."""
    return repr(a) == repr(b)


def test_what_was_taken_and_added_is_counted(tmp_path):
    ledger = filled(tmp_path / "m.jsonl", 3)
    assert (ledger.taken, ledger.added, len(ledger)) == (0, 3, 3)
    assert ledger.get(key(9)) is None
    assert (ledger.taken, ledger.added) == (0, 3)
    again = Ledger(tmp_path / "m.jsonl")
    assert [again.get(key(k)) for k in range(3)] == [measured(k) for k in range(3)]
    assert (again.taken, again.added, len(again)) == (3, 0, 3)


def test_without_a_path_it_remembers_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ledger = Ledger()
    ledger.add(key(1), measured(1))
    assert ledger.get(key(1)) == measured(1)
    assert list(tmp_path.iterdir()) == []


def test_no_file_before_the_first_measurement(tmp_path):
    path = tmp_path / "m.jsonl"
    assert len(Ledger(path)) == 0
    assert not path.exists()


def test_a_crash_at_any_byte_costs_the_torn_measurements_only(tmp_path, caplog):
    """The file cut after every byte of its last two lines: those before are read, a torn one is
    measured again and written on a line of its own, and the next reader finds everything."""
    path = tmp_path / "m.jsonl"
    filled(path, 4)
    whole = path.read_bytes()
    lines = whole.splitlines(keepends=True)
    ends = np.cumsum([len(line) for line in lines])
    for cut in range(int(ends[1]), len(whole) + 1):
        path.write_bytes(whole[:cut])
        caplog.clear()
        ledger = Ledger(path)
        # A line that lacks nothing but its end is whole.
        kept = sum(cut >= end - 1 for end in ends.tolist())
        assert len(ledger) == kept, cut
        torn = cut not in ends and cut + 1 not in ends
        assert len(caplog.records) == torn, cut
        for number in range(4):
            found = ledger.get(key(number))
            assert found == (measured(number) if number < kept else None)
            if found is None:
                ledger.add(key(number), measured(number))
        caplog.clear()
        again = Ledger(path)
        assert [again.get(key(k)) for k in range(4)] == [measured(k) for k in range(4)], cut
        assert len(caplog.records) == torn
        rest = whole[:cut] + b"\n" if torn else b"".join(lines[:kept])
        expected = rest + b"".join(lines[kept:])
        assert path.read_bytes().rstrip(b"\n") == expected.rstrip(b"\n"), cut


@pytest.mark.parametrize("cut", [0, 1, 20, 60])
def test_a_crash_within_the_very_first_line_is_no_other_file(tmp_path, cut):
    path = tmp_path / "m.jsonl"
    filled(path, 1)
    path.write_bytes(path.read_bytes()[:cut])
    ledger = Ledger(path)
    assert len(ledger) == 0
    ledger.add(key(0), measured(0))
    assert Ledger(path).get(key(0)) == measured(0)


def test_ledgers_one_after_the_other_share_a_file(tmp_path):
    """Also where both were opened before either wrote; of two with one key the later counts."""
    path = tmp_path / "m.jsonl"
    first, second = Ledger(path), Ledger(path)
    first.add(key(1), measured(1))
    second.add(key(2), measured(2))
    first.add(key(3), measured(3))
    second.add(key(1), measured(7))
    third = Ledger(path)
    assert len(third) == 3
    assert [third.get(key(k)) for k in (1, 2, 3)] == [measured(7), measured(2), measured(3)]


@given(record=RECORDS, mixed=st.randoms(use_true_random=False))
def test_keys_are_equal_whatever_their_order(record, mixed):
    """At every depth; and a key that says anything else is another one."""

    def shuffled(record: dict) -> dict:
        items = [(name, part(item)) for name, item in record.items()]
        mixed.shuffle(items)
        return dict(items)

    def part(value):
        if isinstance(value, list):
            return [part(item) for item in value]
        return shuffled(value) if isinstance(value, dict) else value

    assert digest(shuffled(record)) == digest(record)
    assert digest({**record, "more than eight letters": 0}) != digest(record)
    assert digest({"a": [1, 2]}) != digest({"a": [2, 1]})


@given(record=RECORDS, value=RECORDS)
def test_any_plain_values_come_back_as_they_were(tmp_path_factory, record, value):
    """NaN, infinities, any text: nothing that was measured is lost for what it is."""
    path = tmp_path_factory.mktemp("ledger") / "m.jsonl"
    ledger = Ledger(path)
    ledger.add(record, value)
    for one in (ledger, Ledger(path)):
        found = one.get(record)
        assert found is not None and same(found, value)


def test_an_endless_setting_and_numbers_of_numpy_are_kept(tmp_path):
    """The same now as after a restart, tuples as lists."""
    path = tmp_path / "m.jsonl"
    ledger = Ledger(path)
    endless = {"ratio": math.inf, "side": np.int64(8)}
    ledger.add(endless, {"error": np.float32(0.5), "m": math.nan, "size": (1, np.int32(2))})
    for one in (ledger, Ledger(path)):
        found = one.get({"side": 8, "ratio": math.inf})
        assert found is not None and same(found, {"error": 0.5, "m": math.nan, "size": [1, 2]})
    with pytest.raises(TypeError, match="Path is no plain value"):
        ledger.add({}, {"path": Path("x")})


def test_what_is_handed_out_is_not_what_was_handed_in():
    """A measurement that its owner changes later stays as it was."""
    ledger, value = Ledger(), measured(1)
    ledger.add(key(1), value)
    value["seconds"].append(3.0)
    assert ledger.get(key(1)) == measured(1)


@pytest.mark.parametrize(
    "line",
    [
        b"[1, 2]",
        b'{"format": "asmjax/measurement/0", "key": "a", "of": {}, "measured": {}}',
        b'{"format": "asmjax/measurement/1"}',
        b'{"format": "asmjax/measurement/1", "key": "a", "of": {}, "measured": {}}',
        b'{"format": "asmjax/measurement/1", "key": 1, "of": 2, "measured": 3}',
        b"\xff\xfe\x00",
        b"null",
    ],
)
def test_a_line_that_is_none_is_left_out_with_one_warning(tmp_path, caplog, line):
    """Another version's, one whose key does not fit, or anything at all, among good ones."""
    path = tmp_path / "m.jsonl"
    filled(path, 2)
    good = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(good[0] + line + b"\n" + b"\n" + line + b"\n" + good[1])
    with caplog.at_level(logging.WARNING, logger="asmjax"):
        ledger = Ledger(path)
    assert [ledger.get(key(k)) for k in range(2)] == [measured(k) for k in range(2)]
    (record,) = caplog.records
    assert "2 of 4 measurements" in record.getMessage() and "line 2: " in record.getMessage()


@pytest.mark.parametrize(
    "content", [b"frame,seconds\n0,1.5\n", b"\x89PNG\r\n\x1a\n\x00", b'{"schema": "other"}', b"x"]
)
def test_a_file_of_something_else_is_not_written_to(tmp_path, content):
    path = tmp_path / "m.jsonl"
    path.write_bytes(content)
    with pytest.raises(UseError, match="holds something else than measurements; move it away"):
        Ledger(path)
    assert path.read_bytes() == content


def test_random_bytes_are_refused_or_left_out(tmp_path):
    """Whatever a disk did to the first of two lines: never a traceback, and the second is read."""
    path, rng = tmp_path / "m.jsonl", random.Random(5)
    filled(path, 2)
    first, second = path.read_bytes().splitlines(keepends=True)
    refused = 0
    for _ in range(200):
        hurt = bytearray(first)
        for _ in range(rng.randrange(1, 9)):
            hurt[rng.randrange(len(hurt) - 1)] = rng.randrange(256)
        path.write_bytes(hurt + second)
        try:
            assert Ledger(path).get(key(1)) == measured(1)
        except UseError:
            refused += 1
    assert 0 < refused < 100


def test_a_folder_in_its_place_is_told_in_one_line(tmp_path):
    with pytest.raises(
        UseError, match=r"cannot read the measurements in '.*'.*choose another `out`"
    ):
        Ledger(tmp_path)


def test_a_place_that_cannot_be_written_loses_nothing(tmp_path):
    """One line, and the measurement is known all the same."""
    ledger = Ledger(tmp_path / "missing" / "m.jsonl")
    with pytest.raises(UseError, match="cannot write measurements to .*No such file"):
        ledger.add(key(1), measured(1))
    assert ledger.get(key(1)) == measured(1)


def test_a_full_disk_loses_nothing_that_was_kept(tmp_path, monkeypatch):
    """And a ledger that has room again goes on behind what came through."""
    path = tmp_path / "m.jsonl"
    ledger = filled(path, 1)
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left")))
        with pytest.raises(UseError, match="cannot write measurements to .*No space left"):
            ledger.add(key(1), measured(1))
    ledger.add(key(2), measured(2))
    assert Ledger(path).get(key(0)) == measured(0)
    assert Ledger(path).get(key(2)) == measured(2)


def test_lines_are_readable_by_people(tmp_path):
    """Each names its format and all that it depends on."""
    filled(tmp_path / "m.jsonl", 1)
    entry = json.loads((tmp_path / "m.jsonl").read_text(encoding="utf-8"))
    assert entry == {
        "format": FORMAT, "key": digest(key(0)), "of": key(0), "measured": measured(0)
    }  # fmt: skip
