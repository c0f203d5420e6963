"""What notebooks call: all take an object of options, or a scene's name and fields of them."""

import pytest

import asmjax
from asmjax.errors import UseError
from asmjax.options import CompareOptions, RunOptions, given_options

CALLS = ("analyse_scene", "compare", "measure_scene", "measure_walkthrough", "plan_scene", "tune")


def test_a_name_and_fields_are_options():
    assert given_options(RunOptions, "terrain", {}) == RunOptions(scene="terrain")
    assert given_options(RunOptions, "terrain", {"seed": 3}) == RunOptions(scene="terrain", seed=3)


def test_fields_change_options_that_are_given():
    found = given_options(CompareOptions, CompareOptions(scene="terrain", seed=3), {"minutes": 2.0})
    assert found == CompareOptions(scene="terrain", seed=3, minutes=2.0)


@pytest.mark.parametrize("call", CALLS)
def test_a_field_that_is_none_is_refused_with_the_nearest(call):
    """Before anything is loaded."""
    with pytest.raises(UseError, match="unknown option 'vieww'.*Did you mean 'view'"):
        getattr(asmjax, call)("paper_room", vieww="closeup")


@pytest.mark.parametrize("call", sorted({*CALLS} - {"measure_walkthrough"}))
def test_what_options_refuse_is_refused(call):
    with pytest.raises(UseError, match="0 x 8"):
        getattr(asmjax, call)("paper_room", size=(0, 8))
