"""Ctrl-C where it may not come at any moment: libraries print it, make another error of it, or lose
it, as one that comes in a callback of the garbage collector."""

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def interruption_waits(most: int = 1) -> Iterator[Callable[[], None]]:
    """Raise the `KeyboardInterrupt` of an interruption inside at the end, or when the function is
    called that this gives.

    Args:
        most: so many wait, the next one comes at once. With 0 the first one does, and only waits
            where a library lost it.
    """
    # Elsewhere, and where interruptions are ignored or somebody else's, all stays as it is.
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield lambda: None
        return
    heard: list[int] = []

    def note(number: int, _) -> None:
        heard.append(number)
        if len(heard) > most:
            raise KeyboardInterrupt

    def raise_if_heard() -> None:
        if heard:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, note)
    try:
        with _lost_in_silence():
            yield raise_if_heard
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    raise_if_heard()


@contextlib.contextmanager
def _lost_in_silence() -> Iterator[None]:
    """Python does not print that it ignores an interruption: it is remembered."""
    before = sys.unraisablehook

    def hook(lost, /) -> None:
        if lost.exc_type is not KeyboardInterrupt:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
