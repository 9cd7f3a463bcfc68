"""Reader of PX4 logs (.ulg), by pyulog."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Event
from .log import Log, Topics, guarded, ordered, read_bytes, unreadable

# Stamps above this (about 2001) count from 1970: a log of a simulation on the computer's clock.
ABSOLUTE_US = 10**15
MAX_ENDS = 50


class _Ending(io.BytesIO):
    """Bytes that end a parser which comes to their end again and again.

    pyulog steps back by the length a header claims even where fewer bytes were left, so it never ends on some
    files that are cut off within their definitions.
    """

    ends = 0

    def read(self, size: int | None = -1, /) -> bytes:
        out = _read(self, size)
        if size is not None and len(out) < size:
            self.ends += 1
            if self.ends > MAX_ENDS:
                raise EOFError("cut off or damaged within its definitions")
        return out


_read = io.BytesIO.read


def euler(w: Array, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch, yaw (rad) of a quaternion from the frame of reference to the body."""
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def _with_angles(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The fields, and roll, pitch, yaw for every quaternion among them (q -> q.roll, q_d -> q_d.roll)."""
    for name in ("q", "q_d"):
        parts = [columns.get(f"{name}[{k}]") for k in range(4)]
        if all(part is not None for part in parts):
            w, x, y, z = (np.asarray(part, dtype=float) for part in parts)
            for axis, angle in zip(("roll", "pitch", "yaw"), euler(w, x, y, z), strict=True):
                columns[f"{name}.{axis}"] = angle
    return columns


def _parameters(log: Any) -> dict[str, float]:
    """Parameters as the flight ended: the first ones, then every change."""
    found = {str(k): float(v) for k, v in log.initial_parameters.items()}
    for _, name, value in log.changed_parameters:
        found[str(name)] = float(value)
    return found


def _messages(log: Any) -> list[tuple[int, str]]:
    tagged = [m for group in log.logged_messages_tagged.values() for m in group]
    return [
        (int(m.timestamp), f"{m.log_level_str()}: {m.message.strip()}")
        for m in (*log.logged_messages, *tagged)
    ]


def _info(raw: dict[str, Any]) -> dict[str, str]:
    info: dict[str, str] = {k: str(raw[k]) for k in ("sys_name", "ver_hw") if k in raw}
    release = raw.get("ver_sw_release")
    if isinstance(release, int) and release > 0:
        info["firmware"] = f"PX4 v{release >> 24}.{release >> 16 & 255}.{release >> 8 & 255}"
    return info


def _earliest(log: Any) -> int:
    """The earliest stamp (us) of all topics on an absolute clock; 0 (never published) does not count."""
    first = [int(log.start_timestamp)]
    for data in log.data_list:
        stamps = np.asarray(data.data["timestamp"], dtype=np.uint64)
        stamps = stamps[(stamps >= ABSOLUTE_US) & (stamps < 2**62)]
        if len(stamps):
            first.append(int(stamps.min()))
    return min(first)


def read_ulog(path: Path, topics: Topics) -> Log:
    """A PX4 log. Instance 0 of a topic has the topic's name, others '<topic>:k'; vectors are 'name[k]'.

    Stamps are the autopilot's (boot time). Where they count from 1970 they start at 0 at the earliest one of
    all topics.
    """
    from pyulog import ULog

    data = read_bytes(path)
    with guarded(path, "ULog"):
        names = None if topics is None else sorted({topic.partition(":")[0] for topic in topics})
        log = ULog(_Ending(data), names, disable_str_exceptions=True)
        absolute = int(log.start_timestamp) > ABSOLUTE_US
        zero = _earliest(ULog(_Ending(data), None, disable_str_exceptions=True)) if absolute else 0
        tables, seen = {}, {}
        for topic in log.data_list:
            name = topic.name if topic.multi_id == 0 else f"{topic.name}:{topic.multi_id}"
            stamps = np.asarray(topic.data["timestamp"], dtype=np.uint64)
            # 0 marks a topic that was never published; on an absolute clock a small stamp is nonsense.
            keep = (stamps > 0) & (stamps < 2**62) & ((stamps >= ABSOLUTE_US) | (not absolute))
            t = (stamps[keep].astype(np.int64) - zero).astype(float) * 1e-6
            columns = {k: np.asarray(v)[keep] for k, v in topic.data.items() if k != "timestamp"}
            tables[name] = ordered(t, _with_angles(columns))
            seen[name] = int(keep.sum())
        parameters = _parameters(log)
        events = [Event((t - zero) * 1e-6, "message", text) for t, text in _messages(log)]
        info = _info(log.msg_info_dict)
        notes = [f"{len(log.dropouts)} dropouts: the logger lost data"] if log.dropouts else []
        if log.file_corruption:
            notes.append("the file is damaged; what could be read is shown")
    if not seen and names is not None:
        return _empty(path, data)
    clock = "0 at the earliest stamp of all topics" if absolute else "autopilot boot time"
    return Log("ulog", tables, clock, parameters, events, info, seen, notes)


def _empty(path: Path, data: bytes) -> Log:
    """What a log without any wanted topic has, for the error message of the caller."""
    from pyulog import ULog

    with guarded(path, "ULog"):
        log = ULog(_Ending(data), disable_str_exceptions=True)
        seen = {topic.name: len(topic.data["timestamp"]) for topic in log.data_list}
    if not seen:
        raise unreadable(path, "holds no data: it is cut off before the first message, or nothing was logged")
    return Log("ulog", {}, "", seen=seen)
