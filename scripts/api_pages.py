"""Pages of the API documentation, read from the source: a hook of MkDocs (mkdocs.yml).

A page for every public module, filled by mkdocstrings, and one for every package with what it
offers and what is in it. No module can be forgotten: the pages follow the folder.
"""

import ast
import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PACKAGE = "asmjax"


@dataclass(frozen=True)
class Module:
    """A module or package as its source has it.

    Attributes:
        name: dotted.
        is_package: whether others are in it.
        tree: of its source.
        origins: dotted name of the module from which each imported name comes, by that name.
    """

    name: str
    is_package: bool
    tree: ast.Module
    origins: dict[str, str]

    @property
    def page(self) -> str:
        """Its place in the site."""
        place = self.name.replace(".", "/")
        return f"api/{place}/index.md" if self.is_package else f"api/{place}.md"

    @property
    def short(self) -> str:
        """Its name in the package that it is in."""
        return self.name.rpartition(".")[2]


@functools.cache
def modules() -> dict[str, Module]:
    """All public modules by dotted name, packages before what is in them."""
    found = {}
    for path in (ROOT / PACKAGE).rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        is_package = parts[-1] == "__init__"
        parts = parts[:-1] if is_package else parts
        if not any(part.startswith("_") for part in parts):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            name = ".".join(parts)
            found[name] = Module(name, is_package, tree, dict(_origins(tree)))
    return dict(sorted(found.items()))


def pages() -> dict[str, str]:
    """The text of every page, by its place in the site."""
    known = modules()
    return {module.page: _text(module, known) for module in known.values()}


def navigation() -> list[Any]:
    """The pages as MkDocs' `nav` has them: a section for each package, nested as they are."""
    return _section(PACKAGE, modules())


def offered(module: Module, known: dict[str, Module]) -> dict[str, tuple[Module, ast.AST | None]]:
    """What a package offers by name: where each is defined, and the statement that does; None for
    a module, and for what no statement defines."""
    return {name: _definition(name, module, known) for name in _exported(module)}


def first_line(home: Module, node: ast.AST | None) -> str:
    """The first sentence of a docstring, or of the text below a constant; "" without one."""
    text = ""
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
        text = ast.get_docstring(node) or ""
    elif isinstance(node, ast.stmt):
        below = [*home.tree.body, None][home.tree.body.index(node) + 1]
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            text = str(below.value.value)
    paragraph = " ".join(text.split("\n\n")[0].split())
    return re.split(r"\. (?=[A-Z])", paragraph)[0].rstrip(".:")


def _origins(tree: ast.Module) -> Iterator[tuple[str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGE):
            yield from ((alias.asname or alias.name, node.module or "") for alias in node.names)


def _inside(name: str, known: dict[str, Module]) -> list[Module]:
    return [module for module in known.values() if module.name.rpartition(".")[0] == name]


def _section(name: str, known: dict[str, Module]) -> list[Any]:
    entries: list[Any] = [known[name].page]
    for module in _inside(name, known):
        entries.append(
            {module.short: _section(module.name, known) if module.is_package else module.page}
        )
    return entries


def _text(module: Module, known: dict[str, Module]) -> str:
    parts = [f"# `{module.name}`", f"::: {module.name}"]
    if module.is_package:
        own = [name for name in _exported(module) if _definition(name, module, known)[0] is module]
        members = [name for name in own if f"{module.name}.{name}" not in known]
        parts[-1] += (
            f"\n    options:\n      members: {members or 'false'}\n      show_source: false"
        )
        rows = [
            f"| [`{name}`][{home.name}.{name}] | {_cell(first_line(home, node))} |"
            for name, (home, node) in offered(module, known).items()
            if node is not None
        ]
        parts += _table("What it offers", rows)
        parts += _table(
            "Modules",
            [
                f"| [`{inner.short}`]({inner.short}{'/index' * inner.is_package}.md) | "
                f"{_cell(first_line(inner, inner.tree))} |"
                for inner in _inside(module.name, known)
            ],
        )
    return "\n\n".join(parts) + "\n"


def _table(title: str, rows: list[str]) -> list[str]:
    return ["\n".join([f"## {title}\n", "| name | |", "| --- | --- |", *rows])] if rows else []


def _exported(module: Module) -> list[str]:
    for node in module.tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return sorted(ast.literal_eval(node.value))
    return []


def _definition(
    name: str, module: Module, known: dict[str, Module]
) -> tuple[Module, ast.AST | None]:
    home = module
    while home.origins.get(name) in known:
        home = known[home.origins[name]]
    return home, next((node for node in home.tree.body if name in _defined(node)), None)


def _defined(node: ast.AST) -> list[str]:
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return [target.id for target in targets if isinstance(target, ast.Name)]


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


# What MkDocs calls.


def on_config(config: Any) -> Any:
    """Put the pages into the navigation, below "API"."""
    config.nav.append({"API": navigation()})
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages to what is built."""
    from mkdocs.structure.files import File

    for place, text in pages().items():
        files.append(File.generated(config, place, content=text))
    return files
