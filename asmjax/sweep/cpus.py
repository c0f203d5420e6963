"""One CPU for each process that carries out trials, of those that nobody else of asmjax has.

Only affinity that is set before JAX and Dr.Jit start bounds the threads of both. A claim is a name
in the abstract socket namespace of Linux: the kernel gives it to one process of the machine, and
takes it back when that process ends, however it does.
"""

import os
import socket
import sys

_claims: list[socket.socket] = []
"""Held until this process ends."""


def claim_cpu() -> int | None:
    """A CPU that this process may use and that no other claims, from now on claimed.

    Where all are claimed one of them is shared; None where affinity cannot be set.
    """
    if sys.platform != "linux":
        return None
    # Of the main thread: this one may be kept to a CPU already.
    usable = sorted(os.sched_getaffinity(os.getpid()))
    for cpu in usable:
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            claim.bind(f"\0asmjax-cpu-{cpu}")
        except OSError:
            claim.close()
            continue
        _claims.append(claim)
        return cpu
    return usable[os.getpid() % len(usable)]


def stay_on(cpu: int | None) -> None:
    """Keep this thread, and the processes that it starts, on one CPU."""
    if cpu is not None and sys.platform == "linux":
        os.sched_setaffinity(0, {cpu})
