"""Reader of ROS 1 bags (.bag) and ROS 2 bags (folder, .mcap, .db3), by rosbags."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from .log import Log, Topics, guarded, ordered, unreadable, wants
from .ulog import euler

CLOCK = "0 at the earliest stamp of all topics"
MAX_ARRAY = 64

# ROS 2 bags in SQLite carry no message definitions; these are the interfaces of mavros that profiles read.
MAVROS_TYPES = {
    "mavros_msgs/msg/RCOut": "std_msgs/Header header\nuint16[] channels\n",
    "mavros_msgs/msg/State": (
        "std_msgs/Header header\nbool connected\nbool armed\nbool guided\nbool manual_input\n"
        "string mode\nuint8 system_status\n"
    ),
    "mavros_msgs/msg/VfrHud": (
        "std_msgs/Header header\nfloat32 airspeed\nfloat32 groundspeed\nint16 heading\n"
        "float32 throttle\nfloat32 altitude\nfloat32 climb\n"
    ),
}


Getter = Callable[[Any], Any]


def _field(key: str) -> Getter:
    return lambda message: getattr(message, key)


def _element(key: str, k: int) -> Getter:
    return lambda message: getattr(message, key)[k]


def _inside(key: str, get: Getter) -> Getter:
    return lambda message: get(getattr(message, key))


def _getters(message: Any, depth: int = 0) -> dict[str, Getter]:
    """Field name -> how to get it from such a message; nested fields with dots, array items with numbers."""
    found: dict[str, Getter] = {}
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is None or depth > 6:
        return found
    for key in fields:
        if key.startswith("__") or key.isupper():
            continue
        value = getattr(message, key)
        if isinstance(value, (bool, int, float, str, np.number, np.bool_)):
            found[key] = _field(key)
        elif isinstance(value, np.ndarray) and value.ndim == 1 and len(value) <= MAX_ARRAY:
            found.update({f"{key}{k}": _element(key, k) for k in range(len(value))})
        else:
            inner = _getters(value, depth + 1)
            found.update({f"{key}.{name}": _inside(key, get) for name, get in inner.items()})
    return found


def _column(values: list[Any]) -> NDArray[Any]:
    if any(isinstance(v, str) for v in values):
        return np.array([str(v) for v in values], dtype=str)
    return np.array(values, dtype=float)


def _item(get: Callable[[Any], Any], message: Any) -> Any:
    try:
        return get(message)
    except (IndexError, AttributeError):
        return float("nan")


def _with_angles(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Orientation of REP 103 (ENU to forward-left-up) as roll, pitch, yaw of NED to forward-right-down."""
    parts = [columns.get(f"orientation.{k}") for k in "wxyz"]
    if all(part is not None for part in parts):
        w, x, y, z = (np.asarray(part, dtype=float) for part in parts)
        roll, pitch, yaw = euler(w, x, y, z)
        known: Array = np.where(w * w + x * x + y * y + z * z > 0.5, 1.0, np.nan)
        columns["orientation.roll"] = roll * known
        columns["orientation.pitch"] = -pitch * known
        columns["orientation.yaw"] = (0.5 * np.pi - yaw) * known
    return columns


def _typestore() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.LATEST)
    types: dict[str, Any] = {}
    for name, text in MAVROS_TYPES.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


def read_rosbag(path: Path, topics: Topics) -> Log:
    """A ROS 1 or ROS 2 bag. Topics lose their leading '/'; stamps are the recorder's.

    Only wanted topics are deserialised. A message that does not fit its type is left out and counted.
    """
    from rosbags.highlevel import AnyReader

    tables, notes = {}, []
    with guarded(path, "ROS bag"), AnyReader([path], default_typestore=_typestore()) as bag:
        seen: dict[str, int] = {}
        for connection in bag.connections:
            name = connection.topic.lstrip("/")
            seen[name] = seen.get(name, 0) + int(connection.msgcount)
        chosen = [c for c in bag.connections if wants(topics, c.topic.lstrip("/"))]
        start = int(bag.start_time)
        stamps: dict[str, list[int]] = {}
        messages: dict[str, list[Any]] = {}
        damaged = 0
        for connection, stamp, raw in bag.messages(connections=chosen) if chosen else ():
            try:
                message = bag.deserialize(raw, connection.msgtype)
            except Exception:  # any parser error on a damaged message: counted below
                damaged += 1
                continue
            name = connection.topic.lstrip("/")
            stamps.setdefault(name, []).append(stamp)
            messages.setdefault(name, []).append(message)
        for name, found in messages.items():
            getters = _getters(found[0])
            columns = {k: _column([_item(get, m) for m in found]) for k, get in getters.items()}
            t = (np.array(stamps[name], dtype=np.int64) - start).astype(float) * 1e-9
            tables[name] = ordered(t, _with_angles(columns))
    if damaged:
        notes.append(f"{damaged} damaged messages were left out")
    if not seen:
        raise unreadable(path, "the bag holds no topics")
    return Log("rosbag", tables, CLOCK, info={"start_unix_s": start * 1e-9}, seen=seen, notes=notes)
