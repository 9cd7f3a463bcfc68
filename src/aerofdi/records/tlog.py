"""Reader of MAVLink telemetry logs (.tlog): an 8 byte big-endian stamp (us) before every MAVLink frame."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Event
from .log import Log, Table, Topics, ordered, read_bytes, unreadable, wants
from .mavlink import Frame, decode, frames

CLOCK = "autopilot boot time"
ALWAYS = frozenset(("HEARTBEAT", "STATUSTEXT", "PARAM_VALUE", "SYSTEM_TIME"))
# Their time_usec counts from 1970, or is the receiver's.
OTHER_CLOCK = frozenset(("GPS_RAW_INT", "GPS2_RAW", "HOME_POSITION", "GPS_GLOBAL_ORIGIN"))
WRAP_S = 2**32 * 1e-6
RESTART_S = 5.0

Raw = dict[str, tuple[NDArray[np.int64], dict[str, NDArray[Any]]]]
"""Message name -> (number of the frame in the log, fields)."""


def _autopilot(found: list[Frame], ids: tuple[int, ...]) -> tuple[int, int] | None:
    """The system that sends most attitude; else most heartbeats."""
    for msgid in ids:
        count = Counter(f.source for f in found if f.msgid == msgid)
        if count:
            return count.most_common(1)[0][0]
    return None


def _own_stamps(name: str, columns: dict[str, NDArray[Any]]) -> Array | None:
    """Boot time by the message's own stamp, s; NaN where it is no boot time, None where it has no stamp."""
    if "time_boot_ms" in columns:
        return columns["time_boot_ms"].astype(float) * 1e-3
    if "time_usec" not in columns or name in OTHER_CLOCK:
        return None
    t = columns["time_usec"].astype(float) * 1e-6
    return np.where(t < 1e9, t, np.nan)


def _known(stamped: list[tuple[NDArray[np.int64], Array]]) -> tuple[NDArray[np.int64], Array]:
    """All (frame number, boot time) pairs in the order of the log."""
    if not stamped:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    number = np.concatenate([n for n, _ in stamped])
    t = np.concatenate([t for _, t in stamped])
    keep = np.isfinite(t)
    order = np.argsort(number[keep], kind="stable")
    return number[keep][order], t[keep][order]


def _last(number: NDArray[np.int64], t: Array, at: NDArray[np.int64]) -> Array:
    """The boot time known when each frame came; the first known one before that."""
    if not len(number):
        return np.full(len(at), np.nan)
    return t[np.clip(np.searchsorted(number, at, side="right") - 1, 0, None)]


def _boot_times(raw: Raw) -> tuple[dict[str, Array], NDArray[np.int64], Array]:
    """Boot time of every message; and all pairs (frame number, boot time) that were stamped.

    SERVO_OUTPUT_RAW counts microseconds in 32 bits and starts again every 71.6 minutes; the other messages
    tell the turn. Messages without a stamp take the last one.
    """
    own = {name: t for name, (_, c) in raw.items() if (t := _own_stamps(name, c)) is not None}
    others = _known([(raw[name][0], t) for name, t in own.items() if name != "SERVO_OUTPUT_RAW"])
    if "SERVO_OUTPUT_RAW" in own:
        t = own["SERVO_OUTPUT_RAW"]
        if len(others[0]):
            t = t + WRAP_S * np.round((_last(*others, raw["SERVO_OUTPUT_RAW"][0]) - t) / WRAP_S)
        else:
            t = t + WRAP_S * np.concatenate(([0.0], np.cumsum(np.diff(t) < -0.5 * WRAP_S)))
        own["SERVO_OUTPUT_RAW"] = t
    number, t = _known([(raw[name][0], stamps) for name, stamps in own.items()])
    times = {name: own[name] if name in own else _last(number, t, at) for name, (at, _) in raw.items()}
    return times, number, t


def _one_boot(number: NDArray[np.int64], t: Array) -> tuple[int, int, list[str]]:
    """The frames (first, last) of the longest stretch without a restart (boot time falling by more than 5 s)."""
    cuts = np.flatnonzero(np.diff(t) < -RESTART_S) + 1
    if not len(cuts):
        return 0, 2**62, []
    edges = np.concatenate(([0], cuts, [len(t)]))
    best = int(np.argmax(np.diff(edges)))
    note = f"the autopilot restarted {len(cuts)} times; only the longest stretch is read"
    return int(number[edges[best]]), int(number[edges[best + 1] - 1]), [note]


def read_tlog(path: Path, topics: Topics) -> Log:
    """A telemetry log: the messages of its autopilot, on boot time.

    Frames with a wrong checksum are left out. Messages without a time of their own take that of the last
    stamped one. Where the autopilot restarted, the longest stretch without a restart is kept and a note says
    so.
    """
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    data = read_bytes(path)
    found = list(frames(data))
    if not found or sum(f.body - f.at + f.size + 10 for f in found) < 0.5 * len(data):
        raise unreadable(path, "not a telemetry log: too few MAVLink frames with stamps before them")
    source = _autopilot(found, (mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_HEARTBEAT))
    by_id: dict[int, list[int]] = {}
    for k, frame in enumerate(found):
        if frame.source == source:
            by_id.setdefault(frame.msgid, []).append(k)
    seen: dict[str, int] = {}
    raw: Raw = {}
    for msgid, numbers in by_id.items():
        message = mavlink.mavlink_map.get(msgid)
        if message is None:
            continue
        name = str(message.msgname)
        seen[name] = len(numbers)
        if wants(topics, name) or name in ALWAYS:
            good, columns = decode(data, [found[k] for k in numbers], message)
            if len(good):
                raw[name] = (np.asarray(numbers, dtype=np.int64)[good], columns)
    if not raw:
        raise unreadable(path, "holds no intact MAVLink message of an autopilot")
    return _log(data, found, raw, seen)


def _log(data: bytes, found: list[Frame], raw: Raw, seen: dict[str, int]) -> Log:
    times, number, t = _boot_times(raw)
    first, last, notes = _one_boot(number, t)
    tables: dict[str, Table] = {}
    for name, (at, columns) in raw.items():
        keep = (at >= first) & (at <= last)
        tables[name] = ordered(times[name][keep], {k: v[keep] for k, v in columns.items()})
    info: dict[str, Any] = {}
    if len(number):
        k = int(np.searchsorted(number, first))
        received = struct.unpack(">Q", data[found[int(number[k])].at - 8 : found[int(number[k])].at])[0]
        info["start_unix_s"] = received * 1e-6 - float(t[k])
    parameters: dict[str, float] = {}
    if (table := tables.pop("PARAM_VALUE", None)) is not None:
        names, values = table.columns["param_id"], table.columns["param_value"]
        parameters = {str(n): float(v) for n, v in zip(names, values, strict=True)}
    events: list[Event] = []
    if (table := tables.pop("STATUSTEXT", None)) is not None:
        texts = table.columns["text"]
        events = [Event(float(s), "message", str(x)) for s, x in zip(table.t_s, texts, strict=True)]
    firmware = [e.text for e in events if e.text.startswith(("ArduPlane", "ArduCopter"))]
    if firmware:
        info["firmware"] = firmware[0]
    return Log("tlog", tables, CLOCK, parameters, events, info, seen, notes)
