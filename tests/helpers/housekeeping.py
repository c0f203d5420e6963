"""What a run of all tests piles up in a process, and how the next file is spared it."""

import ctypes
import gc
from contextlib import suppress

import jax

from asmjax.machine import process_bytes

MOST_BYTES = 3 << 30
"""What a worker may keep compiled, so that two of them fit beside each other into 8 GB."""


def between_files() -> None:
    """What is alive stays, as a rule until the end, and is looked through no more.

    Jobs collect garbage before they measure: among millions of objects that took seconds each time.
    """
    if process_bytes() > MOST_BYTES:
        jax.clear_caches()
        # Without it the process stays as large, and this would happen after every file.
        with suppress(AttributeError, OSError):
            ctypes.CDLL(None).malloc_trim(0)
    gc.collect()
    gc.freeze()
