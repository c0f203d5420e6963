"""More primitives than the ids that maps keep can tell apart."""

import numpy as np
import pytest

from asmjax.buffers import EXACT_IDS
from asmjax.render.load import load_scene
from asmjax.scene.shapes import quad
from asmjax.scene.spec import LightSpec, Mesh, SceneSpec, ViewSpec
from asmjax.shadow import UniformShadowMap

pytestmark = pytest.mark.mitsuba


def dust(count: int) -> Mesh:
    """So many small triangles below the floor, where nobody sees them."""
    k = np.arange(count + 2)
    strip = np.stack([1e-5 * k, 1e-2 * (k % 2), np.full(k.size, -1.0)])
    return Mesh("dust", strip, np.stack([k[:-2], k[1:-1], k[2:]]).astype(np.int32))


def covered(between: int) -> SceneSpec:
    """A floor of two triangles, so many that nobody sees, and two that cover a part of it."""
    floor = quad("floor", [(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)])
    cover = quad("cover", [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)])
    return SceneSpec(
        "covered", "", (floor, dust(between), cover),
        {"side": ViewSpec("side", origin=(0.5, -6.0, 4.0), target=(0.0, 0.0, 0.0))},
        {"sun": LightSpec("sun", "directional", direction=(0.1, 0.8, -1.0))},
    )  # fmt: skip


@pytest.mark.parametrize("compare", ["id", "both"])
def test_a_cover_65536_primitives_further_on_casts_its_shadow(compare):
    """Cut to 16 bits, ids of floor and cover are the same, and all of the shadow was lit."""
    scene = load_scene(covered(EXACT_IDS - 2))
    eye = scene.eye(scene.view().resized(96, 72))
    frame = scene.light_frame(eye)
    rays = scene.light_rays()
    truth = scene.shadow_rays(eye, frame, rays).trace()
    floor = (eye.prim == 0) | (eye.prim == 1)
    assert eye.prim.max() == EXACT_IDS + 1 and 0.03 < np.mean(~truth[floor]) < 0.5
    algorithm = UniformShadowMap(256, compare=compare)
    state = algorithm.build(eye, frame, rays)
    lit = np.asarray(algorithm.visibility(state, eye.points)) > 0.5
    # The floor's two triangles are two ids: along their edge "id" alone has holes.
    assert np.mean(lit[floor & ~truth]) < 0.05
    assert np.mean(lit[floor] != truth[floor]) < 0.05


def test_the_scene_says_how_often_ids_mislead():
    (notice,) = load_scene(covered(EXACT_IDS - 3)).notices
    assert notice.startswith("scene 'covered' has 65,537 primitives") and "one in 65,536" in notice
    assert load_scene(covered(EXACT_IDS - 4)).notices == ()
