"""`asmjax plan`: files, materials of Mitsuba scenes, that planning changes no run, wrong use."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.figures import texels_over, words
from helpers.mitsuba_scenes import pinhole, real_scene

from asmjax import cli
from asmjax.errors import UseError
from asmjax.options import PlanOptions, RunOptions, force_of
from asmjax.report import InvalidReport, validate_report
from asmjax.report.figures.plan import LightPanel, draw_plan
from asmjax.report.keys import key_paths
from asmjax.report.outputs import PLAN
from asmjax.report.plan_schema import PLAN_KEYS
from asmjax.report.plan_table import plan_table
from asmjax.report.schema import RUN_KEYS
from asmjax.report.table import MAX_WIDTH
from asmjax.scene.materials import even_directions

DOCS = Path(__file__).parents[1] / "docs"
GREY = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The plan of a small built-in scene with three lights, with everything written."""
    from asmjax.plan_job import run_plan

    out = tmp_path_factory.mktemp("plan") / "out"
    options = PlanOptions(scene="letter_f", size=(96, 64), quiet=True, out=str(out))
    return run_plan(options), out


@pytest.fixture(scope="module")
def report(result) -> dict:
    return json.loads((result[1] / "report.json").read_text(encoding="utf-8"))


@pytest.mark.mitsuba
def test_everything_is_written_and_valid(result, report):
    """The report follows its schema and says what the plan says; nothing is soft without a size."""
    plan, out = result[0].plan, result[1]
    validate_report(report)
    assert report["schema"] == "asmjax/plan/1" and report["size"] == [96, 64]
    assert {path.name for path in out.iterdir()} == {*PLAN, "report.json"}
    assert [decision["kind"] for decision in report["plan"]["decisions"]] == ["hard"] * 3
    assert set(plan.lights) == {"point", "spot", "directional"}
    assert all(plan.methods_for(light) == ("adaptive",) for light in plan.lights)
    assert report["plan"]["probe_rays"] == plan.probe_rays < 5 * 4096
    skipped = [item["effect"] for item in report["plan"]["skipped"]]
    assert skipped.count("penumbra") == 3 and "transmittance" in skipped
    lines = plan_table(plan).splitlines()
    assert len(lines) == 3 + 3 and max(map(len, lines)) <= MAX_WIDTH
    for line in plan.explain().splitlines():
        assert len(line) <= 100


@pytest.mark.mitsuba
def test_planning_changes_no_map():
    """Rationale: what a plan skips is free. A map that is made after planning casts the same rays
    in the same passes and traces nothing that it would not have traced."""
    from asmjax import AdaptiveShadowMap, load_scene, plan_effects
    from asmjax.experiment.traces import counted_traces
    from asmjax.shadow.adaptive import CostModel

    scene = load_scene("letter_f")
    eye = scene.eye(scene.view("angle").resized(48, 48))
    frame, rays = scene.light_frame(eye, "point"), scene.light_rays("point")
    algorithm = AdaptiveShadowMap(
        memory_bytes=2**19, start_resolution=64, cost_model=CostModel(1e-8, 1e-4, 0.0)
    )

    def made():
        state = algorithm.build(eye, frame, rays)
        lit = np.asarray(algorithm.visibility(state, eye.points))
        cost = algorithm.cost(state)
        return lit, (cost.rays, cost.passes, cost.bytes)

    first = made()
    plan = plan_effects(scene, "angle", lights=["point"])
    assert plan.methods_for("point") == ("adaptive",)
    everything = plan_effects(scene, "angle")
    assert plan.numbers == tuple(each for each in everything.numbers if each.name == "point")
    with counted_traces() as traced:
        second = made()
    assert traced == [] and second[1] == first[1]
    np.testing.assert_array_equal(second[0], first[0])


def room(mi, pane: dict, light: dict, **more) -> dict:
    """A floor with a pane one unit above it, seen from the side."""
    floor = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(4.0), "bsdf": GREY}
    lifted = mi.ScalarTransform4f().translate([0, 0, 1])
    return {
        "type": "scene",
        "sensor": pinhole(mi, (0.0, -4.0, 3.0), size=(128, 128), up=(0, 0, 1)),
        "floor": floor,
        "pane": {"type": "rectangle", "to_world": lifted, **pane},
        "light": light,
        **more,
    }


POINT = {"type": "point", "position": [0.0, 0.0, 3.0], "intensity": {"type": "rgb", "value": 2.0}}


def mask(opacity) -> dict:
    return {"bsdf": {"type": "mask", "opacity": opacity, "nested": GREY}}


@pytest.mark.mitsuba
def test_a_masked_pane_flips_at_the_opacity_that_it_should():
    """A pane of opacity a lets (1 - a) x its shadow's part of the picture through."""
    import asmjax
    from asmjax.render.variant import activate

    mi = activate()
    opaque = asmjax.plan_effects(asmjax.load_scene(room(mi, {"bsdf": GREY}, POINT)))
    assert [decision.kind for decision in opaque.decisions] == ["hard"]
    dark = opaque.numbers[0].shadowed
    assert dark is not None
    shaded = dark * opaque.numbers[0].facing
    assert 0.02 < shaded < 0.5
    for part, kinds in ((0.95, ["hard"]), (1.05, ["hard", "transmittance"])):
        pane = mask(1 - part * 0.01 / shaded)
        plan = asmjax.plan_effects(asmjax.load_scene(room(mi, pane, POINT)), tolerance=0.01)
        assert [decision.kind for decision in plan.decisions] == kinds
        assert plan.numbers[0].transmitted == pytest.approx(part * 0.01, rel=1e-3)


@pytest.mark.mitsuba
def test_materials_of_a_mitsuba_scene():
    """Opaque, masked by a number and by a texture, null around a medium, thin and thick glass."""
    from asmjax import load_scene
    from asmjax.render.materials import materials_of, surroundings_of
    from asmjax.render.variant import activate

    mi = activate()
    half = np.zeros((4, 4, 1), np.float32)
    half[:2] = 1
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(half), "raw": True, "filter_type": "nearest"}
    medium = {
        "type": "homogeneous",
        "sigma_t": {"type": "spectrum", "value": 1.5},
        "albedo": {"type": "rgb", "value": 0.5},
    }
    scene = load_scene(
        room(
            mi,
            mask(0.25),
            POINT,
            leaf={"type": "rectangle", **mask(texture)},
            fog={"type": "cube", "bsdf": {"type": "null"}, "interior": medium},
            window={"type": "rectangle", "bsdf": {"type": "thindielectric"}},
            glass={"type": "sphere", "bsdf": {"type": "dielectric"}},
            sky={"type": "constant", "radiance": {"type": "rgb", "value": 0.3}},
        )
    )
    materials = materials_of(scene)
    both = zip(materials.straight, materials.textured, strict=True)
    found = dict(zip(scene.shape_names, both, strict=True))
    assert found["floor"] == (0.0, False)
    assert found["pane"] == (pytest.approx(0.75, abs=1e-3), False)
    assert found["leaf"] == (pytest.approx(0.5, abs=1e-3), True)
    assert found["fog"] == (1.0, False)
    reflected = ((1.5046 - 1.000277) / (1.5046 + 1.000277)) ** 2
    thin = 1 - 2 * reflected / (1 + reflected)
    assert found["window"] == (pytest.approx(thin, abs=1e-3), False)
    assert found["glass"] == (0.0, False)
    glass = scene.shape_names.index("glass")
    assert np.flatnonzero(materials.refracts).tolist() == [glass]
    fog = scene.shape_names.index("fog")
    assert materials.extinction[fog] == pytest.approx(1.5) and materials.extinction.sum() < 1.6
    assert materials.transmits and not materials.opaque
    (sky,) = surroundings_of(scene)
    assert sky.name == "sky" and sky.luminance.shape == sky.directions[0].shape
    np.testing.assert_allclose(sky.luminance, 0.3, rtol=1e-3)


@pytest.mark.mitsuba
def test_the_sun_is_no_part_of_its_own_sky():
    """A sun ten degrees across stands before a direction that is looked at: what is around it is as
    bright as without it."""
    from asmjax import load_scene
    from asmjax.render.materials import surroundings_of
    from asmjax.render.variant import activate

    mi = activate()
    towards = even_directions()[:, 60]
    assert towards[2] > 0.5
    floors = []
    for scale in (1.0, 0.0):
        words = {"sun_direction": towards.tolist(), "sun_aperture": 10.0, "sun_scale": scale}
        scene = load_scene(room(mi, {"bsdf": GREY}, {"type": "sunsky", "id": "sky", **words}))
        assert list(scene.lights) == (["sky"] if scale else [])
        (sky,) = surroundings_of(scene)
        assert sky.luminance.size == even_directions().shape[1] - bool(scale)
        floors.append(sky.irradiance(np.array([[0.0], [0.0], [1.0]])))
    assert floors[0] > 0 and floors[0] == pytest.approx(floors[1], rel=0.05)


@pytest.mark.mitsuba
def test_a_soft_light_of_a_mitsuba_scene():
    """A rectangle that emits: soft, by what the registry has for it; forced hard on demand."""
    import asmjax
    from asmjax.render.variant import activate

    mi = activate()
    down = mi.ScalarTransform4f().translate([0, 0, 3]).rotate([1, 0, 0], 180).scale(0.3)
    radiance = {"type": "rgb", "value": 5.0}
    lamp = {
        "type": "rectangle", "to_world": down, "bsdf": GREY,
        "emitter": {"type": "area", "radiance": radiance, "id": "lamp"},
    }  # fmt: skip
    scene = asmjax.load_scene(room(mi, {"bsdf": GREY}, lamp))
    (name,) = scene.lights
    plan = asmjax.plan_effects(scene)
    assert plan.decision(name).kind == "soft"
    # Half side 0.3, 2 above the pane and 3 above the floor: 0.3 wide on the floor.
    focal = 64 / np.tan(np.radians(39.3076 / 2))
    assert 0.3 * focal / 6 < plan.numbers[0].width_p50 < 0.3 * focal / 4
    forced = asmjax.plan_effects(scene, force={name: "hard"})
    assert forced.decision(name).kind == "hard"
    assert [item.effect for item in forced.not_simulated] == ["penumbra"]


@pytest.mark.mitsuba
def test_a_light_with_a_texture_is_named():
    """Half of it dark: it varies by as much as it is bright. Of a chessboard the scene does not
    tell how bright it is, and that is said."""
    import asmjax
    from asmjax.render.variant import activate

    mi = activate()
    half = np.zeros((4, 4, 1), np.float32)
    half[:2] = 2
    bitmap = {"type": "bitmap", "bitmap": mi.Bitmap(half), "raw": True, "filter_type": "nearest"}
    down = mi.ScalarTransform4f().translate([0, 0, 3]).rotate([1, 0, 0], 180).scale(0.3)
    for radiance, spread in ((bitmap, 1.0), ({"type": "checkerboard"}, None)):
        emitter = {"type": "area", "radiance": radiance, "id": "lamp"}
        lamp = {"type": "rectangle", "to_world": down, "bsdf": GREY, "emitter": emitter}
        scene = asmjax.load_scene(room(mi, {"bsdf": GREY}, lamp))
        plan = asmjax.plan_effects(scene)
        (numbers,), (missing,) = plan.numbers, plan.not_simulated
        assert numbers.spread == (None if spread is None else pytest.approx(spread, rel=1e-3))
        assert missing.effect == "textured light"
        assert missing.error == pytest.approx(numbers.soft_error, rel=1e-3)
        assert any("taken for 1" in note for note in plan.notes) is (spread is None)
        assert scene.light().intensity == pytest.approx(1.0, rel=1e-3)


@pytest.mark.mitsuba
def test_what_only_a_point_stands_for_is_said():
    """A cube that emits is a point; its penumbrae are missing, about those of a sphere as large. A
    projector is left out, and named."""
    import asmjax
    from asmjax.render.variant import activate

    mi = activate()
    place = mi.ScalarTransform4f().translate([0, 0, 3])
    radiance = {"type": "rgb", "value": 5.0}
    emits = {"emitter": {"type": "area", "radiance": radiance}}
    radius = 0.2 * np.sqrt(6 / np.pi)
    cube = {"type": "cube", "to_world": place.scale(0.2), **emits}
    ball = {"type": "sphere", "center": [0, 0, 3], "radius": radius, **emits}
    plans = [
        asmjax.plan_effects(asmjax.load_scene(room(mi, {"bsdf": GREY}, lamp)))
        for lamp in (cube, ball)
    ]
    hard, soft = (plan.decisions[0] for plan in plans)
    assert (hard.kind, soft.kind) == ("hard", "soft")
    (missing,) = plans[0].not_simulated
    assert missing.effect == "penumbra" and missing.error == pytest.approx(soft.error, rel=0.02)
    look = mi.ScalarTransform4f().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])
    projector = {"type": "projector", "fov": 45, "to_world": look}
    plan = asmjax.plan_effects(asmjax.load_scene(room(mi, {"bsdf": GREY}, projector)))
    assert plan.lights == () and [item.effect for item in plan.not_simulated] == ["a light"]


@pytest.mark.mitsuba
def test_the_cornell_box_is_soft(capsys, tmp_path):
    """From the command line, with table and reasons printed."""
    out = tmp_path / "out"
    scene = real_scene("cornell_box")
    assert cli.main(["plan", scene, "--size", "128", "128", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "soft" in printed and "penumbrae are" in printed and "skipped:" in printed
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    (decision,) = report["plan"]["decisions"]
    assert decision["kind"] == "soft" and decision["error"] > report["plan"]["tolerance"]


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["letter_f", "--tolerance", "-1"], "--tolerance is -1"),
        (["letter_f", "--force", "sfot"], "Did you mean 'soft'"),
        (["letter_f", "--force", "point=soft", "point=hard"], "two things of light 'point'"),
        (["letter_f", "--force", "sun=soft"], "unknown light to force 'sun'"),
        (["letter_f", "--lights", "pint"], "Did you mean 'point'"),
        (["letter_f", "--view", "nowhere"], "nowhere"),
    ],
)
def test_wrong_use_is_one_line_and_leaves_nothing(words, said, tmp_path, capfd):
    out = tmp_path / "out"
    assert cli.main(["plan", *words, "--out", str(out)]) == 2
    printed = capfd.readouterr().err.strip()
    assert printed.startswith("asmjax: error: ") and printed.count("\n") == 0
    assert said in printed
    assert not out.exists()


def test_words_of_force():
    assert force_of([]) == {}
    assert force_of(["soft", "lamp=hard", "a=b=none"]) == {
        "*": "soft", "lamp": "hard", "a=b": "none"
    }  # fmt: skip
    with pytest.raises(UseError, match="all lights: soft and hard"):
        force_of(["soft", "hard"])


@pytest.mark.parametrize("options", [PlanOptions, RunOptions])
@pytest.mark.parametrize("words", [("all",), ("lamp=sfot",), ("soft", "hard")])
def test_wrong_words_of_force_cost_no_scene(options, words):
    """They are refused when options are made."""
    with pytest.raises(UseError, match="effect to force|two things"):
        options(force=words)


@pytest.mark.mitsuba
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p["decisions"][0].update(kind="dark"), "decisions[0].kind: 'dark' is none of"),
        (lambda p: p["decisions"][1].update(light="sun"), "decisions[1].light: 'sun' has no entry"),
        (lambda p: p["numbers"][0].update(share=1.5), "plan.numbers[0].share: expected a number"),
        (lambda p: p.pop("skipped"), "plan.skipped: missing"),
    ],
)
def test_a_report_that_breaks_its_schema_is_named(report, change, said):
    broken = json.loads(json.dumps(report))
    change(broken["plan"])
    with pytest.raises(InvalidReport) as problem:
        validate_report(broken)
    assert said in str(problem.value)


def test_every_key_is_documented():
    """What a plan has in common with a run stands under the run."""
    text = (DOCS / "plans.md").read_text(encoding="utf-8")
    common = {path for path, _ in key_paths(RUN_KEYS)}
    for path, key in key_paths(PLAN_KEYS):
        assert key.means
        short = path.removesuffix("[]")
        assert path in common or f"`{short}`" in text or f"`{path}." in text, path
    assert all(f"`{file}`" in text for file in PLAN)


def test_the_page_of_effects_states_the_thresholds():
    """Numbers in prose are those of the code."""
    from asmjax.effects import TOLERANCE, decide, missing, probe, widths

    text = (DOCS / "effects.md").read_text(encoding="utf-8")
    for number in (
        f"{TOLERANCE:g}", f"{decide.SUBPIXEL:g} px", f"{decide.NARROW:g} px",
        f"{decide.WIDE:g} px", f"{decide.LEAST_UMBRA:g}", f"{missing.VERY_LARGE_SR:g} sr",
        f"{probe.PIXELS:,}", f"{widths.TEXELS} x {widths.TEXELS}",
    ):  # fmt: skip
        assert number in text, number


def test_the_figure_shows_widths_where_a_light_has_a_size():
    """A row for each light with widths beside it; a grid where none has a size; notes below."""
    picture = np.full((8, 8, 3), 128, np.uint8)
    widest = np.zeros((8, 8))
    widest[2:5] = np.array([[2.0], [8.0], [32.0]])
    lamp = LightPanel("lamp: soft", "as seen", picture, widest, "median 8 px")
    spot = LightPanel("spot: hard", "a spot has no penumbra", picture)
    figure = draw_plan([lamp, spot], "room", ["Skipped: nothing."])
    assert len(texels_over(figure)) == 3
    assert {"a spot has no penumbra", "median 8 px", "Skipped: nothing."} <= set(words(figure))
    image = np.asarray(texels_over(figure)[2].get_images()[0].get_array())[..., :3]
    assert len(np.unique(image.reshape(-1, 3), axis=0)) == 4
    many = draw_plan([spot] * 7, "room")
    assert len(texels_over(many)) == 6 and any("Not drawn: spot" in text for text in words(many))
