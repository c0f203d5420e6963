"""What was measured as entries of a report and as images: of a single view, or of a frame."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from asmjax.buffers import EyeBuffer
from asmjax.experiment import Measured
from asmjax.geometry import LightFrame, towards_light
from asmjax.metrics import error_summary, soft_error, surface_pairs
from asmjax.report.figures import linear_parts
from asmjax.report.record import method_record
from asmjax.scene.spec import LightSpec
from asmjax.shadow import AdaptiveShadowMap, CostModel
from asmjax.shadow.adaptive import AdaptiveState
from asmjax.writing import Writer


def method_records(
    eye: EyeBuffer,
    truth: Measured,
    methods: Sequence[Measured],
    adaptive: AdaptiveShadowMap,
    standard_error: np.ndarray | None = None,
) -> list[dict]:
    """The `methods` of a report, judged by `truth`; `eye` are the pixel centres, and
    `standard_error` (n,) is a soft truth's own."""
    size = eye.size
    valid = eye.valid.reshape(size)
    pairs = surface_pairs(valid, np.where(eye.valid, eye.depth, 1.0).reshape(size))
    expected = truth.visibility.reshape(size)
    sure = None if standard_error is None else standard_error.reshape(size)

    def errors(visibility: np.ndarray) -> dict:
        found = error_summary(expected, visibility, valid, pairs)
        if sure is not None:
            found["soft"] = soft_error(expected, visibility, valid, pairs, sure)._asdict()
        return found

    return [
        method_record(
            method.name,
            settings=method.settings,
            effective_resolution=method.effective_resolution,
            bytes=method.cost.bytes,
            rays=method.cost.rays,
            seconds=method.cost.seconds,
            error=errors(method.visibility.reshape(size)),
            **({} if method.bias is None else {"bias": method.bias}),
            **_tree_keys(adaptive, method),
        )
        for method in methods
    ]


def _tree_keys(adaptive: AdaptiveShadowMap, method: Measured) -> dict:
    if not isinstance(method.state, AdaptiveState):
        return {}
    return {
        "nodes": adaptive.nodes(method.state).size.size,
        "passes": method.cost.passes,
        "max_level": adaptive.max_level(method.state),
        "status": method.status.name.lower(),
    }


def truth_record(
    eyes: Sequence[EyeBuffer], truth: Measured, standard_error: np.ndarray | None = None
) -> dict:
    """The `truth` entry of a report; `eyes` are the samples of each pixel, centres first, and
    `standard_error` (n,) is a soft truth's own."""
    valid = eyes[0].valid
    soft = {} if standard_error is None else {
        "standard_error": float(np.sqrt(np.mean(standard_error[valid] ** 2)))
    }  # fmt: skip
    return {
        "samples": truth.settings["rays_per_pixel"],
        "rays": truth.cost.rays,
        "seconds": truth.cost.seconds["query"],
        "valid_pixels": int(valid.sum()),
        "lit_fraction": float(truth.visibility[valid].mean()),
        **soft,
    }


def truth_notices(truth: Measured, standard_error: np.ndarray | None) -> list[str]:
    """What a reader of the table has to know of a soft truth; `standard_error` as above."""
    if standard_error is None:
        return []
    return [
        f"{truth.name} is truth, cast once and cold with drawing the places on the light: its time "
        "is none to compare with"
    ]


def missing_text(effects: Iterable[str]) -> str:
    """What every figure's title ends with where effects are not simulated."""
    named = ", ".join(dict.fromkeys(effects))
    return f"; not simulated: {named}" if named else ""


def cost_model_record(model: CostModel) -> dict:
    """The `cost_model` entry of a report."""
    return {
        "a_seconds_per_texel": model.a_seconds_per_texel,
        "b_seconds": model.b_seconds,
        "residual": model.residual,
        "converged": model.converged,
        "measured_at": model.measured_at,
        "kept": model.kept,
    }


def light_text(light: LightSpec, frame: LightFrame) -> str:
    """Which light, and its type, as a report has it."""
    return f"{light.name} ({light.kind}, {frame.faces} face(s))"


def light_parts(eye: EyeBuffer, frame: LightFrame) -> tuple[np.ndarray, np.ndarray]:
    """What the light adds where it is seen and what is there without it; see `linear_parts`."""
    size = eye.size
    to_light = towards_light(frame, np.where(eye.valid, eye.world, 0.0))
    length = np.linalg.norm(to_light, axis=0)
    cosine = np.einsum("in,in->n", eye.normal, to_light) / np.where(length > 0, length, 1.0)
    return linear_parts(eye.albedo.reshape(3, *size), cosine.reshape(size))


def arrays_writer(
    eye: EyeBuffer,
    truth: Measured,
    methods: Sequence[Measured],
    maps: Mapping[str, np.ndarray],
) -> Writer:
    """Writes the images of one view as an .npz file."""
    size = eye.size
    arrays = {
        "valid": eye.valid.reshape(size),
        "position": eye.world.reshape(3, *size),
        "truth": truth.visibility.reshape(size),
        **{name: values.reshape(size) for name, values in maps.items()},
        **{f"visibility_{m.name}": m.visibility.reshape(size) for m in methods},
    }
    return lambda file: np.savez_compressed(file, **arrays)
