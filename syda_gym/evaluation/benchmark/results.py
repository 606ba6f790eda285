"""Results: the rows of a benchmark with all that is needed to trust them, on disk and in memory."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.errors import MissingExtraError, StorageError
from syda_gym.evaluation.benchmark.cells import FORMAT
from syda_gym.evaluation.benchmark.work import COLUMNS
from syda_gym.evaluation.statistics import Estimate, clustered_estimate, estimate
from syda_gym.files import atomic_path, read_json, write_json, write_text

__all__ = ["Results", "read_results", "write_results"]

_TEXT = ("kind", "route", "method", "agent", "disturbance", "motion", "action")
_WHOLE = ("seed", "actions", "draw", "fold", "frames")
_MAX_BYTES = 2**31

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Results:
    """The rows of a benchmark.

    Attributes:
        rows: one an episode, with the keys of ``work.COLUMNS``; missing numbers are ``None``.
        about: configuration, versions, data fingerprint, failures.
        timings: one a cell: seconds of fits and episodes, latency.
        folder: where they were read from.
    """

    rows: tuple[Row, ...]
    about: dict[str, Any]
    timings: tuple[Row, ...] = ()
    folder: Path | None = None
    _cache: dict[Any, Any] = field(default_factory=dict, repr=False)

    def select(self, **wanted: Any) -> Results:
        """Only rows whose columns have the given values."""
        rows = tuple(row for row in self.rows if all(row[name] == value for name, value in wanted.items()))
        return Results(rows, self.about, self.timings, self.folder)

    def groups(self, *names: str) -> dict[tuple[Any, ...], Results]:
        """Rows by the values of some columns, in order of first appearance."""
        parts: dict[tuple[Any, ...], list[Row]] = {}
        for row in self.rows:
            parts.setdefault(tuple(row[name] for name in names), []).append(row)
        return {key: Results(tuple(rows), self.about, self.timings, self.folder) for key, rows in parts.items()}

    def values(self, name: str) -> NDArray[np.float64]:
        """A column as floats ``(N,)``, missing ones as not a number."""
        return np.array([math.nan if row[name] is None else float(row[name]) for row in self.rows], dtype=np.float64)

    def actions(self) -> NDArray[np.str_]:
        """The action of each row ``(N,)``."""
        return np.array([row["action"] for row in self.rows], dtype=np.str_)

    def estimate(self, name: str, *, over: str = "episodes", **options: Any) -> Estimate:
        """Interquartile mean of a column with its interval.

        Args:
            name: of the column.
            over: ``"episodes"`` for the bootstrap stratified by action (the same actions, recorded again),
                ``"actions"`` for one over whole actions (what other actions would give; wider).
            **options: of the bootstrap.
        """
        bootstrap: Callable[..., Estimate] = estimate if over == "episodes" else clustered_estimate
        return bootstrap(self.values(name), self.actions(), **options)


def write_results(folder: Path, results: Results, parquet: bool = False) -> Path:
    """Writes ``results.csv`` (or ``.parquet``), ``benchmark.json`` and ``timings.csv``, each atomically.

    Only ``timings.csv`` differs between two runs of the same benchmark.

    Raises:
        StorageError: the folder cannot be written.
        MissingExtraError: Parquet without pyarrow.
    """
    if parquet:
        _write_parquet(folder / "results.parquet", results.rows)
    else:
        write_text(folder / "results.csv", _csv(COLUMNS, results.rows))
    write_json(folder / "benchmark.json", {**results.about, "format": FORMAT, "table": _table_name(parquet)})
    names = list(dict.fromkeys(name for row in results.timings for name in row))
    write_text(folder / "timings.csv", _csv(names, results.timings))
    return folder / _table_name(parquet)


def read_results(folder: str | os.PathLike[str]) -> Results:
    """Reads what ``write_results`` wrote.

    Raises:
        StorageError: no benchmark there, of another version, or damaged.
    """
    root = Path(folder)
    if not (root / "benchmark.json").is_file():
        raise StorageError(f"no benchmark in {root} (benchmark.json is missing); run `syda-gym benchmark` first")
    about = read_json(root / "benchmark.json")
    found = about.get("format") if isinstance(about, dict) else None
    if found != FORMAT:
        raise StorageError(
            f"{root / 'benchmark.json'} has format {found!r}, this version reads {FORMAT}; read it with the version "
            "that wrote it, or run the benchmark again into another folder"
        )
    table = root / str(about.get("table"))
    if not table.is_file():
        raise StorageError(f"{table} is missing; run the benchmark again, finished cells are not computed twice")
    if table.stat().st_size > _MAX_BYTES:
        raise StorageError(f"{table} is larger than {_MAX_BYTES >> 20} MB")
    rows = _read_parquet(table) if table.suffix == ".parquet" else _read_csv(table)
    timings = root / "timings.csv"
    return Results(tuple(rows), about, tuple(_read_timings(timings)) if timings.is_file() else (), root)


def _table_name(parquet: bool) -> str:
    return "results.parquet" if parquet else "results.csv"


def _csv(columns: Sequence[str], rows: Iterable[Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_word(row.get(name)) for name in columns])
    return text.getvalue()


def _word(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return " ".join(repr(float(item)) for item in value)
    return repr(value) if isinstance(value, float) else str(value)


def _read_csv(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames is None or set(reader.fieldnames) != set(COLUMNS):
            raise StorageError(f"{path}: expected the columns {', '.join(COLUMNS)}; got {reader.fieldnames}")
        try:
            return [{name: _value(name, text) for name, text in row.items()} for row in reader]
        except (ValueError, TypeError, AttributeError) as error:
            raise StorageError(
                f"{path} is damaged near line {reader.line_num}: {error}; run the benchmark again"
            ) from error


def _value(name: str, text: str) -> Any:
    if name in _TEXT:
        return text
    if text == "":
        return None
    if name == "landmarks":
        return [float(part) for part in text.split()]
    return int(text) if name in _WHOLE or name == "success" else float(text)


def _read_timings(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        return [dict(row) for row in csv.DictReader(file)]


def _write_parquet(path: Path, rows: Sequence[Row]) -> None:
    pyarrow, parquet = _arrow()
    text, whole, numbers = pyarrow.string(), pyarrow.int64(), pyarrow.float64()
    kinds = {name: text for name in _TEXT} | {name: whole for name in (*_WHOLE, "success")}
    kinds["landmarks"] = pyarrow.list_(numbers)
    schema = pyarrow.schema([(name, kinds.get(name, numbers)) for name in COLUMNS])
    table = pyarrow.Table.from_pylist([{name: row.get(name) for name in COLUMNS} for row in rows], schema=schema)
    with atomic_path(path) as temporary:
        parquet.write_table(table, temporary)


def _read_parquet(path: Path) -> list[Row]:
    pyarrow, parquet = _arrow()
    try:
        table = parquet.read_table(path)
    except (pyarrow.ArrowException, OSError) as error:
        raise StorageError(f"{path} is not a readable Parquet file: {error}; run the benchmark again") from error
    if set(table.column_names) != set(COLUMNS):
        raise StorageError(f"{path}: expected the columns {', '.join(COLUMNS)}; got {table.column_names}")
    return [dict(row) for row in table.to_pylist()]


def _arrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("Parquet files", "data") from error
    return pyarrow, pyarrow.parquet


def dumps(value: Any) -> str:
    """JSON without surprises: sorted keys, no NaN."""
    return json.dumps(value, sort_keys=True, allow_nan=False)
