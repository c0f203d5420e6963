"""Calibrations that outlive the process: one JSON file per machine, scene, light and variant.

Calibration is a preprocess (Fernando et al. 2001, 3.1); its answer holds as long as what is cast
and what casts it stay the same, so a later run takes it from the user's cache folder.
"""

import hashlib
import json
import logging
import math
import platform
import re
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np

from asmjax import machine, paths
from asmjax.buffers import LightRays
from asmjax.geometry import LightFrame
from asmjax.shadow.adaptive.cost_model import CostModel, dated, fit_cost_model, time_sizes

FORMAT = "asmjax/calibration/1"

_log = logging.getLogger("asmjax")


@dataclass(frozen=True)
class Calibrated:
    """What a calibration belongs to; all of it must be the same for one to be used again.

    Attributes:
        cpu, cores, system: the machine: processor model, usable cores, kernel and instruction set.
        scene: its name.
        triangles: how many it has.
        bounds: 12 hex digits of its box, to the last bit.
        light: kind of light.
        variant: the Mitsuba variant that casts.
    """

    cpu: str
    cores: int
    system: str
    scene: str
    triangles: int
    bounds: str
    light: str
    variant: str

    @property
    def file(self) -> Path:
        """Where the calibration is kept; readable by people up to the hash."""
        facts = json.dumps(asdict(self), sort_keys=True)
        names = [re.sub(r"\W+", "_", name)[:40] for name in (self.scene, self.light, self.variant)]
        digest = hashlib.sha256(facts.encode()).hexdigest()[:12]
        return calibration_dir() / f"{'-'.join([*names, digest])}.json"


def calibration_dir() -> Path:
    """The folder of all kept calibrations; not created here."""
    return paths.cache_dir() / "calibrations"


def on_this_machine(
    scene: str, triangles: int, bounds: np.ndarray, light: str, variant: str
) -> Calibrated:
    """What a calibration measured here and now belongs to; `bounds` (3, 2) is the scene's box."""
    box = np.ascontiguousarray(bounds, "<f8").tobytes()
    return Calibrated(
        cpu=machine.cpu_name(),
        cores=machine.usable_cores(),
        system=f"{platform.system()} {platform.machine()}",
        scene=scene,
        triangles=int(triangles),
        bounds=hashlib.sha256(box).hexdigest()[:12],
        light=light,
        variant=variant,
    )


def kept_or_measured(
    rays: LightRays, frame: LightFrame, what: Calibrated, *, recalibrate: bool = False
) -> CostModel:
    """The kept model of `what` if there is one, else one that is measured now and kept.

    Args:
        recalibrate: measure even where a model is kept, and keep the new one.

    A file that is torn, of another format or of something else is ignored with a warning and
    written anew. A model that did not converge is used but not kept. Where nothing can be written
    every run measures.
    """
    known = None if recalibrate else kept_model(what)
    if known is not None:
        return known
    texels, seconds = time_sizes(rays, frame)
    model = dated(fit_cost_model(texels, seconds))
    if model.converged:
        record = {
            "format": FORMAT,
            "belongs_to": asdict(what),
            "measured_at": model.measured_at,
            "texels": texels.tolist(),
            "seconds": seconds.tolist(),
            "a_seconds_per_texel": model.a_seconds_per_texel,
            "b_seconds": model.b_seconds,
            "residual": model.residual,
        }
        paths.keep_text(what.file, json.dumps(record, indent=2) + "\n")
    return model


def kept_model(what: Calibrated) -> CostModel | None:
    """The kept model, or None where there is none that can be trusted."""
    try:
        text = what.file.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as problem:
        _warn(what, f"it cannot be read ({problem})")
        return None
    try:
        return _checked(json.loads(text), what)
    except (ValueError, TypeError, KeyError) as problem:
        _warn(what, str(problem))
        return None


def _checked(record: object, what: Calibrated) -> CostModel:
    """The model of a record. Raises where anything in it could not have been written here."""
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise ValueError(f"it is not '{FORMAT}'")
    if record["belongs_to"] != asdict(what):
        raise ValueError("it belongs to something else")
    a, b, residual = (record[key] for key in ("a_seconds_per_texel", "b_seconds", "residual"))
    numbers = [a, b, residual]
    if not all(type(n) in (int, float) and math.isfinite(n) and n >= 0 for n in numbers):
        raise ValueError(f"its coefficients and residual {numbers} are no costs")
    if a + b == 0:
        raise ValueError("nothing costs no time")
    if datetime.fromisoformat(record["measured_at"]).tzinfo is None:
        raise ValueError("its date has no time zone")
    model = CostModel(float(a), float(b), float(residual), measured_at=record["measured_at"])
    return replace(model, kept=True)


def _warn(what: Calibrated, reason: str) -> None:
    _log.warning("kept calibration '%s' is ignored: %s; measuring again.", what.file, reason)
