"""Folders of sweeps whose trials were never run: rows and a report, made up or hostile."""

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from asmjax.report.record import write_json
from asmjax.sweep.ended import End, Ended
from asmjax.sweep.schema import SWEEP_KEYS, SWEEP_SCHEMA, check_sweep
from asmjax.sweep.store import Store
from helpers.page_folders import HOSTILE, sample


def key_of(config: Mapping[str, Any]) -> str:
    """A key, as the sweep's own but of nothing else than the configuration."""
    return hashlib.sha256(json.dumps(config, sort_keys=True).encode()).hexdigest()[:32]


def grid(**axes: Sequence[Any]) -> list[dict[str, Any]]:
    """Configurations, one for each combination; two underscores stand for a dot."""
    configs = []
    for values in itertools.product(*axes.values()):
        config: dict[str, Any] = {"scene": "wall", "algorithm": "uniform", "settings": {}}
        for name, value in zip(axes, values, strict=True):
            table, _, inner = name.rpartition("__")
            (config[table] if table else config)[inner] = value
        configs.append(config)
    return configs


def done(config: Mapping[str, Any], error: float, seconds: float, **more: Any) -> Ended:
    """A trial that ended well; more of its record may be said."""
    record = {
        "name": f"{config['algorithm']}-64",
        "family": config["algorithm"],
        "scene": config["scene"],
        "error": {
            "misclassified_fraction": error / 10,
            "boundary_displacement_px": {"mean": 2 * error, "per_edge_length": error},
        },
        "seconds": {"build": seconds / 2, "query": seconds / 2, "total": seconds},
        "runs_seconds": {
            "build": [seconds / 4, seconds / 2, seconds],
            "query": [seconds / 4, seconds / 2, seconds],
            "yardstick": [1e-3, 1e-3, 1e-3],
        },
        "yardstick_ratio": 1e3 * seconds,
        "bytes": 2**20,
        "variant": "llvm_ad_rgb",
        "device": "cpu",
        "code": "c0de",
        "notices": [],
    }
    return Ended(End.DONE, json.dumps(record | more), seconds=1.5, **WHERE)


def bad(status: End, error: str, attempts: int = 1) -> Ended:
    """A trial that did not end well."""
    return Ended(status, error=error, details=error, attempts=attempts, seconds=2.5, **WHERE)


WHERE: dict[str, Any] = {
    "versions": {"numpy": "2.1"},
    "machine": {"host": "node7", "cpu": "8086"},
    "started": 1.7e9,
}


def sweep_folder(
    folder: Path, trials: Sequence[tuple[dict[str, Any], Ended]], **report: Any
) -> Path:  # fmt: skip
    """A folder with these trials, and a report of them all with what else is said of it."""
    keys = [key_of(config) for config, _ in trials]
    with Store.open(folder) as store:
        for config, ended in trials:
            store.add(key_of(config), config, ended)
    whole = sample(SWEEP_KEYS) | {
        "schema": SWEEP_SCHEMA, "name": "made-up", "status": "complete", "skipped": [], "left": 0,
        "scheduler": None, "keys": keys, "trials": len(keys), "failed": {}, "workers": 2,
        "seconds": 75.0, "file": "made-up.toml", "command": "asmjax sweep made-up.toml",
    } | report  # fmt: skip
    whole["trials"] = len(whole["keys"])
    check_sweep(whole)
    write_json(folder / "report.json", whole)
    return folder


def hostile_folder(folder: Path) -> Path:
    """Every text of it tries to be a script, a picture of elsewhere, and to turn the line."""
    where = {HOSTILE: HOSTILE, "host": HOSTILE, "cpu": HOSTILE}
    trials: list[tuple[dict[str, Any], Ended]] = []
    for k, config in enumerate(grid(algorithm=[HOSTILE, "uniform"], settings__x=[HOSTILE, 2])):
        config[HOSTILE] = f"{k}{HOSTILE}"
        record = {
            name: HOSTILE for name in ("name", "family", "scene", "variant", "device", "code")
        }
        ended = done(config, 0.1 * k, 0.01 + 0.01 * k, **record, notices=[HOSTILE])
        if k == 3:
            ended = bad(End.FAILED, HOSTILE, attempts=3)
        trials.append((config, Ended(**{**vars(ended), "machine": where, "versions": where})))
    texts = ("command", "file", "name", "status", "scheduler")
    return sweep_folder(
        folder,
        trials,
        **dict.fromkeys(texts, HOSTILE),
        keys=[*(key_of(config) for config, _ in trials), HOSTILE],
        skipped=[HOSTILE, key_of(trials[0][0])],
        versions={HOSTILE: HOSTILE},
    )
