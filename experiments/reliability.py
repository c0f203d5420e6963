"""What does a sweep lose to kills, full disks, bad trials and cut networks, and what does it cost?

Drivers and workers are killed at random points, disks of every size get full, trials end as badly
as they can, a worker of a small network is cut off; then the overhead of a trial, what a second
worker brings, and what a thousand warm trials leave behind in memory.

    python experiments/reliability.py [--smoke] [--out DIR] [--only STEP ...] [--docs]

Takes about 20 minutes on 2 cores. Throughput is measured, so nothing else may run beside it. Full
disks and networks need root on Linux, and are left out elsewhere. `--docs` writes
docs/reliability.md.
"""

import argparse
import json
import os
import random
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
# Their trials, and eyes on their processes, are those of the tests.
sys.path.insert(0, str(ROOT / "tests"))

from cluster.cutting import cut_off  # noqa: E402
from cluster.namespaces import Network, NoNetwork  # noqa: E402
from cluster.page import DEADLINE, SECONDS, bounds, document  # noqa: E402
from helpers.sweep_disk import NoDisks, on_full_disks  # noqa: E402
from helpers.sweep_processes import seconds_until_gone, starts_after_kept  # noqa: E402
from helpers.sweep_runs import (  # noqa: E402
    driven,
    driver,
    killing,
    median_rate,
    scratch,
    statuses,
    swept,
)
from helpers.sweep_trials import FakeTrial, fake_trials, sleepers  # noqa: E402

from asmjax.machine import process_bytes  # noqa: E402
from asmjax.paths import write_atomic  # noqa: E402
from asmjax.report.provenance import provenance  # noqa: E402
from asmjax.report.stepwise import StepwiseRecord, exit_code  # noqa: E402
from asmjax.sweep.config import sweep_of  # noqa: E402
from asmjax.sweep.results import results  # noqa: E402
from asmjax.sweep.trial import Outcome, run_trial  # noqa: E402

STEPS = (
    "drivers", "workers", "disks", "poisons", "network", "overhead", "throughput", "warm",
)  # fmt: skip
"""In order."""

POISONS = {"abort": "crashed", "segv": "crashed", "hog": "out of memory", "endless": "timeout"}
"""What a trial does, and how it is to be kept."""

WARM = """
[trial]
scene = "letter_f"
size = [64, 48]
algorithm = "adaptive"
memory_mb = 0.25
repeats = 1
"""
"""A sweep file: the trial that is run a thousand times."""


class Study:
    """The steps of the experiment; each adds to the record."""

    def __init__(self, folder: Path, smoke: bool):
        self.kills, self.batch = (4, 40) if smoke else (50, 400)
        self.warm, self.nothings, self.rounds = (60, 60, 1) if smoke else (1000, 500, 3)
        settings = {"smoke": smoke, "seed": 0}
        self.record = StepwiseRecord(folder, "Reliability of sweeps", settings, bounds, document)
        self.found = self.record.record
        here = provenance("")
        self.found |= {"versions": here["versions"], "machine": here["machine"], "left_out": {}}
        self._chance = random.Random(0)

    def take_over(self, file: Path, again: list[str]) -> None:
        """All steps of an earlier record but those that are done again."""
        earlier = json.loads(file.read_text(encoding="utf-8"))
        for table, found in ((self.found, earlier), *(
            (self.found[name], earlier[name]) for name in ("left_out", "steps")
        )):  # fmt: skip
            table.update({name: found[name] for name in found if name in STEPS})
            for name in again:
                table.pop(name, None)

    def steps(self) -> dict[str, Callable[[], None]]:
        """Names to what is done, in order."""
        calls = (
            self.killed_drivers, self.killed_workers, self.full_disks, self.poisons,
            self.cut_network, self.overhead, self.throughput, self.warm_trials,
        )  # fmt: skip
        return dict(zip(STEPS, calls, strict=True))

    def killed_drivers(self) -> None:
        """Drivers are killed at random points of their start and of the sweep that follows."""
        told: Counter[str] = Counter()
        gone: list[float] = []
        while told["kills"] < self.kills:
            with scratch() as folder:
                kept: dict[str, float] = {}
                words, ended = driver(folder, self.batch, SECONDS), ""
                while not ended:
                    ended = driven(words, kept, **self._point(told["kills"], len(kept)))
                    told["kills"] += not ended
                    gone.append(seconds_until_gone(str(folder)))
                    told["lost"] += lost(folder, kept)
                self._count(told, folder, kept)
        self.found["drivers"] = dict(told) | {"gone_seconds": max(gone)}

    def _point(self, kills: int, kept: int) -> dict[str, Any]:
        """When to kill a driver: one in five while it starts, the others as it sweeps."""
        if kills >= self.kills:
            return {}
        if self._chance.random() < 0.2:
            return {"kill_after": self._chance.uniform(0.2, 4.0)}
        more = self._chance.randint(1, 60)
        return {"kill_at": kept + more, "kill_after": self._chance.uniform(0, 0.1)}

    def killed_workers(self) -> None:
        """Of a sweep that runs, the process of a trial and a worker are killed in turns."""
        told: Counter[str] = Counter()
        kills: Counter[str] = Counter()
        while kills.total() < self.kills:
            with scratch() as folder:
                kept: dict[str, float] = {}
                trials = sleepers(self.batch, SECONDS, str(folder / "log"))
                with killing(folder, kills, self.kills, self._chance):
                    swept(folder / "s", trials, kept)
                told["lost"] += lost(folder, kept)
                self._count(told, folder, kept)
        self.found["workers"] = dict(told) | {"kills": dict(kills)}

    def _count(self, told: Counter[str], folder: Path, kept: dict[str, float]) -> None:
        """Of a sweep that came to its end: what ran again, and whether all of it is there."""
        log = folder / "log"
        told["twice"] += starts_after_kept(log, sleepers(self.batch, SECONDS, str(log)), kept)
        told["incomplete"] += statuses(folder / "s") != Counter(done=self.batch)
        told["trials"] += self.batch
        told["sweeps"] += 1

    def full_disks(self) -> None:
        """A sweep on disks of every size, and of every number of files, up to what it needs."""
        with scratch() as folder:
            try:
                disks = on_full_disks(folder / "disk")
            except NoDisks as problem:
                self.found["left_out"]["disks"] = str(problem)
                return
        full = [one for one in disks if one["told"] is not None]
        places = Counter(place_of(one["told"]) for one in full)
        self.found["disks"] = {
            "full": len(full),
            "unclear": places.pop("", 0),
            "lost": sum(one["lost"] for one in disks),
            "not_resumed": sum(one["left"] > 0 for one in disks),
            "places": dict(places),
        }

    def poisons(self) -> None:
        """40 trials, one of which ends as badly as it can, with two workers."""
        self.found["poisons"] = []
        for do, expected in POISONS.items():
            with scratch() as folder:
                trials = fake_trials(39, first=1, do="sleep", seconds=SECONDS)
                trials[20:20] = fake_trials(1, do=do)
                found = swept(folder / "s", trials, deadline_s=DEADLINE, memory_bytes=2**30)
                (bad,) = [row for row in results(folder / "s").stored if row.key in found.failed]
            self.found["poisons"].append({
                "do": do,
                "others_done": len(found.done),
                "kept_as": bad.status,
                "as_expected": bad.status == expected and len(found.done) == 39,
                "cause": bad.error,
                "attempts": bad.attempts,
                "seconds": bad.seconds,
            })  # fmt: skip

    def cut_network(self) -> None:
        """Three workers in networks of their own, one of which is cut off in the middle."""
        try:
            with scratch() as folder, Network(3) as network:
                self.found["network"] = cut_off(network, folder, self.batch, SECONDS)
        except NoNetwork as problem:
            self.found["left_out"]["network"] = str(problem)

    def overhead(self) -> None:
        """Trials that do nothing, of one worker that is warm."""
        trials = fake_trials(self.nothings, arrays=True)

        def sweep(folder: Path) -> list[float]:
            kept: dict[str, float] = {}
            swept(folder / "s", trials, kept, workers=1)
            return list(kept.values())

        seconds = 1 / median_rate(sweep, self.rounds, skipped=self.nothings // 10)
        self.found["overhead"] = {"seconds": seconds, "trials": self.nothings}

    def throughput(self) -> None:
        """Trials of a second of work, with one worker and with two."""
        rates = {}
        for workers in (1, 2):

            def sweep(folder: Path, workers: int = workers) -> list[float]:
                kept: dict[str, float] = {}
                trials = fake_trials(12 * workers, do="work", seconds=1.0)
                swept(folder / "s", trials, kept, workers=workers)
                return list(kept.values())

            rates[str(workers)] = median_rate(sweep, self.rounds, skipped=workers)
        self.found["throughput"] = {"rates": rates, "ratio": rates["2"] / rates["1"]}

    def warm_trials(self) -> None:
        """Real trials, all of one configuration, in one worker."""
        with scratch() as folder:
            (folder / "warm.toml").write_text(WARM)
            (real,) = sweep_of(folder / "warm.toml").trials
            trials = [FakeTrial(one.key, real.config) for one in fake_trials(self.warm)]
            swept(folder / "s", trials, workers=1, run=weighed_trial, deadline_s=300.0)
            rows = [row.record for row in results(folder / "s").stored if row.status == "done"]
        held = [row["held_bytes"] for row in rows]
        first = min(50, len(held) // 2)
        self.found["warm"] = {
            "trials": len(rows),
            "processes": len({row["process"] for row in rows}),
            "held_bytes": [held[0], held[first - 1], held[-1]],
            "growth": max(held[first:]) / held[first - 1] - 1,
            "traces": sum(row["functions_traced"] for row in rows[first:]),
            "seconds": statistics.median(row["wall_seconds"] for row in rows[first:]),
        }


def weighed_trial(config: dict) -> Outcome:
    """A real trial, and what its process holds after it."""
    outcome = run_trial(config)
    outcome.record.update(held_bytes=process_bytes(), process=os.getpid())
    return outcome


def lost(folder: Path, kept: Mapping[str, float]) -> int:
    """How many trials that were told to be kept are not there."""
    return len(set(kept) - {row.key for row in results(folder / "s").stored}) if kept else 0


def place_of(told: str) -> str:
    """What could not be written, by what a sweep says; empty where it does not say so clearly."""
    name = told.partition("cannot write '")[2].partition("' (")[0].rpartition("/")[2]
    remedy = "make room or choose another --out" in told
    return ("arrays/KEY.npz" if name.endswith(".npz") else name) if remedy else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="few kills and trials, 3 minutes")
    parser.add_argument("--out", type=Path, default=Path("out/reliability"))
    parser.add_argument(
        "--only",
        nargs="*",
        metavar="STEP",
        choices=STEPS,
        help="these steps only; of the others the record in DIR is kept",
    )
    parser.add_argument("--docs", action="store_true", help="write docs/reliability.md as well")
    arguments = parser.parse_args()
    if arguments.docs and arguments.smoke:
        parser.error("--docs is for a whole run; leave out --smoke.")
    started = time.monotonic()
    study = Study(arguments.out, arguments.smoke)
    steps = study.steps()
    report = arguments.out / "report.json"
    if arguments.only and report.exists():
        study.take_over(report, arguments.only)
    study.record.run({name: steps[name] for name in arguments.only or steps})
    page = (arguments.out / "report.md").read_text(encoding="utf-8")
    failed = exit_code(study.record.record)
    if arguments.docs and not failed:
        write_atomic(ROOT / "docs" / "reliability.md", page)
    print(page)
    print(f"{time.monotonic() - started:.0f} s")
    return failed


if __name__ == "__main__":
    sys.exit(main())
