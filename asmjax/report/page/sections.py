"""Which section shows a folder, by the schema of its report: one file and one line for each."""

from collections.abc import Callable, Mapping

from asmjax.report.compare_schema import COMPARISON_SCHEMA
from asmjax.report.page.analysis import analysis_part
from asmjax.report.page.compare import compare_part
from asmjax.report.page.folder import Results
from asmjax.report.page.part import Part
from asmjax.report.page.plan import plan_part
from asmjax.report.page.run import run_part
from asmjax.report.page.tune import tune_part
from asmjax.report.page.walkthrough import walkthrough_part
from asmjax.report.plan_schema import PLAN_SCHEMA
from asmjax.report.schema import ALIASING_SCHEMA, RUN_SCHEMA, WALKTHROUGH_SCHEMA
from asmjax.report.tune_schema import TUNING_SCHEMA

Sections = Mapping[str, Callable[[Results], Part]]
"""What draws a kind of report, by its schema."""

SECTIONS: Sections = {
    RUN_SCHEMA: run_part,
    WALKTHROUGH_SCHEMA: walkthrough_part,
    ALIASING_SCHEMA: analysis_part,
    COMPARISON_SCHEMA: compare_part,
    TUNING_SCHEMA: tune_part,
    PLAN_SCHEMA: plan_part,
}
