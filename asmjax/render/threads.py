"""Dr.Jit's worker threads: there while rays are cast, gone while JAX computes.

A worker that finds nothing more to do looks for work for about 20 ms before it sleeps, and a JAX
kernel that follows shares the cores with it: on two cores it takes twice as long. Ending the
workers and starting them again takes 0.1 ms (docs/benchmarks.md, "Two thread pools").
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()
_inside = 0
_wanted = 1


@contextmanager
def all_threads() -> Iterator[None]:
    """Dr.Jit has all its threads inside, and one outside after the first use.

    Put it around Mitsuba renders of your own that come after calls of asmjax. A number set with
    `drjit.set_thread_count` outside is respected when it is more than one.
    """
    global _inside, _wanted
    import drjit as dr

    with _lock:
        if _inside == 0:
            now = dr.thread_count()
            _wanted = now if now > 1 else _wanted
            dr.set_thread_count(_wanted)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                dr.set_thread_count(1)
