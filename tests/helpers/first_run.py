"""What the first run of a process casts, traces and calls; run as a program.

`python -m helpers.first_run registered` prints JSON: `rays` by what casts them, `traces` of JAX by
name, `names` of the methods, and `reached`, the files of soft and filtered maps that ran a line.
With `removed` these families are not registered, and `unplanned` has the rays of a second run that
is given the first one's plan, of which `probe_rays` says what it cast.
"""

import json
import sys

import pytest

from asmjax import main_job
from asmjax.experiment import RunResult
from asmjax.experiment.traces import counted_traces
from asmjax.options import RunOptions
from asmjax.render.caster import MitsubaRays
from asmjax.shadow import CostModel
from asmjax.shadow.registry import ALGORITHMS, FILTERS, SOFT

OPTIONS = RunOptions(scene="letter_f", size=(48, 32), memory_mb=0.25, repeats=1)

CASTING = ("light_buffer", "hits", "prepare_occlusion", "first_surfaces")

FOLDERS = ("/shadow/soft/", "/shadow/filtered/", "soft_truth.py", "soft_visibility.py")


def counted_run(patch: pytest.MonkeyPatch) -> tuple[dict[str, int], RunResult]:
    """A run, and the rays that it cast."""
    rays: dict[str, int] = {}

    def counted(name, before):
        def count(caster, *args, **kwargs):
            size = args[1].texels if name == "light_buffer" else args[0].shape[1]
            rays[name] = rays.get(name, 0) + size
            return before(caster, *args, **kwargs)

        return count

    with patch.context() as inner:
        for name in CASTING:
            inner.setattr(MitsubaRays, name, counted(name, getattr(MitsubaRays, name)))
        return rays, main_job.measure_scene(OPTIONS)


def main(arm: str) -> None:
    """Run, and print."""
    reached: set[str] = set()

    def look(frame, event, arg) -> None:
        if event == "call" and any(part in frame.f_code.co_filename for part in FOLDERS):
            reached.add(frame.f_code.co_filename)

    plans = []

    def kept(*args, **kwargs):
        plans.append(planned(*args, **kwargs))
        return plans[-1]

    planned = main_job.plan_effects
    with pytest.MonkeyPatch.context() as patch:
        if arm == "removed":
            for family in (*SOFT, *FILTERS):
                patch.delitem(ALGORITHMS, family)
        patch.setattr(main_job, "plan_effects", kept)
        # Measuring it casts as many rays as the clock wants.
        patch.setattr(main_job, "calibrated", lambda *args: CostModel(1e-8, 1e-4, 0.1))
        with counted_traces() as traces:
            sys.setprofile(look)
            rays, result = counted_run(patch)
            sys.setprofile(None)
        told = {
            "rays": rays,
            "traces": list(traces),
            "names": [one.name for one in result.methods],
            "reached": sorted(reached),
        }
        if arm == "removed":
            patch.setattr(main_job, "plan_effects", lambda *args, **kwargs: plans[0])
            told |= {"unplanned": counted_run(patch)[0], "probe_rays": plans[0].probe_rays}
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
