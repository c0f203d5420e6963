"""What a run leaves behind: `report.json`, the table, and (in `figures`) its pictures.

Importing this package loads neither JAX nor matplotlib.
"""

from asmjax.report.keys import InvalidReport, key_paths
from asmjax.report.provenance import provenance
from asmjax.report.record import map_summary, method_record, run_report, write_json
from asmjax.report.schema import (
    MAP_NAMES,
    METHOD_KINDS,
    RUN_KEYS,
    RUN_SCHEMA,
    WALKTHROUGH_KEYS,
    WALKTHROUGH_SCHEMA,
    validate_report,
)
from asmjax.report.table import MB, comparison_table, csv_text, significant, write_csv

__all__ = [
    "MAP_NAMES",
    "MB",
    "METHOD_KINDS",
    "RUN_KEYS",
    "RUN_SCHEMA",
    "WALKTHROUGH_KEYS",
    "WALKTHROUGH_SCHEMA",
    "InvalidReport",
    "comparison_table",
    "csv_text",
    "key_paths",
    "map_summary",
    "method_record",
    "provenance",
    "run_report",
    "significant",
    "validate_report",
    "write_csv",
    "write_json",
]
