"""The schema of a sweep's report.json, as data."""

from asmjax.report.keys import InvalidReport, Key, check_keys

SWEEP_SCHEMA = "asmjax/sweep/1"

SWEEP_KEYS = {
    "schema": Key("text", f'"{SWEEP_SCHEMA}"'),
    "command": Key("text", "the command line, quoted for a shell"),
    "versions": Key("text object", "package name to version, of the command's process"),
    "machine": Key(
        {
            "cpu": Key("text", "processor model"),
            "cores": Key("count", "cores that the process may use"),
            "memory_bytes": Key("count", "main memory, bytes; 0 where it cannot be told"),
        },
        "of the command's process; those of the trials are in their rows",
    ),
    "file": Key("text", "the sweep file"),
    "name": Key("text", "of the sweep"),
    "status": Key(
        "text", "running, complete, interrupted, lost the scheduler, without workers, or failed"
    ),
    "cause": Key("text", "what it was ended by, where it failed or was without workers; or empty"),
    "trials": Key("count", "of the sweep"),
    "keys": Key("text list", "of its trials, in the order in which they are run"),
    "merged": Key("count", "combinations that came to the same trial as another one"),
    "skipped": Key("text list", "keys of trials that were finished before, well or not"),
    "done": Key("count", "trials that this run finished well"),
    "failed": Key("text object", "key to cause, of this run and of those before"),
    "left": Key("count", "trials that are still to be run"),
    "workers": Key("count", "processes on this machine; 0 for this one, or a scheduler's"),
    "scheduler": Key("text", "the scheduler's address or file; null without", nullable=True),
    "estimated_seconds": Key("amount", "wall time as it was estimated, seconds"),
    "seconds": Key("amount", "wall time, seconds"),
}


def check_sweep(report: object) -> None:
    """Check the report of a sweep.

    Raises:
        InvalidReport: with the JSON path of the first thing that is wrong.
    """
    check_keys(report, SWEEP_KEYS)
    assert isinstance(report, dict)
    if report["schema"] != SWEEP_SCHEMA:
        raise InvalidReport(f"schema: expected '{SWEEP_SCHEMA}', got {report['schema']!r}")
    if report["trials"] != len(report["keys"]):
        raise InvalidReport(
            f"trials: {report['trials']} is not the number of keys, {len(report['keys'])}"
        )
