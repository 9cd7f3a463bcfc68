"""Flight files: one Parquet file a flight, each series on its own clock, exact both ways.

Every channel is a column `table/name` and every clock a column `clock/k` (channels on the same stamps share
one), filled up with nulls to the longest; units are in the field's metadata. Lengths, codes, repeats, events,
parameters and meta are one JSON text in the file's metadata, key `aerofdi`.
"""

from __future__ import annotations

import contextlib
import json
import os
import uuid
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ..core import Array, Event, Flight, Series, UnreadableFile, WrongUse
from .log import guarded, printable, unreadable

VERSION = 1
KEY = b"aerofdi"
KEY_CRC = b"aerofdi.crc32"
TABLES = ("measured", "output", "truth")


def _plain(value: Any, where: str) -> Any:
    """JSON values only: NumPy scalars become numbers, tuples lists; anything else is refused by name."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, float, np.integer, np.floating, np.bool_)):
        return value.item() if isinstance(value, np.generic) else value
    if isinstance(value, dict):
        return {str(k): _plain(v, f"{where}.{k}") for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v, f"{where}[{k}]") for k, v in enumerate(value)]
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise WrongUse(
        f"{where} is a {type(value).__name__}, which a Flight file cannot hold; use text, numbers or lists"
    )


def _column(values: Array, n: int) -> Any:
    """An Arrow column of n rows: the values, then nulls. NaN stays NaN."""
    import pyarrow as pa

    mask = np.arange(n) >= len(values)
    full = np.zeros(n)
    full[: len(values)] = values
    return pa.array(full, mask=mask, from_pandas=False)


def _clock_of(t_s: Array, clocks: list[Array]) -> int:
    for k, clock in enumerate(clocks):
        if clock is t_s or (len(clock) == len(t_s) and clock.tobytes() == t_s.tobytes()):
            return k
    clocks.append(t_s)
    return len(clocks) - 1


def _is_clock(t_s: Array) -> bool:
    return bool(np.isfinite(t_s).all() and (np.diff(t_s) >= 0).all())


def _arrow(flight: Flight) -> Any:
    import pyarrow as pa

    clocks: list[Array] = []
    entries: list[dict[str, Any]] = []
    values: list[Array] = []
    for table in TABLES:
        for name, series in getattr(flight, table).items():
            t = np.ascontiguousarray(series.t_s, dtype=float)
            v = np.ascontiguousarray(series.value, dtype=float)
            if t.ndim != 1 or t.shape != v.shape:
                raise WrongUse(
                    f"{table} channel {name!r} has stamps {t.shape} and values {v.shape}; both must be (n,)"
                )
            if not _is_clock(t):
                raise WrongUse(
                    f"{table} channel {name!r} has stamps that decrease or are not finite; sort them"
                )
            codes = None if series.codes is None else {str(k): str(x) for k, x in series.codes.items()}
            entries.append(
                {
                    "table": table,
                    "name": name,
                    "unit": series.unit,
                    "codes": codes,
                    "repeats": bool(series.repeats),
                    "clock": _clock_of(t, clocks),
                    "n": len(v),
                }
            )
            values.append(v)
    rows = max((len(c) for c in clocks), default=0)
    names = [f"{e['table']}/{e['name']}" for e in entries] + [f"clock/{k}" for k in range(len(clocks))]
    units = [e["unit"] for e in entries] + ["s"] * len(clocks)
    arrays = [_column(v, rows) for v in values] + [_column(c, rows) for c in clocks]
    fields = [
        pa.field(n, pa.float64(), metadata={b"unit": u.encode()}) for n, u in zip(names, units, strict=True)
    ]
    head = {
        "version": VERSION,
        "channels": entries,
        "events": [[float(e.t_s), e.kind, e.text] for e in flight.events],
        "parameters": _plain(flight.parameters, "parameters"),
        "meta": _plain(flight.meta, "meta"),
    }
    text = json.dumps(head).encode()
    schema = pa.schema(fields, metadata={KEY: text, KEY_CRC: str(zlib.crc32(text)).encode()})
    return pa.Table.from_arrays(arrays, schema=schema)


def write_flight(flight: Flight, path: str | Path) -> Path:
    """Write a Flight file; beside the target first, then renamed, so that a broken run leaves no half file.

    Exact: reading it back gives the same stamps, values, units, codes, tables, events, parameters and meta
    (meta as JSON values: tuples become lists). Raises WrongUse where meta holds what JSON cannot.
    """
    from pyarrow import parquet

    path = Path(path)
    table = _arrow(flight)
    beside = path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")
    try:
        with beside.open("xb") as file:
            parquet.write_table(
                table,
                file,
                compression="zstd",
                use_dictionary=False,
                use_byte_stream_split=True,
                write_page_checksum=True,
            )
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except OSError as error:
        raise WrongUse(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
    return path


def is_flight_file(path: Path) -> bool:
    """Whether a Parquet file carries a Flight; False where it is damaged too (the reader then says so)."""
    from pyarrow import parquet

    try:
        with guarded(path, "Parquet file"):
            return KEY in (parquet.read_schema(path).metadata or {})
    except UnreadableFile:
        return False


def read_flight(path: str | Path) -> Flight:
    """The Flight in a file written by `write_flight`; UnreadableFile where a checksum says it is damaged."""
    from pyarrow import parquet

    path = Path(path)
    with guarded(path, "Flight file"):
        table = parquet.read_table(path, use_threads=False, page_checksum_verification=True)
        metadata = table.schema.metadata or {}
        text = metadata[KEY]
        head = json.loads(text)
    if metadata.get(KEY_CRC) != str(zlib.crc32(text)).encode():
        raise unreadable(path, "the Flight file is damaged: its description does not match its checksum")
    version = head.get("version") if isinstance(head, dict) else None
    if version != VERSION:
        raise unreadable(
            path, f"is a Flight file of version {version!r}; this package reads version {VERSION}"
        )
    with guarded(path, "Flight file"):
        columns = {n: table.column(n).to_numpy() for n in table.column_names}
        clocks: dict[tuple[int, int], Array] = {}
        tables: dict[str, dict[str, Series]] = {name: {} for name in TABLES}
        for entry in head["channels"]:
            n, k = int(entry["n"]), int(entry["clock"])
            if (k, n) not in clocks:
                clocks[k, n] = np.array(columns[f"clock/{k}"][:n])
            value = np.array(columns[f"{entry['table']}/{entry['name']}"][:n])
            if len(value) != n or len(clocks[k, n]) != n or not _is_clock(clocks[k, n]):
                raise unreadable(path, f"the Flight file is damaged in channel {printable(entry['name'])!r}")
            codes = entry["codes"] and {int(c): str(x) for c, x in entry["codes"].items()}
            tables[entry["table"]][entry["name"]] = Series(
                clocks[k, n], value, str(entry["unit"]), codes, bool(entry["repeats"])
            )
        return Flight(
            **tables,
            events=[Event(float(t), str(kind), str(text)) for t, kind, text in head["events"]],
            parameters={str(k): v for k, v in head["parameters"].items()},
            meta=dict(head["meta"]),
        )
