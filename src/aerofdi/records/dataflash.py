"""Reader of ArduPilot dataflash logs, binary (.BIN) and text (.log).

The format states itself: FMT messages give each message type its length, field types and names. One pass
collects the offsets of each type, then every wanted type is decoded at once as a NumPy structure. pymavlink's
DFReader is the reference the tests compare with.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Event
from .log import Log, Table, Topics, ordered, read_bytes, unreadable, wants

HEAD = b"\xa3\x95"
FMT_TYPE = 128
FMT_LENGTH = 89
CLOCK = "autopilot boot time"

# Field character -> (NumPy type, factor that gives the stated unit).
FIELDS: dict[str, tuple[str, float]] = {
    "a": ("<i2", 1.0),
    "b": ("i1", 1.0),
    "B": ("u1", 1.0),
    "h": ("<i2", 1.0),
    "H": ("<u2", 1.0),
    "i": ("<i4", 1.0),
    "I": ("<u4", 1.0),
    "f": ("<f4", 1.0),
    "d": ("<f8", 1.0),
    "g": ("<f2", 1.0),
    "n": ("S4", 1.0),
    "N": ("S16", 1.0),
    "Z": ("S64", 1.0),
    "c": ("<i2", 0.01),
    "C": ("<u2", 0.01),
    "e": ("<i4", 0.01),
    "E": ("<u4", 0.01),
    "L": ("<i4", 1e-7),
    "M": ("u1", 1.0),
    "q": ("<i8", 1.0),
    "Q": ("<u8", 1.0),
}
ALWAYS = frozenset(("PARM", "MSG", "MODE", "EV", "ERR", "ARM"))


class Format(NamedTuple):
    name: str
    length: int
    dtype: np.dtype[Any]
    factors: dict[str, float]


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", errors="replace")


def _format(body: bytes) -> tuple[int, Format] | None:
    """One FMT message -> (type, Format); None where it contradicts itself."""
    number, length, name, kinds, labels = struct.unpack("<BB4s16s64s", body)
    fields, names = _text(kinds), [n for n in _text(labels).split(",") if n]
    if len(fields) != len(names) or len(set(names)) != len(names) or any(f not in FIELDS for f in fields):
        return None
    parts = []
    for kind, label in zip(fields, names):
        code = FIELDS[kind][0]
        parts.append((label, code, (32,)) if kind == "a" else (label, code))
    dtype = np.dtype(parts) if parts else np.dtype([])
    if length < 3 or dtype.itemsize != length - 3:
        return None
    factors = {label: FIELDS[kind][1] for kind, label in zip(fields, names) if FIELDS[kind][1] != 1.0}
    return number, Format(_text(name), length, dtype, factors)


def _scan(data: bytes) -> tuple[dict[int, Format], dict[int, list[int]], int]:
    """Formats, offsets of every message by type, and the number of bytes that belong to none."""
    formats: dict[int, Format] = {}
    lengths = [0] * 256
    lengths[FMT_TYPE] = FMT_LENGTH
    offsets: list[list[int]] = [[] for _ in range(256)]
    at, end, lost = 0, len(data), 0
    while at + 3 <= end:
        if data[at] == 0xA3 and data[at + 1] == 0x95:
            kind = data[at + 2]
            length = lengths[kind]
            if length and at + length <= end:
                if kind == FMT_TYPE:
                    found = _format(data[at + 3 : at + FMT_LENGTH])
                    if found is not None and found[0] != FMT_TYPE:
                        formats[found[0]] = found[1]
                        lengths[found[0]] = found[1].length
                offsets[kind].append(at)
                at += length
                continue
        after = data.find(HEAD, at + 1)
        after = end if after < 0 else after
        lost += after - at
        at = after
    return formats, {kind: found for kind, found in enumerate(offsets) if found}, lost + max(end - at, 0)


def _decode(data: NDArray[np.uint8], offsets: list[int], fmt: Format) -> dict[str, NDArray[Any]]:
    """Every message of one type as columns."""
    width = fmt.length - 3
    where = np.asarray(offsets, dtype=np.int64) + 3
    block = np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(data, width)[where])
    body = block.view(fmt.dtype).reshape(-1)
    columns: dict[str, NDArray[Any]] = {}
    for label in fmt.dtype.names or ():
        column = body[label]
        if column.ndim > 1:
            continue
        if column.dtype.kind == "S":
            column = np.array([_text(bytes(x)) for x in column], dtype=str)
        elif label in fmt.factors:
            column = column * fmt.factors[label]
        columns[label] = np.ascontiguousarray(column)
    return columns


def _stamped(columns: dict[str, NDArray[Any]]) -> Table | None:
    """Columns on the boot clock, by TimeUS, or TimeMS of logs before 2015."""
    for name, factor in (("TimeUS", 1e-6), ("TimeMS", 1e-3)):
        if name in columns and columns[name].dtype.kind in "iuf":
            return ordered(columns[name].astype(float) * factor, columns)
    return None


def _finish(
    path: Path, raw: dict[str, dict[str, NDArray[Any]]], seen: dict[str, int], notes: list[str]
) -> Log:
    parameters: dict[str, float] = {}
    names, values = raw.get("PARM", {}).get("Name"), raw.get("PARM", {}).get("Value")
    if names is not None and values is not None and values.dtype.kind in "fiu":
        parameters = {str(k): float(v) for k, v in zip(names, values, strict=True)}
    tables = {name: table for name, columns in raw.items() if (table := _stamped(columns)) is not None}
    if not any(len(table.t_s) for name, table in tables.items()):
        raise unreadable(path, "holds no stamped messages; it is empty or cut off before the first one")
    events = _events(tables)
    info: dict[str, Any] = {}
    firmware = [
        e.text for e in events if e.kind == "message" and e.text.startswith(("ArduPlane", "ArduCopter"))
    ]
    if firmware:
        info["firmware"] = firmware[0]
    return Log("dataflash", tables, CLOCK, parameters, events, info, seen, notes)


def _events(tables: dict[str, Table]) -> list[Event]:
    events = []
    if "MSG" in tables and "Message" in tables["MSG"].columns:
        table = tables["MSG"]
        events += [Event(float(t), "message", str(x)) for t, x in zip(table.t_s, table.columns["Message"])]
    for name, kind in (("EV", "event"), ("ERR", "error")):
        if name in tables:
            table = tables[name]
            keys = [k for k in table.columns if k not in ("TimeUS", "TimeMS")]
            for k, t in enumerate(table.t_s):
                events.append(
                    Event(float(t), kind, " ".join(f"{key} {table.columns[key][k]}" for key in keys))
                )
    return events


def read_dataflash(path: Path, topics: Topics) -> Log:
    """An ArduPilot onboard log; only the wanted messages (and parameters, modes, texts) are decoded."""
    data = read_bytes(path)
    if data[:2] != HEAD:
        return _read_text(path, data, topics)
    formats, offsets, lost = _scan(data)
    seen = {formats[kind].name: len(found) for kind, found in offsets.items() if kind in formats}
    if not seen:
        raise unreadable(path, "not a dataflash log: no message formats, or cut off within them")
    array = np.frombuffer(data, dtype=np.uint8)
    raw: dict[str, dict[str, NDArray[Any]]] = {}
    for kind, found in offsets.items():
        fmt = formats.get(kind)
        if fmt is not None and fmt.length > 3 and (wants(topics, fmt.name) or fmt.name in ALWAYS):
            raw[fmt.name] = _decode(array, found, fmt)
    notes = [f"{lost} bytes that belong to no message were skipped"] if lost else []
    return _finish(path, raw, seen, notes)


def _column(cells: list[str], kind: str) -> NDArray[Any]:
    if kind in "nNZ":
        return np.array(cells, dtype=str)
    try:
        return np.array(cells, dtype=float)
    except ValueError:
        out = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            try:
                out[k] = float(cell)
            except ValueError:
                continue
        return out


def _read_text(path: Path, data: bytes, topics: Topics) -> Log:
    """The text form: `FMT, type, length, NAME, format, columns`, then lines of `NAME, value, value`."""
    layout: dict[str, tuple[str, list[str]]] = {}
    rows: dict[str, list[list[str]]] = {}
    seen: dict[str, int] = {}
    bad = 0
    for line in data.decode("ascii", errors="replace").split("\n"):
        if not line.strip():
            continue
        cells = [cell.strip() for cell in line.rstrip("\r").split(",")]
        if cells[0] == "FMT" and len(cells) >= 6:
            kinds, names = cells[4], cells[5:]
            if len(kinds) == len(names) and len(set(names)) == len(names):
                layout[cells[3]] = (kinds, names)
            continue
        if cells[0] not in layout:
            bad += 1
            continue
        name, (_, names) = cells[0], layout[cells[0]]
        seen[name] = seen.get(name, 0) + 1
        if wants(topics, name) or name in ALWAYS:
            values = cells[1 : len(names)] + [", ".join(cells[len(names) :])]
            if len(values) == len(names):
                rows.setdefault(name, []).append(values)
    if not layout or bad > sum(seen.values()):
        raise unreadable(
            path, "not a dataflash log: neither binary messages nor lines of `NAME, value, ...` after FMT"
        )
    raw = {}
    for name, found in rows.items():
        kinds, names = layout[name]
        raw[name] = {label: _column([r[j] for r in found], kinds[j]) for j, label in enumerate(names)}
    notes = [f"{bad} lines that are not messages were left out"] if bad else []
    return _finish(path, raw, seen, notes)
