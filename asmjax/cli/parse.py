"""From the words of a command line to an options object, with tyro.

Two things are added to tyro: the groups an options class inherits become the groups of `--help`,
and an error is one line instead of a box.
"""

import contextlib
import dataclasses
import io
import os
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Union

import tyro

from asmjax.errors import UseError

if TYPE_CHECKING:
    from asmjax.cli import Command

# How tyro words a bad value of an option that may be left out.
_UNION = re.compile(
    r"no type matching \{?(.*?)\}? could be instantiated from \[(.*?)\]\. Got errors: .*"
)

DESCRIPTION = """Where does a shadow map alias, what would each pixel need, and what does accuracy
cost? Measured on Mitsuba scenes against ray-traced truth."""


def parse(arguments: list[str], commands: "Mapping[str, Command]") -> tuple[str, Any]:
    """The chosen command's name and its options object.

    Raises:
        UseError: what tyro found wrong, in one line.
        SystemExit: after `--help` was printed (code 0).
    """
    from asmjax.cli import load

    # Only the wanted command's options are looked at: reading all help texts would take longer
    # than everything else.
    wanted = next((word for word in arguments if word in commands), None)
    options = load(commands[wanted].options) if wanted else None
    forms = {name: _form(name, options if name == wanted else None) for name in commands}
    members = [
        Annotated[form, tyro.conf.subcommand(name, description=commands[name].summary)]
        for name, form in forms.items()
    ]
    filled = _ask_tyro(Union[tuple(members)], arguments)  # noqa: UP007 - members known at run time
    if wanted is None or options is None:
        raise UseError(f"name a command: {', '.join(commands)}; asmjax --help explains them")
    values: dict[str, Any] = {}
    for group in dataclasses.fields(filled):
        part = getattr(filled, group.name)
        values |= {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    return wanted, options(**values)


def _form(name: str, options: type | None) -> type:
    """A class with one field per option group: nested is what tyro shows as groups."""
    bases = options.__bases__ if options else ()
    groups = [base for base in bases if dataclasses.is_dataclass(base)]
    if options and not groups:
        groups = [options]
    fields = [(group.__name__.removesuffix("Options").lower(), group, group()) for group in groups]
    return dataclasses.make_dataclass(f"{name}_form", fields, frozen=True)


def _ask_tyro(form: Any, arguments: list[str]) -> Any:
    options = {
        "args": arguments,
        "prog": "asmjax",
        "description": DESCRIPTION,
        "config": (
            tyro.conf.OmitArgPrefixes,
            tyro.conf.FlagCreatePairsOff,
            tyro.conf.DisallowNone,
        ),
    }
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return tyro.cli(form, **options)
    except SystemExit as end:
        if not end.code:
            raise
    # Once more in a terminal wide enough for every word that was given: wrapped lines cannot be
    # joined without guessing. Words of spaces alone are told in quotes.
    options["args"] = [word if word.strip() else repr(word) for word in arguments]
    box, width = io.StringIO(), 2000 + sum(map(len, arguments))
    with _columns(str(width)), contextlib.redirect_stderr(box), contextlib.suppress(SystemExit):
        tyro.cli(form, **options)
    raise UseError(flatten_box(box.getvalue()))


@contextlib.contextmanager
def _columns(width: str) -> Iterator[None]:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = width
    try:
        yield
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before


def flatten_box(box: str) -> str:
    """The sentences of one of tyro's error boxes on one line, with names it suggests."""
    sentences = []
    for section in _sections(box):
        if section[0].startswith("Argument helptext"):
            continue  # --help has it
        if section[0].startswith("Perhaps you meant"):
            section = [section[0], ", ".join(x for x in section[1:] if x.startswith("--"))]
        sentences.append(_UNION.sub(r"expected \1, got \2", " ".join(section).rstrip(".")))
    return ". ".join(sentences)


def _sections(box: str) -> Iterator[list[str]]:
    """The lines of each part of the box, without its frame and title."""
    section: list[str] = []
    for line in box.splitlines():
        if re.fullmatch(r"\W*[╭╰].*|│? *─+ *│?", line.strip()):
            if section:
                yield section
            section = []
        elif text := line.strip("│ "):
            section.append(text)
    if section:
        yield section
