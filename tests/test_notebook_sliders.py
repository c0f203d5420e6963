"""The sliders of a notebook: their callback as a plain function, their widgets, and a browser.

Skipped where there is no Jupyter (`make extras EXTRA=notebooks`) or no Chromium.
"""

import base64
import os
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from helpers.browser import Browser, browser_path
from helpers.notebooks import PNG, as_ipynb, ran

NOTEBOOK = "perspective_aliasing"
EXTRA = "no Jupyter here; make extras EXTRA=notebooks"

FIRST = {"angle_deg": 60, "alpha": 50.0, "warp": "light-space"}
"""Where the sliders stand at first, in their order."""

MOVED = {"angle_deg": ("65", 65), "alpha": ("63.2", 2 * 10**1.5), "warp": ("perspective",) * 2}
"""What is read beside each, one step further to the right, and its value."""

SECONDS = 600.0
"""Longest wait for a server, a kernel or a figure, most of which is compiling."""

KERNEL = """(() => {
    document.querySelector('.jp-CodeCell .cm-content')?.focus();
    return window.jupyterapp?.shell.currentWidget?.sessionContext?.session?.kernel?.status;
})()"""
"""What the kernel of the notebook that has the focus does; nothing before there is one."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def smoke() -> Iterator[None]:
    """The smallest sizes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ASMJAX_SMOKE", "1")
        yield


@pytest.fixture(scope="module")
def notebook() -> tuple[dict, list[bytes]]:
    """The notebook's names after its last cell, and its figures."""
    names, _, figures = ran(NOTEBOOK)
    return names, figures


def test_the_callback_draws_what_theory_says(notebook):
    """Warps help under a light across the view, and fade, down to none, as the light turns into
    it; splits remain."""
    names, figures = notebook
    assert len(figures) == 4 and all(figure.startswith(PNG) for figure in figures)
    seen, explore, warps = names["seen"], names["explore"], names["WARPS"]
    across = {warp: seen(90.0, 50.0, warp).storage for warp in warps}
    along = {warp: seen(10.0, 50.0, warp).storage for warp in warps}
    assert across["logarithmic"] < across["perspective"] < across["none"] / 5
    assert along["light-space"] == pytest.approx(along["none"], rel=0.05)
    assert along["faces, 2 parts"] < along["none"] / 5
    # A wider range of depths takes many more texels, but of the map that bends with it.
    narrow = {warp: seen(90.0, 10.0, warp).storage for warp in ("none", "logarithmic")}
    assert across["none"] / narrow["none"] > 5 > across["logarithmic"] / narrow["logarithmic"]
    drawn = [explore(angle, 20.0, "perspective")._repr_png_() for angle in (30, 60)]
    assert drawn[0].startswith(PNG) and drawn[0] != drawn[1]
    # Without a warp the map is the coarser the nearer the ground, which is below.
    maps = seen(60.0, 20.0, "none").perspective
    assert np.nanmedian(maps[-1]) > 2 * np.nanmedian(maps[len(maps) // 2])


def test_jupyter_shows_the_figures(tmp_path):
    """In a kernel of its own every figure becomes a picture, without pyplot."""
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    shown = nbformat.read(as_ipynb(NOTEBOOK, tmp_path / "shown.ipynb"), 4)
    nbclient.NotebookClient(shown, timeout=600, kernel_name="python3").execute()
    outputs = [out for cell in shown.cells if cell.cell_type == "code" for out in cell.outputs]
    assert not [out for out in outputs if out.output_type == "error"]
    assert sum("image/png" in out.get("data", {}) for out in outputs) >= 4


def test_sliders_are_the_arguments_of_the_callback(notebook):
    """Moving the widgets draws anew with their values."""
    pytest.importorskip("ipywidgets", reason=EXTRA)
    names, _ = notebook
    controls = names["sliders"]()
    assert controls.kwargs == FIRST
    for slider, value in zip(controls.children, (30, 20.0, "4 slabs"), strict=False):
        slider.value = value
    assert controls.kwargs == {"angle_deg": 30, "alpha": 20.0, "warp": "4 slabs"}
    assert controls.result._repr_png_() == names["explore"](30, 20.0, "4 slabs")._repr_png_()


def test_sliders_are_moved_in_a_browser(notebook, tmp_path, tmp_path_factory):
    """In JupyterLab an arrow key moves each of them, a kernel answers, and what is shown is what
    the callback draws; nothing complains, and nothing is asked of another host."""
    program = browser_path()
    if program is None:
        pytest.skip("no Chromium here; Debian: apt-get install chromium")
    for name in ("ipywidgets", "jupyterlab"):
        pytest.importorskip(name, reason=EXTRA)
    names, _ = notebook
    as_ipynb(NOTEBOOK, tmp_path / "sliders.ipynb")
    port, token = _free_port(), secrets.token_hex(16)
    server = _served(tmp_path, port, token)
    try:
        _until(lambda: _answers(port), "the server")
        with Browser(program, tmp_path_factory.mktemp("profile"), 1400, 1200) as page:
            # Without a focus no key arrives, and no notebook is the current one.
            page("Emulation.setFocusEmulationEnabled", enabled=True)
            page.open(f"http://127.0.0.1:{port}/lab/tree/sliders.ipynb?token={token}")
            _until(lambda: page.evaluate(KERNEL) == "idle", "the kernel")
            page.evaluate("void jupyterapp.commands.execute('notebook:run-all-cells')")
            first = _drawn(names, FIRST)
            _until(lambda: _figures(page) == [first], "the first figure")
            # On a busy machine JupyterLab warns that parts of its own start slowly.
            page.complaints.clear()
            now, read = dict(FIRST), _readouts(page)
            for number, (name, (shown, value)) in enumerate(MOVED.items()):
                handle = f"document.querySelectorAll('.jupyter-widgets .noUi-handle')[{number}]"
                page.evaluate(f"{handle}.scrollIntoView({{block: 'center'}}); {handle}.focus()")
                page.press("ArrowRight")
                now[name], read[number] = value, shown
                _until(lambda: _readouts(page) == read, name)
                drawn = _drawn(names, now)
                _until(lambda drawn=drawn: _figures(page) == [drawn], f"the figure of {name}")
            assert page.complaints == []
            asked = [address for address in page.requests if address.startswith("http")]
            assert all(f"//127.0.0.1:{port}/" in address for address in asked)
    finally:
        server.terminate()
        server.wait(60)


def _drawn(names: dict, settings: dict) -> bytes:
    """The callback's figure."""
    return names["explore"](**settings)._repr_png_()


def _figures(page: Browser) -> list[bytes]:
    """The pictures below the sliders, as the page has them."""
    images = "[...document.querySelectorAll('.jupyter-widgets img')].map(image => image.src)"
    return [base64.b64decode(source.partition(",")[2]) for source in page.evaluate(images)]


def _readouts(page: Browser) -> list[str]:
    """What stands beside the sliders."""
    return page.evaluate(
        "[...document.querySelectorAll('.jupyter-widgets .widget-readout')]"
        ".map(readout => readout.textContent)"
    )


def _served(folder: Path, port: int, token: str) -> subprocess.Popen:
    """JupyterLab over a folder, on this machine alone, with nothing of the user's own."""
    command = [
        sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ip=127.0.0.1",
        f"--port={port}", "--ServerApp.port_retries=0", f"--IdentityProvider.token={token}",
        "--expose-app-in-browser", f"--notebook-dir={folder}",
        "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate",
    ]  # fmt: skip
    own = {f"JUPYTER_{kind}_DIR": str(folder / kind) for kind in ("CONFIG", "DATA", "RUNTIME")}
    with open(folder / "server.log", "wb") as log:
        return subprocess.Popen(command, cwd=folder, stdout=log, stderr=log, env=os.environ | own)


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def _answers(port: int) -> bool:
    with socket.socket() as tried:
        return tried.connect_ex(("127.0.0.1", port)) == 0


def _until(happened: Callable[[], bool], what: str) -> None:
    """Wait for something to happen."""
    end = time.monotonic() + SECONDS
    while not happened():
        assert time.monotonic() < end, f"{what} did not come"
        time.sleep(0.3)
