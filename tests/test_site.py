"""The site of the documentation: every page and module is in it, and every link leads somewhere."""

import ast
import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WRITTEN = sorted(
    path
    for pattern in ("*.md", "docs/**/*.md", "notebooks/*.md", "experiments/*.md", "analysis/*.md")
    for path in ROOT.glob(pattern)
)
SITE = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))


def loaded_script(name: str):
    """A file of scripts/ or notebooks/ as a module."""
    path = ROOT / name
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def api():
    return loaded_script("scripts/api_pages.py")


def places(nav) -> Iterator[str]:
    """All pages of a navigation."""
    for entry in nav if isinstance(nav, list) else nav.values():
        yield from [entry] if isinstance(entry, str) else places(entry)


def slug(heading: str) -> str:
    """The anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def prose(path: Path) -> str:
    """A page without its blocks of code."""
    text = path.read_text(encoding="utf-8")
    return re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_relative_link_leads_somewhere(page):
    """Files and pictures exist, headings too."""
    for link, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)", prose(page)):
        target = (page.parent / link) if link else page
        assert target.exists(), f"{link} is not there"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in map(slug, headings), f"{target.name} has no heading '{anchor}'"


def test_every_page_is_in_the_navigation():
    """What the navigation has and is not there, the building of the site tells."""
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    assert pages <= set(places(SITE["nav"]))


def test_pages_of_the_site_stay_within_it():
    """A link out of docs/ works in the repository and is broken on the site."""
    for page in DOCS.rglob("*.md"):
        for link in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", prose(page)):
            assert DOCS in (page.parent / link).resolve().parents, f"{page.name}: {link}"


def test_every_public_module_is_in_the_navigation(api):
    """Each has a page with its docstring, and a place below "API"."""
    sources = [path.relative_to(ROOT) for path in (ROOT / "asmjax").rglob("*.py")]
    public = {
        ".".join(path.with_suffix("").parts).removesuffix(".__init__")
        for path in sources
        if not re.search(r"/_(?!_init__)", path.as_posix())
    }
    pages, listed = api.pages(), list(places(api.navigation()))
    assert len(listed) == len(set(listed)) and set(listed) == set(pages)
    shown = {name for text in pages.values() for name in re.findall(r"^::: (.*)$", text, re.M)}
    assert shown == public and len(public) > 200


def test_what_packages_offer_is_found_where_it_is_defined(api):
    """Every name of every `__all__` leads to the statement that defines it."""
    known = api.modules()
    for package in known.values():
        for name, (home, node) in api.offered(package, known).items():
            assert node is not None or f"{package.name}.{name}" in known, f"{package.name}.{name}"
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                assert api.first_line(home, node), f"{home.name}.{name} has no docstring"
    offered = api.pages()["api/asmjax/index.md"]
    assert "[`UniformShadowMap`][asmjax.shadow.uniform.UniformShadowMap]" in offered
    assert "| [`shadow`](shadow/index.md) |" in offered
    registry = api.pages()["api/asmjax/shadow/index.md"]
    assert re.search(r"\[`MAPS`\].* \| Family name, with which", registry)


def test_every_picture_is_in_the_gallery():
    """With what it shows, and how to draw it."""
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    for picture in (DOCS / "images").glob("*.png"):
        assert f"(images/{picture.name})" in text, picture.name


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    """As `make docs` builds it: a broken link or reference is an error."""
    pytest.importorskip("mkdocs", reason="`make docs` installs what builds the site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(tmp_path)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "api/asmjax/shadow/uniform.html").exists()
