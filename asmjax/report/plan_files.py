"""From a plan to its files: report.json and a figure."""

import sys

import jax
import numpy as np

from asmjax.effects import Decision, LightSeen, Plan
from asmjax.effects.plan import with_error
from asmjax.effects.records import percent, pixels
from asmjax.report.figures.board import drawing
from asmjax.report.figures.plan import LightPanel, draw_plan
from asmjax.report.figures.shading import shade
from asmjax.report.outputs import PLAN, Outputs
from asmjax.report.plan_result import PlanResult
from asmjax.report.plan_schema import PLAN_SCHEMA
from asmjax.report.provenance import provenance
from asmjax.report.record import report_of_entries


def write_plan(result: PlanResult, report: dict, outputs: Outputs) -> None:
    """Write report.json and plan.png.

    The numbers come first: a figure that fails cannot lose them.

    Args:
        report: as of `report_of_plan`.

    Raises:
        WriteError: some of it cannot be written.
    """
    outputs.keep(report)
    plan = result.plan
    drawn = drawing(lambda: draw_plan(panels(result), _title(plan), footnotes(plan)))
    outputs.add({PLAN[0]: drawn})
    outputs.finish()


def report_of_plan(result: PlanResult, seed: int) -> dict:
    """The validated `report.json` of a plan that was made with that seed."""
    plan = result.plan
    return report_of_entries(
        schema=PLAN_SCHEMA,
        argv=["asmjax", *sys.argv[1:]],
        provenance=provenance(result.variant, jax.devices()[0].device_kind),
        seed=seed,
        memory=result.memory,
        scene=plan.scene,
        view=plan.view.name,
        light=", ".join(numbers.name for numbers in plan.numbers),
        size=(plan.view.width, plan.view.height),
        plan=plan.record(),
        notices=result.notices,
    )


def panels(result: PlanResult) -> list[LightPanel]:
    """A panel for each light, in the plan's order."""
    plan, eye = result.plan, result.eye
    albedo, valid = eye.albedo.reshape(3, *eye.size), eye.valid.reshape(eye.size)
    drawn = []
    if not plan.numbers:
        whole = shade(albedo, np.ones(eye.size), valid, valid)
        drawn.append(LightPanel("no light", "none that casts shadows", whole))
    for numbers, seen in zip(plan.numbers, plan.seen, strict=True):
        decision = plan.decision(numbers.name)
        lit = seen.facing if seen.lit is None else seen.lit
        drawn.append(
            LightPanel(
                title=_heading(plan, decision),
                small=_small(seen, decision),
                picture=shade(albedo, seen.cosine, lit, valid),
                widest=seen.widest,
                widths=_widths(decision),
            )
        )
    return drawn


def footnotes(plan: Plan) -> list[str]:
    """What is skipped and what is not simulated, for small print."""
    notes = [f"Note: {note}." for note in plan.notes]
    for title, items in (("Skipped", plan.skipped), ("Not simulated", plan.not_simulated)):
        named = [
            f"{item.effect}{f' of {item.light}' if item.light else ''} - {with_error(item)}"
            for item in items
        ]
        notes.append(f"{title}: {'; '.join(named) or 'nothing'}.")
    return notes


def _heading(plan: Plan, decision: Decision) -> str:
    methods = " + ".join(decision.methods)
    parts = [f"{decision.light}: {decision.kind}", *([methods] if methods else [])]
    missing = [item for item in plan.not_simulated if item.light == decision.light]
    return ", ".join([*parts, *(f"no {item.effect}" for item in missing)])


def _small(seen: LightSeen, decision: Decision) -> str:
    if seen.widest is not None:
        return "shadow of its centre, as the probe sees it"
    return decision.reason


def _widths(decision: Decision) -> str:
    """Of a light with a size."""
    if decision.width_p95 == 0:
        return "none at any edge"
    return f"median {pixels(decision.width_p50)}, 95 % below {pixels(decision.width_p95)} at edges"


def _title(plan: Plan) -> str:
    return (
        f"{plan.scene}, {plan.view.name}, {plan.view.width} x {plan.view.height} pixels; what "
        f"changes less than {percent(plan.tolerance)} of the light is skipped"
    )
