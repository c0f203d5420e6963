"""The scripts of a cluster: names with blanks, a scheduler that dies, and what is passed on."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "experiments" / "cluster"

PROGRAMS = {
    "dask": 'echo "dask $*" >> calls; [ "$1" = worker ] || eval "$DASK_DOES"',
    "srun": 'shift; exec "$@"',
    "asmjax": 'sleep 0.2; echo "asmjax $*" >> calls',
}
"""What stands in for those of a cluster, by name."""


def test_certificates_may_lie_in_a_folder_of_any_name(tmp_path):
    if shutil.which("openssl") is None:
        pytest.skip("there is no `openssl`")
    folder = tmp_path / "it's my $HOME"
    subprocess.run([SCRIPTS / "certificates.sh", folder], check=True)
    words = ["bash", "-c", 'source "$0/settings.sh" && env -0', folder]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    found = {name: value for name, _, value in (one.partition("=") for one in told.split("\0"))}
    tls = "DASK_DISTRIBUTED__COMM__TLS__"
    files = {name: Path(value) for name, value in found.items() if name.startswith(tls)}
    assert len(files) == 7 and all(file.is_file() for file in files.values())
    assert files[f"{tls}WORKER__KEY"] == folder / "key.pem"
    assert all(file.stat().st_mode & 0o077 == 0 for file in files.values())


@pytest.fixture
def job(tmp_path):
    """Runs the batch script in a folder with programs that only note how they are called."""
    (tmp_path / "experiments/cluster").mkdir(parents=True)
    (tmp_path / ".venv/bin").mkdir(parents=True)
    (tmp_path / ".venv/bin/activate").write_text(f'PATH="{tmp_path}/.venv/bin:$PATH"\n')
    certificates = tmp_path / "experiments/cluster/certificates.sh"
    certificates.write_text('#!/bin/sh\nmkdir -p "$1" && touch "$1/settings.sh"\n')
    certificates.chmod(0o755)
    for name, does in PROGRAMS.items():
        program = tmp_path / ".venv/bin" / name
        program.write_text(f"#!/bin/bash\n{does}\n")
        program.chmod(0o755)

    def run(scheduler: str, **environment: str) -> tuple[int, list[str]]:
        environment = os.environ | {"SLURM_JOB_ID": "7", "DASK_DOES": scheduler} | environment
        words = ["bash", SCRIPTS / "slurm.sh", "a b.toml"]
        done = subprocess.run(words, cwd=tmp_path, env=environment, timeout=60)
        assert not (tmp_path / "out/slurm-7").exists(), "keys are removed"
        return done.returncode, sorted((tmp_path / "calls").read_text().splitlines())

    return run


def test_a_job_ends_with_its_scheduler(job):
    """Otherwise it would wait for the file until its time limit."""
    code, calls = job("exit 3")
    assert code == 1 and [line.split()[1] for line in calls] == ["scheduler"]


def test_a_job_connects_its_parts_and_serves_no_pages(job):
    """A trial gets what its task has, but for the worker."""
    scheduler = 'while [ "$1" != --scheduler-file ]; do shift; done; echo {} > "$2"; exec sleep 60'
    code, (sweep, first, second) = job(scheduler, SLURM_MEM_PER_CPU="4096")
    assert code == 0
    assert sweep.startswith("asmjax sweep a b.toml --scheduler-file ")
    assert sweep.endswith("/out/slurm-7/scheduler.json --max-memory 3796")
    for line, what in ((first, "scheduler"), (second, "worker")):
        assert line.startswith(f"dask {what} ") and "--protocol tls" in line
        assert line.endswith("--no-dashboard --dashboard-address 127.0.0.1:0")
    code, calls = job(scheduler)
    assert code == 0 and calls[0].endswith("scheduler.json")
