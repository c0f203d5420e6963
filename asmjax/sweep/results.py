"""What a sweep found: as rows, as a table in CSV or parquet, as an xarray dataset, as netCDF.

    found = results("out/sweep-first")
    found.to_csv("first.csv")
    wrong = found.to_xarray(dims=("memory_mb", "view"))["error.misclassified_fraction"]

Every trial has one row. Tables within configurations and records become columns with dots in their
names, as "settings.node_resolution"; a result that has the name of a setting becomes "result.NAME".
"""

import contextlib
import csv
import importlib
import io
import json
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from asmjax.errors import UseError, file_errors, missing_extra, require, unknown_name
from asmjax.paths import write_atomic
from asmjax.sweep.store import Row, stored_rows

FIRST = ("key", "status", "attempts", "cause", "started_utc", "attempt_seconds")
"""Columns of every trial, whatever it measures."""

FEW = 6
"""Names that a message lists."""


def results(folder: str | Path) -> "Results":
    """The rows of the sweep in `folder`, as they are now; also while it is running.

    Raises:
        UseError: there is no sweep, or it cannot be read.
    """
    return Results(Path(folder), tuple(stored_rows(folder)))


@dataclass(frozen=True)
class Results:
    """Rows of a sweep.

    Attributes:
        folder: of the sweep.
        stored: one row a trial, in the order in which they started.
    """

    folder: Path
    stored: tuple[Row, ...]

    def __len__(self) -> int:
        return len(self.stored)

    @property
    def settings(self) -> tuple[str, ...]:
        """Columns that say what a trial was asked for."""
        return tuple(dict.fromkeys(name for row in self.stored for name, _ in flat(row.config)))

    @property
    def varied(self) -> tuple[str, ...]:
        """Those of `settings` that are not the same in all rows."""
        rows = self.rows()
        return tuple(
            name for name in self.settings if len({_hashable(row.get(name)) for row in rows}) > 1
        )

    def rows(self) -> list[dict[str, Any]]:
        """One flat dictionary a trial: `FIRST`, settings, results, "versions." and "machine."."""
        settings = {*FIRST, *self.settings}
        return [_named(row, settings) for row in self.stored]

    def arrays(self, key: str) -> dict[str, np.ndarray]:
        """The arrays that a trial kept, by name.

        Raises:
            UseError: no such trial, or its file cannot be read.
        """
        row = next((row for row in self.stored if row.key == key), None)
        if row is None:
            raise unknown_name("trial", key, [row.key for row in self.stored][:10])
        if row.arrays is None:
            return {}
        try:
            # NumPy leaves a file open that is no archive.
            with open(row.arrays, "rb") as file, np.load(file, allow_pickle=False) as archive:
                return dict(archive)
        except (OSError, ValueError, zipfile.BadZipFile, zlib.error) as problem:
            raise UseError(f"cannot read '{row.arrays}' ({problem}); restore it.") from problem

    def to_csv(self, path: str | Path) -> None:
        """Write all columns of `rows` as CSV.

        Raises:
            UseError: `path` cannot be written.
        """
        columns = self._columns()
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
        with _written(Path(path)):
            write_atomic(path, text.getvalue())

    def to_parquet(self, path: str | Path) -> None:
        """Write all columns of `rows` as a parquet file.

        Raises:
            UseError: the extra `analysis` is not installed, or `path` cannot be written.
        """
        arrow, parquet = _needed("pyarrow"), _needed("pyarrow.parquet")
        columns = {name: _column(values) for name, values in self._columns().items()}
        table = arrow.table(
            {name: arrow.array(values.tolist()) for name, values in columns.items()}
        )
        with _draft(Path(path)) as draft:
            parquet.write_table(table, draft)

    def to_xarray(self, dims: Sequence[str] = (), arrays: Sequence[str] = ()) -> Any:
        """The rows as an `xarray.Dataset`. What a row does not have is NaN, or empty text.

        Args:
            dims: settings that become dimensions, as ("memory_mb", "view"); together they must tell
                all rows apart. Without them rows lie along one dimension, "trial".
            arrays: names of kept arrays to be added, of one shape in all rows that have them.

        Raises:
            UseError: the extra `analysis` is not installed; `dims` that are no settings, or that do
                not tell rows apart; arrays that no row has, or of several shapes.
        """
        xr = _needed("xarray")
        columns = {name: _column(values) for name, values in self._columns().items()}
        axes, places = self._axes(dims, columns)
        shape = tuple(len(values) for values in axes.values())
        data = {}
        for name, values in columns.items():
            if name not in axes:
                data[name] = tuple(axes), _spread(values, places, shape)
        for name in arrays:
            values = self._stacked(name)
            inner = tuple(f"{name}_{k}" for k in range(values.ndim - 1))
            data[name] = (*axes, *inner), _spread(values, places, shape)
        found = xr.Dataset(data, coords=dict(axes), attrs={"sweep": str(self.folder)})
        return found.set_coords([name for name in self.settings if name in data])

    def to_netcdf(self, path: str | Path, dims: Sequence[str] = ()) -> None:
        """Write the dataset of `to_xarray` as a netCDF 4 file.

        Raises:
            UseError: as `to_xarray`, or `path` cannot be written.
        """
        for module in ("h5netcdf", "h5py"):
            _needed(module)
        dataset = self.to_xarray(dims)
        with _draft(Path(path)) as draft:
            dataset.to_netcdf(draft, engine="h5netcdf")

    def _columns(self) -> dict[str, list]:
        """Every column of `rows`, None where a row has no such value."""
        rows = self.rows()
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name) for row in rows] for name in names}

    def _axes(
        self, dims: Sequence[str], columns: Mapping[str, np.ndarray]
    ) -> tuple[dict[str, np.ndarray], tuple[np.ndarray, ...]]:
        """The values along each dimension, and where each row lies along them."""
        if not dims:
            rows = np.arange(len(self))
            return {"trial": rows}, (rows,)
        for name in dims:
            if name not in self.settings:
                raise unknown_name("dimension", name, self.settings)
        axes, places = {}, []
        for name in dims:
            axes[name], place = np.unique(columns[name], return_inverse=True)
            places.append(place)
        taken = set(zip(*(place.tolist() for place in places), strict=True))
        others = [name for name in self.varied if name not in dims]
        require(
            len(taken) == len(self),
            f"{len(self)} trials share {len(taken)} values of {', '.join(dims)}: they differ in "
            f"{_listed(others)} too; name more dimensions, or none.",
        )
        return axes, tuple(places)

    def _stacked(self, name: str) -> np.ndarray:
        """An array of all rows, NaN or 0 where a row has none."""
        found = {row.key: self.arrays(row.key).get(name) for row in self.stored if row.arrays}
        shapes = {array.shape for array in found.values() if array is not None}
        require(
            len(shapes) == 1,
            f"array '{name}' has {len(shapes)} shapes in this sweep; allowed: one. Read those of "
            "single trials with arrays(key).",
        )
        kinds = [array.dtype for array in found.values() if array is not None]
        whole = _blank((len(self), *shapes.pop()), np.result_type(*kinds))
        for k, row in enumerate(self.stored):
            array = found.get(row.key)
            if array is not None:
                whole[k] = array
        return whole


def _named(row: Row, settings: set[str]) -> dict[str, Any]:
    """A row as flat columns."""
    started = datetime.fromtimestamp(row.started, UTC).isoformat(timespec="milliseconds")
    first = (row.key, row.status, row.attempts, row.error, started, row.seconds)
    named = dict(zip(FIRST, first, strict=True)) | dict(flat(row.config))
    for name, value in flat(row.record):
        named[f"result.{name}" if name in settings else name] = value
    for prefix, table in (("versions", row.versions), ("machine", row.machine)):
        for name, value in flat(table):
            # What a trial says itself of where it ran counts.
            named.setdefault(f"{prefix}.{name}", value)
    return named


def flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Names with dots, and values: numbers, text, truth, None; lists as JSON."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", json.dumps(value) if isinstance(value, list) else value


def _listed(names: Sequence[str]) -> str:
    """The first few, and how many more there are."""
    shown = ", ".join(names[:FEW]) or "nothing else"
    return f"{shown} and {len(names) - FEW} more" if len(names) > FEW else shown


def _hashable(value: Any) -> tuple[type, Any]:
    """Different for values that are written differently: 1, 1.0 and true."""
    return type(value), value


def _column(values: Sequence[Any]) -> np.ndarray:
    """Values as one array: whole numbers, numbers (NaN where there is none), truth, or text."""
    there = [value for value in values if value is not None]
    kinds = {type(value) for value in there}
    whole = len(there) == len(values)
    if kinds == {bool} and whole:
        return np.array(values, bool)
    if kinds == {int} and whole and all(abs(value) < 2**63 for value in there):
        return np.array(values, np.int64)
    if kinds and kinds <= {int, float}:
        return np.array([np.nan if value is None else float(value) for value in values])
    return np.array(["" if value is None else str(value) for value in values], object)


def _blank(shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """An array of nothing: empty text, NaN, 0."""
    nothing = "" if dtype.kind == "O" else np.nan if dtype.kind in "fc" else 0
    return np.full(shape, nothing, dtype)


def _spread(
    values: np.ndarray, places: tuple[np.ndarray, ...], shape: tuple[int, ...]
) -> np.ndarray:  # fmt: skip
    """Rows at their places in an array of `shape`; whole numbers become floats where some lack."""
    holes = len(values) < np.prod(shape)
    kind = np.dtype(float) if holes and values.dtype.kind in "biu" else values.dtype
    spread = _blank((*shape, *values.shape[1:]), kind)
    spread[places] = values
    return spread


def _needed(module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ImportError as problem:
        raise missing_extra(module.partition(".")[0], "analysis") from problem


@contextlib.contextmanager
def _draft(path: Path) -> Iterator[str]:
    """A file to write to, which becomes `path` once it is whole."""
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    with _written(path):
        try:
            yield str(scratch)
            os.replace(scratch, path)
        finally:
            scratch.unlink(missing_ok=True)


def _written(path: Path) -> contextlib.AbstractContextManager[None]:
    return file_errors(f"cannot write '{path}'", "choose another file")
