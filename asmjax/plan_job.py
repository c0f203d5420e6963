"""`asmjax plan`: which shadow effects a scene calls for, and which it does not."""

from functools import partial
from typing import Any

from tqdm import tqdm

from asmjax.delivery import deliver
from asmjax.effects import plan_lights, probe_size
from asmjax.folders import results_folder
from asmjax.job_memory import Sight, plan_stages
from asmjax.memory import check, limit_of
from asmjax.options import PlanOptions, force_of, given_options
from asmjax.planning import asked_of, known_rates, measured_rates
from asmjax.preparation import Progress, StepBar, chosen_scene, chosen_view
from asmjax.report.plan_files import report_of_plan, write_plan
from asmjax.report.plan_result import PlanResult
from asmjax.report.plan_table import plan_table
from asmjax.shadow import ALGORITHMS

_STEPS = 3
"""Steps of progress: scene, probe, figure."""


def run_plan(options: PlanOptions) -> PlanResult:
    """Plan, write the results below `options.out`, and print table and reasons.

    Raises:
        UseError: wrong options or a scene that cannot be used; nothing is written then.
    """
    outputs = results_folder(options)
    with tqdm(total=_STEPS, disable=options.quiet or None, leave=False, unit="step") as bar:
        progress = StepBar(bar)
        result = plan_scene(options, progress)
        progress("figure")
        report = report_of_plan(result, options.seed)
        write = partial(write_plan, result, report, outputs)
        text = f"{plan_table(result.plan)}\n\n{result.plan.explain()}"
        deliver(text, write, outputs, bar, quiet=options.quiet, what="report and figure")
    return result


def plan_scene(
    options: PlanOptions | str = "paper_room",
    progress: Progress = lambda _: None,
    **changes: Any,
) -> PlanResult:
    """The plan that the options ask for, or `plan_scene("terrain", tolerance=1e-3)`; writes
    nothing. `progress` hears of each step.

    Raises:
        UseError: wrong options or a scene that cannot be used.
    """
    options = given_options(PlanOptions, options, changes)
    progress("scene")
    force = force_of(options.force)
    scene = chosen_scene(options)
    view = chosen_view(scene, options)
    width, height = probe_size(view.width, view.height)
    sight = Sight(width, height, 1, scene.variant.startswith("scalar"))
    memory = check(plan_stages(sight), limit_of(options.max_memory_mb))
    progress("probe")
    asked = asked_of(scene, view, options.lights)
    rates = measured_rates(scene, asked, options) if options.recalibrate else known_rates(scene)
    plan = plan_lights(asked, options.tolerance, force, ALGORITHMS, rates, options.seed)
    return PlanResult(plan, asked.eye, scene.variant, scene.notices, memory)
