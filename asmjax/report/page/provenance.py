"""Where the numbers of a section come from."""

from asmjax.report.page.folder import REPORT, Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.tables import bullets, pairs
from asmjax.report.page.words import megabytes


def provenance_block(results: Results) -> Markup:
    """Command, scene, machine, versions, seed and memory, and what was left out or approximated."""
    report = results.report
    machine, memory = report["machine"], report.get("memory")
    size = f"{report['size'][0]} x {report['size'][1]} pixels"
    held = machine["memory_bytes"]
    rows = [
        ("command", report["command"]),
        ("seen", f"{report['scene']}, {report['view']}, {size}"),
        ("light", report["light"]),
        (
            "machine",
            f"{machine['cpu']}, {machine['cores']} cores"
            + (f", {megabytes(held)} of memory" if held else ""),
        ),
        ("renderer, kernels", f"{machine['variant']}, JAX on {machine['device']}"),
        ("versions", ", ".join(f"{name} {v}" for name, v in report["versions"].items())),
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
    rows.append(
        ("file", f"{results.folder / REPORT}, {report['schema']}, SHA-256 {results.digest}")
    )
    notices = bullets(report["notices"])
    return joined(
        [
            tag("h3", "Left out or approximated") if notices else None,
            notices,
            tag("h3", "Provenance"),
            pairs(rows, "Where these numbers come from"),
        ]
    )
