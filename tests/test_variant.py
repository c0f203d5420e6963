"""The choice of a Mitsuba variant: explicit, lazy, once per process, with a remedy in words."""

import logging
import subprocess
import sys

import pytest

from asmjax.errors import UseError
from asmjax.render import llvm, variant

USABLE = llvm.Verdict(True, None, "19.1.7", "LLVM 19.1.7 works")
UNUSABLE = llvm.Verdict(False, None, None, "no LLVM library found")


def in_new_process(code: str, **environment: str) -> subprocess.CompletedProcess:
    import os

    return subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.fixture
def verdict(monkeypatch):
    """Sets what the probe will say."""
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    return lambda value: monkeypatch.setattr(llvm, "probe", lambda: value)


def test_llvm_where_it_works(verdict):
    verdict(USABLE)
    assert variant.choose_variant() == "llvm_ad_rgb"
    assert variant.choose_variant("llvm_ad_rgb") == "llvm_ad_rgb"


def test_scalar_elsewhere_with_one_warning(verdict, caplog):
    verdict(UNUSABLE)
    with caplog.at_level(logging.WARNING, logger="asmjax"):
        assert variant.choose_variant() == "scalar_rgb"
    (record,) = caplog.records
    assert "apt-get install -y libllvm19" in record.getMessage()
    assert "no LLVM library found" in record.getMessage()


def test_llvm_on_request_does_not_fall_back(verdict):
    verdict(UNUSABLE)
    with pytest.raises(UseError, match="no LLVM library found.*scalar_rgb.*libllvm19"):
        variant.choose_variant("llvm_ad_rgb")


@pytest.mark.parametrize("name", ["cuda_ad_rgb", "scalar_rgb"])
def test_other_requests_do_not_probe(monkeypatch, name):
    monkeypatch.setattr(llvm, "probe", lambda: pytest.fail("probed"))
    assert variant.choose_variant(name) == name


@pytest.mark.parametrize("name", ["", "llvm", "scalar_spectral", "LLVM_AD_RGB"])
def test_unknown_name(name):
    with pytest.raises(UseError, match="known: cuda_ad_rgb, llvm_ad_rgb, scalar_rgb"):
        variant.choose_variant(name)


def test_active_once_per_process():
    done = in_new_process("""
import drjit as dr
from asmjax.errors import UseError
from asmjax.render.variant import activate, active_variant
assert active_variant() is None
mi = activate("scalar_rgb")
assert mi.variant() == active_variant() == "scalar_rgb"
assert dr.log_level() == dr.LogLevel.Warn
assert activate() is mi and activate("scalar_rgb") is mi
try:
    activate("cuda_ad_rgb")
except UseError as problem:
    assert "scalar_rgb" in str(problem) and "new process" in str(problem)
    print("refused")
""")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "refused\n"


def test_default_renders_or_falls_back(tmp_path):
    """Whatever the machine has, the first render after `activate()` works."""
    code = """
from asmjax.render.variant import activate
mi = activate()
scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere"},
    "integrator": {"type": "direct"}, "light": {"type": "constant"},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 2, "height": 2}}})
mi.render(scene, spp=1).numpy()
print(mi.variant())
"""
    usual = in_new_process(code)
    assert usual.returncode == 0, usual.stderr
    assert usual.stdout.strip() in ("llvm_ad_rgb", "scalar_rgb")
    without = in_new_process(
        code,
        DRJIT_LIBLLVM_PATH=str(tmp_path / "absent.so"),
        ASMJAX_CACHE_DIR=str(tmp_path / "cache"),
    )
    assert without.returncode == 0, without.stderr
    assert without.stdout.strip() == "scalar_rgb"
    assert without.stderr.count("libllvm19") == 1


def test_cuda_without_a_device_says_what_is_allowed():
    done = in_new_process("""
from asmjax.errors import UseError
from asmjax.render.variant import activate
try:
    activate("cuda_ad_rgb")
    print("works")
except UseError as problem:
    assert "llvm_ad_rgb, scalar_rgb" in str(problem) and "\\n" not in str(problem)
    print("refused")
""")
    assert done.returncode == 0, done.stderr
    assert done.stdout in ("works\n", "refused\n")
