"""Tuning as text and as CSV: the rivals, their settings, and what came of it."""

from collections.abc import Callable, Mapping
from typing import Any

from asmjax.experiment.clock import Median
from asmjax.report.table import MB, Column, csv_text, significant, table_text
from asmjax.report.tune_record import tried_records
from asmjax.report.tune_result import TuningResult
from asmjax.report.tune_words import OTHERS, RIVAL_WORDS, setting_words
from asmjax.tuning.result import Candidate
from asmjax.tuning.space import NAMES


def tuning_text(result: TuningResult) -> str:
    """Two tables and what they say, without a last newline."""
    found = result.found
    parts = [
        f"{result.where} ({', '.join(found.chosen_on)}), {found.goal.words}:",
        table_text(_columns(result), [{"name": name} for name in found.rivals]),
        _settings_text(result),
        verdict(result),
    ]
    return "\n\n".join(part for part in parts if part)


def verdict(result: TuningResult) -> str:
    """How much better the tuned settings are, in a sentence or two."""
    found = result.found
    if not found.goal.met(found.tuned.edge_px, found.tuned.seconds):
        return found.advice
    end = f" {_sentence(found.advice)}" if found.advice else ""
    if found.tuned is found.default:
        return f"tuned is the default.{end}"
    told = []
    for name, words in OTHERS.items():
        if name not in found.rivals:
            continue
        gain = result.gain_over(name)
        if gain is not None:
            told.append(f"{_percent(gain)} than {words}")
        elif not found.goal.met(found.rivals[name].edge_px, found.rivals[name].seconds):
            told.append(f"within the limit, which {words} is not")
    return f"tuned is {_listed(told)}, {result.where}.{end}"


def _listed(told: list[str]) -> str:
    return " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)


def _percent(gain: float) -> str:
    size = f"{significant(100 * abs(gain))} %"
    return f"{size} better" if gain >= 0 else f"{size} worse"


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:]


def _columns(result: TuningResult) -> list[Column]:
    found, goal = result.found, result.found.goal
    unit, scale = ("ms", 1e3) if goal.kind == "error" else ("px", 1.0)

    def column(group: str, head: str, value: Callable[[Candidate], Any], text: Callable) -> Column:
        return Column(group, head, lambda row: value(found.rivals[row["name"]]), text, head)

    def objective(one: Candidate) -> str:
        if not goal.met(one.edge_px, one.seconds):
            return "over limit"
        return significant(scale * one.objective(goal))

    def gain(row: Mapping) -> str | None:
        part = result.gain_over(row["name"]) if row["name"] in OTHERS else None
        return None if part is None else _percent(part)

    return [
        Column("", "settings", lambda row: RIVAL_WORDS[row["name"]], str, "settings"),
        column("objective", unit, objective, str),
        Column("objective", "tuned is", gain, str, "gain"),
        column("edge off", "px", lambda one: one.edge_px, significant),
        column("milliseconds", "median", lambda one: 1e3 * one.seconds, significant),
        column("milliseconds", "interval", lambda one: _range(one.whole.total, 1e3), str),
        column("x rays", "median", lambda one: one.ratio.value, significant),
        column("x rays", "interval", lambda one: _range(one.ratio), str),
        column("", "MB", lambda one: one.whole.bytes / MB, significant),
    ]


def _range(of: Median, scale: float = 1.0) -> str:
    return f"{significant(scale * of.low)}-{significant(scale * of.high)}"


def _settings_text(result: TuningResult) -> str:
    """The settings in which rivals differ from the default."""
    rivals = result.found.rivals
    values = {name: one.settings for name, one in rivals.items()}
    differ = [
        setting
        for setting in NAMES
        if any(own[setting] != values["default"][setting] for own in values.values())
    ]
    if not differ:
        return ""

    def column(name: str) -> Column:
        def text(row: Mapping) -> str:
            value, usual = values[name][row["setting"]], values["default"][row["setting"]]
            same = name != "default" and value == usual
            return "as default" if same else setting_words(row["setting"], value)

        return Column("", RIVAL_WORDS[name], text, str, name)

    columns = [Column("", "setting", lambda row: row["setting"], str, "setting")]
    rows = [{"setting": setting} for setting in differ]
    return table_text([*columns, *(column(name) for name in rivals)], rows)


def tried_csv(result: TuningResult) -> str:
    """A row for each settings that were tried, in order, unrounded."""

    def column(name: str, value: Callable[[Mapping], Any]) -> Column:
        return Column("", name, value, str, name)

    def scaled(value: float | None) -> float | None:
        return None if value is None else 1e3 * value

    columns = [
        column("role", lambda row: row["role"]),
        *(column(name, lambda row, name=name: row["settings"][name]) for name in NAMES),
        column("met", lambda row: row["met"]),
        column("objective", lambda row: row["objective"]),
        column("per_edge_length_px", lambda row: row["edge_px"]),
        column("total_ms", lambda row: 1e3 * row["seconds"]["median"]),
        column("ratio_to_rays", lambda row: row["ratio"]["median"]),
        column("bytes", lambda row: row["bytes"]),
        column("predicted_per_edge_length_px", lambda row: row["predicted"]["edge_px"]),
        column("predicted_total_ms", lambda row: scaled(row["predicted"]["seconds"])),
    ]
    return csv_text(tried_records(result), columns)
