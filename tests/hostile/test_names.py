"""What cannot be the name of a file is refused in one line wherever a file is named."""

import pytest

from asmjax.errors import UseError, file_errors
from asmjax.folders import results_folder
from asmjax.options import RunOptions
from asmjax.shadow import read_settings
from asmjax.toml_files import read_toml

NAMES = {"a\0b": "has a NUL", "a\ud800b": "half a character"}
"""And what the message says of them."""

ACTIONS = {
    "TOML": lambda name: read_toml(name, "settings file"),
    "settings": read_settings,
    "scene": lambda name: results_folder(RunOptions(scene=f"{name}.xml")),
    "results": lambda name: results_folder(RunOptions(scene="letter_f", out=name)),
    "settings of a run": lambda name: results_folder(
        RunOptions(scene="letter_f", settings=f"{name}.toml")
    ),
}


@pytest.mark.parametrize("name", NAMES, ids=NAMES.values())
@pytest.mark.parametrize("what", ACTIONS)
def test_no_name_of_a_file(what, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UseError, match=f"no file's name has.*{NAMES[name].split()[-1]}") as problem:
        ACTIONS[what](name)
    message = str(problem.value)
    assert message.isprintable() and len(message) < 300
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "problem",
    [
        UseError("an embedded null byte"),
        ValueError("another"),
        UnicodeEncodeError("ascii", "é", 0, 1, "ordinal not in range(128)"),
    ],
)
def test_other_errors_pass_through(problem):
    """Of wrong use as they are, and those of the code."""
    with pytest.raises(type(problem)) as end, file_errors("this failed", "try that"):
        raise problem
    assert end.value is problem


def test_what_the_system_refuses():
    with pytest.raises(UseError, match=r"^this failed \(No such file.*\); try that\.$"):
        with file_errors("this failed", "try that"):
            open("/no/such/file")
