"""What every kernel promises, whatever it computes: `helpers.kernels` says which there are.

R1 no NaN or infinity in value or gradient, for any finite input. R2 float32 keeps five digits of
float64. R3 float64 keeps twelve digits of 50. R4 gradients are central differences, and the same
forwards as backwards. Kernels whose results are no numbers of this kind have tests of their own:
`test_comparison` (the shadow test), `test_page_table` and `test_blocks` (integers),
`test_predicted` and `test_tuning_surrogate` (a whole view or map at once), `test_metrics` (NumPy).
"""

import ast
import functools
import importlib
import inspect
import pkgutil
import zlib
from pathlib import Path
from types import ModuleType

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import kernels_of_numbers, kernels_of_poses, kernels_of_soft, kernels_of_theory
from helpers.effort import PROFILE, effort
from helpers.gradients import hostile_arrays, value_and_gradient
from helpers.kernels import POINTS, ROWS, Kernel
from helpers.kernels_exempt import PACKAGES, exempt_names
from helpers.theory import QUICKLY
from hypothesis import example, given
from hypothesis import strategies as st

FAMILIES = {
    "numbers": kernels_of_numbers.KERNELS,
    "theory": kernels_of_theory.KERNELS,
    "poses": kernels_of_poses.KERNELS,
    "soft": kernels_of_soft.KERNELS,
}
KERNELS = [kernel for family in FAMILIES.values() for kernel in family]

COUNT = 10_000
"""Points at which precisions are compared."""

SLOPES = 200
"""Points at which gradients are."""

FINITE_IN = ("float32",) if PROFILE == "fast" else ("float32", "float64")
"""What is finite in float32 has more room in float64: that is asked in the longer profiles."""

STEP = 1e-6
"""Of central differences, in parts of the pushes: off by 1e-9 or so of cubic terms and rounding."""


def every(kernels):
    return pytest.mark.parametrize("kernel", kernels, ids=lambda kernel: kernel.name)


def numbers_of(kernel: Kernel) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(kernel.name.encode()))


@functools.cache
def compiled(kernel: Kernel, precision: str):
    """The kernel in one compilation a precision."""
    del precision
    return jax.jit(kernel.of, compiler_options=QUICKLY)


def computed(kernel: Kernel, arguments, dtype: str) -> np.ndarray:
    """Its result in one precision, as a user of that precision gets it."""
    with jax.enable_x64(dtype == "float64"):
        found = compiled(kernel, dtype)(*(jnp.asarray(a, dtype) for a in arguments))
        assert found.dtype == dtype
    return np.asarray(found)


# Which kernels there are


def functions_of(package: str) -> set[str]:
    """Full names of the public functions that the modules of a package define."""
    whole = importlib.import_module(package)
    names = [package] + [
        f"{package}.{found.name}" for found in pkgutil.iter_modules(getattr(whole, "__path__", ()))
    ]
    found = set()
    for module in map(importlib.import_module, names):
        found |= {
            full_name(value)
            for name, value in vars(module).items()
            if not name.startswith("_") and defined_in(value) == module.__name__
        }
    return found


def defined_in(value) -> str | None:
    """The module of a function, also of a jitted one; None of anything else."""
    inner = inspect.unwrap(value) if callable(value) else value
    return inner.__module__ if inspect.isfunction(inner) else None


def full_name(function) -> str:
    return f"{defined_in(function)}.{function.__name__}"


def named_in(lists: ModuleType) -> set[str]:
    """Full names of the functions that a file of kernels names, imported or by their module."""
    assert lists.__file__
    held = dict(vars(lists))
    for node in ast.walk(ast.parse(Path(lists.__file__).read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            owner = vars(lists).get(node.value.id)
            if isinstance(owner, ModuleType) and owner.__name__.startswith("asmjax"):
                held[f"{node.value.id}.{node.attr}"] = getattr(owner, node.attr)
    return {full_name(value) for value in held.values() if defined_in(value)}


def test_no_kernel_is_forgotten():
    """Every function of the packages of kernels is in a list, or exempted with a reason."""
    there = set().union(*map(functions_of, PACKAGES))
    lists = (kernels_of_numbers, kernels_of_theory, kernels_of_poses, kernels_of_soft)
    listed = set().union(*map(named_in, lists))
    exempt = exempt_names()
    assert len(there) > 150 and len(listed & there) > 70
    assert sorted(there - listed - set(exempt)) == [], "in no list of kernels, and not exempted"
    assert sorted(set(exempt) - there) == [], "exempted, but no function"
    assert sorted(set(exempt) & listed) == [], "exempted, but in a list"
    assert len(set(exempt)) == len(exempt)


# R1


@functools.cache
def check_of(family: str, precision: str):
    """Of arguments of each kernel, whether its value or a gradient is not finite: one array, as
    hundreds of small ones take longer to fetch than to compute."""
    del precision
    each = [value_and_gradient(kernel.of) for kernel in FAMILIES[family]]

    def wrong(given):
        flags = []
        for kernel, both, arguments in zip(FAMILIES[family], each, given, strict=True):
            value, gradient = both(*arguments)
            bad = jnp.isnan(value) if kernel.infinite else ~jnp.isfinite(value)
            flags.append(jnp.stack([
                bad.any(), jnp.stack([(~jnp.isfinite(g)).any() for g in gradient]).any()
            ]))  # fmt: skip
        return jnp.stack(flags)

    return jax.jit(wrong, compiler_options=QUICKLY)


@pytest.mark.parametrize("family", FAMILIES)
@given(hostile_arrays((ROWS, POINTS // 2)), st.integers(0, 2**32 - 1))
@example(np.zeros((ROWS, POINTS // 2)), 0)
@example(np.ones((ROWS, POINTS // 2)), 1)
@example(np.full((ROWS, POINTS // 2), 1e8), 2)
def test_everything_is_finite(family, numbers, seed):
    """R1: zeros, denormals, up to 1e6 and 1e8, edge-on, behind eye and light, and at them."""
    given_ = [kernel.hostile(numbers, seed) for kernel in FAMILIES[family]]
    for dtype in FINITE_IN:
        with jax.enable_x64(dtype == "float64"):
            arguments = [[np.asarray(a, dtype) for a in row] for row in given_]
            found = np.asarray(check_of(family, dtype)(arguments))
        bad = {
            kernel.name: ("value" if value else "gradient", row)
            for kernel, (value, gradient), row in zip(
                FAMILIES[family], found, arguments, strict=True
            )
            if value or gradient
        }
        assert not bad, f"not finite in {dtype}: {bad}"


# R2, R3


PRECISE = [kernel for kernel in KERNELS if kernel.precise]


@every(PRECISE)
def test_float32_keeps_five_digits(kernel):
    """R2: within 1e-5 for 99.9 % of 10,000 points and 1e-3 for all, of the NumPy twin in float64 or
    the kernel itself. Both are given the same float32 numbers."""
    drawn = kernel.sane(numbers_of(kernel), COUNT)
    arguments = [np.asarray(a, np.float32).astype(np.float64) for a in drawn]
    single = computed(kernel, arguments, "float32").astype(np.float64)
    double = kernel.oracle(*arguments) if kernel.oracle else computed(kernel, arguments, "float64")
    error = kernel.error(single - double, double)
    assert np.isfinite(error).all()
    if kernel.jumps is not None:
        kept = ~kernel.jumps(*arguments)
        assert kept.mean() > 0.95, f"too few points away from {kernel.jumps_at}"
        error = error[kept]
    assert np.quantile(error, 0.999) <= 1e-5, f"at {arguments_at(arguments, error.argmax())}"
    assert error.max() <= 1e-3, f"at {arguments_at(arguments, error.argmax())}"


def arguments_at(arguments, i: int) -> list:
    """Of one point, for messages."""
    return [a[..., i].tolist() if a.shape and i < a.shape[-1] else a.tolist() for a in arguments]


@every([kernel for kernel in PRECISE if kernel.digits])
def test_float64_keeps_twelve_digits(kernel):
    """R3: within 1e-12 of the equation in 50 digits."""
    count = effort(60, 1_000)
    draw = kernel.spaced or kernel.sane
    few = draw(numbers_of(kernel), count)
    # Filled up to a size that is compiled already.
    full = [a for a in draw(numbers_of(kernel), COUNT)]
    arguments = [
        np.concatenate([a, b[..., count:]], axis=-1) if a.shape != b.shape else a
        for a, b in zip(few, full, strict=True)
    ]
    got = computed(kernel, arguments, "float64")
    got = got.reshape(-1, got.shape[-1])[:, :count]
    wrong, size = np.empty(got.shape), np.empty(got.shape)
    with mpmath.workdps(50):
        for i in range(count):
            point = [
                exact(a[..., i] if a.shape != b.shape else a)
                for a, b in zip(few, full, strict=True)
            ]
            wanted = kernel.digits(*point)
            for row, x in enumerate(wanted):
                wrong[row, i], size[row, i] = float(mpmath.mpf(float(got[row, i])) - x), float(x)
    error = kernel.error(wrong, size)
    assert error.max() <= 1e-12, f"{error.max()} at {arguments_at(few, error.argmax())}"


def exact(a):
    """Nested lists of mpmath's numbers."""
    return [exact(x) for x in a] if np.ndim(a) else mpmath.mpf(float(a))


# R4


@every([kernel for kernel in PRECISE if kernel.slopes])
def test_gradients_are_central_differences(kernel, x64):
    """R4: within 1e-4 at 200 points, in a random direction of each argument; and forward as reverse
    mode within 1e-10. What is nearly 0 beside the value is compared to that: 1e-8 of it."""
    rng = numbers_of(kernel)
    given_ = tuple(jnp.asarray(a) for a in kernel.smooth(*kernel.sane(rng, SLOPES)))
    sizes = kernel.pushes(*map(np.asarray, given_)) if kernel.pushes else [
        np.abs(np.asarray(a)) for a in given_
    ]  # fmt: skip
    weights = rng.normal(size=jax.eval_shape(kernel.of, *given_).shape)

    @functools.partial(jax.jit, compiler_options=QUICKLY)
    def derivatives(pushes):
        def shifted(t):
            return kernel.of(*(a + t * p for a, p in zip(given_, pushes, strict=True)))

        value, forward = jax.jvp(kernel.of, given_, pushes)
        # Both at once: compiled once.
        after, before = jax.vmap(shifted)(jnp.array([STEP, -STEP]))
        _, pull = jax.vjp(kernel.of, *given_)
        return value, forward, (after - before) / (2 * STEP), pull(jnp.asarray(weights))

    for k, size in enumerate(sizes):
        pushes = tuple(
            jnp.asarray(size * rng.normal(size=a.shape) if i == k else np.zeros(a.shape))
            for i, a in enumerate(given_)
        )
        value, forward, central, reverse = jax.device_get(derivatives(pushes))
        allowed = 1e-4 * kernel.lengths(forward) + 1e-8 * kernel.lengths(value) + 1e-12
        off = np.abs(central - forward).reshape(allowed.shape) / allowed
        assert off.max() <= 1, f"argument {k}: {off.max()} of what is allowed"
        pulled = sum(float((g * p).sum()) for g, p in zip(reverse, pushes, strict=True))
        pushed = weights * forward
        assert abs(pulled - pushed.sum()) <= 1e-10 * np.abs(pushed).sum(), f"argument {k}: reverse"
