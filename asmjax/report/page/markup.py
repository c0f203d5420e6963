"""HTML that is safe by its type: text is escaped unless a function here made it."""

import html
from collections.abc import Iterable

VOID = {"img", "input", "link", "meta"}
"""Elements that hold nothing and are not closed."""


class Markup(str):
    """Text that is HTML already. Only `tag` and `joined` make it, and constants of this package."""


def tag(name: str, /, *children: str | None, **attributes: str | float | bool | None) -> Markup:
    """An element. Children and values that are no `Markup` are escaped; None is left out.

    An attribute is written without its last underscore and with dashes for others: `class_`,
    `data_x`. True gives it without a value, False and None leave it out.
    """
    words = [name]
    for key, value in attributes.items():
        if value is None or value is False:
            continue
        key = key.removesuffix("_").replace("_", "-")
        words.append(key if value is True else f'{key}="{escaped(str(value))}"')
    opened = f"<{' '.join(words)}>"
    return Markup(opened if name in VOID else f"{opened}{joined(children)}</{name}>")


def joined(parts: Iterable[str | None], between: str = "") -> Markup:
    """Parts one after the other, escaped unless they are `Markup`; None is left out."""
    safe = [part if isinstance(part, Markup) else escaped(part) for part in parts if part]
    return Markup(escaped(between).join(safe))


def escaped(text: str) -> Markup:
    """`text` as HTML shows it; what cannot be printed, such as a sign that turns the direction of
    writing, becomes its escape."""
    shown = "".join(
        char if char.isprintable() or char.isspace() else ascii(char)[1:-1] for char in text
    )
    return Markup(html.escape(shown))
