"""Options as notebooks give them: an object of them, or a scene's name and some of its fields."""

from dataclasses import fields, replace
from typing import Any, TypeVar

from asmjax.errors import unknown_name

Options = TypeVar("Options")


def given_options(kind: type[Options], what: Options | str, changes: dict[str, Any]) -> Options:
    """Options of a kind: `what` with some of its fields changed, or those of the scene of that
    name.

    Raises:
        UseError: they have no field of that name, or as the options do.
    """
    made: Any = kind
    known = [field.name for field in fields(made)]
    for name in changes:
        if name not in known:
            raise unknown_name("option", name, known)
    if isinstance(what, str):
        return made(**{"scene": what, **changes})
    return replace(what, **changes)  # pyright: ignore[reportCallIssue, reportArgumentType]
