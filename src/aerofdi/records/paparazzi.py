"""Reader of Paparazzi SD logs (.data): lines of `time aircraft MESSAGE values`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Event
from .log import Log, Table, Topics, ordered, read_bytes, unreadable, wants


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _table(times: list[float], rows: list[str]) -> Table:
    """Messages of one kind as columns 0, 1, ...; a message with too few values has NaN there."""
    try:
        body = np.array([row.replace(",", " ").split() for row in rows], dtype=float)
    except ValueError:
        split = [row.replace(",", " ").split() for row in rows]
        width = max(len(row) for row in split)
        body = np.full((len(split), width), np.nan)
        for k, row in enumerate(split):
            body[k, : len(row)] = [_number(x) for x in row]
    columns: dict[str, NDArray[Any]] = (
        {str(j): body[:, j] for j in range(body.shape[1])} if body.ndim == 2 else {}
    )
    return ordered(np.array(times), columns)


def read_paparazzi(path: Path, topics: Topics) -> Log:
    """A Paparazzi .data log: each message a topic, its values the fields '0', '1', ...

    Lines that are not messages are counted and left out; a file where more than half of the lines are such is
    not a Paparazzi log. A last line without a line end is cut off and left out.
    """
    text = read_bytes(path).decode("ascii", errors="replace")
    lines = text.split("\n")
    bad = 0
    if lines[-1]:
        bad += 1
    times: dict[str, list[float]] = {}
    rows: dict[str, list[str]] = {}
    seen: dict[str, int] = {}
    for line in lines[:-1]:
        parts = line.rstrip("\r").split(" ", 3)
        try:
            t, name = float(parts[0]), parts[2]
        except (ValueError, IndexError):
            bad += bool(line.strip())
            continue
        if not name.isidentifier() or len(name) > 64:
            bad += 1
            continue
        seen[name] = seen.get(name, 0) + 1
        if (wants(topics, name) or name == "SETTINGS") and len(parts) == 4:
            times.setdefault(name, []).append(t)
            rows.setdefault(name, []).append(parts[3])
    if bad >= max(1, sum(seen.values())):
        raise unreadable(path, "not a Paparazzi .data log (lines of `time aircraft MESSAGE values`)")
    tables = {name: _table(times[name], rows[name]) for name in times}
    notes = [f"{bad} lines that are not messages were left out"] if bad else []
    events = _settings(tables)
    return Log(
        "paparazzi", tables, "the log's own clock (autopilot time, s)", events=events, seen=seen, notes=notes
    )


def _settings(tables: dict[str, Table]) -> list[Event]:
    """Changes of the operator's settings as events."""
    table = tables.get("SETTINGS")
    if table is None:
        return []
    values = np.stack(list(table.columns.values()), axis=1)
    return [
        Event(float(t), "settings", " ".join(f"{x:g}" for x in row))
        for t, row in zip(table.t_s, values, strict=True)
    ]
