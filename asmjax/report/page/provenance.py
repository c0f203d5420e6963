"""Where the numbers of a section come from."""

from collections.abc import Mapping, Sequence
from typing import Any

from asmjax.report.page.folder import REPORT, Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.tables import bullets, pairs
from asmjax.report.page.words import megabytes


def provenance_block(results: Results) -> Markup:
    """Command, scene, machine, versions, seed and memory, and what was left out or approximated."""
    report = results.report
    machine, memory = report["machine"], report.get("memory")
    size = f"{report['size'][0]} x {report['size'][1]} pixels"
    rows = [
        ("command", report["command"]),
        ("seen", f"{report['scene']}, {report['view']}, {size}"),
        ("light", report["light"]),
        ("machine", machine_words(machine)),
        ("renderer, kernels", f"{machine['variant']}, JAX on {machine['device']}"),
        ("versions", versions_words(report["versions"])),
        ("seed", str(report["seed"])),
    ]
    if memory:
        limit = memory["limit_bytes"]
        allowed = "no limit" if limit is None else f"limit {megabytes(limit)}"
        rows.append(
            ("memory of the job", f"estimated {megabytes(memory['estimate_bytes'])}, {allowed}")
        )
    model = report.get("cost_model")
    if model and model.get("measured_at"):
        kept = "by an earlier run" if model.get("kept") else "by this run"
        rows.append(("cost of texels", f"measured {kept}, {model['measured_at']}"))
    rows.append(file_row(results))
    return origin(rows, report["notices"])


def origin(rows: Sequence[tuple[str, str]], notices: Sequence[str]) -> Markup:
    """What was left out or approximated, and below it where the numbers come from."""
    told = bullets(notices)
    return joined(
        [
            tag("h3", "Left out or approximated") if told else None,
            told,
            tag("h3", "Provenance"),
            pairs(rows, "Where these numbers come from"),
        ]
    )


def machine_words(machine: Mapping[str, Any]) -> str:
    """Processor, cores and memory of a report's `machine`."""
    held = machine["memory_bytes"]
    known = f", {megabytes(held)} of memory" if held else ""
    return f"{machine['cpu']}, {machine['cores']} cores{known}"


def versions_words(versions: Mapping[str, str]) -> str:
    """Of a report's `versions`."""
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def file_row(results: Results) -> tuple[str, str]:
    """Which file it was, and what was in it."""
    return (
        "file",
        f"{results.folder / REPORT}, {results.report['schema']}, SHA-256 {results.digest}",
    )
