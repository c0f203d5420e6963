"""Which code measured: a measurement of other code, or of other libraries, is another one."""

import hashlib
from functools import cache
from pathlib import Path

from asmjax.libraries import LIBRARIES, version_of

PACKAGE = Path(__file__).parents[1]


@cache
def code_facts() -> dict[str, str]:
    """A digest of all source files of the package, and the versions of `LIBRARIES`."""
    found = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        found.update(f"{path.relative_to(PACKAGE).as_posix()}\n".encode())
        found.update(path.read_bytes())
    return {
        "code": found.hexdigest()[:16],
        **{name: version_of(name) or "none" for name in LIBRARIES},
    }
