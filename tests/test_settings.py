"""Settings files: read strictly, written exactly, refused in one line, documented in full."""

import math
import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asmjax.analyze_job import algorithms_of, analyse_scene
from asmjax.errors import UseError
from asmjax.options import AnalyzeOptions, RunOptions
from asmjax.preparation import ChosenMaps, chosen_maps
from asmjax.report import METHOD_KINDS
from asmjax.report.figures.families import FAMILY_LOOKS, look_of
from asmjax.shadow import (
    ALGORITHMS,
    AdaptiveShadowMap,
    CostModel,
    FilteredShadowMap,
    LightSpaceShadowMap,
    LogarithmicShadowMap,
    PartitionedShadowMap,
    PerspectiveShadowMap,
    UniformShadowMap,
    algorithm_of,
    family_of,
    read_settings,
    settings_page,
    settings_text,
    write_settings,
)
from asmjax.shadow.filtered import KERNELS
from asmjax.shadow.settings import meanings, setting_types
from asmjax.toml_files import LARGEST_FILE

PAGE = Path(__file__).parents[1] / "docs/settings.md"


def numbers(least: float, most: float):
    """Numbers in a range, whole ones among them."""
    whole = st.integers(math.ceil(least), math.floor(min(most, 2**40)))
    return st.floats(least, most, allow_nan=False, allow_infinity=False) | whole


COMMON = {
    "resolution": st.integers(1, 2**13),
    "compare": st.sampled_from(("depth", "id", "both")),
    "bias": numbers(0, 1),
}
WARP = st.sampled_from(("none", "light-space"))
SETTINGS: dict[str, dict[str, Any]] = {
    "uniform": {**COMMON, "keep": st.booleans()},
    "adaptive": {
        "memory_bytes": st.integers(1, 2**45),
        "time_limit": st.none() | st.floats(1e-6, 1e6),
        "node_resolution": st.sampled_from((8, 16, 32, 64, 128, 256, 512)),
        "cells": st.sampled_from((2, 4, 8)),
        "start_resolution": st.none() | st.sampled_from((512, 1024, 2**14)),
        "ratio_target": numbers(1, 1e9),
        "measure": st.sampled_from(("axis", "area", "mipmap", "mipmap_anisotropic")),
        "pixel_share": st.sampled_from((1, 2, 4, 8)),
        "compare": COMMON["compare"],
        "bias": COMMON["bias"],
        "discontinuity": numbers(0, 1e3),
        "least_profit": numbers(0, 1e12),
        "cover": st.booleans(),
        "finest_ratio": st.floats(1e-9, 1),
        "max_passes": st.integers(1, 10**6),
    },
    "perspective": {**COMMON, "slide": numbers(0, 1e300) | st.just(math.inf)},
    "light-space": {**COMMON, "falloff": st.sampled_from(("sine", "shaped", "none"))},
    "trapezoidal": {**COMMON, "focus": st.none() | st.floats(1e-9, 1e9)},
    "logarithmic": {
        **COMMON,
        "across": st.sampled_from(("perspective", "uniform")),
        "ratio": numbers(1, 1e300) | st.just(math.inf),
    },
    "partitioned": {
        **COMMON,
        "partitions": st.integers(1, 16),
        "blend": numbers(0, 1),
        "near": st.none() | st.floats(1e-6, 1),
        "far": st.none() | st.floats(2, 1e9),
        "warp": WARP,
    },
    "subdivided": {**COMMON, "parts": st.integers(0, 8), "strength": numbers(-1, 1)},
    "tuned": {
        **COMMON,
        "partitions": st.integers(1, 16),
        "warp": WARP,
        "power": numbers(1, 64),
        "measure": st.sampled_from(("m", "perspective")),
    },
    "accumulated": {**COMMON, "samples": st.integers(1, 64), "keep": st.booleans()},
    "pcss": {
        **COMMON,
        "blocker_taps": st.integers(1, 2**12),
        "filter_taps": st.integers(1, 2**12),
        "keep": st.booleans(),
    },
    "moment": {
        **COMMON,
        "compare": st.just("depth"),
        "kernel": numbers(1, 1024),
        "keep": st.booleans(),
    },
    "filtered": {
        "kernel": st.sampled_from(KERNELS),
        "width": st.just(0) | numbers(0.02, 64),
        "strata": st.integers(1, 64),
        "inner": st.builds(UniformShadowMap, **COMMON)
        | st.builds(LogarithmicShadowMap, ratio=numbers(1, 1e300) | st.just(math.inf)),
    },
}
"""Of every family, what each setting may be."""


@st.composite
def algorithms(draw):
    """Any algorithm of the registry with any of its settings changed."""
    family = draw(st.sampled_from(sorted(ALGORITHMS)))
    chosen = draw(st.fixed_dictionaries({}, optional=SETTINGS[family]))
    return ALGORITHMS[family](**chosen)


@pytest.mark.parametrize("family", ALGORITHMS)
def test_random_settings_cover_every_field(family):
    """Nothing that a file may set is left out of the round trip, and all of it is explained."""
    assert set(SETTINGS[family]) == set(setting_types(ALGORITHMS[family]))
    assert set(SETTINGS[family]) == {f.name for f in fields(ALGORITHMS[family])} - {"cost_model"}
    assert all(len(words) > 8 for words in meanings(ALGORITHMS[family]).values())


@given(algorithms(), st.booleans())
def test_what_is_written_is_read_again(tmp_path_factory, algorithm, every):
    """Exactly, float for float; and the file holds only fields whose values are no default."""
    path = tmp_path_factory.getbasetemp() / "settings.toml"
    write_settings(path, algorithm, every=every)
    assert read_settings(path) == algorithm
    held = tomllib.loads(path.read_text(encoding="utf-8"))["settings"]
    default = type(algorithm)()
    differs = {
        n for n in setting_types(type(algorithm)) if getattr(algorithm, n) != getattr(default, n)
    }
    assert held.keys() == differs or every
    assert held.keys() >= differs


def of(family: str, **settings) -> Any:
    return algorithm_of({"algorithm": family, "settings": settings})


def test_defaults_units_and_kinds_of_numbers():
    """No table is all defaults; MB and ms are the fields' own units; a whole number is a number."""
    assert algorithm_of({"algorithm": "uniform"}) == UniformShadowMap()
    assert of("adaptive", memory_mb=0.5, time_limit_ms=20) == AdaptiveShadowMap(
        memory_bytes=2**19, time_limit=0.02
    )
    assert of("perspective", slide=3).slide == 3.0
    assert of("perspective", slide=math.inf) == PerspectiveShadowMap(slide=math.inf)
    assert of("logarithmic", ratio=math.inf) == LogarithmicShadowMap()


def test_the_text_says_what_was_changed_or_explains_everything():
    """Few lines for a few changes; with `every`, a line for each setting and for each None."""
    algorithm = PartitionedShadowMap(near=0.5, warp="light-space")
    assert settings_text(algorithm) == (
        'algorithm = "partitioned"\n\n[settings]\nnear = 0.5\nwarp = "light-space"\n'
    )
    text = settings_text(algorithm, every=True)
    assert text.startswith('algorithm = "partitioned"\n\n[settings]\n\n# texels a side of a square')
    assert "\n# far is left out: None\n" in text and "\nblend = 1.0\n" in text
    assert "[0]" not in settings_text(UniformShadowMap(compare="id"))


def test_a_map_within_a_filter_is_a_table_of_its_own():
    """The same keys again, below its name; as much as differs, also where all is explained."""
    algorithm = FilteredShadowMap("area", inner=AdaptiveShadowMap(cells=4))
    text = settings_text(algorithm)
    assert text == (
        'algorithm = "filtered"\n\n[settings]\nkernel = "area"\n\n'
        '[settings.inner]\nalgorithm = "adaptive"\n\n[settings.inner.settings]\ncells = 4\n'
    )
    assert algorithm_of(tomllib.loads(text)) == algorithm
    assert algorithm_of(tomllib.loads(settings_text(algorithm, every=True))) == algorithm
    assert algorithm_of({"algorithm": "filtered"}) == FilteredShadowMap()


def test_a_calibrated_map_keeps_its_costs_to_itself():
    """The cost model is this machine's; the rest returns."""
    model = CostModel(a_seconds_per_texel=1e-8, b_seconds=1e-5, residual=0.0)
    text = settings_text(AdaptiveShadowMap(cells=4, cost_model=model), every=True)
    assert "cost_model" not in text
    assert algorithm_of(tomllib.loads(text)) == AdaptiveShadowMap(cells=4)


def test_what_no_file_may_hold_is_not_written(tmp_path):
    """An infinite time limit is possible in Python, as none; the old file stays."""
    path = tmp_path / "a.toml"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(UseError, match="time_limit is inf; allowed: a finite number"):
        write_settings(path, AdaptiveShadowMap(time_limit=math.inf))
    assert path.read_text(encoding="utf-8") == "old"
    with pytest.raises(UseError, match=r"nowhere/a.toml' \(No such file"):
        write_settings(tmp_path / "nowhere/a.toml", AdaptiveShadowMap())
    assert [p.name for p in tmp_path.iterdir()] == ["a.toml"]


WRONG = {
    "text": ("adaptive", {"node_resolution": "16"}, 'is "16"; allowed: a whole number, without'),
    "true for 1": ("adaptive", {"cells": True}, "cells is true; allowed: a whole number"),
    "true as number": ("adaptive", {"bias": True}, "bias is true; allowed: a number"),
    "1 for true": ("adaptive", {"cover": 1}, "cover is 1; allowed: true or false"),
    "16.0 for 16": ("uniform", {"resolution": 16.0}, "16.0; allowed: a whole number"),
    "nan": ("uniform", {"bias": math.nan}, "bias is nan; allowed: a finite number"),
    "nan slide": ("perspective", {"slide": math.nan}, "a slide of nan"),
    "inf": ("partitioned", {"far": math.inf}, "far is inf; allowed: a finite number; or leave"),
    "too large": ("uniform", {"bias": 10**400}, "allowed: a finite number"),
    "list": ("uniform", {"bias": [1]}, r"bias is \[1\]"),
    "unlisted": ("uniform", {"compare": "dept"}, "unknown compare 'dept'.*mean 'depth'"),
    "unlisted measure": ("adaptive", {"measure": "length"}, "unknown measure 'length'.*area, axis"),
    "unlisted falloff": ("light-space", {"falloff": "linear"}, "unknown falloff 'linear'.*sine"),
    "unlisted across": ("logarithmic", {"across": "z"}, "unknown across 'z'.*uniform"),
    "unlisted warp": ("partitioned", {"warp": "psm"}, "unknown warp 'psm'.*light-space"),
    "unlisted tuned warp": ("tuned", {"warp": "sideways"}, "unknown warp 'sideways'.*light-space"),
    "two": ("uniform", {"bias": "x", "keep": 0}, r"bias is .*numb.* keep is 0; allowed: true"),
    "refused": ("adaptive", {"node_resolution": 17}, "powers of two"),
    "pair refused": ("partitioned", {"near": 4.0, "far": 2.0}, "far beyond near"),
    "both units": ("adaptive", {"memory_mb": 1.0, "memory_bytes": 1}, "both say the same"),
    "no memory": ("adaptive", {"memory_mb": 1e-9}, "limit of 0 bytes"),
    "memory": ("adaptive", {"memory_mb": 1e300}, r"allowed: 1 to 2\^50"),
    "memory in bytes": ("adaptive", {"memory_bytes": 10**400}, r"allowed: 1 to 2\^50"),
    "unknown": ("adaptive", {"node_resolutoin": 1}, "adaptive setting .*mean 'node_resolution'"),
    "another's": ("uniform", {"cells": 2}, "unknown uniform setting 'cells'"),
    "another's unit": ("uniform", {"memory_mb": 2}, "unknown uniform setting 'memory_mb'"),
    "cost model": ("adaptive", {"cost_model": {}}, "measured on each machine, not set"),
    "name for a map": ("filtered", {"inner": "uniform"}, 'is "uniform"; allowed: a table with'),
    "within": (
        "filtered",
        {"inner": {"algorithm": "uniform", "settings": {"cells": 2}}},
        "inner: unknown uniform setting 'cells'",
    ),
    "filter of a filter": ("filtered", {"inner": {"algorithm": "filtered"}}, "not possible"),
    "width": ("filtered", {"width": 1e-3}, "0.001 texels is not possible; allowed: 0, or 1/64"),
    "strata": ("filtered", {"strata": 0}, "0 strata"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_settings_are_refused(case):
    """Each says what is wrong and what is allowed."""
    family, settings, said = WRONG[case]
    with pytest.raises(UseError, match=said) as raised:
        of(family, **settings)
    assert len(str(raised.value)) < 400


FILES: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", "no algorithm is named; .*known: uniform, adaptive"),
    "comments": ("# nothing\n", "no algorithm is named"),
    "no equals sign": ('algorithm = "uniform"\n\nkeep true\n', "no TOML: .*line 3"),
    "torn": ('algorithm = "uniform"\n[settings', "no TOML: .*at the end, line 2"),
    "twice": ('algorithm = "uniform"\nalgorithm = "tuned"\n', "no TOML: .*line 2"),
    "latin 1": ('# ok\n# \u00e9\nalgorithm = "uniform"\n'.encode("latin-1"), "UTF-8.*line 2"),
    "utf-16": ('algorithm = "uniform"\n'.encode("utf-16"), "UTF-8"),
    "zeros": (bytes(64), "no TOML: .*line 1"),
    "deep": ("a = " + "[" * 5000, "too deep"),
    "digits": ("a = " + "9" * 5000, "too long"),
    "large": ("#" * (LARGEST_FILE + 1), "larger than"),
    "misspelt": ('algorithm = "adaptve"\n', "unknown algorithm 'adaptve'.*mean 'adaptive'"),
    "misspelt key": ('algoritm = "adaptive"\n', "unknown key 'algoritm'.*mean 'algorithm'"),
    "number": ("algorithm = 3\n", "algorithm is 3; allowed: its name in quotes"),
    "no table": ('algorithm = "uniform"\nsettings = 3\n', "settings is 3; allowed: a table"),
    "list": ('algorithm = "uniform"\n[[settings]]\n', "allowed: a table"),
    "above": ('algorithm = "uniform"\nkeep = true\n', "keep is a setting; write it below"),
    "date": ('algorithm = "uniform"\n[settings]\nbias = 2024-01-01\n', "bias is 2024-01-01"),
}


@pytest.mark.parametrize("case", FILES)
def test_broken_files_are_told_with_their_name(case, tmp_path):
    """In one line, with the line number where there is one."""
    path = tmp_path / "mine.toml"
    content, said = FILES[case]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(UseError, match=said) as raised:
        read_settings(path)
    assert "mine.toml'" in str(raised.value) and "\n" not in str(raised.value)


def test_files_that_are_none(tmp_path):
    """Missing, a folder, a name too long: the system's own reason."""
    for path, said in (
        (tmp_path / "no.toml", "No such file"),
        (tmp_path, "Is a directory"),
        (Path("x" * 5000), "File name too long"),
    ):
        with pytest.raises(UseError, match=said) as raised:
            read_settings(path)
        assert len(str(raised.value)) < 300


def test_editors_of_other_systems(tmp_path):
    """A byte-order mark and carriage returns are no trouble."""
    path = tmp_path / "a.toml"
    path.write_bytes('\ufeffalgorithm = "uniform"\r\n[settings]\r\nkeep = true\r\n'.encode())
    assert read_settings(path) == UniformShadowMap(keep=True)


def test_reports_and_figures_know_every_family():
    """A method of any family may be in a report, and has a look of its own."""
    assert set(METHOD_KINDS) == {*ALGORITHMS, "rays"}
    looks = [look_of(family) for family in ALGORITHMS]
    assert len(set(looks)) == len(looks)
    assert set(FAMILY_LOOKS) == set(ALGORITHMS)


@pytest.fixture
def files(tmp_path) -> dict[str, str]:
    """A file of an adaptive map of 2 MB, and one of another family."""
    made = {"adaptive": AdaptiveShadowMap(memory_bytes=2**21), "other": UniformShadowMap(7)}
    for name, algorithm in made.items():
        write_settings(tmp_path / f"{name}.toml", algorithm)
    return {name: str(tmp_path / f"{name}.toml") for name in made}


def test_options_and_file_become_maps(files):
    """An adaptive file is the adaptive map, another one goes beside that of the options."""
    assert chosen_maps(RunOptions(memory_mb=3.0)).adaptive.memory_bytes == 3 * 2**20
    assert chosen_maps(RunOptions()).adaptive == AdaptiveShadowMap()
    own = chosen_maps(AnalyzeOptions(settings=files["adaptive"]))
    assert own.adaptive == AdaptiveShadowMap(memory_bytes=2**21) and own.other is None
    beside = chosen_maps(RunOptions(settings=files["other"], memory_mb=1.0, cells=4))
    assert beside.other == UniformShadowMap(7)
    assert beside.adaptive == AdaptiveShadowMap(memory_bytes=2**20, cells=4)


@pytest.mark.parametrize(
    "option",
    [
        {"memory_mb": 16.0},
        {"time_limit_ms": 5.0},
        {"preset": "default"},
        {"node_resolution": 16},
        {"cells": 2},
    ],
    ids=lambda option: next(iter(option)),
)
def test_the_same_is_not_said_twice(option, files):
    """An option beside an adaptive file is refused, its default too."""
    flag = "--" + next(iter(option)).replace("_", "-")
    with pytest.raises(UseError, match=f"{flag} and the settings file"):
        chosen_maps(RunOptions(settings=files["adaptive"], **option))
    assert chosen_maps(RunOptions(settings=files["other"], **option)).other is not None


def test_an_analysis_takes_the_file_in_its_familys_place(files):
    """The other families have the texels of the adaptive map's memory; a family that is not
    analysed is refused."""
    families = ("uniform", "adaptive", "light-space")
    own = chosen_maps(AnalyzeOptions(settings=files["adaptive"]))
    found = algorithms_of(families, own, 2)
    assert found["adaptive"] == AdaptiveShadowMap(memory_bytes=2**21)
    assert found["uniform"] == UniformShadowMap(512)
    found = algorithms_of(families, chosen_maps(AnalyzeOptions(settings=files["other"])), 1)
    assert found["uniform"] == UniformShadowMap(7)
    assert found["light-space"] == LightSpaceShadowMap(2048)
    with pytest.raises(UseError, match="is of uniform, which --methods leaves out"):
        analyse_scene(AnalyzeOptions(settings=files["other"], methods=("adaptive",)))


def test_a_limit_that_does_not_fit_is_told_in_the_words_of_its_source():
    """A file has no --memory-mb to raise, and no marks by which it would be named."""
    small = AdaptiveShadowMap(memory_bytes=1000)
    with pytest.raises(UseError, match="raise `memory_bytes` or lower `node_resolution`"):
        ChosenMaps(small).check(1)
    with pytest.raises(UseError, match="'a.toml': .*raise memory_mb or lower node_resolution"):
        ChosenMaps(small, source="a.toml").check(1)


def test_the_page_is_up_to_date():
    """As the code writes it: `python -m asmjax.shadow.settings_page docs/settings.md`."""
    page = PAGE.read_text(encoding="utf-8")
    assert page == settings_page.written_into(page)
    assert all(f"### `{family}`\n" in page for family in ALGORITHMS)
    with pytest.raises(UseError, match="put the lines"):
        settings_page.written_into("# Settings files\n")


def test_examples_of_the_page_are_its_files_and_load():
    """What is shown is what lies beside it, and each changes something."""
    page = PAGE.read_text(encoding="utf-8")
    shown = re.findall(r"\((settings/\w+\.toml)\):\n\n```toml\n(.*?)```", page, flags=re.DOTALL)
    assert len(shown) == 3
    for name, text in shown:
        path = PAGE.parent / name
        assert path.read_text(encoding="utf-8") == text
        algorithm = read_settings(path)
        assert algorithm != algorithm_of({"algorithm": family_of(algorithm)})


def refused(family: str, name: str, value: Any) -> str:
    """What an algorithm says to a value of a kind that the tests' type checks would not let by."""
    kind: Any = ALGORITHMS[family]
    algorithm = kind()
    object.__setattr__(algorithm, name, value)
    with pytest.raises(UseError) as problem:
        algorithm.__check_init__()
    return str(problem.value)


@pytest.mark.parametrize("family", ALGORITHMS)
def test_a_choice_is_one_of_the_words_that_the_page_lists(family):
    """Whoever misspells one is told which was meant, from Python as from a file."""
    types = setting_types(ALGORITHMS[family])
    assert str not in types.values(), "a text that may be anything"
    for name, annotation in types.items():
        for word in get_args(annotation) if get_origin(annotation) is Literal else ():
            told = re.compile(f"unknown {name} '{word}x'.*mean '{word}'")
            assert told.search(refused(family, name, f"{word}x"))
            with pytest.raises(UseError, match=told):
                algorithm_of({"algorithm": family, "settings": {name: f"{word}x"}})


def test_a_number_is_told_to_be_no_word():
    """Of a filter the map has the resolution."""
    assert "unknown kernel '2048'" in refused("filtered", "kernel", 2048)
    assert "given as inner" in refused("filtered", "kernel", 2048)
    assert "unknown measure '3'" in refused("adaptive", "measure", 3)


@pytest.mark.parametrize("family", ALGORITHMS)
def test_settings_have_to_be_named(family):
    """All but the first, which is the resolution; a filter's width and samples too. Of an adaptive
    map a number alone would be one of bytes."""
    may = {"adaptive": (), "filtered": ("area", 2.0), "accumulated": (64, 2)}.get(family, (64,))
    kind: Any = ALGORITHMS[family]
    kind(*may)
    with pytest.raises(TypeError, match="positional argument"):
        kind(*may, 2048)
