"""Records that grow step by step: what fails is told, and takes no other step with it."""

import json

from asmjax.report.stepwise import StepwiseRecord, exit_code, head_of


def test_a_step_that_fails_is_told_in_the_document_and_by_the_exit_code(tmp_path, caplog):
    kept = StepwiseRecord(
        tmp_path, "A study", {}, lambda record: [], lambda record: "\n".join(head_of(record)),
        quiet=True,
    )  # fmt: skip

    def find() -> None:
        kept.record["found"] = 7

    def fail() -> None:
        raise ValueError("no such scene\nand more")

    kept.run({"first": find})
    assert exit_code(kept.record) == 0 and "failed" not in (tmp_path / "report.md").read_text()
    kept.record["left_out"] = ["munich: there are no shared scenes"]
    kept.run({"second": fail, "third": find})
    assert "'second' failed" in caplog.text
    assert exit_code(kept.record) == 1
    report = json.loads((tmp_path / "report.json").read_text())
    assert [step["status"] for step in report["steps"].values()] == ["done", "failed", "done"]
    assert report["found"] == 7
    page = (tmp_path / "report.md").read_text()
    assert "* **step 'second' failed**: ValueError: no such scene\n" in page
    assert "* left out: munich: there are no shared scenes" in page
    kept.record["left_out"] = {"disks": "none can be mounted"}
    assert "* left out: disks: none can be mounted" in head_of(kept.record)
