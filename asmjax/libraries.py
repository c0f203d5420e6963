"""Whose work a number is: the libraries that can change one, and their versions."""

from importlib import metadata

LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "numpy", "scipy", "mitsuba", "drjit")
"""Other versions of them may give other numbers, and other times."""


def version_of(name: str) -> str | None:
    """The installed version of a package; None where it is not installed, as asmjax itself is not
    when it runs from a source tree."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def versions() -> dict[str, str | None]:
    """Of asmjax, and of all `LIBRARIES`."""
    return {name: version_of(name) for name in ("asmjax", *LIBRARIES)}
