"""The section of `asmjax tune`: settings for a goal, beside those of a grid and of chance."""

from collections.abc import Mapping, Sequence

from asmjax.report.figures.tuning import ROLES
from asmjax.report.page.chart import Chart, Mark, Point, charts
from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag
from asmjax.report.page.part import Part
from asmjax.report.page.pictures import figures
from asmjax.report.page.provenance import provenance_block
from asmjax.report.page.tables import table
from asmjax.report.page.words import EDGE, listed, megabytes, milliseconds, plural
from asmjax.report.table import MB, Column, significant
from asmjax.report.tune_words import OTHERS, RIVAL_WORDS, setting_words

_FIGURES = {
    "tried.png": (
        "All that was tried, and on the held-out views the rivals; settings on one grey line are "
        "equally good.",
        "Two plots of error against time",
    ),
    "surrogate.png": (
        "What the surrogate says of error and time against what was measured.",
        "Points along the diagonals of two plots",
    ),
}

_SENSITIVITY = {
    "sensitivity.png": (
        "What a dearer second changes, and the best settings over the price.",
        "Bars of slopes, and a curve for each setting over the price",
    ),
}


def tune_part(results: Results) -> Part:
    """The section of a tuning.

    Raises:
        UseError: a picture in the folder is damaged.
    """
    report = results.report
    drawn = _FIGURES | (_SENSITIVITY if report["sensitivity"] else {})
    tried, finalists = len(report["tried"]), len(report["finalists"])
    body = joined(
        [
            tag("h3", "What was tried"),
            charts(
                [
                    _chart(f"{plural(tried, 'setting')} tried", report["tried"], "tuned on"),
                    _chart(f"{finalists} on held-out views", report["finalists"], "held out"),
                ]
            ),
            _rivals(report),
            _settings(report),
            figures(results, drawn),
            provenance_block(results),
        ]
    )
    return Part(f"Tuning: {report['scene']}, {report['goal']['words']}", _summary(report), body)


def _summary(report: Mapping) -> tuple[str, ...]:
    rivals = _measured(report)
    tuned, default = rivals["tuned"], rivals["default"]
    chosen = [view["name"] for view in report["views"] if view["held_out"]]
    where = f"on {listed(chosen)}" if chosen else "on the views tuned on"
    said = [
        f"Goal: least {report['goal']['words']}."
        if report["goal"]["kind"] == "price"
        else f"Goal: {report['goal']['words']}.",
        f"The tuned settings take {_time(tuned)} for an error of {_off(tuned)}, the default's "
        f"{_time(default)} for {_off(default)}, {where}.",
    ]
    gains = [
        f"{significant(100 * abs(one['gain']))} % {'better' if one['gain'] >= 0 else 'worse'} than "
        f"{words}"
        for name, words in OTHERS.items()
        if (one := rivals.get(name)) and one["gain"] is not None
    ]
    if not tuned["met"]:
        said.append("The limit is not kept.")
    elif tuned["all_settings"] == default["all_settings"]:
        said.append("The default stands: nothing was better.")
    elif gains:
        said.append(f"By the goal that is {listed(gains)}.")
    if report["advice"]:
        said.append(f"{report['advice'][:1].upper()}{report['advice'][1:].rstrip('.')}.")
    return tuple(said)


def _measured(report: Mapping) -> dict[str, Mapping]:
    return {name: report["objective"][name] for name in RIVAL_WORDS if report["objective"][name]}


def _time(one: Mapping) -> str:
    return milliseconds(one["seconds"]["median"])


def _off(one: Mapping) -> str:
    return f"{significant(one['edge_px'])} px"


def _chart(title: str, candidates: Sequence[Mapping], which: str) -> Chart:
    points = [_point(one) for one in candidates]
    # One ray per pixel: over all that was measured, as each has turns of its own.
    rays = sorted(
        one["seconds"]["median"] / one["ratio"]["median"]
        for one in candidates
        if one["ratio"]["median"] > 0
    )
    marks = [Mark("1 ray per pixel", 1e3 * rays[len(rays) // 2])] if rays else []
    return Chart(
        title=title,
        x_axis=f"time from nothing, milliseconds; views {which}",
        y_axis=EDGE,
        points=points,
        looks={look.words: (look.colour, look.marker) for look in ROLES.values()},
        marks=marks,
        note="Lower left is better. Open markers on the line of 0: no wrong pixel. Bars: interval "
        "of the median time.",
    )


def _point(one: Mapping) -> Point:
    settings = [f"{name}: {_setting(name, value)}" for name, value in one["settings"].items()]
    seconds = one["seconds"]
    words = ROLES[one["role"]].words
    return Point(
        group=words,
        name=words,
        x=1e3 * seconds["median"],
        y=one["edge_px"],
        low=1e3 * seconds["low"],
        high=1e3 * seconds["high"],
        facts=(
            f"{significant(one['edge_px'])} {EDGE}",
            f"{_time(one)}, {significant(one['ratio']['median'])} times a ray per pixel",
            megabytes(one["bytes"]),
            *settings,
        ),
    )


def _rivals(report: Mapping) -> Markup:
    scale, unit = (1e3, "ms") if report["goal"]["kind"] == "error" else (1.0, "px")
    columns = [
        Column("", "settings", lambda row: row["name"], str, "name"),
        Column("objective", unit, lambda row: row["objective"], _scaled(scale), "objective"),
        Column("tuned gains", "%", lambda row: row["gain"], _scaled(100), "gain"),
        Column("edge off", "px", lambda row: row["edge_px"], significant, "edge_px"),
        *(
            Column("milliseconds", end, _second(end), significant, end)
            for end in ("median", "low", "high")
        ),
        Column("", "x rays", lambda row: row["ratio"]["median"], significant, "ratio"),
        Column("", "MB", lambda row: row["bytes"] / MB, significant, "bytes"),
    ]
    rows = [{**one, "name": RIVAL_WORDS[name]} for name, one in _measured(report).items()]
    return table(columns, rows, "The rivals, as measured on the views that choose")


def _second(end: str):
    return lambda row: 1e3 * row["seconds"][end]


def _scaled(scale: float):
    def words(value: float) -> str:
        return ("-" if value < 0 else "") + significant(scale * abs(value))

    return words


def _settings(report: Mapping) -> Markup | None:
    """The settings in which rivals differ; None where they do not."""
    rivals = _measured(report)
    names = [
        name
        for name, value in rivals["default"]["settings"].items()
        if any(one["settings"].get(name) != value for one in rivals.values())
    ]
    if not names:
        return None

    def column(rival: str) -> Column:
        def value(row: Mapping) -> str:
            return _setting(row["name"], rivals[rival]["settings"].get(row["name"]))

        return Column("", RIVAL_WORDS[rival], value, str, rival)

    columns = [Column("", "setting", lambda row: row["name"], str, "setting")]
    rows = [{"name": name} for name in names]
    return table([*columns, *(column(rival) for rival in rivals)], rows, "Settings that differ")


def _setting(name: str, value: object) -> str:
    """As `setting_words`; what no tuned setting can be is shown as it is."""
    plain = value is None or isinstance(value, int | float)
    return setting_words(name, value) if plain else str(value)
