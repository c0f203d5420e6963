"""Views and lights refuse what the pipeline would read in two ways."""

import math

import pytest

from asmjax.errors import UseError
from asmjax.scene.spec import LightSpec, ViewSpec


@pytest.mark.parametrize(
    ("near", "far"), [(-5.0, math.inf), (0.0, 1.0), (2.0, 1.0), (1.0, math.nan), (math.nan, 1.0)]
)
def test_a_view_sees_from_somewhere_to_somewhere_farther(near, far):
    with pytest.raises(UseError, match="'v' .*(from|finite)"):
        ViewSpec("v", (0, 0, 0), (1, 0, 0), near=near, far=far)


@pytest.mark.parametrize("cutoff", [math.nan, -30.0, 0.0, 200.0])
def test_a_spot_has_a_cone(cutoff):
    """Truth ignored a cone of NaN degrees, and maps were dark in it."""
    with pytest.raises(UseError, match=f"cone of {cutoff} degrees"):
        LightSpec("spot", "spot", (0, 0, 3), (0, 0, -1), None, cutoff)
    LightSpec("spot", "spot", (0, 0, 3), (0, 0, -1), None, 180.0)
