"""Tables of the page, from the same columns as those of terminal and CSV."""

from collections.abc import Mapping, Sequence
from itertools import groupby

from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.table import Column


def table(
    columns: Sequence[Column], rows: Sequence[Mapping], caption: str, wordy: int = 0
) -> Markup:
    """A row for each item; the first column heads its row, columns of a group share a heading.

    Args:
        wordy: so many columns at the end are sentences, which may go over several lines.
    """
    groups = [(name, len(list(span))) for name, span in groupby(columns, lambda c: c.group)]
    above = [
        tag("th", name, colspan=count if count > 1 else None, scope="colgroup" if name else None)
        if name
        else tag("td", colspan=count if count > 1 else None)
        for name, count in groups
    ]
    kinds = [None] * (len(columns) - wordy) + ["wordy"] * wordy
    heads = [
        tag("th", column.head, scope="col", class_=kind)
        for column, kind in zip(columns, kinds, strict=True)
    ]
    body = [tag("tr", *_cells(columns, kinds, row)) for row in rows]
    grouped = tag("tr", *above, class_="groups") if any(name for name, _ in groups) else None
    content = joined([tag("thead", grouped, tag("tr", *heads)), tag("tbody", *body)])
    return _framed(caption, content)


def _cells(
    columns: Sequence[Column], kinds: Sequence[str | None], row: Mapping
) -> list[Markup]:  # fmt: skip
    cells = []
    for i, (column, kind) in enumerate(zip(columns, kinds, strict=True)):
        value = column.value(row)
        text = "-" if value is None else column.text(value)
        cells.append(tag("th", text, scope="row") if i == 0 else tag("td", text, class_=kind))
    return cells


def pairs(rows: Sequence[tuple[str, str]], caption: str) -> Markup:
    """Two columns: what, and which, as words."""
    body = [tag("tr", tag("th", name, scope="row"), tag("td", value)) for name, value in rows]
    return _framed(caption, tag("tbody", *body), "words")


def _framed(caption: str, content: Markup, kind: str | None = None) -> Markup:
    """Wide tables scroll within their own frame, not the page."""
    inner = tag("table", tag("caption", caption), content, class_=kind)
    return tag("div", inner, class_="table", tabindex="0", role="region", aria_label=caption)


def bullets(lines: Sequence[str], class_: str | None = None) -> Markup | None:
    """A list; None where there is nothing to say."""
    return tag("ul", *(tag("li", line) for line in lines), class_=class_) if lines else None
