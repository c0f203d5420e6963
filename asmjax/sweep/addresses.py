"""Which schedulers a sweep may connect to: what a dask scheduler's peers send is run as code."""

import ipaddress
import json
from pathlib import Path
from urllib.parse import urlsplit

from asmjax.errors import UseError, file_errors, require

TLS_SETTINGS = ("CA_FILE", "CLIENT__CERT", "CLIENT__KEY")
"""Of the driver, behind `DASK_DISTRIBUTED__COMM__TLS__`."""


def scheduler_address(scheduler: str | None, scheduler_file: Path | None) -> str | None:
    """The address to connect to; None for a cluster of our own.

    Raises:
        UseError: two schedulers are named, the file does not name one, the address is none, or it
            is on another machine and not encrypted.
    """
    require(
        scheduler is None or scheduler_file is None,
        "--scheduler and --scheduler-file both name a scheduler; leave one out.",
    )
    if scheduler_file is not None:
        scheduler = _written_in(scheduler_file)
    if scheduler is None:
        return None
    address = scheduler if "://" in scheduler else f"tcp://{scheduler}"
    protocol, host = _parts(address)
    require(
        protocol in ("tcp", "tls") and host is not None,
        f"'{scheduler}' is no address of a scheduler; allowed: tls://HOST:PORT, and on this "
        "machine tcp://127.0.0.1:PORT.",
    )
    require(
        protocol == "tls" or _is_here(host),
        f"scheduler '{scheduler}' is on another machine and not encrypted: whoever reaches it can "
        "run programs as you. Start it with --protocol tls and certificates (docs/cluster.md), and "
        "name it as tls://HOST:PORT.",
    )
    return address


def check_certificates(security) -> None:
    """Raise `UseError` unless dask's configuration has what an encrypted connection needs."""
    found = (security.tls_ca_file, security.tls_client_cert, security.tls_client_key)
    missing = [name for name, value in zip(TLS_SETTINGS, found, strict=True) if not value]
    require(
        not missing,
        "a tls:// scheduler wants certificates; set "
        + " and ".join(f"DASK_DISTRIBUTED__COMM__TLS__{name}" for name in missing)
        + " to paths of PEM files (docs/cluster.md).",
    )


def _written_in(path: Path) -> str:
    remedy = "start one: dask scheduler --scheduler-file FILE"
    with file_errors(f"cannot read the scheduler file '{path}'", remedy):
        content = path.read_bytes()
    try:
        address = json.loads(content)["address"]
    except (ValueError, TypeError, KeyError) as problem:
        raise UseError(f"'{path}' is no scheduler file; {remedy}.") from problem
    require(isinstance(address, str), f"'{path}' is no scheduler file; {remedy}.")
    return address


def _parts(address: str) -> tuple[str, str | None]:
    """Protocol, and host where there are a host and a port."""
    try:
        parts = urlsplit(address)
        return parts.scheme, parts.hostname if parts.port else None
    except ValueError:
        return "", None


def _is_here(host: str | None) -> bool:
    """Whether a host is the loopback of this machine, whatever a name server says."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host or "").is_loopback
    except ValueError:
        return False
