"""The per-pixel kernels on each device: what they answer there, and how long they take."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array

from asmjax import machine
from asmjax.buffers import anchor, light_offset, project
from asmjax.experiment.clock import timed
from asmjax.experiment.stored_view import Device, StoredView, on_device
from asmjax.footprint import log2_linear_ratio, log2_m, uv_jacobian
from asmjax.shadow.adaptive.address import address_of
from asmjax.shadow.adaptive.tree import lookup


@dataclass(frozen=True)
class KernelTime:
    """Wall time of one kernel on one device, its arrays already there.

    Attributes:
        kernel: its name in `KERNELS`.
        device: see `device_name`.
        pixels: surface points that it is asked about.
        median, least: seconds over the timed runs.
    """

    kernel: str
    device: str
    pixels: int
    median: float
    least: float


def footprints(view: StoredView) -> dict[str, Array]:
    """Image coordinates (2, n), and log2 of the linear ratio and of m for one texel per face side
    (n,)."""
    offset = light_offset(view.points, view.frame)
    return _footprints(view.points, view.camera, view.frame, offset)


def visibility(view: StoredView) -> dict[str, Array]:
    """Whether each point is lit (n,), and the level of the page that says so (n,)."""
    return _visibility(
        view.tree, view.points, view.frame, light_offset(view.points, view.frame),
        anchor(view.points, view.frame), view.bias, shape=view.shape,
    )  # fmt: skip


KERNELS: dict[str, Callable[[StoredView], dict[str, Array]]] = {
    "project + footprint": footprints,
    "visibility": visibility,
}
"""What is run and timed: functions of a view that leave their results on its device."""


@jax.jit
def _footprints(points, camera, frame, offset):
    receivers = project(points, frame, offset)
    jacobian = uv_jacobian(points, camera, frame, receivers)
    return {
        "uv": receivers.uv,
        "log2_linear_ratio": log2_linear_ratio(jacobian, 1),
        "log2_m": log2_m(jacobian, 1),
    }


@partial(jax.jit, static_argnames="shape")
def _visibility(tree, points, frame, offset, anchor, bias, *, shape):
    receivers = project(points, frame, offset)
    address = address_of(points, anchor, receivers, frame.perspective)
    lit, level = lookup(shape, tree, receivers, address, bias=bias, perspective=frame.perspective)
    return {"lit": lit, "level": jnp.where(receivers.facing, level, 0)}


def available_devices() -> list[Device]:
    """The CPU, then the first GPU if JAX has one."""
    devices = [jax.devices("cpu")[0]]
    if jax.default_backend() == "gpu":
        devices.append(jax.devices("gpu")[0])
    return devices


def device_name(device: Device) -> str:
    """Kind of device for people; the CPU with its model and the cores that may be used."""
    if device.platform == "cpu":
        return f"CPU: {machine.cpu_name()}, {machine.usable_cores()} cores"
    return f"{device.platform.upper()}: {device.device_kind}"


def kernel_times(view: StoredView, device: Device, repeats: int = 50) -> list[KernelTime]:
    """Time each of `KERNELS` on `device`, `repeats` times after two runs to warm up."""
    there = on_device(view, device)
    result = []
    for name, kernel in KERNELS.items():
        runs = [timed(lambda kernel=kernel: kernel(there))[1] for _ in range(repeats + 2)][2:]
        result.append(
            KernelTime(
                name, device_name(device), view.points.count, statistics.median(runs), min(runs)
            )
        )
    return result
