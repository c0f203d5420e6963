"""The library names fields; only the command line speaks of its options."""

import ast
import logging
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from asmjax.cli.flags import FLAGS, FlagFormatter, in_flags
from asmjax.options import PlanOptions, RunOptions, SweepOptions, TuneOptions
from asmjax.shadow import Status

PACKAGE = Path(__file__).parents[1] / "asmjax"
SPEAK_OF_OPTIONS = (
    "cli", "options", "sweep", "report", "preparation.py", "folders.py", "writing.py",
)  # fmt: skip
"""Besides jobs: what only they use, and whose words are of their options."""


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of all constants of a file but docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield node.lineno, node.value


def test_no_message_of_the_library_names_an_option():
    named = [
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if not path.relative_to(PACKAGE).parts[0].endswith((*SPEAK_OF_OPTIONS, "_job.py"))
        for line, text in texts(path)
        if re.search(r"(^|\W)--[a-z]", text)
    ]
    assert not named


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("raise `memory_bytes`, lower `cells`.", "raise --memory-mb, lower --cells."),
        ("choose another `light` or `view`.", "choose another --light or --view."),
        ("or give `trust=True` if", "or give --trust-scene if"),
        ("choose `variant` scalar_rgb", "choose --variant scalar_rgb"),
        ("raise `max_passes` of", "raise max_passes of"),
        ("'a `b c` d'", "'a `b c` d'"),
    ],
)
def test_the_command_line_says_its_options(told, said):
    assert in_flags(told) == said


def test_options_of_other_commands_are_no_remedy():
    """`asmjax tune` has no --node-resolution, and `asmjax plan` no --light."""
    said = in_flags("raise `memory_bytes` or lower `node_resolution`", TuneOptions)
    assert said == "raise --memory-mb or lower node_resolution"
    assert in_flags("another `light`, or `trust=True`", PlanOptions) == (
        "another light, or --trust-scene"
    )
    assert in_flags("raise `max_memory_mb`", SweepOptions) == "raise --max-memory"


def test_warnings_are_said_alike():
    record = logging.LogRecord("asmjax", logging.WARNING, "", 0, "raise `%s`", ("samples",), None)
    assert FlagFormatter("%(message)s").format(record) == "raise --samples"


def test_every_field_with_another_name_is_an_option(capsys):
    """As `asmjax run --help` has them."""
    from asmjax import cli

    with pytest.raises(SystemExit):
        cli.main(["run", "--help"])
    shown = capsys.readouterr().out
    for flag in FLAGS.values():
        assert flag in shown
    assert RunOptions(memory_mb=4).memory_bytes == 4 * 2**20


def test_a_limit_names_what_it_is_a_field_of():
    for status in (Status.MEMORY_LIMIT, Status.TIME_LIMIT, Status.NODE_CAPACITY):
        assert "--" in in_flags(status.value) and "--" not in status.value
