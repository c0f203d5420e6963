"""What the page shows of one folder."""

from dataclasses import dataclass

from asmjax.report.page.markup import Markup


@dataclass(frozen=True)
class Part:
    """One section of the page.

    Attributes:
        title: what was measured, and on what.
        summary: what came of it, in sentences, which stand at the head of the page.
        body: charts, pictures and tables.
        subject: what the title of the page names; None for the report's scene.
    """

    title: str
    summary: tuple[str, ...]
    body: Markup
    subject: str | None = None
