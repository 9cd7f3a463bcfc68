"""Readers of plain tables: CSV (also gzipped), foreign Parquet, MATLAB files."""

from __future__ import annotations

import gzip
import io
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .log import Log, Table, Topics, guarded, read_bytes, unreadable
from .mat5 import check_mat5

MAX_UNPACKED = 4 << 30
ROW_CLOCK = "row numbers; name the time field in [time] of the profile"


def unpacked(path: Path, data: bytes) -> bytes:
    """The bytes of a gzip file, whole; refuses one that unpacks to more than 4 GB."""
    try:
        with gzip.open(path) as file:
            out = file.read(MAX_UNPACKED + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise unreadable(path, f"damaged gzip file ({error})") from error
    if len(out) > MAX_UNPACKED:
        raise unreadable(path, "unpacks to more than 4 GB")
    if not out:
        raise unreadable(path, "the file is empty")
    return out


def _delimiter(header: bytes) -> str:
    counts = {d: header.count(d.encode()) for d in (",", ";", "\t")}
    return max(counts, key=lambda d: counts[d])


def parse_csv(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    """Columns of a CSV text with a header line; numbers as float64 (empty cells NaN), the rest as text."""
    import pyarrow as pa
    from pyarrow import csv

    head = data[: 1 << 16].split(b"\n", 1)[0]
    if b"\0" in data[: 1 << 16]:
        raise unreadable(path, "holds binary data, not text; is the suffix right?")
    with guarded(path, "CSV table"):
        table = csv.read_csv(
            pa.BufferReader(data),
            read_options=csv.ReadOptions(use_threads=False, block_size=min(len(data) + 1, 1 << 28)),
            parse_options=csv.ParseOptions(delimiter=_delimiter(head)),
            convert_options=csv.ConvertOptions(null_values=["", "nan", "NaN", "NA", "null"]),
        )
        return arrow_columns(table)


def arrow_columns(table: Any) -> dict[str, NDArray[Any]]:
    """The columns of an Arrow table as arrays: numbers, booleans and dates as float64, text as text."""
    import pyarrow as pa

    out: dict[str, NDArray[Any]] = {}
    for name, column in zip(table.column_names, table.columns):
        kind = column.type
        if pa.types.is_timestamp(kind):
            column, kind = column.cast(pa.timestamp("ns")).cast(pa.int64()), pa.int64()
        if pa.types.is_integer(kind) and not column.null_count:
            out[name] = column.to_numpy()
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            out[name] = column.cast(pa.float64()).to_numpy()
        elif pa.types.is_null(kind):
            out[name] = np.full(len(column), np.nan)
        elif pa.types.is_string(kind) or pa.types.is_large_string(kind):
            out[name] = np.array(["" if x is None else x for x in column.to_pylist()], dtype=str)
    return out


def _rows(columns: dict[str, NDArray[Any]]) -> Table:
    n = len(next(iter(columns.values()))) if columns else 0
    return Table(np.arange(n, dtype=float), columns)


def read_csv(path: Path, topics: Topics) -> Log:
    """A CSV table, gzipped or not, as the topic `table`."""
    data = read_bytes(path)
    if data[:2] == b"\x1f\x8b":
        data = unpacked(path, data)
    columns = parse_csv(path, data)
    table = _rows(columns)
    if not len(table.t_s):
        raise unreadable(path, "has a header line but no rows")
    return Log("csv", {"table": table}, ROW_CLOCK, seen={f"table.{name}": len(table.t_s) for name in columns})


def read_parquet_table(path: Path, topics: Topics) -> Log:
    """A Parquet table that is not a Flight file, as the topic `table`."""
    from pyarrow import parquet

    with guarded(path, "Parquet file"):
        columns = arrow_columns(parquet.read_table(path, use_threads=False))
    table = _rows(columns)
    if not len(table.t_s):
        raise unreadable(path, "has no rows of numbers or text")
    return Log("parquet", {"table": table}, ROW_CLOCK, seen={f"table.{k}": len(table.t_s) for k in columns})


def _arrays(name: str, value: Any, found: dict[str, NDArray[Any]], depth: int = 0) -> None:
    """Numeric vectors of a MATLAB value, structures opened, as 'struct.field'."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None and depth < 8:
        for key in fields:
            _arrays(f"{name}.{key}" if name else key, getattr(value, key), found, depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim == 1:
        found[name] = value


def read_mat(path: Path, topics: Topics) -> Log:
    """A MATLAB file (version 4 to 7.2): each structure is a topic; loose vectors are the topic `mat`.

    Vectors of the most common length share a topic; others of n samples are in '<topic>:n'.
    """
    from scipy.io import loadmat

    data = read_bytes(path)
    if data.startswith(b"MATLAB 7.3"):
        raise unreadable(path, "is a MATLAB 7.3 (HDF5) file; save it in MATLAB with save(..., '-v7')")
    with guarded(path, "MATLAB file"):
        if data.startswith(b"MATLAB 5") or data[126:128] in (b"IM", b"MI"):
            check_mat5(data)
        raw = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
        raw = {key: value for key, value in raw.items() if not key.startswith("__")}
        found: dict[str, NDArray[Any]] = {}
        for key, value in raw.items():
            _arrays(key, value, found)
    grouped: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in found.items():
        topic, _, column = name.rpartition(".")
        grouped.setdefault(topic or "mat", {})[column] = array
    tables: dict[str, Table] = {}
    for topic, columns in grouped.items():
        common = Counter(len(a) for a in columns.values()).most_common(1)[0][0]
        for n in {len(a) for a in columns.values()}:
            part = {k: a for k, a in columns.items() if len(a) == n}
            tables[topic if n == common else f"{topic}:{n}"] = _rows(part)
    if not tables:
        raise unreadable(path, "holds no vectors of numbers")
    seen = {f"{topic}.{k}": len(t.t_s) for topic, t in tables.items() for k in t.columns}
    return Log("mat", tables, ROW_CLOCK, seen=seen)
