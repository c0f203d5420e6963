"""`asmjax report`: what is on the page, that it is safe and needs nothing else; wrong folders."""

import base64
import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.figures import run_pictures
from helpers.page_folders import PageReader, check_escaped, report_of, write_report
from helpers.sweep_folders import hostile_folder
from PIL import Image

from asmjax import cli
from asmjax.errors import UseError
from asmjax.report.figures import write_figures
from asmjax.report.figures.seen import write_seen
from asmjax.report.outputs import PAGE, Outputs
from asmjax.report.page import SECTIONS, Part, Results, page_of, read_results, write_page
from asmjax.report.page.chart import Chart, Mark, Point, charts
from asmjax.report.page.drawing import zero_line
from asmjax.report.page.markup import escaped, tag
from asmjax.report.page.pictures import MOST_BYTES, read_picture
from asmjax.report.schema import RUN_SCHEMA, SCHEMAS

RUN_FIGURES = ("shadows.png", "errors.png", "maps.png", "levels.png", "tree.png")


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory) -> Path:
    """A run of a wall with all of its pictures."""
    pictures = run_pictures()
    folder = tmp_path_factory.mktemp("run")
    write_report(
        folder, report_of(RUN_SCHEMA) | {"methods": list(pictures.methods), "scene": "wall"}
    )
    write_figures(pictures, folder)
    write_seen(pictures, folder)
    return folder


@pytest.fixture(scope="module")
def page(run_folder) -> str:
    return page_of([read_results(run_folder)])


@pytest.mark.parametrize("schema", SCHEMAS)
def test_every_kind_has_a_section_in_which_all_texts_are_escaped(schema, tmp_path):
    """Each text tries to be a script, a picture of elsewhere, and to turn the line."""
    assert schema in SECTIONS
    page = page_of([read_results(write_report(tmp_path, report_of(schema)))])
    check_escaped(page)
    assert len(PageReader(page).all("section")) == 2


def test_the_page_needs_nothing_else(page):
    """No address but those of data and of its own sections, and a policy that forbids the rest."""
    read = PageReader(page)
    for _, found in read.elements:
        for name in ("src", "href", "srcset", "action", "poster", "xlink:href"):
            address = found.get(name) or "#"
            assert address.startswith(("data:", "#")), address
    assert "@import" not in page and "url(" not in page and "fetch(" not in page
    policy = next(
        a["content"] for a in read.all("meta") if a.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy and policy.startswith("default-src 'none'; img-src data:;")
    for kind in ("style", "script"):
        (text,) = read.texts[kind]
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy


def test_the_run_is_on_the_page(page, run_folder):
    """Pictures to slide over each other, figures, chart, tables, and where it comes from."""
    read = PageReader(page)
    (slider,) = read.of_class("slider")
    layers = [a for a in read.all("img")][:5]
    names = ["seen_truth", "seen_uniform-16", "seen_adaptive-1MB"]
    names += ["wrong_uniform-16", "wrong_adaptive-1MB"]
    embedded = [base64.b64decode((a["src"] or "").partition(",")[2]) for a in layers]
    assert embedded == [(run_folder / f"{name}.png").read_bytes() for name in names]
    assert len(read.all("img")) == 5 + len(RUN_FIGURES)
    assert all(a["alt"] and int(a["width"] or 0) > 0 for a in read.all("img"))
    assert len(read.of_class("point")) == 3
    assert any("uniform-16\n" in text for text in read.texts["title"])
    for words in ("SHA-256", "Provenance", "Left out or approximated"):
        assert words in page
    ids = [a["id"] for _, a in read.elements if "id" in a]
    assert ids == ["part-1"] and f'href="#{ids[0]}"' in page


def test_the_summary_says_what_the_numbers_say(page):
    """A wall of 58 columns and 42 rows, whose edge the uniform map puts two columns off."""
    read = PageReader(page)
    wrong = run_pictures().error("uniform-16").misclassified_fraction
    said = " ".join(read.texts["li"])
    assert f"unlike uniform-16 with {100 * wrong:.2f} %" in said
    assert "adaptive-1MB gets 0 % of the pixels wrong, unlike" in said
    assert "takes 4.00 ms and 1.00 MB, the uniform one 2.00 ms" in said
    assert "rays-1, the yardstick, traces 10 shadow rays, is exact and takes 6.00 ms." in said


def test_several_folders_make_one_page_and_the_same_one_again(run_folder, tmp_path, capsys):
    other = write_report(tmp_path / "plan", report_of("asmjax/plan/1"))
    words = ["report", str(run_folder), str(other)]
    pages = []
    for name in ("a", "b"):
        target = tmp_path / name / "all.html"
        assert cli.main([*words, "--out", str(target)]) == 0
        assert capsys.readouterr().out.startswith(f"page: {target} (")
        pages.append(target.read_bytes())
    assert pages[0] == pages[1] and len(pages[0]) < 2**21
    assert [a.get("id") for a in PageReader(pages[0].decode()).all("section")] == [
        None, "part-1", "part-2",
    ]  # fmt: skip


def test_the_page_stands_in_the_first_folder_until_that_is_used_again(tmp_path):
    """A page of an earlier run would not belong to the next one's numbers."""
    folder = write_report(tmp_path / "out", report_of(RUN_SCHEMA))
    assert cli.main(["report", str(folder), "--quiet"]) == 0
    assert (folder / PAGE).is_file()
    Outputs(folder, "run").keep(report_of(RUN_SCHEMA))
    assert sorted(path.name for path in folder.iterdir()) == ["report.json"]


def test_pictures_that_are_not_there_are_named(tmp_path):
    page = page_of([read_results(write_report(tmp_path, report_of(RUN_SCHEMA)))])
    assert f"Not in the folder: {', '.join(RUN_FIGURES)}." in page
    assert "has no pictures to compare" in page


def damage(folder: Path, what: str) -> Path:
    """A folder that no command wrote."""
    path = folder / "report.json"
    contents: dict[str, bytes] = {
        "empty file": b"",
        "half": path.read_bytes()[:500],
        "not text": b"\xff\xfe\x00",
        "deep": b"[" * 100_000,
        "nan": b'{"schema": NaN}',
        "a list": b"[]",
        "other schema": b'{"schema": "other/1"}',
        "no schema": b'{"results": [1, 2]}',
        "unhashable schema": b'{"schema": []}',
        "later version": json.dumps(report_of(RUN_SCHEMA) | {"schema": "asmjax/run/9"}).encode(),
        "wrong key": json.dumps(report_of(RUN_SCHEMA) | {"notices": 3}).encode(),
        "long number": b'{"schema": ' + b"9" * 6000 + b"}",
    }
    if what == "no folder":
        return folder / "absent"
    if what == "no report":
        path.unlink()
    elif what == "a folder of that name":
        path.unlink()
        path.mkdir()
    elif what == "half a picture":
        (folder / "maps.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    elif what == "no picture":
        (folder / "tree.png").write_text("<svg/>")
    else:
        path.write_bytes(contents[what])
    return folder


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("no folder", "is no folder; name a folder that asmjax run"),
        ("no report", "has no report.json"),
        ("a folder of that name", "has no report.json"),
        ("empty file", "is damaged"),
        ("half", "is damaged"),
        ("not text", "is damaged"),
        ("deep", "is damaged"),
        ("nan", "is damaged (NaN is no number of JSON)"),
        ("long number", "is damaged"),
        ("a list", "expected an object, got list"),
        ("other schema", "got 'other/1'"),
        ("no schema", "got None"),
        ("unhashable schema", "expected"),
        ("later version", "got 'asmjax/run/9'"),
        ("wrong key", "notices: expected a list of texts"),
        ("half a picture", "maps.png' is no whole PNG or GIF file"),
        ("no picture", "tree.png' is no whole PNG or GIF file"),
    ],
)
def test_wrong_folders_are_one_line_and_exit_2(what, said, tmp_path, capsys):
    folder = damage(write_report(tmp_path / "out", report_of(RUN_SCHEMA)), what)
    assert cli.main(["report", str(folder)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and said in captured.err and str(folder) in captured.err
    assert captured.out == "" and not (tmp_path / "out" / PAGE).exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no folder is named"),
        (["out", "--out", "{here}"], "choose another --out"),
        (["out", "--out", "{here}/out/report.json/x.html"], "choose another --out"),
    ],
)
def test_wrong_use_is_one_line_and_exit_2(words, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_report(tmp_path / "out", report_of(RUN_SCHEMA))
    assert cli.main(["report", *(word.format(here=tmp_path) for word in words)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and said in captured.err
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_names_do_not_lead_out_of_the_folder(tmp_path):
    """A method's name is part of a file's name."""
    (tmp_path / "seen_uniform-").mkdir()
    (tmp_path / "secret.png").write_bytes(b"secret")
    report = report_of(RUN_SCHEMA)
    report["methods"][0]["name"] = "uniform-/../../secret"
    results = read_results(write_report(tmp_path / "out", report))
    for name in ("../secret.png", "seen_uniform-/../../secret.png", "/etc/passwd", "..", ""):
        assert results.file(name) is None
    assert "secret.png" not in page_of([results])


def test_large_pictures_are_made_smaller(tmp_path):
    """Noise of 1500 x 400 pixels has 1.8 MB."""
    noise = np.random.default_rng(0).integers(0, 256, (400, 1500, 3), np.uint8)
    path = tmp_path / "maps.png"
    Image.fromarray(noise).save(path, compress_level=1)
    assert path.stat().st_size > MOST_BYTES
    small = read_picture(path)
    assert small.shrunk and len(small.content) < MOST_BYTES / 2
    assert (small.width, small.height) == (1400, 373)
    path.write_bytes(path.read_bytes()[:16] + b"\xff" * 8 + path.read_bytes()[24:])
    with pytest.raises(UseError, match="4294967295 x 4294967295 pixels; allowed"):
        read_picture(path)


def test_pictures_to_slide_fit_over_each_other(tmp_path):
    """One size without margin, whatever the figures' layout; wrong pixels where they are wrong."""
    files = {
        path.name: np.asarray(Image.open(path)) for path in write_seen(run_pictures(), tmp_path)
    }
    assert {image.shape for image in files.values()} == {(48, 64, 3)}
    assert (files["seen_truth.png"] == files["seen_adaptive-1MB.png"]).all()
    differ = (files["seen_truth.png"] != files["seen_uniform-16.png"]).any(axis=(0, 2))
    assert np.flatnonzero(differ).tolist() == [30, 31]


def point(name: str, x: float, y: float, number: int | None = None) -> Point:
    return Point("maps", name, x, y, x, x, number=number)


def drawn(*points: Point, **options) -> PageReader:
    looks = {"maps": ("#009E73", "o"), "rays": ("#CC79A7", "D")}
    return PageReader(charts([Chart("time", "ms", "error", points, looks, **options)]))


def test_a_chart_is_logarithmic_and_has_a_line_for_none():
    """Equal factors are equal steps; 0 lies below the smallest error, as an open marker."""
    made = drawn(*(point(str(k), 10.0**k, 10.0**-k) for k in range(3)), point("none", 50, 0))
    x, y = (
        np.array([float(a[f"data-{axis}"] or "nan") for a in made.of_class("point")])
        for axis in "xy"
    )
    assert x[1] - x[0] == pytest.approx(x[2] - x[1], abs=0.2)
    assert y[1] - y[0] == pytest.approx(y[2] - y[1], abs=0.2) and y[1] > y[0]
    assert y[3] > y[2]
    assert len(made.of_class("hollow")) == 1
    assert {"1", "10", "100", "0.01", "0"} <= set(made.texts["text"])
    assert zero_line([0.3, 0.0, 0.06]) == pytest.approx(0.02)
    assert made.unbalanced == []


def test_a_chart_numbers_its_front_and_names_its_marks():
    """Of many points those on the front have numbers; few points have their names beside them."""
    front = [point("a", 1, 1, 1), point("b", 2, 0.5, 2)]
    worse = [point(f"worse {k}", 3 + k, 0.7) for k in range(5)]
    made = drawn(*front, *worse, marks=[Mark("1 ray", 4.0)])
    assert len(made.of_class("number")) == 2 and len(made.of_class("mark")) == 1
    (stairs,) = made.of_class("front")
    at = [(a["data-x"], a["data-y"]) for a in made.of_class("point")]
    assert re.findall(r"H([\d.]+)V([\d.]+)", stairs["d"] or "") == at[:2]
    assert "1 ray" in made.texts["text"] and "b" not in made.texts["text"]
    few = drawn(*front)
    assert {"a", "b"} < set(few.texts["text"]) and few.of_class("number") == []
    # A group without a point is not in the legend, a chart without any is not drawn.
    assert [a["data-group"] for a in made.all("button")] == ["maps"]
    assert drawn().all("svg") == []


def test_one_point_is_a_chart_too():
    made = drawn(point("alone", 3.0, 0.0))
    (where,) = made.of_class("point")
    assert 84 < float(where["data-x"] or 0) < 900 and 16 < float(where["data-y"] or 0) < 504


def test_markup_escapes_all_but_itself():
    inner = tag("b", "a<b")
    assert tag("p", inner, "&", None, class_="x", data_y='"', hidden=True, id=None) == (
        '<p class="x" data-y="&quot;" hidden><b>a&lt;b</b>&amp;</p>'
    )
    assert tag("img", alt="") == '<img alt="">'
    assert escaped("a\u2028\ud800é") == "a\u2028\\ud800é"


def test_the_page_is_made_without_jax(run_folder, tmp_path):
    """Rationale: a page of finished results should not take as long to start as a measurement."""
    code = (
        "import sys; from asmjax import cli; "
        "assert cli.main(['report', *sys.argv[2:], '--quiet', '--out', sys.argv[1]]) == 0; "
        "print(sorted({'jax', 'mitsuba', 'drjit'} & set(sys.modules)))"
    )
    folders = [run_folder, hostile_folder(tmp_path / "swept")]
    words = [sys.executable, "-c", code, str(tmp_path / "page.html"), *map(str, folders)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines()[-1:] == ["[]"], done.stderr


def test_write_page_says_what_it_wrote(run_folder, tmp_path):
    path = tmp_path / "page.html"
    assert write_page([run_folder], path) == path.stat().st_size


def test_a_kind_of_report_of_elsewhere_brings_its_section(tmp_path):
    """Sections and check are handed in, for packages that this one must not import."""
    folder = write_report(tmp_path / "out", {"schema": "mine/1", "scene": "wall"})

    def check(report: object) -> None:
        assert isinstance(report, dict) and report["schema"] == "mine/1"

    def part(results: Results) -> Part:
        return Part("Mine", ("It is <mine>.",), tag("p", results.folder.name))

    path = tmp_path / "page.html"
    write_page([folder], path, {"mine/1": part}, check)
    assert "It is &lt;mine&gt;." in path.read_text(encoding="utf-8")


def test_a_page_of_somebody_else_is_not_overwritten(tmp_path, capfd):
    """Only what asmjax made gives way to a new page."""
    folder = write_report(tmp_path / "out", report_of(RUN_SCHEMA))
    (folder / PAGE).write_text("<title>mine</title>", encoding="utf-8")
    assert cli.main(["report", str(folder), "--quiet"]) == 2
    assert "not a page that asmjax made" in capfd.readouterr().err
    assert (folder / PAGE).read_text(encoding="utf-8") == "<title>mine</title>"
    (folder / PAGE).unlink()
    for _ in range(2):
        assert cli.main(["report", str(folder), "--quiet"]) == 0
