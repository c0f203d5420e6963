"""`asmjax sweep`: all trials of a sweep file, each run once."""

import logging
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import dask.config

from asmjax import machine
from asmjax.errors import UseError
from asmjax.experiment.code import code_facts
from asmjax.libraries import LIBRARIES
from asmjax.options.sweep import SweepOptions
from asmjax.preparation import check_writable
from asmjax.report.outputs import Outputs
from asmjax.report.provenance import provenance
from asmjax.sweep.config import Sweep, sweep_of
from asmjax.sweep.driver import SweepResult, SweepStatus, run_sweep
from asmjax.sweep.ended import End
from asmjax.sweep.estimate import Estimate, estimate
from asmjax.sweep.share import share_of
from asmjax.sweep.store import BASE, Row, Store, stored_rows
from asmjax.sweep.summary import SweepSummary, write_summary
from asmjax.sweep.telling import telling
from asmjax.sweep.trial import run_trial

_log = logging.getLogger("asmjax")


def run_sweep_job(options: SweepOptions) -> SweepSummary | None:
    """Run what is not finished yet, keep it below `options.out`, and print what happened.

    Returns None where the options ask to count only.

    Raises:
        UseError: a wrong file or wrong options, before anything is written or run; or the
            scheduler or all workers were lost on the way.
        KeyboardInterrupt: with a message that says where the finished trials are.
    """
    assert options.config is not None  # the options see to it
    sweep = sweep_of(
        Path(options.config),
        smoke=options.smoke,
        trust_scene=options.trust_scene,
        variant=options.variant,
    )
    folder = Path(options.out or f"out/sweep-{sweep.name}")
    check_writable(folder)
    outputs = Outputs(folder, "sweep")
    rows = stored_rows(folder) if (folder / BASE).is_file() else []
    expected = _expected(sweep, rows, options)
    if not options.quiet:
        print(_announced(sweep, rows, expected))
    _warn_of_others(sweep, rows)
    if options.count:
        return None
    summary = SweepSummary(
        file=options.config,
        sweep=sweep,
        result=_begun(sweep, rows, options),
        workers=0 if _scheduler(options) else _workers(options),
        scheduler=_scheduler(options),
        estimate=expected,
        seconds=0.0,
    )
    command = ["asmjax", *sys.argv[1:]]
    start = time.monotonic()
    with Store.open(folder) as store:
        # Of an earlier run: it would not belong to these numbers.
        outputs.forget()
        # One that is killed leaves a report too.
        write_summary(summary, folder, command)
        try:
            result = _run(sweep, store, options)
        except UseError as problem:
            # Where the disk is full nothing more can be told; what ended the sweep is.
            with suppress(UseError):
                result = _ended_by(problem, summary.result, sweep, stored_rows(folder), options)
                summary = replace(summary, result=result, seconds=time.monotonic() - start)
                write_summary(summary, folder, command)
            raise
        summary = replace(summary, result=result, seconds=time.monotonic() - start)
        if not options.quiet and not result.left:
            print(summary.text(folder))
        try:
            write_summary(summary, folder, command)
        except UseError:
            # What ended the sweep comes first.
            _raise_if_left(result, folder)
            raise
    _raise_if_left(result, folder)
    return summary


def _run(sweep: Sweep, store: Store, options: SweepOptions) -> SweepResult:
    # Dask tells every step of its workers; whatever matters of it is in the progress.
    silent = dask.config.set({"logging.distributed": "critical"})
    share = share_of(0 if _scheduler(options) else _workers(options), options.max_memory_mb)
    wait_s = 60 * options.wait_minutes
    with silent, telling(options.quiet, wait_s) as progress:
        return run_sweep(
            sweep.trials,
            store,
            run=run_trial if share is None else partial(run_trial, share=share),
            workers=_workers(options),
            scheduler=options.scheduler,
            scheduler_file=None if options.scheduler_file is None else Path(options.scheduler_file),
            deadline_s=sweep.deadline_s,
            progress=progress,
            memory_bytes=None if share is None else share.bytes,
            alone_s=wait_s,
            again=options.retry,
        )


def _workers(options: SweepOptions) -> int:
    """Processes on this machine."""
    return machine.usable_cores() if options.workers is None else options.workers


def _scheduler(options: SweepOptions) -> str | None:
    return options.scheduler or options.scheduler_file


def _settled(rows: list[Row], options: SweepOptions) -> dict[str, Row]:
    """Trials that are not run again, by key."""
    return {row.key: row for row in rows if row.status == End.DONE or not options.retry}


def _begun(sweep: Sweep, rows: list[Row], options: SweepOptions) -> SweepResult:
    """What there is before the first trial."""
    settled, wanted = _settled(rows, options), [trial.key for trial in sweep.trials]
    known = {key: settled[key] for key in wanted if key in settled}
    return SweepResult(
        SweepStatus.RUNNING,
        skipped=tuple(known),
        failed={key: row.error for key, row in known.items() if row.status != End.DONE},
        left=tuple(key for key in wanted if key not in settled),
    )


def _ended_by(
    problem: UseError, begun: SweepResult, sweep: Sweep, rows: list[Row], options: SweepOptions
) -> SweepResult:
    """What there is after an error that no trial is to blame for."""
    now = _begun(sweep, rows, options)
    done = tuple(key for key in now.skipped if key not in begun.skipped and key not in now.failed)
    return replace(
        now, status=SweepStatus.FAILED, done=done, skipped=begun.skipped, cause=str(problem)
    )


def _expected(sweep: Sweep, rows: list[Row], options: SweepOptions) -> Estimate:
    """The time of the trials that are to be run."""
    settled = _settled(rows, options)
    waiting = [trial for trial in sweep.trials if trial.key not in settled]
    found = estimate(waiting, 1 if _scheduler(options) else _workers(options))
    return replace(found, trials=len(waiting))


def _announced(sweep: Sweep, rows: list[Row], expected: Estimate) -> str:
    """How many trials there are and what they will take, in a line."""
    known = len(sweep.trials) - expected.trials
    parts = [f"sweep {sweep.name}: {len(sweep.trials)} trials"]
    if sweep.merged:
        parts.append(f"{sweep.merged} more combinations come to the same")
    if known:
        parts.append(f"{known} are finished")
    if expected.trials:
        parts.append(f"{expected.trials} to run, {expected.words} by rule of thumb")
    return ", ".join(parts)


def _warn_of_others(sweep: Sweep, rows: list[Row]) -> None:
    """Say how many finished trials this process would measure differently."""
    wanted = {trial.key for trial in sweep.trials}
    done = [row for row in rows if row.key in wanted and row.status == End.DONE]
    code, versions = code_facts()["code"], provenance("")["versions"]
    _warn(sum(row.record.get("code") != code for row in done), "by other code than this")
    libraries = [words for row in done if (words := _differences(row.versions, versions))]
    for words, count in Counter(libraries).items():
        _warn(count, f"with other libraries ({words})")


def _differences(there: dict[str, str], here: dict[str, str]) -> str:
    """Libraries of two versions; of asmjax itself its code is compared."""
    return ", ".join(
        f"{name} {there.get(name, 'unknown')} there and {here[name]} here"
        for name in LIBRARIES
        if there.get(name) != here[name]
    )


def _warn(count: int, measured: str) -> None:
    if count:
        _log.warning(
            "%d of the finished trials were measured %s; choose another --out to measure them "
            "again.",
            count,
            measured,
        )


def _raise_if_left(result: SweepResult, folder: Path) -> None:
    kept = f"what is finished is in {folder}/; the same command goes on from there"
    if result.status is SweepStatus.INTERRUPTED:
        raise KeyboardInterrupt(f"{len(result.left)} trials are left; {kept}")
    if result.status in (SweepStatus.LOST, SweepStatus.ALONE):
        cause = result.cause or "the scheduler was lost"
        raise UseError(f"{cause}, {len(result.left)} trials are left; {kept}.")
