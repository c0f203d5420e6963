"""A sweep on a disk that gets full, at every size and every number of files up to what it needs.

`unshare --mount python -m helpers.sweep_disk FOLDER STEP`, which `on_full_disks` calls, mounts
small disks at FOLDER, one after the other, with STEP pages or files more each time. It prints a
line of JSON for each: `limit` of the disk, `told`, what the sweep said (null where the disk was
large enough), `lost`, trials that were told of and cannot be read while the disk is full, and
`left` after the same sweep with more room.
"""

import json
import subprocess
import sys
from pathlib import Path

from asmjax.errors import UseError
from asmjax.sweep.driver import SweepProgress, run_sweep
from asmjax.sweep.results import results
from asmjax.sweep.store import Store, StoreError
from helpers.sweep_runs import environment
from helpers.sweep_trials import FakeTrial, fake_trials, run

TRIALS = 6

ENOUGH = {"size": "16m", "nr_inodes": "10000"}


class NoDisks(Exception):
    """Disks cannot be mounted here; says why."""


def on_full_disks(folder: Path, step: int = 1) -> list[dict]:
    """What becomes of a sweep on each disk, as it is printed.

    Raises:
        NoDisks: they cannot be mounted.
        CalledProcessError: they can, and the sweeps failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    alone = ["unshare", "--mount"]
    probe = [*alone, "mount", "-t", "tmpfs", "tmpfs", str(folder)]
    try:
        tried = subprocess.run(probe, stderr=subprocess.PIPE, text=True)
    except FileNotFoundError:
        raise NoDisks("there is no `unshare`") from None
    if tried.returncode:
        raise NoDisks(" ".join(tried.stderr.split()))
    words = [*alone, sys.executable, "-m", "helpers.sweep_disk", str(folder), str(step)]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, env=environment(), check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def sweep(folder: Path, trials: list[FakeTrial]) -> tuple[list[str], str | None, int]:
    """Keys that were told to be kept, what a full disk said, and how many trials are left."""
    kept: list[str] = []

    def tell(now: SweepProgress) -> None:
        if now.last is not None:
            kept.append(now.last)

    try:
        with Store.open(folder) as store:
            found = run_sweep(trials, store, run=run, workers=0, deadline_s=60.0, progress=tell)
            return kept, None, len(found.left)
    except StoreError as problem:
        return kept, str(problem), len(trials) - len(kept)


def on_disk(disk: Path, limit: dict[str, str]) -> dict:
    """What becomes of a sweep on a disk with that limit."""
    trials = fake_trials(TRIALS, arrays=True)
    folder = disk / "sweep"
    mount(disk, ENOUGH | limit)
    try:
        kept, told, _ = sweep(folder, trials)
        try:
            readable = {row.key for row in results(folder).stored}
        except UseError:
            readable = set()
        mount(disk, ENOUGH, again=True)
        _, _, left = sweep(folder, trials)
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    return {"limit": limit, "told": told, "lost": len(set(kept) - readable), "left": left}


def mount(disk: Path, limits: dict[str, str], again: bool = False) -> None:
    """Mount a disk in memory, or give it more room."""
    options = ",".join(f"{name}={value}" for name, value in limits.items())
    words = ["mount", "-t", "tmpfs", "-o", f"{'remount,' * again}{options}", "tmpfs", str(disk)]
    subprocess.run(words, check=True)


def main(folder: str, step: str) -> None:
    """Sizes in pages, then numbers of files."""
    disk = Path(folder)
    for name, unit in (("size", "k"), ("nr_inodes", "")):
        for count in range(1, 1000, int(step)):
            limit = {name: f"{4 * count}{unit}" if unit else str(count)}
            found = on_disk(disk, limit)
            print(json.dumps(found), flush=True)
            if found["told"] is None:
                break


if __name__ == "__main__":
    main(*sys.argv[1:])
