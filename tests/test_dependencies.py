"""What is imported is declared in pyproject.toml, and what is declared is used: by the source."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

SCRIPTS = ("tests", "experiments", "analysis", "notebooks")
"""Folders whose files import each other."""

MODULES = {"pillow": "PIL", "pyyaml": "yaml"}
"""Of packages that are not called as what they bring, "-" and "_" aside."""

USED_BY_NAME = {
    "cryptography": "distributed",
    "h5netcdf": "xarray",
    "h5py": "h5netcdf",
    "ipykernel": "nbclient",
    "jupyterlab": "make extras",
    "jupytext": "jupyterlab",
    "nbclient": "notebooks as Jupyter runs them",
    "pytest-timeout": "pyproject.toml",
    "pytest-benchmark": "make bench",
    "pytest-xdist": "make test",
}
"""Packages that no file needs to import, and who uses them."""


def modules(requirements: Iterable[str]) -> dict[str, str]:
    """Packages of requirements to the modules that they bring."""
    names = [re.split(r"[^\w-]", one)[0] for one in requirements]
    return {name: MODULES.get(name, name.replace("-", "_")) for name in names}


BASE = modules(PROJECT["project"]["dependencies"])
TEST = BASE | modules(PROJECT["dependency-groups"]["test"])
EXTRAS = {
    name: modules(needed) for name, needed in PROJECT["project"]["optional-dependencies"].items()
}


def nodes(*folders: str) -> Iterator[ast.AST]:
    """All of all files of folders."""
    for folder in folders:
        for path in (ROOT / folder).rglob("*.py"):
            yield from ast.walk(ast.parse(path.read_text(encoding="utf-8")))


def imported(*folders: str) -> set[str]:
    """Modules of others that files of folders import, inside functions too."""
    found = set()
    for node in nodes(*folders):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.partition(".")[0])
    ours = {"asmjax"} | {path.stem for folder in SCRIPTS for path in (ROOT / folder).iterdir()}
    return found - ours - sys.stdlib_module_names


def called_with(function: str, place: int) -> set[str]:
    """Words that the package calls a function with, at a place of its arguments."""
    calls = [node for node in nodes("asmjax") if isinstance(node, ast.Call)]
    words = [one.args[place] for one in calls if getattr(one.func, "id", "") == function]
    return {str(word.value) for word in words if isinstance(word, ast.Constant)}


@pytest.mark.parametrize(
    ("folders", "declared"),
    [
        (("asmjax",), BASE),
        (("tests",), TEST),
        (("experiments", "analysis"), TEST),
        (("notebooks",), BASE | EXTRAS["notebooks"]),
    ],
    ids=["asmjax", "tests", "experiments", "notebooks"],
)
def test_what_is_imported_is_declared(folders, declared):
    """Libraries of extras are never imported by a statement of the package."""
    assert imported(*folders) <= set(declared.values())


def test_what_is_declared_is_used():
    """By a file that imports it, or by whom `USED_BY_NAME` says."""
    asked_for = {name.partition(".")[0] for name in called_with("_needed", 0)}
    used = imported("asmjax", "tests", "notebooks") | asked_for
    declared = TEST | {package: name for one in EXTRAS.values() for package, name in one.items()}
    unused = {package for package, name in declared.items() if name not in used}
    assert unused <= set(USED_BY_NAME) <= set(declared)


def test_remedies_name_extras_that_there_are():
    """Of messages and pages; what `make extras` says knows all."""
    paths = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("notebooks/*")]
    pages = [path.read_text(encoding="utf-8") for path in paths if path.is_file()]
    named = {name for page in pages for name in re.findall(r"EXTRA=([\w-]+)", page)}
    assert called_with("missing_extra", 1) == {"analysis"} <= named <= set(EXTRAS)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(name in makefile for name in EXTRAS)
