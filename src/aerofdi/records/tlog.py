"""Reader of MAVLink telemetry logs (.tlog): an 8 byte big-endian stamp (us) before every MAVLink frame."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Event
from .log import Log, Table, Topics, guarded, ordered, read_bytes, unreadable, wants

CLOCK = "autopilot boot time"
ALWAYS = frozenset(("HEARTBEAT", "STATUSTEXT", "PARAM_VALUE", "SYSTEM_TIME"))
WRAP_S = 2**32 * 1e-6


class Frame(NamedTuple):
    at: int
    end: int
    msgid: int
    source: tuple[int, int]


def frames(data: bytes) -> Iterator[Frame]:
    """Every frame of the log, by layout; garbage between frames is skipped. CRCs are checked later."""
    at, end = 0, len(data)
    while at + 16 <= end:
        start = at + 8
        magic = data[start]
        if magic == 0xFE:
            stop = start + 8 + data[start + 1]
            msgid, source = data[start + 5], (data[start + 3], data[start + 4])
        elif magic == 0xFD and start + 10 <= end:
            stop = start + 12 + data[start + 1] + (13 if data[start + 2] & 1 else 0)
            msgid = int.from_bytes(data[start + 7 : start + 10], "little")
            source = (data[start + 5], data[start + 6])
        else:
            at += 1
            continue
        # Followed by another frame, or the end (perhaps a cut-off stamp); else a chance byte in garbage.
        if stop > end or (stop + 8 < end and data[stop + 8] not in (0xFE, 0xFD)):
            at += 1
            continue
        yield Frame(start, stop, msgid, source)
        at = stop


def _boot_s(message: Any, last: float) -> float:
    """Boot time of a message, s; that of the last stamped message where it has none of its own."""
    ms = getattr(message, "time_boot_ms", None)
    if ms is not None:
        return float(ms) * 1e-3
    us = getattr(message, "time_usec", None)
    if us is None or message.get_type() in ("GPS_RAW_INT", "GPS2_RAW", "HOME_POSITION", "GPS_GLOBAL_ORIGIN"):
        return last
    t = float(us) * 1e-6
    if message.get_type() == "SERVO_OUTPUT_RAW" and np.isfinite(last):
        # A 32 bit count of microseconds: it starts again every 71.6 minutes.
        t += WRAP_S * round((last - t) / WRAP_S)
    return t if t < 1e9 else last


def _autopilot(found: list[Frame], heartbeat: int, attitude: int) -> tuple[int, int] | None:
    """The system that sends most attitude; else most heartbeats."""
    for msgid in (attitude, heartbeat):
        count = Counter(f.source for f in found if f.msgid == msgid)
        if count:
            return count.most_common(1)[0][0]
    return None


def _table(messages: list[tuple[float, Any]]) -> Table:
    names = [n for n in messages[0][1].get_fieldnames()]
    columns: dict[str, NDArray[Any]] = {}
    for name in names:
        values = [getattr(m, name, None) for _, m in messages]
        if all(isinstance(v, (int, float)) for v in values):
            columns[name] = np.array(values, dtype=float)
        elif all(isinstance(v, str) for v in values):
            columns[name] = np.array(values, dtype=str)
    return ordered(np.array([t for t, _ in messages], dtype=float), columns)


def read_tlog(path: Path, topics: Topics) -> Log:
    """A telemetry log: the messages of its autopilot, on boot time.

    Messages without a time of their own take that of the last stamped one. Where the autopilot restarted, the
    longest stretch without a restart is kept and a note says so.
    """
    data = read_bytes(path)
    found = list(frames(data))
    if not found or sum(f.end - f.at + 8 for f in found) < 0.5 * len(data):
        raise unreadable(path, "not a telemetry log: too few MAVLink frames with stamps before them")
    with guarded(path, "telemetry log"):
        messages, seen, start = _decode(data, found, topics)
    if not messages:
        raise unreadable(path, "holds no intact MAVLink message of an autopilot")
    messages, notes = _one_boot(messages)
    return _log(messages, seen, notes, start)


def _decode(
    data: bytes, found: list[Frame], topics: Topics
) -> tuple[list[tuple[float, Any]], dict[str, int], float]:
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    names = {number: cls.msgname for number, cls in mavlink.mavlink_map.items()}
    mav = mavlink.MAVLink(None)
    mav.robust_parsing = True
    source = _autopilot(found, mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_ATTITUDE)
    seen: dict[str, int] = {}
    messages: list[tuple[float, Any]] = []
    last = float("nan")
    start = float("nan")
    for frame in found:
        name = names.get(frame.msgid)
        if frame.source != source or name is None:
            continue
        seen[name] = seen.get(name, 0) + 1
        if not (wants(topics, name) or name in ALWAYS):
            continue
        try:
            message = mav.decode(bytearray(data[frame.at : frame.end]))
        except (mavlink.MAVError, struct.error, ValueError, TypeError):
            continue
        t = _boot_s(message, last)
        if not np.isfinite(start) and np.isfinite(t):
            start = struct.unpack(">Q", data[frame.at - 8 : frame.at])[0] * 1e-6 - t
        last = t
        messages.append((t, message))
    first = next((t for t, _ in messages if np.isfinite(t)), 0.0)
    messages = [(t if np.isfinite(t) else first, m) for t, m in messages]
    return messages, seen, start


def _one_boot(messages: list[tuple[float, Any]]) -> tuple[list[tuple[float, Any]], list[str]]:
    """The longest stretch without a restart (boot time falling by more than 5 s)."""
    t = np.array([stamp for stamp, _ in messages])
    cuts = np.flatnonzero(np.diff(t) < -5.0) + 1
    if not len(cuts):
        return messages, []
    edges = [0, *cuts.tolist(), len(t)]
    best = max(range(len(edges) - 1), key=lambda k: edges[k + 1] - edges[k])
    note = f"the autopilot restarted {len(cuts)} times; only the longest stretch is read"
    return messages[edges[best] : edges[best + 1]], [note]


def _log(messages: list[tuple[float, Any]], seen: dict[str, int], notes: list[str], start: float) -> Log:
    by_name: dict[str, list[tuple[float, Any]]] = {}
    for t, message in messages:
        by_name.setdefault(message.get_type(), []).append((t, message))
    parameters: dict[str, float] = {}
    for _, m in by_name.pop("PARAM_VALUE", []):
        parameters[str(m.param_id)] = float(m.param_value)
    texts = by_name.pop("STATUSTEXT", [])
    events = [Event(t, "message", str(m.text).split("\0")[0]) for t, m in texts]
    tables = {name: _table(rows) for name, rows in by_name.items()}
    info: dict[str, Any] = {"start_unix_s": start} if np.isfinite(start) else {}
    firmware = [e.text for e in events if e.text.startswith(("ArduPlane", "ArduCopter"))]
    if firmware:
        info["firmware"] = firmware[0]
    return Log("tlog", tables, CLOCK, parameters, events, info, seen, notes)
