"""Notebooks run as they stand, at smoke size, and their pages show their code."""

import ast
import re

import pytest
from helpers.notebooks import FOLDER, PNG, ran, render, script

PAGES = FOLDER.parent / "docs/notebooks"
EVERY = pytest.mark.parametrize("name", render.NOTEBOOKS)


@pytest.fixture
def smoke(monkeypatch, tmp_path):
    """The smallest sizes, in a folder where a notebook may write."""
    monkeypatch.setenv("ASMJAX_SMOKE", "1")
    monkeypatch.chdir(tmp_path)


def test_all_notebooks_are_rendered():
    """Nothing of the folder is forgotten."""
    scripts = {path.stem for path in FOLDER.glob("*.py")} - {"render"}
    assert scripts == set(render.NOTEBOOKS)
    assert {path.stem for path in PAGES.glob("*.md")} == scripts


@EVERY
def test_a_notebook_begins_with_its_title_and_uses_what_is_public(name):
    """A Markdown title, code that parses, and no name with an underscore of asmjax."""
    first, *others = render.cells(script(name))
    assert first.kind == "markdown" and first.text.startswith("# ")
    code = [cell.text for cell in others if cell.kind == "code"]
    assert len(code) >= 5
    for text in code:
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom):
                words = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
                assert not any(word.startswith("_") for word in words)
            if isinstance(node, ast.Attribute):
                assert not node.attr.startswith("_")


@EVERY
def test_pages_show_the_code_of_today(name):
    """As `python notebooks/render.py docs/notebooks` writes it; every figure is there."""
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```python\n(.*?)\n```$", text, re.MULTILINE | re.DOTALL)
    assert shown == [cell.text for cell in render.cells(script(name)) if cell.kind == "code"]
    assert all(cell.text in text for cell in render.cells(script(name)))
    pictures = re.findall(r"\]\((images/[^)]+)\)", text)
    assert pictures and all((PAGES / picture).exists() for picture in pictures)
    assert str(FOLDER.parent) not in text and "Traceback" not in text


@pytest.mark.mitsuba
def test_a_first_look_takes_ten_cells(smoke):
    """It runs, its adaptive map is better than its uniform one, and it shows four figures."""
    assert sum(cell.kind == "code" for cell in render.cells(script("first_look"))) == 10
    names, output, figures = ran("first_look")
    wrong = {
        line.split("-")[0]: float(line.split()[1].rstrip("%"))
        for line in output.splitlines()
        if " wrong, " in line
    }
    assert wrong["adaptive"] < wrong["uniform"] / 10
    assert names["tree"].pool.used_pages > 0
    assert len(figures) == 4 and all(figure.startswith(PNG) for figure in figures)


@pytest.mark.slow
@pytest.mark.mitsuba
@pytest.mark.parametrize("name", [name for name in render.NOTEBOOKS if name != "first_look"])
def test_longer_notebooks_run(name, smoke):
    """From the first cell to the last, with figures and without a complaint."""
    names, output, figures = ran(name)
    assert len(figures) >= 2 and all(figure.startswith(PNG) for figure in figures)
    if name == "hard_cases":
        assert "announced" in output and "silent" not in output
    if name == "your_own_scene":
        assert "terrace" in output and output.count("unknown scene 'paper_romm'") == 1
    if name == "tuning":
        assert names["comparison"].best(error=0.5).trial.edge_px <= 0.5
        assert output.count("0.1 px within a nanosecond: refused, nothing that was tried") == 1
        found = names["tuning"].found
        assert set(found.rivals) == {"default", "tuned", "grid_best", "random_best"}
        assert found.tuned.objective(found.goal) <= found.default.objective(found.goal)
        prices = [point.price for point in found.front]
        assert prices == sorted(prices) and prices[2] == pytest.approx(found.goal.price)
