"""Random command lines and settings files: a valid configuration, or one line that says where.

`ASMJAX_TEST_HARD=1` tries ten times as many.
"""

import random
import re

import pytest
import tomli_w
from helpers.effort import effort

from asmjax import cli
from asmjax.cli.parse import parse
from asmjax.errors import UseError
from asmjax.shadow import ALGORITHMS, read_settings
from asmjax.shadow.base import ShadowAlgorithm
from asmjax.shadow.settings import allowed_names
from asmjax.toml_files import LARGEST_FILE
from hostile.mutations import mutated

HARD = effort(1, 10)
COMMAND_LINES, TABLES, TEXTS = 80 * HARD, 500 * HARD, 420 * HARD
"""A thousand in all. A command line takes a hundred times as long as a file."""

OPTIONS = {
    "run": ("--view", "--size", "--sensor", "--light", "--frames", "--motion", "--keys", "--object",
            "--memory-mb", "--time-limit-ms", "--settings", "--preset", "--node-resolution",
            "--cells", "--samples", "--repeats", "--seed", "--variant", "--recalibrate",
            "--trust-scene", "--out", "--quiet", "--save-arrays"),
    "analyze": ("--methods", "--angles", "--samples", "--size", "--memory-mb", "--trust-scene"),
    "compare": ("--views", "--samples", "--minutes", "--fresh", "--methods", "--view"),
    "tune": ("--price", "--within-ms", "--error", "--views", "--held-out", "--evaluations",
             "--memory-mb", "--settings", "--seed"),
    "scenes": ("--json",),
    "info": ("--json",),
}  # fmt: skip

WORDS = (
    "0", "1", "-1", "7", "28", "1.5", "1e-300", "1e400", "nan", "-inf", "inf", "99999999999999999",
    "9" * 400, "0x10", "1_000", "١٢", "", " ", "a b", "x" * 3000, "--", "-", "-v", "=", "a=b",
    "None", "null", "true", "[1, 2]", "{}", "\n", "\t", "\x00", "\x1b[31m", "é", "🙂", "%s%n",
    "$HOME", "`id`", "../../etc", "/dev/zero", "camera", "light", "uniform", "adaptive", "terrain",
    "scalar_rgb", "paper_2001",
)  # fmt: skip


def shown(word: str) -> str:
    """How a message may have it, short of words that every message has by chance."""
    if word.startswith("--") and len(word) > 2:
        return word
    if not word.strip():
        return f" {word!r}"
    return f" {UseError(word)}"


def one_line(message: str) -> bool:
    """Whether it is one line of text, as `asmjax` prints it."""
    return bool(message) and message.isprintable() and len(message) < 12_000


def command_line(chance: random.Random) -> list[str]:
    name = chance.choice(("run", "run", "run", "analyze", "compare", "tune", "scenes", "info"))
    words = [name]
    for _ in range(chance.choice((1, 1, 2, 3))):
        option = chance.choice(OPTIONS[name])
        if chance.random() < 0.15:
            place = chance.randrange(2, len(option))
            option = option[:place] + chance.choice("xyz-_") + option[place:]
        words.append(option)
        words += chance.choices(WORDS, k=chance.choice((0, 1, 1, 1, 2)))
    return words


def test_command_lines():
    """An options object, or a line that names one of the options or words that were given."""
    chance = random.Random(13)
    ends = {"valid": 0, "refused": 0}
    for _ in range(COMMAND_LINES):
        words = command_line(chance)
        try:
            name, options = parse(list(words), cli.COMMANDS)
            assert name == words[0] and type(options).__name__.endswith("Options")
            ends["valid"] += 1
        except UseError as problem:
            message = str(problem)
            said = [word for word in words[1:] if shown(word) in message]
            assert said and one_line(message), (words, message)
            ends["refused"] += 1
    assert min(ends.values()) > 0.05 * COMMAND_LINES, ends


SCALARS = (
    0, 1, -1, 2, 8, 16, 64, 512, 1024, 2**31, 2**63 - 1, -(2**63), 0.0, -0.0, 0.5, 1.5, 1e-300,
    1e300, float("nan"), float("inf"), -float("inf"), True, False, "", "depth", "both", "axis",
    "light-space", "none", "16", "x" * 500, "\n", "\0", "é", [], [1, 2], [[]], {}, {"a": 1},
)  # fmt: skip


def table(chance: random.Random) -> dict:
    """Mostly names that are known, with values of any kind."""
    family = chance.choice(list(ALGORITHMS))
    names = allowed_names(ALGORITHMS[family])
    settings = {}
    for _ in range(chance.choice((1, 1, 2, 4))):
        name = chance.choice(names)
        if chance.random() < 0.1:
            name = chance.choice((name.upper(), name + "s", name[1:], "", "cost_model", "é\n"))
        settings[name] = chance.choice(SCALARS)
    whole = {"algorithm": family, "settings": settings}
    if chance.random() < 0.1:
        whole[chance.choice(("algorithm", "settings", "seting", "bias"))] = chance.choice(SCALARS)
    return whole


def names_of(whole: dict) -> set[str]:
    """The keys of a file, at both levels."""
    settings = whole.get("settings", {})
    inner = settings if isinstance(settings, dict) else {}
    return {"algorithm", "settings", *whole, *inner}


def test_settings_files(tmp_path):
    """An algorithm, or a line that names the file and the key."""
    chance = random.Random(14)
    path = tmp_path / "settings.toml"
    ends = {"valid": 0, "refused": 0}
    for _ in range(TABLES):
        whole = table(chance)
        path.write_text(tomli_w.dumps(whole), encoding="utf-8")
        try:
            assert isinstance(read_settings(path), ShadowAlgorithm)
            ends["valid"] += 1
        except UseError as problem:
            message = str(problem)
            assert "settings.toml" in message and one_line(message), (whole, message)
            keys = [key for key in names_of(whole) if key in message or repr(key)[1:-1] in message]
            assert keys, (whole, message)
            ends["refused"] += 1
    assert min(ends.values()) > 0.05 * TABLES, ends


EXAMPLES = (
    b'algorithm = "adaptive"\n\n[settings]\nmemory_mb = 4\nnode_resolution = 32\ncells = 4\n',
    b'# warped\nalgorithm = "partitioned"\n[settings]\nresolution = 2048\ncompare = "both"\n',
    b'algorithm = "uniform"\n[settings]\nresolution = 512\nbias = 0.001\nkeep = true\n',
)
"""Files that load."""


def test_mutated_settings_files(tmp_path):
    """Text that may be no TOML: the line is named then."""
    chance = random.Random(15)
    path = tmp_path / "settings.toml"
    for example in EXAMPLES:
        path.write_bytes(example)
        read_settings(path)
    ends = {"valid": 0, "refused": 0}
    for _ in range(TEXTS):
        content = mutated(chance.choice(EXAMPLES), chance)
        path.write_bytes(content)
        try:
            assert isinstance(read_settings(path), ShadowAlgorithm)
            ends["valid"] += 1
        except UseError as problem:
            message = str(problem)
            assert "settings.toml" in message and one_line(message), (content, message)
            assert re.search(r"line \d+|\w+ is |algorithm|setting|key|UTF-8", message), message
            ends["refused"] += 1
    assert min(ends.values()) > 0.1 * TEXTS, ends


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe", b"\0" * 100, b"a = " + b"[" * 100_000, b"a = " + b"{x=" * 5_000,
        b"a = 1" + b"0" * 10_000, b"." * 1000, b"[[[[", b"a" * (LARGEST_FILE + 1),
        b'algorithm = """' + b"x" * 9999, b"[settings]\n" * 9, b"a.b = 1\na.b.c = 2",
        b"\xef\xbb\xbf",
    ],
    ids=lambda content: repr(content[:12]),
)  # fmt: skip
def test_hostile_toml(content, tmp_path):
    """Depth, length and bytes that a reader may stumble over."""
    path = tmp_path / "settings.toml"
    path.write_bytes(content)
    with pytest.raises(UseError) as problem:
        read_settings(path)
    assert "settings.toml" in str(problem.value) and one_line(str(problem.value))


def test_a_word_is_told_whole_however_long_it_is():
    """It was cut into lines of 2,000 characters, and joined with spaces."""
    with pytest.raises(UseError, match=f"Unrecognized options: {'x' * 3000}"):
        parse(["info", "--json", "x" * 3000], cli.COMMANDS)


@pytest.mark.parametrize("option", ["--seed", "--repeats", "--samples", "--memory-mb"])
def test_numbers_beyond_all_floats(option):
    """Whole numbers of any length are compared, not converted."""
    with pytest.raises(UseError, match=f"{option} is .*at most 2.53"):
        parse(["run", option, "9" * 400], cli.COMMANDS)


def test_trust_is_an_option_of_every_command_that_loads():
    """It is off unless it is given."""
    for name in ("run", "analyze", "compare", "tune"):
        assert parse([name, "a.xml", "--trust-scene"], cli.COMMANDS)[1].trust_scene is True
        assert parse([name, "a.xml"], cli.COMMANDS)[1].trust_scene is False
