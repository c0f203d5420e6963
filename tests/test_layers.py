"""Imports go downwards only, and the renderer stays in one folder: read from the source."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "asmjax"

# Lowest first; what stands in one row may not import its neighbours either.
LAYERS = [
    {"errors", "paths", "machine", "libraries", "numerics", "interruption", "plain"},
    {"memory", "toml_files", "fronts", "writing"},
    {"options"},
    {"geometry"},
    {"buffers"},
    {"scene"},
    {"footprint"},
    {"theory"},
    {"shadow"},
    {"metrics"},
    {"experiment"},
    {"effects"},
    {"tuning"},
    {"report"},
    {"hard_cases"},
    {"job_memory"},
    {"preparation"},
    {"planning", "folders", "delivery"},
    {"sweep"},
    {
        "main_job",
        "walkthrough_job",
        "analyze_job",
        "compare_job",
        "tune_job",
        "plan_job",
        "sweep_job",
        "report_job",
    },
    {"cli"},
    {"__init__", "__main__"},
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
RENDER_MAY_IMPORT = {name for name, rank in RANK.items() if rank <= RANK["scene"]} - {"options"}
MAY_IMPORT_RENDER = {
    "preparation",
    "main_job",
    "walkthrough_job",
    "analyze_job",
    "compare_job",
    "tune_job",
    "planning",
    "plan_job",
    "sweep",
    "sweep_job",
    "cli",
    "__init__",
    "render",
}
RENDERER = {"mitsuba", "drjit"}

FILES = sorted(PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    """The sub-package or top-level module a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full dotted name of all that a file imports, inside functions too."""
    parents = path.relative_to(PACKAGE.parent).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = list(parents[: len(parents) - node.level + 1]) if node.level else []
            module = ".".join(base + ([node.module] if node.module else []))
            # "from asmjax import scene" names the room only in the alias
            yield from ((node.lineno, f"{module}.{alias.name}") for alias in node.names)


def may_import(importer: str, target: str) -> bool:
    """Whether a file in the room `importer` may import from the room `target`."""
    if importer == target or target not in RANK | {"render": 0}:
        return True
    if importer == "render":
        return target in RENDER_MAY_IMPORT
    if target == "render":
        return importer in MAY_IMPORT_RENDER
    return RANK[importer] > RANK[target]


def test_every_file_has_a_layer():
    unknown = {room(path) for path in FILES} - set(RANK) - {"render"}
    assert not unknown, f"give {unknown} a place in LAYERS"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_downwards(path):
    wrong = []
    for line, name in imported(path):
        parts = name.split(".")
        if parts[0] == "asmjax" and len(parts) > 1 and not may_import(room(path), parts[1]):
            wrong.append(f"line {line}: {name}")
        if parts[0] in RENDERER and room(path) != "render":
            wrong.append(f"line {line}: {name} outside asmjax/render")
    assert not wrong, f"{path.name}: {wrong}"


@pytest.mark.parametrize(
    ("importer", "target", "allowed"),
    [
        ("shadow", "footprint", True),
        ("footprint", "shadow", False),
        ("scene", "render", False),
        ("shadow", "render", False),
        ("cli", "render", True),
        ("render", "scene", True),
        ("render", "shadow", False),
        ("paths", "errors", False),
    ],
)
def test_the_rule_itself(importer, target, allowed):
    assert may_import(importer, target) is allowed


def test_the_rule_is_told_as_it_is():
    """CONTRIBUTING.md names the layers in their order, but for the entry points."""
    text = (PACKAGE.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rule = text.split("**Imports go downwards**:")[1].split("`render/`")[0]
    told = [set(re.split(r"[,\s]+", names)) for names in re.findall("`([^`]+)`", rule)]
    assert told == LAYERS[:-1]
