"""A sweep on three machines of a small network, one of which is cut off in the middle."""

import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from cluster.namespaces import HUB, Network
from helpers.sweep_runs import driver, statuses
from helpers.sweep_tls import certified, program

PORT = 8786

TCP_TIMEOUT = "12s"
"""After which a silent connection counts as lost; dask's own is 30 s, its least 11."""


def cut_off(network: Network, folder: Path, count: int, seconds: float) -> dict[str, Any]:
    """Sweep `count` trials of so many seconds, and cut a worker off after a third of them."""
    settings = certified(folder) | {"DASK_DISTRIBUTED__COMM__TIMEOUTS__TCP": TCP_TIMEOUT}
    address = f"tls://{HUB}:{PORT}"
    common = ["--protocol", "tls", "--no-dashboard"]
    with ExitStack() as stack:

        def started(place: int, *words: str) -> subprocess.Popen:
            return stack.enter_context(program(network.words(place, *words), settings, folder))

        dask = [sys.executable, "-m"]
        started(0, *dask, "distributed.cli.dask_scheduler", "--host", HUB, "--port", str(PORT),
                *common)  # fmt: skip
        for place in (1, 2, 3):
            started(place, *dask, "distributed.cli.dask_worker", address, "--nthreads", "1",
                    "--memory-limit", "0", "--local-directory", str(folder), *common)  # fmt: skip
        kept, cut = [0.0], 0.0
        words = network.words(0, *driver(folder, count, seconds, address))
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=settings) as process:
            stack.callback(process.kill)
            assert process.stdout is not None
            for line in process.stdout:
                if line.startswith("kept"):
                    kept.append(time.monotonic())
                    if len(kept) == count // 3 + 1:
                        network.cut(1)
                        cut = time.monotonic()
    return {
        "trials": count,
        "kept_before": count // 3,
        "not_done": count - statuses(folder / "s")["done"],
        "seconds_after_cut": kept[-1] - cut,
        "tcp_timeout": TCP_TIMEOUT,
    }
