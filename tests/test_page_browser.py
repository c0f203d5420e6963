"""The page of `asmjax report` in a headless browser: nothing is fetched or complains, it works.

Skipped where there is no Chromium (Debian: `apt-get install chromium`).
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.browser import Browser, browser_path
from helpers.figures import run_pictures
from helpers.page_folders import report_of, write_report
from helpers.sweep_folders import hostile_folder

from asmjax.report.figures.seen import write_seen
from asmjax.report.page import write_page
from asmjax.report.schema import RUN_SCHEMA, SCHEMAS
from asmjax.report_job import ALL_SECTIONS, check_report


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[Browser]:
    program = browser_path()
    if program is None:
        pytest.skip("no Chromium here; Debian: apt-get install chromium")
    with Browser(program, tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture(scope="module")
def address(tmp_path_factory) -> str:
    """A page of one folder of each kind, every text of which is hostile."""
    here = tmp_path_factory.mktemp("page")
    folders = []
    for k, schema in enumerate(SCHEMAS):
        report = report_of(schema)
        if schema == RUN_SCHEMA:
            report["methods"] = list(run_pictures().methods)
        folders.append(write_report(here / str(k), report))
    write_seen(run_pictures(), folders[0])
    folders.append(hostile_folder(here / "sweep"))
    write_page(folders, here / "report.html", ALL_SECTIONS, check_report)
    return (here / "report.html").as_uri()


@pytest.fixture
def page(browser, address) -> Browser:
    browser.requests.clear()
    browser.complaints.clear()
    browser.open(address)
    return browser


def centre(page: Browser, selector: str) -> tuple[float, float]:
    """Where an element is in the window, after it was brought there."""
    script = (
        f"(() => {{ const e = document.querySelector('{selector}');"
        "e.scrollIntoView({block: 'center', behavior: 'instant'});"
        "const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    x, y = page.evaluate(script)
    return x, y


def test_nothing_is_fetched_and_nothing_complains(page, address):
    assert page.requests == [address] and page.complaints == []
    assert page.evaluate("document.querySelectorAll('section').length") == 2 + len(SCHEMAS)
    assert page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 0)")
    assert not page.evaluate("document.documentElement.scrollWidth > window.innerWidth")


def test_the_counts_count(page, tmp_path):
    """Rationale: that nothing was seen proves nothing unless something would have been."""
    path = tmp_path / "other.html"
    path.write_text("<img src='http://127.0.0.1:9/x.png'><script>missing()</script>")
    page.open(path.as_uri())
    assert "http://127.0.0.1:9/x.png" in page.requests and len(page.complaints) >= 2


def test_the_policy_stops_what_got_past_the_escaping(page, tmp_path, address):
    """Scripts, handlers and pictures that stand in the page by mistake neither run nor load."""
    whole = Path(address.removeprefix("file://")).read_text(encoding="utf-8")
    slip = (
        "<img src='http://127.0.0.1:9/x.png' onerror='window.ran=1'><script>window.ran=1</script>"
    )
    path = tmp_path / "slipped.html"
    path.write_text(whole.replace("<main>", f"<main>{slip}", 1), encoding="utf-8")
    page.requests.clear()
    page.open(path.as_uri())
    assert page.evaluate("window.ran") is None
    assert page.evaluate("document.images[0].naturalWidth") == 0
    assert any("Content Security Policy" in text for text in page.complaints)


def test_pointing_at_a_setting_names_it(page):
    tip = "document.querySelector('.tip')"
    x, y = centre(page, ".point path")
    page.point_at(x + 4, y)
    assert page.evaluate(f"{tip}.textContent").startswith("uniform-16\n")
    assert page.evaluate(f"{tip}.offsetWidth") > 50
    page.point_at(2, 2)
    assert page.evaluate(f"{tip}.hidden") is True
    page.evaluate("document.querySelector('.plot > svg').focus()")
    named = []
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft"):
        page.press(key)
        named.append(page.evaluate(f"{tip}.textContent").split("\n")[0])
    assert named == ["uniform-16", "adaptive-1MB", "uniform-16"]


def test_pointing_at_a_row_of_an_axis_tells_its_median(page):
    """Of the sweep, whose section is the last one: small charts name their points too."""
    strips = "[...document.querySelectorAll('section:last-of-type .chart')].at(-1)"
    script = (
        f"(() => {{ const e = {strips}.querySelector('.point path');"
        "e.scrollIntoView({block: 'center', behavior: 'instant'});"
        "const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    page.point_at(*page.evaluate(script))
    said = page.evaluate(f"{strips}.querySelector('.tip').textContent").split("\n")
    assert "wrong pixels per pixel of shadow edge" in said and "median 0" in said


def test_the_legend_hides_a_group(page):
    shown = "document.querySelector('.point').getBoundingClientRect().width > 0"
    assert page.evaluate(shown)
    page.evaluate("document.querySelector('.legend button').click()")
    assert not page.evaluate(shown)
    page.evaluate("document.querySelector('.legend button').click()")
    assert page.evaluate(shown)


def test_tabs_show_one_chart_at_a_time(page):
    shown = (
        "[...document.querySelector('.tabbed').querySelectorAll('.chart')]"
        ".map(c => c.getBoundingClientRect().height > 0)"
    )
    assert page.evaluate(shown) == [True, False]
    page.evaluate("document.querySelectorAll('.tabbed [role=tab]')[1].click()")
    assert page.evaluate(shown) == [False, True]


def test_the_slider_cuts_the_right_picture(page):
    """At a quarter it hides that much of it; magnified, pixels stay where they were."""
    page.evaluate(
        "(() => { const r = document.querySelector('.slider input'); r.value = 250;"
        "r.dispatchEvent(new Event('input')); })()"
    )
    cut = "parseFloat(document.querySelectorAll('.pair img')[1].style.clipPath.split(' ')[3])"
    wide = page.evaluate("document.querySelector('.window').clientWidth")
    assert page.evaluate(cut) == pytest.approx(0.25 * wide, abs=1)
    page.evaluate(
        "(() => { const s = document.querySelector('[data-side=size]'); s.value = '8';"
        "s.dispatchEvent(new Event('change', {bubbles: true})); })()"
    )
    assert page.evaluate("document.querySelector('.pair').clientWidth") == 8 * 64
    sources = "[...document.querySelectorAll('.pair img')].map(i => i.src)"
    layers = "[...document.querySelectorAll('.layers img')].map(i => i.src)"
    assert page.evaluate(sources) == page.evaluate(layers)[1:3]


def test_it_prints_everything(page, tmp_path):
    """On paper there are no controls, and what was behind tabs and the slider is there."""
    page("Emulation.setEmulatedMedia", media="print")
    sizes = {
        name: page.evaluate(
            f"[...document.querySelectorAll('{name}')].map(e => e.getBoundingClientRect().height)"
        )
        for name in (".stage", ".controls", ".tablist", ".chart", ".layers img")
    }
    page("Emulation.setEmulatedMedia", media="")
    assert set(sizes[".stage"] + sizes[".controls"] + sizes[".tablist"]) == {0}
    # Rows of a sweep's axis are as low as there are few.
    assert min(sizes[".chart"]) > 60 and min(sizes[".layers img"]) > 10
    page.print_to(tmp_path / "page.pdf")
    pages = re.findall(rb"/Type\s*/Page\b", (tmp_path / "page.pdf").read_bytes())
    assert 4 <= len(pages) <= 40
