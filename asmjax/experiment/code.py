"""Which code measured: a measurement of other code, or of other libraries, is another one."""

import hashlib
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGE = Path(__file__).parents[1]

LIBRARIES = ("jax", "jaxlib", "mitsuba", "drjit", "numpy")
"""Whose versions change what is measured."""


@cache
def code_facts() -> dict[str, str]:
    """A digest of all source files of the package, and the versions of `LIBRARIES`."""
    found = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        found.update(f"{path.relative_to(PACKAGE).as_posix()}\n".encode())
        found.update(path.read_bytes())
    return {"code": found.hexdigest()[:16], **{name: _version(name) for name in LIBRARIES}}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "none"
