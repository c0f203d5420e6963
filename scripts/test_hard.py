"""The long tests, part after part, and what each took: `make test-hard`.

    python scripts/test_hard.py [PART ...] [OPTION OF PYTEST ...]

Each part is a run of pytest of its own: one that fails or is stopped takes no other with it. Quick
parts go first. Logs, and times by test, are in `build/test-hard/`. Ends with a table, and with 1
if a test failed.
"""

import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "test-hard"

PARTS: dict[str, tuple[str, ...]] = {
    "hard_cases": ("test_hard_cases.py", "test_hard_aliasing.py"),
    "render": ("render/test_*.py",),
    "jobs": ("test_*_job.py", "test_*_run.py", "test_sweep_*.py", "test_docs.py", "test_site.py",
             "test_notebooks.py", "test_memory_peak.py"),
    "studies": ("test_analysis_*.py", "test_predicted.py", "test_theory_*.py"),
    "rest": (),
    "hostile": ("hostile/test_*.py",),
    "hard_scenes": ("test_hard_cases_scene.py",),
    "properties": ("test_kernel_promises.py",),
}  # fmt: skip
"""Files of tests by part; those that no part names are the rest."""

ENVIRONMENT = {"ASMJAX_TEST_HARD": "1", "HYPOTHESIS_PROFILE": "hard"}
"""What is set where it is not set already."""


class Ended(NamedTuple):
    """A part that has run: counts of its tests, seconds, and the test that took longest."""

    name: str
    passed: int
    failed: int
    skipped: int
    wall: float
    cpu: float
    slowest: str


def files_of(part: str) -> list[str]:
    """Files of tests of a part, relative to the repository."""
    tests = ROOT / "tests"
    named = {name: {p for one in PARTS[name] for p in tests.glob(one)} for name in PARTS}
    every = set(tests.rglob("test_*.py"))
    mine = named[part] if PARTS[part] else every.difference(*named.values())
    return sorted(str(path.relative_to(ROOT)) for path in mine)


def run(part: str, options: Sequence[str]) -> Ended:
    """Run a part; its output goes to the terminal and to its log."""
    record = FOLDER / f"{part}.xml"
    record.unlink(missing_ok=True)
    command = [
        sys.executable, "-m", "pytest", "-n", "auto", "--dist", "loadfile",
        "--no-loadscope-reorder", "-q", "--timeout", "3600", f"--junitxml={record}",
        *options, *files_of(part),
    ]  # fmt: skip
    start, before = time.monotonic(), _cpu()
    with (
        (FOLDER / f"{part}.txt").open("w", encoding="utf-8") as log,
        subprocess.Popen(
            command, cwd=ROOT, env=ENVIRONMENT | os.environ, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ) as child,
    ):  # fmt: skip
        assert child.stdout is not None
        for line in child.stdout:
            print(line, end="", flush=True)
            log.write(line)
    return _ended(part, record, child.returncode, time.monotonic() - start, _cpu() - before)


def _cpu() -> float:
    """Seconds of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _ended(part: str, record: Path, code: int, wall: float, cpu: float) -> Ended:
    if not record.is_file():
        return Ended(part, 0, 1, 0, wall, cpu, f"none: pytest ended with {code}")
    suites = list(ElementTree.parse(record).getroot().iter("testsuite"))
    tests, skipped, *bad = (
        sum(int(suite.get(key, 0)) for suite in suites)
        for key in ("tests", "skipped", "failures", "errors")
    )
    took = [(float(c.get("time", 0)), c.get("name")) for s in suites for c in s.iter("testcase")]
    seconds, name = max(took, default=(0.0, "none"))
    # 5 says that no test was chosen, as of `-k`.
    failed = sum(bad) or int(code not in (0, 5))
    passed = tests - skipped - sum(bad)
    return Ended(part, passed, failed, skipped, wall, cpu, f"{name} ({seconds:.0f} s)")


def table(ended: Sequence[Ended]) -> str:
    """What each part came to, a line each."""
    lines = ["part         passed failed skipped    min CPU min  slowest test"]
    for part in ended:
        counts = f"{part.passed:6} {part.failed:6} {part.skipped:7}"
        minutes = f"{part.wall / 60:6.1f} {part.cpu / 60:7.1f}"
        lines.append(f"{part.name:12} {counts} {minutes}  {part.slowest}")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Run the parts that are named first, or all; Ctrl-C ends with the table of those that ran."""
    cut = next((k for k, word in enumerate(arguments) if word.startswith("-")), len(arguments))
    parts, options = list(arguments[:cut]) or list(PARTS), arguments[cut:]
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        allowed = ", ".join(PARTS)
        print(f"unknown part '{unknown[0]}'; allowed: {allowed}, or none for all", file=sys.stderr)
        return 2
    FOLDER.mkdir(parents=True, exist_ok=True)
    ended: list[Ended] = []
    try:
        for part in parts:
            print(f"=== {part}", flush=True)
            ended.append(run(part, options))
    except KeyboardInterrupt:
        left = " ".join(parts[len(ended) :])
        print(f'stopped; go on with: make test-hard ARGS="{left}"')
    print(f"\n{table(ended)}")
    return int(len(ended) < len(parts) or any(part.failed for part in ended))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
