"""The whole page: head, summary, a section for each folder, style and script, in one file."""

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from asmjax import __version__
from asmjax.errors import file_errors
from asmjax.paths import write_atomic
from asmjax.report.page.folder import Check, Results, read_results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.sections import SECTIONS, Sections
from asmjax.report.page.tables import bullets
from asmjax.report.schema import validate_report


def write_page(
    folders: Sequence[Path],
    path: Path,
    sections: Sections = SECTIONS,
    check: Check = validate_report,
) -> int:
    """Write the page of those folders to `path`, whole or not at all; returns its bytes.

    The same folders give the same page.

    Args:
        sections: by schema, those of other kinds of report among them.
        check: of all these kinds.

    Raises:
        UseError: a folder has no results that are known, they are damaged, or `path` cannot be
            written.
    """
    page = page_of([read_results(folder, check) for folder in folders], sections)
    with file_errors(f"cannot write the page to '{path}'", "choose another --out"):
        write_atomic(path, page)
    return len(page.encode())


def page_of(results: Sequence[Results], sections: Sections = SECTIONS) -> Markup:
    """The page of those results.

    Raises:
        UseError: a picture of theirs is damaged.
    """
    parts = [sections[one.report["schema"]](one) for one in results]
    subjects = [
        part.subject or one.report["scene"] for part, one in zip(parts, results, strict=True)
    ]
    title = f"Shadow-map accuracy: {', '.join(dict.fromkeys(subjects))}"
    style, script = _file("page.css"), _file("page.js")
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_policy(style, script)),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light"),
        tag("link", rel="icon", href="data:,"),
        tag("title", title),
        tag("style", style),
    )
    blocks = [
        tag("section", tag("h2", part.title), part.body, id=f"part-{k}")
        for k, part in enumerate(parts, start=1)
    ]
    body = tag(
        "body",
        tag("header", tag("h1", title), tag("p", _made_by(len(parts)), class_="note")),
        tag("main", _summary(parts), *blocks),
        tag("script", script),
    )
    return joined([Markup("<!DOCTYPE html>"), tag("html", head, body, lang="en"), "\n"])


def _summary(parts: Sequence[Part]) -> Markup:
    entries = [
        tag(
            "li",
            tag("a", part.title, href=f"#part-{k}"),
            bullets(part.summary),
        )
        for k, part in enumerate(parts, start=1)
    ]
    return tag("section", tag("h2", "Summary"), tag("ul", *entries), class_="summary")


def _made_by(count: int) -> str:
    results = "a folder" if count == 1 else f"{count} folders"
    return f"Made by asmjax {__version__} from {results} of results. This file needs no other."


def _file(name: str) -> Markup:
    """Style or script of this package; HTML takes both as they are."""
    return Markup(resources.files("asmjax.report.page").joinpath(name).read_text(encoding="utf-8"))


def _policy(style: str, script: str) -> str:
    """What the browser may do: show pictures that are in the page, use its style, run its script.

    It could fetch nothing and run nothing else even if a text got past the escaping.
    """
    return (
        f"default-src 'none'; img-src data:; style-src {_hash(style)}; script-src {_hash(script)}"
    )


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
