"""The command line: help, one-line errors, exit codes, and what the commands print."""

import dataclasses
import json
import os
import resource
import subprocess
import sys
import types

import pytest

from asmjax import cli
from asmjax.cli.parse import flatten_box, parse
from asmjax.errors import UseError
from asmjax.options import AnalyzeOptions, RunOptions


def parsed(*words: str):
    return parse(list(words), cli.COMMANDS)[1]


def run_program(*words: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "asmjax", *words],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.fixture
def main_job(monkeypatch):
    """Stands in for the main job; `main_job.action` is what it does with the options."""
    module = types.ModuleType("asmjax.main_job")
    stand_in = types.SimpleNamespace(action=lambda options: None)
    vars(module)["run_main_job"] = lambda options: stand_in.action(options)
    monkeypatch.setitem(sys.modules, "asmjax.main_job", module)
    monkeypatch.setattr("asmjax.cli.prepare_to_measure", lambda: None)
    return stand_in


def test_defaults():
    assert parsed("run") == RunOptions()
    assert parsed("run").scene == "paper_room" and parsed("run").memory_bytes == 16 * 2**20


def test_every_option_arrives():
    words = (
        "run terrain --view low --size 256 128 --sensor 1 --light sun --trust-scene "
        "--tolerance 0.01 --force soft "
        "--memory-mb 0.5 --time-limit-ms 2.5 --node-resolution 64 --cells 4 --preset paper_2001 "
        "--settings my.toml --samples 16 --repeats 1 --seed 7 --variant scalar_rgb "
        "--max-memory-mb 512 --recalibrate --out there --save-arrays --quiet"
    )
    wanted = RunOptions(
        scene="terrain",
        view="low",
        size=(256, 128),
        sensor="1",
        light="sun",
        trust_scene=True,
        tolerance=0.01,
        force=("soft",),
        memory_mb=0.5,
        time_limit_ms=2.5,
        node_resolution=64,
        cells=4,
        preset="paper_2001",
        settings="my.toml",
        samples=16,
        repeats=1,
        seed=7,
        variant="scalar_rgb",
        max_memory_mb=512,
        recalibrate=True,
        out="there",
        save_arrays=True,
        quiet=True,
    )
    assert parsed(*words.split()) == wanted
    # Those of walkthroughs exclude each other, and a single view excludes them all.
    along = RunOptions(frames=8, keys=("overview", "closeup"))
    assert parsed(*"run paper_room --frames 8 --keys overview closeup".split()) == along
    pushed = RunOptions(frames=8, motion="object", object="robot")
    assert parsed(*"run --frames 8 --motion object --object robot".split()) == pushed
    changed = {
        field.name
        for options in (wanted, along, pushed)
        for field in dataclasses.fields(options)
        if getattr(options, field.name) != getattr(RunOptions(), field.name)
    }
    named = {field.name for field in dataclasses.fields(RunOptions)}
    assert changed == named, "name the new option here too"


@pytest.mark.parametrize("command", ["run", "analyze", "compare", "tune"])
def test_max_memory_has_a_short_name_too(command):
    assert parsed(command, "--max-memory", "2000").max_memory_mb == 2000
    assert parsed(command).max_memory_mb is None


def test_analyze_has_the_options_of_run_but_those_of_walks_and_plans():
    own = {"methods", "angles"}
    walk = {"frames", "motion", "keys", "object", "force", "tolerance"}
    of_run, of_analyze = (
        {field.name: field.default for field in dataclasses.fields(options)}
        for options in (RunOptions, AnalyzeOptions)
    )
    assert of_analyze.keys() == of_run.keys() - walk | own
    assert all(of_analyze[name] == of_run[name] for name in of_analyze.keys() - own)
    words = "analyze terrain --methods uniform light-space --angles 0 --memory-mb 2 --quiet"
    wanted = AnalyzeOptions(
        scene="terrain", methods=("uniform", "light-space"), angles=0, memory_mb=2.0, quiet=True
    )
    assert parsed(*words.split()) == wanted
    assert parsed("analyze") == AnalyzeOptions()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "Expected one of"),
        ("runn", "Available subcommands: run, analyze, compare"),
        ("--frobnicate", "Unrecognized options"),
        ("run --szie 3 4", "Perhaps you meant: --size W H"),
        ("run --size 3", "expected INT INT, got '3'"),
        ("run --size 3 x", "expected INT INT"),
        ("run --size 2.5 3", "expected INT INT"),
        ("run a b", "Unrecognized options: b"),
        ("run --memory-mb lots", "--memory-mb"),
        ("run --memory-mb nan", "--memory-mb is nan; allowed"),
        ("run --memory-mb -1", "--memory-mb"),
        ("run --memory-mb 0", "--memory-mb is 0.0; allowed"),
        ("run --time-limit-ms inf", "--time-limit-ms is inf; allowed"),
        ("run --node-resolution 0", "--node-resolution is 0; allowed"),
        ("run --cells 0", "--cells is 0; allowed"),
        ("run --samples 0", "--samples is 0; allowed"),
        ("run --max-memory 0", "--max-memory is 0.0; allowed"),
        ("compare --max-memory nan", "--max-memory is nan; allowed"),
        ("tune --max-memory-mb -1", "--max-memory is -1.0; allowed"),
        ("run --repeats 0", "--repeats is 0; allowed"),
        ("run --seed -1", "--seed"),
        ("run --view", "--view"),
        ("run --quiet maybe perhaps", "Unrecognized options"),
        ("analyze --angles -1", "--angles is -1; allowed"),
        ("analyze --angles few", "--angles"),
        ("analyze --samples 0", "--samples is 0; allowed"),
        ("analyze --frames 3", "Unrecognized options: --frames"),
        ("info --yaml", "--yaml"),
    ],
)
def test_wrong_use_is_one_line_and_exit_2(words, said, capsys, main_job):
    assert cli.main(words.split()) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("asmjax: error: ") and captured.err.count("\n") == 1
    assert said in captured.err
    assert not set("│╭╰─") & set(captured.err)


def test_long_words_of_an_error_stay_whole(capsys):
    word = "--" + "x" * 300
    assert cli.main(["run", word]) == 2
    assert word in capsys.readouterr().err


def test_use_errors_of_a_command_are_one_line(capsys, main_job):
    def complain(options):
        raise UseError("nothing\n  to see")

    main_job.action = complain
    assert cli.main(["run"]) == 2
    assert capsys.readouterr().err == "asmjax: error: nothing to see\n"


def test_interrupt_is_130_and_one_line(capsys, main_job):
    def interrupt(options):
        raise KeyboardInterrupt

    main_job.action = interrupt
    assert cli.main(["run"]) == 130
    assert capsys.readouterr().err == "asmjax: interrupted\n"


@pytest.mark.parametrize("bug", [ValueError("bug"), RuntimeError("bug")])
def test_bugs_keep_their_traceback(bug, main_job):
    def break_down(options):
        raise bug

    main_job.action = break_down
    with pytest.raises(type(bug), match="bug"):
        cli.main(["run"])


def test_command_gets_its_options(main_job):
    seen = []
    main_job.action = seen.append
    assert cli.main(["run", "letter_f", "--quiet"]) == 0
    assert seen == [RunOptions(scene="letter_f", quiet=True)]


def test_frames_go_to_the_walkthrough(main_job, monkeypatch):
    """A number of frames chooses the job; neither loads the other."""
    seen = []
    module = types.ModuleType("asmjax.walkthrough_job")
    vars(module)["run_walkthrough"] = seen.append
    monkeypatch.setitem(sys.modules, "asmjax.walkthrough_job", module)
    assert cli.main(["run", "letter_f", "--frames", "3"]) == 0
    assert seen == [RunOptions(scene="letter_f", frames=3)]


def test_an_interrupt_may_say_what_was_saved(capsys, main_job):
    def interrupt(options):
        raise KeyboardInterrupt("2 of 3 frames are in out/")

    main_job.action = interrupt
    assert cli.main(["run"]) == 130
    assert capsys.readouterr().err == "asmjax: interrupted; 2 of 3 frames are in out/\n"


def test_help_is_fast_and_loads_no_library():
    code = (
        "import sys; from asmjax.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as end: assert not end.code\n"
        "assert not {'jax', 'numpy', 'mitsuba', 'drjit', 'scipy'} & set(sys.modules)"
    )
    seconds = []
    for _ in range(3):
        before = children_cpu_seconds()
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        seconds.append(children_cpu_seconds() - before)
        assert done.returncode == 0, done.stderr
        assert "scenes" in done.stdout
    assert min(seconds) < 0.5


def children_cpu_seconds() -> float:
    """Processor time of finished children: wall time would measure the machine's other work."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_help_explains_every_option_in_groups():
    shown = run_program("run", "--help", COLUMNS="200").stdout
    for field in dataclasses.fields(RunOptions):
        if field.name != "scene":
            assert f"--{field.name.replace('_', '-')}" in shown
    for group in ("scene", "walk", "limit", "map", "measure", "machine", "output"):
        assert f"{group} options" in shown
    for unit in ("MB (2^20 bytes)", "milliseconds", "pixels", "Texels"):
        assert unit in shown


def test_help_of_analyze_names_its_own_options():
    shown = run_program("analyze", "--help", COLUMNS="500").stdout
    for words in ("--methods", "--angles", "comparison options", "overhead", "(default: all maps)"):
        assert words in shown, words
    assert "--frames" not in shown


def test_every_row_of_the_table_loads():
    for name, command in cli.COMMANDS.items():
        assert dataclasses.is_dataclass(cli.load(command.options)), name
        assert callable(cli.load(command.action)), name


def test_closed_pipe_is_no_error():
    command = f"{sys.executable} -m asmjax scenes | true"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0 and done.stderr == ""


def test_scenes(capsys):
    assert cli.main(["scenes", "--json"]) == 0
    scenes = {scene["name"]: scene for scene in json.loads(capsys.readouterr().out)}
    assert {"paper_room", "terrain", "letter_f"} <= set(scenes)
    assert {"overview", "closeup", "macro"} <= set(scenes["paper_room"]["views"])
    assert cli.main(["scenes"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in scenes)


def test_info_as_json_and_text():
    done = run_program("info", "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert set(facts) == {"versions", "renderer", "llvm", "devices", "caches"}
    assert facts["versions"]["drjit"].startswith("1.5")
    assert facts["renderer"]["variant"] in ("llvm_ad_rgb", "scalar_rgb")
    assert facts["llvm"]["usable"] is (facts["llvm"]["repair"] == "")
    assert facts["devices"]
    assert facts["caches"]["calibrations"]["count"] >= 0


def test_info_names_the_repair(tmp_path):
    """Rationale: this is where a user with a slow renderer looks first."""
    done = run_program(
        "info",
        DRJIT_LIBLLVM_PATH=str(tmp_path / "absent.so"),
        ASMJAX_CACHE_DIR=str(tmp_path / "cache"),
    )
    assert done.returncode == 0, done.stderr
    rows = [line.split(maxsplit=1) for line in done.stdout.splitlines()]
    shown = {row[0]: row[1] for row in rows if len(row) == 2}
    assert shown["variant"] == "scalar_rgb" and shown["usable"] == "no"
    assert shown["repair"] == "unset DRJIT_LIBLLVM_PATH; apt-get install -y libllvm19"
    assert shown["calibrations"] == f"{tmp_path / 'cache' / 'calibrations'}  (0 kept)"


def test_flatten_box_drops_frame_and_help_text():
    box = """
╭─ Value error ──────────────────╮
│ Error parsing --size: too few. │
│ ────────────────────────────── │
│ Argument helptext:             │
│     --size W H                 │
│ ────────────────────────────── │
│ For full helptext, see --help  │
╰────────────────────────────────╯
"""
    assert flatten_box(box) == "Error parsing --size: too few. For full helptext, see --help"


def test_compilation_cache_is_hit_by_the_next_process(tmp_path):
    code = """
import sys
from asmjax.cli.caches import enable_compilation_cache
import jax
hits = []
jax.monitoring.register_event_listener(lambda event, **_: hits.append("cache_hits" in event))
assert enable_compilation_cache() is not None
jax.jit(lambda x: (x * 2 + 1).sum())(jax.numpy.arange(100.0)).block_until_ready()
print(sum(hits))
"""
    counts = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"ASMJAX_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0 and done.stderr == "", done.stderr
        counts.append(int(done.stdout))
    assert counts[0] == 0 and counts[1] > 0


def test_compilation_cache_does_without_a_folder(tmp_path, monkeypatch):
    from asmjax.cli.caches import enable_compilation_cache

    blocked = tmp_path / "a_file"
    blocked.write_text("")
    monkeypatch.setenv("ASMJAX_CACHE_DIR", str(blocked))
    assert enable_compilation_cache() is None
