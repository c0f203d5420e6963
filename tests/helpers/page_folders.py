"""Folders of results whose every text is hostile, made from the schemas; and reading pages."""

import json
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from asmjax.report.keys import Key
from asmjax.report.page.markup import VOID
from asmjax.report.schema import SCHEMAS, validate_report

HOSTILE = "<script>alert('x')</script>\"&\u202e\u0000\n<img src=http://evil.example/x onerror=1>"
"""What a scene file could call its lights."""

_VALUES: dict[str, Any] = {
    "text": HOSTILE,
    "integer": 3,
    "count": 3,
    "number": 0.5,
    "amount": 0.5,
    "fraction": 0.25,
    "flag": True,
    "text list": [HOSTILE],
    "size": [64, 48],
    "vector": [1.0, 2.0, 3.0],
    "any object": {HOSTILE: HOSTILE},
    "text object": {HOSTILE: HOSTILE},
}


def sample(keys: Mapping[str, Key]) -> dict:
    """An object with every key of a schema."""
    return {name: _sample(key) for name, key in keys.items()}


def _sample(key: Key) -> Any:
    if isinstance(key.kind, str):
        value = _VALUES[key.kind]
        return json.loads(json.dumps(value))
    return [sample(key.kind)] if key.each else sample(key.kind)


def report_of(schema: str) -> dict:
    """A valid report with all keys of its schema, every text hostile that may be."""
    report: dict[str, Any] = sample(SCHEMAS[schema]) | {"schema": schema}
    _consistent(report)
    kind = schema.split("/")[1]
    if kind in ("run", "aliasing"):
        report["methods"] = _methods(report["methods"][0])
    if kind == "walkthrough":
        frame = report["frames"][0]
        frame["frame"], frame["methods"] = 0, _methods(frame["methods"][0])
        report["summary"]["methods"] = _methods(report["summary"]["methods"][0])
    if kind == "comparison":
        report["ended"] = "complete"
        for trial in (*report["trials"], *report["yardsticks"]):
            trial |= {"family": "uniform", "name": f"uniform-{HOSTILE}"}
    if kind == "tuning":
        report["outcome"] = "found"
        rivals = list(report["objective"].values())
        for one in (*rivals, *report["tried"], *report["finalists"]):
            one["role"] = "sample"
        report["views"].append(report["views"][0] | {"held_out": False, "name": "tuned on"})
    if kind in ("run", "plan"):
        for decision in report["plan"]["decisions"]:
            decision["kind"] = "hard"
    validate_report(report)
    return report


def _consistent(value: Any) -> None:
    """The wrong pixels are the sum of their two kinds."""
    if isinstance(value, dict):
        if {"misclassified_fraction", "false_lit_fraction"} <= value.keys():
            value["misclassified_fraction"] = 0.5
        for item in value.values():
            _consistent(item)
    elif isinstance(value, list):
        for item in value:
            _consistent(item)


def _methods(one: dict) -> list[dict]:
    families = ("uniform", "adaptive", "rays")
    return [
        one | {"name": f"{family}-{HOSTILE}"} | ({"family": family} if "family" in one else {})
        for family in families
    ]


def write_report(folder: Path, report: dict) -> Path:
    """A folder with that report.json."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "report.json").write_text(json.dumps(report), encoding="utf-8")
    return folder


class PageReader(HTMLParser):
    """What is in a page.

    Attributes:
        elements: name and attributes of each, in order.
        texts: the text within each kind of element.
        unbalanced: end tags that close nothing, and elements that nothing closes.
    """

    def __init__(self, page: str):
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.unbalanced: list[str] = []
        self._open: list[str] = []
        self.feed(page)
        self.close()
        self.unbalanced += self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self._open and self._open[-1] == tag:
            self._open.pop()
        else:
            self.unbalanced.append(f"/{tag}")

    def handle_data(self, data: str) -> None:
        for tag in self._open[-1:]:
            self.texts.setdefault(tag, []).append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        """The attributes of all elements of that name."""
        return [attributes for name, attributes in self.elements if name == tag]

    def of_class(self, name: str) -> list[dict[str, str | None]]:
        """The attributes of all elements of that class."""
        return [a for _, a in self.elements if name in (a.get("class") or "").split()]


def check_escaped(page: str) -> None:
    """Of a page whose texts are `HOSTILE` none became anything but text, and none was lost."""
    read = PageReader(page)
    assert read.unbalanced == []
    assert len(read.all("script")) == 1 and read.all("script")[0] == {}
    assert [a for a in read.all("img") if not (a["src"] or "").startswith("data:")] == []
    assert all(not name.startswith("on") for _, found in read.elements for name in found)
    assert "\u202e" not in page and "\0" not in page and r"\u202e" in page
    assert any(HOSTILE.split("\n")[0][:8] in text for text in read.texts["td"])
    assert read.texts["title"] != [] and len(read.all("h1")) == 1
