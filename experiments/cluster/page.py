"""Bounds and page of `../reliability.py`: what its record says, for people."""

from collections.abc import Callable, Mapping
from typing import Any

from asmjax.experiment.bounds import Bound
from asmjax.report.stepwise import head_of

SECONDS = 0.1
"""Of a trial that is killed, or that runs beside a poison."""

DEADLINE = 5.0
"""Of poisons, seconds."""


def bounds(record: Mapping[str, Any]) -> list[Bound]:
    """The requirements; smaller is better."""
    left_out = record["left_out"]

    def bound(name: str, what: str, step: str, limit: float, measured: Callable) -> Bound:
        there = step in record
        figure = float(measured(record[step])) if there else None
        return Bound(name, what, figure, limit, reason=left_out.get(step, ""))

    def of(key: str) -> Callable:
        return lambda found: found.get(key, 0)

    def both(key: str, what: str) -> list[Bound]:
        return [
            bound(f"{key}, {step} killed", what, step, 0, of(key))
            for step in ("drivers", "workers")
        ]  # fmt: skip

    return [
        *both("lost", "trials that were kept and are not there"),
        *both("twice", "trials started after they were kept"),
        *both("incomplete", "sweeps that did not complete"),
        bound("orphans", "seconds until all processes of a killed driver are gone, largest",
              "drivers", 10, of("gone_seconds")),
        bound("full disk, unclear", "ends without one line that names what cannot be written",
              "disks", 0, of("unclear")),
        bound("full disk, lost", "trials that were kept and cannot be read then",
              "disks", 0, of("lost")),
        bound("full disk, not resumed", "sweeps that do not complete with more room",
              "disks", 0, of("not_resumed")),
        bound("poisons", "of 4 in a sweep of 40, those that cost another trial or keep no cause",
              "poisons", 0, lambda found: sum(not one["as_expected"] for one in found)),
        bound("deadline", "seconds that an endless trial takes beyond its deadline",
              "poisons", 10, lambda found: max(one["seconds"] for one in found) - DEADLINE),
        bound("cut network", "trials that are not done once one of three workers is cut off",
              "network", 0, of("not_done")),
        bound("overhead", "seconds of a trial that does nothing", "overhead", 0.02, of("seconds")),
        bound("throughput", "rate of one worker / of two, trials of 1 s",
              "throughput", 1 / 1.7, lambda found: 1 / found["ratio"]),
        bound("memory", "growth of a process after its first 50 trials, to the 1,000th",
              "warm", 0.05, of("growth")),
        bound("traces", "functions traced after the first 50 trials", "warm", 0, of("traces")),
    ]  # fmt: skip


def document(record: Mapping[str, Any]) -> str:
    """The record as Markdown."""
    machine = record["machine"]
    lines = head_of(record)
    lines += ["", f"{machine['cpu']}, {machine['cores']} cores; Python "
              f"{record['versions']['python']}."]  # fmt: skip
    for step, words in WORDS.items():
        if step in record:
            lines += ["", *words(record[step])]
    return "\n".join(lines) + "\n"


def _kills(found: Mapping[str, Any]) -> str:
    return f"{found['trials']:,} trials in {found['sweeps']} sweep{'s' * (found['sweeps'] > 1)}"


WORDS: dict[str, Callable[[Any], list[str]]] = {
    "drivers": lambda found: [
        "## Killed drivers", "",
        f"{found['kills']} drivers of {_kills(found)} of two workers and trials of {SECONDS} s "
        "were killed (SIGKILL), one in five 0.2 to 4 s after its start, the others up to 0.1 s "
        "after 1 to 60 trials more were kept; the same command was then given again, until the "
        "sweep was complete. All processes were gone "
        f"within {found['gone_seconds']:.2f} s.",
    ],
    "workers": lambda found: [
        "## Killed workers", "",
        f"{sum(found['kills'].values())} processes of {_kills(found)} were killed, one every 0.2 "
        f"to 1.5 s: {found['kills'].get('worker', 0)} workers of dask, "
        f"{found['kills'].get('trial', 0)} processes that carried out a trial.",
    ],
    "disks": lambda found: [
        "## Full disks", "",
        f"A sweep of 6 trials with arrays on {found['full']} disks (in memory) that were too small "
        "for it: of 4 KB, 8 KB and so on, then with room for 1 file, 2 files and so on. Where it "
        "ended, by what it said could not be written:", "",
        "| | times |", "| --- | ---: |",
        *(f"| `{place}` | {times} |" for place, times in found["places"].items()),
    ],
    "poisons": lambda found: [
        "## Poisons", "",
        f"40 trials, one of which is bad; two workers, a deadline of {DEADLINE:g} s, 1 GB.", "",
        "| it | the others that are done | kept as | attempts | seconds | cause |",
        "| --- | ---: | --- | ---: | ---: | --- |",
        *(
            f"| {one['do']} | {one['others_done']} | {one['kept_as']} | {one['attempts']} | "
            f"{one['seconds']:.2f} | {one['cause']} |"
            for one in found
        ),
    ],
    "network": lambda found: [
        "## A cut network", "",
        "Three workers in network namespaces of their own, connected by TLS to a scheduler and a "
        f"driver in a fourth. After {found['kept_before']} of {found['trials']} trials the line of "
        "one worker let nothing through any more. The others did the rest, its trials too, the "
        f"last one {found['seconds_after_cut']:.0f} s after the cut (dask's `tcp` timeout was "
        f"{found['tcp_timeout']}).",
    ],
    "overhead": lambda found: [
        "## Time", "",
        f"A trial that does nothing takes {1e3 * found['seconds']:.1f} ms from one that is kept to "
        f"the next, {found['trials']} of them with one worker: to a worker, to its process, back, "
        "arrays and row on disk.",
    ],
    "throughput": lambda found: [
        f"Of trials that keep a CPU busy for 1 s, two workers do {found['ratio']:.2f} times as "
        f"many as one ({found['rates']['1']:.3f} and {found['rates']['2']:.3f} a second).",
    ],
    "warm": lambda found: [
        "## Warm trials", "",
        f"{found['trials']:,} trials of an adaptive map in {found['processes']} process: "
        + ", ".join(f"{held / 2**20:.0f}" for held in found["held_bytes"])
        + " MB held after the first, the 50th and the last, "
        f"{1e3 * found['seconds']:.0f} ms each (median).",
    ],
}  # fmt: skip
"""What is told of each step."""
