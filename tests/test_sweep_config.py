"""Sweep files: what trials they come to, what they refuse and where, what trials are known by."""

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hostile.building import BALL, mesh_xml, ply, scene_xml, text_scene
from hypothesis import given
from hypothesis import strategies as st

from asmjax.errors import UseError
from asmjax.scene import BUILTIN
from asmjax.scene.builtin import list_scenes, scene_item
from asmjax.shadow import AdaptiveShadowMap, FilteredShadowMap, PerspectiveShadowMap
from asmjax.sweep import fields
from asmjax.sweep.config import MOST_TRIALS, Sweep, sweep_of
from asmjax.sweep.estimate import estimate
from asmjax.sweep.fields import FIELDS
from asmjax.sweep.identity import canonical, file_content, key_of
from asmjax.sweep.resolve import algorithm_in, settings_table
from asmjax.sweep.trial import algorithm_for
from asmjax.sweep.words import in_words

ROOT = Path(__file__).parents[1]
EXPERIMENTS = sorted((ROOT / "experiments").glob("*.toml"))


@pytest.fixture
def swept(tmp_path):
    """Reads a text as the sweep file mine.toml."""

    def read(text: str, **options) -> Sweep:
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return sweep_of(path, **options)

    return read


def values(sweep: Sweep, *names: str) -> set:
    """What the trials have under some keys, settings among them."""
    return {
        tuple(
            trial.config[name] if name in trial.config else trial.config["settings"][name]
            for name in names
        )
        for trial in sweep.trials
    }


def test_axes_multiply(swept):
    """Each key of the grid, each group that steps together, each list; and what all trials have."""
    sweep = swept(
        """
        deadline_s = 5
        [trial]
        scene = "letter_f"
        algorithm = "uniform"
        settings.bias = 1e-3
        [grid]
        samples = [1, 4]
        settings.resolution = [16, 32, 64]
        [zip.lights]
        view = ["angle", "above"]
        light = ["point", 2]
        [[list.tests]]
        settings = { compare = "both", bias = 1e-4 }
        [[list.tests]]
        """
    )
    assert sweep.name == "mine" and sweep.deadline_s == 5 and sweep.merged == 0
    assert len(sweep.trials) == 2 * 3 * 2 * 2 == len({trial.key for trial in sweep.trials})
    assert values(sweep, "view", "light") == {("angle", "point"), ("above", "directional")}
    assert values(sweep, "samples", "resolution") == {
        (samples, side) for samples in (1, 4) for side in (16, 32, 64)
    }
    # A point that says nothing leaves what all trials have.
    assert values(sweep, "compare", "bias") == {("both", 1e-4), ("depth", 1e-3)}


def test_what_nobody_says_is_filled_in(swept):
    """Said or not, a default is the same trial: the first view, all settings, 16 for 16.0."""
    plain = swept('[trial]\nscene = "letter_f"\n').trials[0]
    said = swept(
        """
        [trial]
        scene = "letter_f"
        view = 0
        light = "point"
        algorithm = "adaptive"
        samples = 1
        memory_mb = 16
        settings = { bias = 5e-6, finest_ratio = 0.0625 }
        """
    ).trials[0]
    assert said == plain
    assert set(plain.config) == {*FIELDS, "content", "settings", "variant", "trust_scene"}
    assert algorithm_in("adaptive", plain.config["settings"]) == AdaptiveShadowMap()
    assert json.loads(json.dumps(plain.config)) == plain.config
    other = swept('[trial]\nscene = "letter_f"\nsettings.bias = 0\n').trials[0]
    assert other.key != plain.key and other.config["settings"]["bias"] == 0.0


def test_combinations_that_come_to_the_same_are_one_trial(swept):
    sweep = swept(
        """
        [grid]
        memory_mb = [1, 1.0, 2]
        view = ["overview", 0, "closeup"]
        """
    )
    assert len(sweep.trials) == 4 and sweep.merged == 5


def test_trials_of_one_view_follow_each_other(swept):
    """Whatever the order of the axes: a scene is loaded once."""
    sweep = swept(
        """
        [grid]
        settings.node_resolution = [8, 16]
        memory_mb = [1, 2]
        scene = ["letter_f", "a1_square", "terrain"]
        samples = [1, 2]
        """
    )
    met = [(trial.config["scene"], trial.config["samples"]) for trial in sweep.trials]
    changes = sum(a != b for a, b in zip(met, met[1:], strict=False))
    assert len(met) == 24 and changes == 5


def test_random_points(swept):
    """They lie in their ranges, are the same for the same seed, and stay as more are drawn."""

    def drawn(count: int, seed: int = 0) -> list:
        sweep = swept(
            f"""
            seed = {seed}
            [trial]
            scene = "letter_f"
            [random.points]
            count = {count}
            settings.finest_ratio = {{ from = 1e-3, to = 1, scale = "log" }}
            settings.least_profit = {{ from = 100, to = 200 }}
            settings.max_passes = {{ from = 1, to = 3, whole = true }}
            settings.node_resolution = {{ choice = [8, 32] }}
            """
        )
        names = ("finest_ratio", "least_profit", "max_passes", "node_resolution")
        return sorted(values(sweep, *names))

    few, many = drawn(5), drawn(200)
    assert len(few) == 5 and len(many) == 200 and set(few) < set(many)
    assert drawn(5) == few != drawn(5, seed=1)
    ratios, profits, passes, nodes = zip(*many, strict=True)
    assert all(1e-3 <= ratio <= 1 and float(f"{ratio:.6g}") == ratio for ratio in ratios)
    assert 70 < sum(ratio < 10**-1.5 for ratio in ratios) < 130
    assert all(100 <= profit <= 200 for profit in profits)
    assert 70 < sum(profit < 150 for profit in profits) < 130
    assert {*passes} == {1, 2, 3} and {*nodes} == {8, 32}
    assert min(passes.count(number) for number in (1, 2, 3)) > 40


def test_memory_is_said_for_every_algorithm(swept):
    """The adaptive map's limit; of others the texels that fill it, once the faces are known."""
    sweep = swept(
        """
        [trial]
        memory_mb = 1
        [grid]
        algorithm = ["adaptive", "uniform", "subdivided", "filtered"]
        """
    )
    config = {trial.config["algorithm"]: trial.config for trial in sweep.trials}

    def made(family: str, faces: int) -> Any:
        return algorithm_for(config[family], faces)

    assert config["adaptive"]["settings"]["memory_bytes"] == 2**20
    assert {config[name]["memory_mb"] for name in config} == {1.0}
    for faces, side in ((1, 512), (4, 256)):
        assert made("uniform", faces).resolution == side
        assert made("subdivided", faces).resolution == side
        assert made("filtered", faces).inner.resolution == side
        assert made("adaptive", faces).memory_bytes == 2**20


@pytest.mark.parametrize(
    "algorithm",
    [
        PerspectiveShadowMap(slide=math.inf),
        FilteredShadowMap(inner=AdaptiveShadowMap(time_limit=0.5), width=2.0),
    ],
    ids=lambda algorithm: algorithm.name,
)
def test_settings_survive_as_plain_values(algorithm):
    table = settings_table(algorithm)
    family = {"PerspectiveShadowMap": "perspective", "FilteredShadowMap": "filtered"}
    again = algorithm_in(family[type(algorithm).__name__], json.loads(canonical(table)))
    assert again == algorithm


REFUSED = {
    "file key": ("[tril]\n", r"unknown key 'tril'; known: .*Did you mean 'trial'\?"),
    "above": ("samples = 4\n", r"samples is said of trials; write it below \[trial\]"),
    "in smoke": ("[smoke]\nname = 'x'\n", r"smoke: unknown key 'name'"),
    "trial key": ("[trial]\nscen = 'terrain'\n", r"trial: unknown key 'scen'.*mean 'scene'"),
    "axis key": ("[grid]\nsample = [1]\n", r"grid: unknown key 'sample'.*mean 'samples'"),
    "setting": (
        "[grid]\nsettings.node_resoluton = [8]\n",
        r"grid\.settings\.node_resoluton\[0\]: unknown adaptive setting.*mean 'node_resolution'",
    ),
    "of another": (
        "[trial]\nsettings.cells = 4\n[[list.maps]]\n[[list.maps]]\nalgorithm = 'uniform'\n",
        r"trial\.settings\.cells: unknown uniform setting 'cells'",
    ),
    "scene": ("[grid]\nscene = ['terrain', 'terain']\n", r"grid\.scene\[1\]: .*mean 'terrain'"),
    "size of a scene": ("[trial]\nscene = 'plant:7'\n", r"trial\.scene: .*allowed is 10000"),
    "no size": ("[trial]\nscene = 'terrain:1m'\n", r"trial\.scene: .*has one size"),
    "file": ("[trial]\nscene = 'no/such.xml'\n", r"trial\.scene: there is no scene file"),
    "view": ("[trial]\nview = 'close'\n", r"trial\.view: unknown view.*mean 'closeup'"),
    "light": ("[trial]\nlight = 3\n", r"trial\.light: unknown light .*Indices 0 to 0"),
    "algorithm": ("[grid]\nalgorithm = ['unifrm']\n", r"grid\.algorithm\[0\]: .*mean 'uniform'"),
    "value": (
        "[grid]\nsettings.node_resolution = [16, 24]\n",
        r"grid\.settings\.node_resolution\[1\]: a node resolution of 24 is not supported; allowed",
    ),
    "kind": ("[trial]\nsamples = '4'\n", r'trial\.samples is "4"; allowed: a whole number'),
    "float": ("[grid]\nsamples = [4.0]\n", r"grid\.samples\[0\] is 4\.0; allowed: a whole number"),
    "flag": ("[trial]\nsamples = true\n", r"trial\.samples is true; allowed: a whole number"),
    "nan": ("[grid]\nmemory_mb = [1, nan]\n", r"grid\.memory_mb\[1\] is nan; allowed: a number"),
    "inf": ("[trial]\nlight_angle_deg = inf\n", r"light_angle_deg is inf; allowed"),
    "nan setting": ("[grid]\nsettings.bias = [nan]\n", r"grid\.settings\.bias\[0\] is nan"),
    "inf setting": ("[trial]\nsettings.bias = inf\n", r"trial\.settings\.bias: bias is inf"),
    "nan deadline": ("deadline_s = nan\n", r"deadline_s is nan; allowed: seconds"),
    "name": ("name = '../x'\n", r"name is \"\.\./x\"; allowed: up to 64 letters"),
    "size": ("[grid]\nsize = [64, 64]\n", r"grid\.size\[0\] is 64; allowed: a list of two"),
    "no list": ("[grid]\nsamples = 4\n", r"grid\.samples is 4; allowed: a list of values"),
    "empty": ("[grid]\nsamples = []\n", r"grid\.samples has 0 values; allowed: 1 to"),
    "table": ("trial = 3\n", r"trial is 3; allowed: a table"),
    "settings": ("[grid]\nsettings = [1]\n", r"grid\.settings is \[1\]; allowed: a table"),
    "no group": ("[zip]\nview = [0, 1]\n", r"zip\.view is \[0, 1\]; allowed: a group.*\[zip\.NAME"),
    "lengths": (
        "[zip.a]\nview = [0, 1]\nlight = [0]\n",
        r"zip\.a has lists of 2, 1 values, which cannot step together",
    ),
    "twice": (
        "[grid]\nview = [0]\n[zip.a]\nview = [0]\n",
        r"view is said by grid\.view and by zip\.a; leave it out of one",
    ),
    "count": ("[random.a]\nsettings.bias = {from = 0, to = 1}\n", r"random\.a\.count is missing"),
    "range": (
        "[random.a]\ncount = 2\nsettings.bias = {from = 1, to = 0}\n",
        r"random\.a\.settings\.bias is from 1 to 0; give the smaller",
    ),
    "log": (
        "[random.a]\ncount = 2\nsettings.bias = {from = 0, to = 1, scale = 'log'}\n",
        r"random\.a\.settings\.bias\.from is 0; allowed with scale",
    ),
    "drawn": (
        "[random.a]\ncount = 2\nsamples = {from = 1, to = 8}\n",
        r"random\.a\.samples is .*; allowed: a whole number",
    ),
    "spread": (
        "[random.a]\ncount = 2\nsettings.bias = {form = 1, to = 2}\n",
        r"random\.a\.settings\.bias: unknown key 'form'.*mean 'from'",
    ),
    "memory twice": (
        "[grid]\nmemory_mb = [1]\n[trial]\nsettings.memory_bytes = 4096\n",
        r"grid\.memory_mb\[0\] and trial\.settings\.memory_bytes both say how large",
    ),
    "memory and side": (
        "[trial]\nalgorithm = 'uniform'\nmemory_mb = 1\nsettings.resolution = 8\n",
        r"trial\.memory_mb and trial\.settings\.resolution both say how large",
    ),
    "lights": (
        "[trial]\nlight = 0\nlight_angle_deg = 10\n",
        r"trial\.light_angle_deg and trial\.light both say where the light is",
    ),
    "too many": (
        "[random.a]\ncount = 1000\nseed = {from = 0, to = 9, whole = true}\n"
        f"[grid]\nrepeats = {list(range(1, 102))}\n",
        r"its axes have 101000 combinations; allowed: 100000",
    ),
    "digits": ("[trial]\nsamples = 0x" + "f" * 9000 + "\n", r"trial\.samples is a number of "),
    "no TOML": ("[trial\n", r"is no TOML: .*line 1"),
    "deep": ("[trial]\nsettings" + ".inner.settings" * 9 + ".bias = 1\n", r"deeper than 8 names"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_told_with_its_place(case, swept):
    """In one line that names the file."""
    text, said = REFUSED[case]
    with pytest.raises(UseError, match=said) as raised:
        swept(text)
    message = str(raised.value)
    assert "mine.toml'" in message and "\n" not in message and len(message) < 2500


def test_a_small_size_is_in_the_same_file(swept):
    """What [smoke] says stands in place of what the file says of the same keys and groups."""
    text = """
        deadline_s = 100
        [trial]
        scene = "letter_f"
        size = [512, 512]
        samples = 2
        [grid]
        memory_mb = [1, 2, 4, 8]
        repeats = [1, 2]
        [[list.views]]
        view = "angle"
        [[list.views]]
        view = "above"
        [smoke]
        deadline_s = 10
        [smoke.trial]
        size = [32, 32]
        [smoke.grid]
        memory_mb = [1]
        [[smoke.list.views]]
        view = "above"
    """
    whole, small = swept(text), swept(text, smoke=True)
    assert (whole.name, len(whole.trials), whole.deadline_s) == ("mine", 16, 100)
    assert (small.name, len(small.trials), small.deadline_s) == ("mine-smoke", 2, 10)
    assert values(small, "view", "samples", "repeats") == {("above", 2, 1), ("above", 2, 2)}
    assert all(trial.config["size"] == [32, 32] for trial in small.trials)
    with pytest.raises(UseError, match=r"no table \[smoke\] says what the small size is"):
        swept("[grid]\nrepeats = [1]\n", smoke=True)
    # Also where nobody asks for it.
    with pytest.raises(UseError, match=r"smoke\.trial: unknown key 'siz'"):
        swept("[smoke.trial]\nsiz = [1, 1]\n")


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_experiments_say_how_many_trials_they_are(path):
    """In their first lines, with the question and the command; of the small size too."""
    text = path.read_text(encoding="utf-8")
    head = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
    assert "?" in head and f"asmjax sweep experiments/{path.name}" in head
    counts = [int(count) for count in re.findall(r"(\d+) trials", head)]
    sizes = (False, True) if "[smoke" in text else (False,)
    assert [len(sweep_of(path, smoke=smoke).trials) for smoke in sizes] == counts
    readme = (ROOT / "experiments/README.md").read_text(encoding="utf-8")
    assert f"`{path.name}`" in readme


def test_the_page_of_keys_is_up_to_date():
    """As the code writes it: `python -m asmjax.sweep.fields docs/sweeps.md`."""
    page = (ROOT / "docs/sweeps.md").read_text(encoding="utf-8")
    assert page == fields.written_into(page)


def test_example_of_the_page_is_a_sweep(swept):
    """18 trials, as the page says."""
    page = (ROOT / "docs/sweeps.md").read_text(encoding="utf-8")
    example = page.partition("```toml\n")[2].partition("```")[0]
    assert len(swept(example).trials) == 18 and "18 trials" in page


CONFIG = {"b": [1, 2.5, None], "a": {"x": 0.1, "y": 1e-300, "z": "é"}, "scene": "here"}
KEY = "6d4970e7dd86f562a8cc68bba3bb177d"


def test_keys_are_the_same_everywhere():
    """In another process, another order and another Python; wherever the scene's file lies."""
    assert canonical(CONFIG) == (
        '{"a":{"x":0.1,"y":1e-300,"z":"\\u00e9"},"b":[1,2.5,null],"scene":"here"}'
    )
    key = key_of(CONFIG)
    assert key == KEY
    assert key_of({**dict(reversed(CONFIG.items())), "scene": "there", "trust_scene": True}) == key
    assert key_of({**CONFIG, "b": [1.0, 2.5, None]}) != key
    program = f"from asmjax.sweep.identity import key_of; print(key_of({CONFIG!r}))"
    made = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONHASHSEED": "99"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert made.stdout.strip() == key
    with pytest.raises(ValueError, match="not JSON compliant"):
        canonical(math.nan)


def folder_scene(folder: Path, x: float = 0.0) -> Path:
    """A scene that includes another file, which names a mesh with a vertex at `x`."""
    folder.mkdir()
    corners = ((x, 0.0, 4.0), (1.0, 0.0, 4.0), (0.0, 1.0, 4.0))
    (folder / "mesh.ply").write_bytes(ply(corners))
    (folder / "part.xml").write_text(f'<scene version="3.0.0">{mesh_xml("mesh.ply")}</scene>')
    return text_scene(folder, scene_xml(BALL, '<include filename="part.xml"/>'))


@pytest.mark.parametrize("trust", [False, True])
def test_a_scene_file_is_known_by_all_that_it_reads(trust, tmp_path, swept):
    """Wherever it lies and whatever lies beside it; one bit of a mesh makes another scene."""
    first, second, other = (
        folder_scene(tmp_path / name, x) for name, x in (("a", 0.0), ("b", 0.0), ("c", 1e-6))
    )
    (second.parent / "notes.txt").write_text("not read")
    content = file_content(first, trust)
    assert content == file_content(second, trust) == file_content(first, not trust)
    assert content != file_content(other, trust)
    one, same, another = (
        swept(f'[trial]\nscene = "{name}/scene.xml"\nview = 0\n', trust_scene=trust).trials[0]
        for name in "abc"
    )
    assert one.key == same.key != another.key
    assert one.config["scene"] == str(first) and one.config["view"] == "0"
    assert one.config["trust_scene"] is trust


def test_a_hostile_scene_is_refused_unless_it_is_trusted(tmp_path, swept):
    """As by every other command; the file cannot ask for trust itself."""
    text_scene(tmp_path, scene_xml(BALL, '<shape type="made_up"/>'))
    text = '[trial]\nscene = "scene.xml"\n'
    with pytest.raises(UseError, match=r"trial\.scene: .*unknown plugin type 'made_up'"):
        swept(text)
    assert len(swept(text, trust_scene=True).trials) == 1
    with pytest.raises(UseError, match="unknown key 'trust_scene'"):
        swept(f"{text}trust_scene = true\n")


def test_scenes_are_described_without_being_built():
    """As the list has them; of another size with its triangles."""
    assert [scene_item(item.name) for item in list_scenes()] == list_scenes()
    assert {item.name for item in list_scenes()} == {*BUILTIN}
    large = scene_item("plant:12m")
    assert (large.name, large.triangles) == ("plant:12m", 12_000_000)
    assert large.views == scene_item("plant").views


def test_estimates_grow_with_what_there_is_to_do(swept):
    """With trials, pixels, triangles and repeats; less with more workers; nothing for nothing."""

    def seconds(text: str, workers: int = 1) -> float:
        return estimate(swept(text).trials, workers).seconds

    base = '[trial]\nscene = "letter_f"\nsize = [64, 64]\n'
    least = seconds(base)
    for more in (
        base.replace("64, 64", "512, 512"),
        base.replace("letter_f", "surface:12m"),
        base + "repeats = 1000\n",
        base + "[grid]\nsettings.bias = [0, 1e-6, 1e-5]\n",
    ):
        assert seconds(more) > least
    many = base + "repeats = 1000\n[grid]\nsettings.bias = [0, 1e-6, 1e-5]\n"
    assert seconds(many, 4) < seconds(many, 2) < seconds(many)
    assert estimate([], 2).seconds == 0
    assert [in_words(s) for s in (0.2, 40, 150, 7200)] == ["1 s", "40 s", "2 min", "2.0 h"]


SCALARS = st.sampled_from(
    [0, 1, 2, 16, 64, -1, 2**31, 2**70, 0.5, 1e-300, 1e300, math.nan, math.inf, True, "", "terrain",
     "letter_f", "uniform", "adaptive", "depth", "angle", "x" * 99, "\0", "\n", [], [1, 2], {}]
)  # fmt: skip
NAMES = st.sampled_from([*FIELDS, "settings", "count", "smaples", "from", "", "é\n", "a b"])
SETTINGS = st.sampled_from(["bias", "resolution", "cells", "memory_mb", "inner", "bais"])
TABLES = st.dictionaries(NAMES, SCALARS, max_size=2) | st.fixed_dictionaries(
    {"settings": st.dictionaries(SETTINGS, SCALARS, min_size=1, max_size=2)}
)
LISTS = st.dictionaries(NAMES, st.lists(SCALARS, max_size=3), max_size=2)
RANDOM = st.fixed_dictionaries(
    {"count": st.sampled_from([1, 3, 0, "2"])},
    optional={
        "samples": st.fixed_dictionaries({"from": SCALARS, "to": SCALARS}) | SCALARS,
        "view": st.fixed_dictionaries({"choice": st.lists(SCALARS, max_size=2)}),
    },
)
FILES = st.fixed_dictionaries(
    {"trial": TABLES},
    optional={
        "grid": LISTS,
        "zip": st.dictionaries(st.sampled_from(["a", "b"]), LISTS, max_size=2) | LISTS,
        "list": st.dictionaries(st.just("a"), st.lists(TABLES, max_size=2)) | TABLES,
        "random": st.dictionaries(st.just("a"), RANDOM),
        "deadline_s": SCALARS,
        "gird": SCALARS,
    },
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("sweeps")


@given(document=FILES)
def test_any_file_is_a_sweep_or_refused_with_a_place(document, folder):
    """Never another error; and what is accepted can be stored, and run as far as its algorithm."""
    path = folder / "any.toml"
    path.write_text(tomli_w.dumps(document), encoding="utf-8")
    try:
        sweep = sweep_of(path)
    except UseError as problem:
        message = str(problem)
        assert message.startswith("sweep file '") and message.isprintable()
        assert any(name in message for name in document), (document, message)
        return
    assert 1 <= len(sweep.trials) <= MOST_TRIALS
    for trial in sweep.trials:
        assert key_of(json.loads(canonical(trial.config))) == trial.key
        assert algorithm_in(trial.config["algorithm"], trial.config["settings"]).name
