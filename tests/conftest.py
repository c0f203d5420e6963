"""Shared by all tests: scratch caches, both precisions, seeded keys, hypothesis profiles.

`HYPOTHESIS_PROFILE=ci` asks for 1,000 examples a property instead of 30, `ASMJAX_TEST_HARD=1` for
10,000 and for more of other things too (`helpers.effort`).
"""

import atexit
import gc
import os
import shutil
import tempfile
import zlib

import hypothesis
import pytest
from helpers.effort import EXAMPLES, HARD, PROFILE

# Before anything imports Dr.Jit. Workers of xdist inherit the folder of the process that made it.
if "ASMJAX_TEST_SCRATCH" not in os.environ:
    _scratch = tempfile.mkdtemp(prefix="asmjax-tests-")
    atexit.register(shutil.rmtree, _scratch, ignore_errors=True)
    os.environ["ASMJAX_TEST_SCRATCH"] = _scratch
    os.environ["ASMJAX_CACHE_DIR"] = os.path.join(_scratch, "asmjax")
    os.environ["DRJIT_CACHE_DIR"] = os.path.join(_scratch, "drjit")
    os.environ["MPLBACKEND"] = "agg"
    # Most of the time of a run is compiling, much of it the same in several files and workers.
    os.environ["JAX_COMPILATION_CACHE_DIR"] = os.path.join(_scratch, "jax")
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.1"
    os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"
    # Less than half of it; the longer profiles compile as users do.
    if PROFILE == "fast":
        quick = (
            "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true "
            "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
        )
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {quick}".strip()

# A tenth of some files' time went into looking for cycles among what JAX makes as it traces.
gc.set_threshold(50_000, 20, 50)

# Compilation happens inside an example, so a deadline per example would measure the compiler.
for _profile, _examples in EXAMPLES.items():
    # The quick run is the same for everybody; the longer ones look further each time.
    hypothesis.settings.register_profile(
        _profile, max_examples=_examples, deadline=None, derandomize=_profile == "fast"
    )
hypothesis.settings.load_profile(PROFILE)


SLOW_FILES = (
    "test_analysis_tr05", "test_siblings", "test_analyze_job", "test_analysis_2001",
    "test_main_job", "test_walkthrough_job", "test_adaptive_refine", "test_hard_cases_scene",
    "test_predicted", "test_tuned", "test_blocks", "test_adaptive_pool",
    "test_slow_asm", "test_traces", "test_theory_storage",
)  # fmt: skip
"""They start first, so that no worker is left with one of them at the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow files first, each in its own order."""
    rank = {name: k for k, name in enumerate(SLOW_FILES)}
    items.sort(key=lambda item: rank.get(item.path.stem, len(rank)))


def pytest_collection_finish() -> None:
    """Modules stay: garbage is not looked for among what they made."""
    gc.freeze()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Tidy up between files."""
    if nextitem is None or nextitem.path != item.path:
        # Once the tests' modules are there: it imports what they are to find instrumented.
        from helpers.housekeeping import between_files

        between_files()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what this machine cannot run, or this run has no time for, and say why."""
    if item.get_closest_marker("slow") and not HARD:
        pytest.skip("takes long; `make test-hard` runs it")
    if item.get_closest_marker("mitsuba"):
        from asmjax.errors import UseError
        from asmjax.render.variant import activate

        try:
            activate()
        except UseError as problem:
            pytest.skip(f"no renderer: {problem}")
    if item.get_closest_marker("gpu"):
        import jax

        if jax.default_backend() != "gpu":
            pytest.skip(f"no CUDA device: JAX runs on {jax.default_backend()}")


@pytest.fixture(params=["float32", "float64"])
def dtype(request):
    """Both precisions, one after the other; JAX's x64 mode is on only for float64."""
    import jax

    with jax.enable_x64(request.param == "float64"):
        yield jax.numpy.dtype(request.param)


@pytest.fixture
def x64():
    """JAX's x64 mode for one test."""
    import jax

    with jax.enable_x64(True):
        yield


@pytest.fixture
def key(request):
    """A random key that differs between tests and is the same in every run of a test."""
    import jax

    return jax.random.key(zlib.crc32(request.node.nodeid.encode()))
