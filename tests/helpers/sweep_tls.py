"""Certificates of one's own, and dask's programs that are connected by them."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from helpers.sweep_runs import environment

CERTIFICATES = Path(__file__).parents[2] / "experiments" / "cluster" / "certificates.sh"


def certified(folder: Path) -> dict[str, str]:
    """The environment of programs with new certificates of `certificates.sh`."""
    tls = folder / "tls"
    subprocess.run([str(CERTIFICATES), str(tls)], check=True)
    words = ["bash", "-c", f"source '{tls}/settings.sh' && env -0"]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    return environment() | {
        name: value
        for name, _, value in (line.partition("=") for line in told.split("\0"))
        if name.startswith("DASK_")
    }


def configured(settings: dict[str, str]) -> dict[str, str]:
    """For `dask.config.set`, what an environment says to dask."""
    return {
        name.removeprefix("DASK_").lower().replace("__", "."): value
        for name, value in settings.items()
        if name.startswith("DASK_")
    }


@contextmanager
def program(words: list[str], settings: dict[str, str], folder: Path) -> Iterator[Any]:
    """A program that ends with the context; what it says goes to `folder`/said."""
    with (folder / "said").open("a") as said:
        process = subprocess.Popen(words, stdout=said, stderr=said, env=settings)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
