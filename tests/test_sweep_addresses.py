"""A sweep connects to schedulers of this machine, or encrypted, and says so of all others."""

import pytest

from asmjax.errors import UseError
from asmjax.sweep.addresses import check_certificates, scheduler_address


@pytest.mark.parametrize(
    ("scheduler", "message"),
    [
        ("tcp://10.0.0.1:8786", "on another machine and not encrypted.*tls://HOST:PORT"),
        ("cluster.example:8786", "on another machine and not encrypted"),
        ("tcp://localhost.example:8786", "on another machine and not encrypted"),
        ("inproc://10.0.0.1/1/2", "is no address of a scheduler"),
        ("tls://10.0.0.1", "is no address of a scheduler"),
        ("tcp://127.0.0.1:many", "is no address of a scheduler"),
        ("tcp://[::1", "is no address of a scheduler"),
        ("", "is no address of a scheduler"),
    ],
)
def test_schedulers_that_may_not_be_used(scheduler, message):
    with pytest.raises(UseError, match=message):
        scheduler_address(scheduler, None)


def test_schedulers_that_may_be_used(tmp_path):
    assert scheduler_address(None, None) is None
    assert scheduler_address("127.0.0.1:8786", None) == "tcp://127.0.0.1:8786"
    assert scheduler_address("tcp://[::1]:8786", None) == "tcp://[::1]:8786"
    file = tmp_path / "scheduler.json"
    file.write_text('{"address": "tls://10.0.0.1:8786", "type": "Scheduler"}')
    assert scheduler_address(None, file) == "tls://10.0.0.1:8786"
    with pytest.raises(UseError, match="both name a scheduler"):
        scheduler_address("127.0.0.1:8786", file)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"address": 3}'])
def test_files_that_name_no_scheduler(tmp_path, content):
    with pytest.raises(UseError, match="cannot read the scheduler file .*dask scheduler"):
        scheduler_address(None, tmp_path / "absent.json")
    (tmp_path / "scheduler.json").write_text(content)
    with pytest.raises(UseError, match="is no scheduler file"):
        scheduler_address(None, tmp_path / "scheduler.json")


def test_an_encrypted_connection_wants_certificates():
    from distributed import Security

    with pytest.raises(UseError, match="DASK_DISTRIBUTED__COMM__TLS__CA_FILE and .*CLIENT__KEY"):
        check_certificates(Security())
