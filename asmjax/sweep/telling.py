"""What a sweep tells while it runs: a bar on a terminal, elsewhere a line now and then."""

import contextlib
import sys
from collections.abc import Callable, Iterator

from tqdm import tqdm

from asmjax.sweep.driver import SweepProgress
from asmjax.sweep.words import in_words

EVERY = 60.0
"""Seconds between lines."""

MISSED = 10.0
"""Seconds after which it is told that no worker is there."""


@contextlib.contextmanager
def telling(quiet: bool, wait_s: float) -> Iterator[Callable[[SweepProgress], None]]:
    """What is to be called with the progress of a sweep, which waits so long for workers.

    Args:
        quiet: failures and missing workers are told all the same.
    """
    # None is for terminals only.
    with tqdm(disable=quiet or None, leave=False, unit="trial", file=sys.stderr) as bar:
        yield _Telling(bar, bar.disable and not quiet, wait_s)


class _Telling:
    """Progress: rate and time left, failures, and who works."""

    def __init__(self, bar: tqdm, lines: bool, wait_s: float):
        self._bar, self._lines, self._wait_s = bar, lines, wait_s
        self._begun, self._missed, self._told = False, False, 0.0

    def __call__(self, now: SweepProgress) -> None:
        if not self._begun:
            # What was finished before took no time of this run: the rate is of the others.
            self._begun = True
            self._bar.reset(total=now.total - now.skipped)
        self._bar.n = now.done + now.failed
        self._bar.set_postfix_str(", ".join(_who(now)), refresh=False)
        self._bar.refresh()
        if now.cause:
            _say(f"trial {now.last} failed: {now.cause}")
        if now.alone_s >= MISSED and not self._missed:
            _say(
                f"no worker is there; the sweep waits {in_words(self._wait_s)} for one "
                "(--wait-minutes)"
            )
        self._missed = now.alone_s >= MISSED
        if self._lines and now.seconds >= self._told + EVERY:
            self._told = now.seconds
            _say(_line(now))


def _who(now: SweepProgress) -> list[str]:
    busy = f"{now.workers} workers" if now.workers != 1 else "1 worker"
    said = {"failed": now.failed, "known": now.skipped}
    told = [busy if now.workers else "waiting for workers"]
    return told + [f"{count} {name}" for name, count in said.items() if count]


def _line(now: SweepProgress) -> str:
    """Where a sweep is: "12 of 40 trials, 2 workers, 1 failed, about 3 min left"."""
    ended, count = now.done + now.failed, now.total - now.skipped
    left = (count - ended) * now.seconds / ended if ended else None
    told = [f"{ended:,} of {count:,} trials", *_who(now)]
    return ", ".join(told if left is None else [*told, f"about {in_words(left)} left"])


def _say(text: str) -> None:
    tqdm.write(text, file=sys.stderr)
