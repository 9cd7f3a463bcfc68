"""MAVLink frames decoded a message type at a time.

pymavlink's generated classes state each message (field order, format, CRC seed); the frames of one type are
checked and decoded together as a NumPy structure, which takes a twentieth of the time of building one object
a message. pymavlink's own parser is the reference the tests compare with.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
_NUMPY = {"b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8"}
_NUMPY |= {"f": "<f4", "d": "<f8", "c": "S1"}


class Frame(NamedTuple):
    """Where one frame lies: `at` its first byte, payload from `body` on, `size` bytes long."""

    at: int
    body: int
    size: int
    msgid: int
    source: tuple[int, int]


def frames(data: bytes) -> Iterator[Frame]:
    """Every frame of a telemetry log by layout: an 8 byte stamp, then MAVLink 1 or 2; garbage is skipped."""
    at, end = 0, len(data)
    while at + 16 <= end:
        start = at + 8
        magic = data[start]
        size = data[start + 1]
        if magic == 0xFE:
            body, stop = start + 6, start + 8 + size
            msgid, source = data[start + 5], (data[start + 3], data[start + 4])
        elif magic == 0xFD and start + 10 <= end:
            body, stop = start + 10, start + 12 + size + (13 if data[start + 2] & 1 else 0)
            msgid = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
            source = (data[start + 5], data[start + 6])
        else:
            at += 1
            continue
        # Followed by another frame, or the end (perhaps a cut-off stamp); else a chance byte in garbage.
        if stop > end or (stop + 8 < end and data[stop + 8] not in (0xFE, 0xFD)):
            at += 1
            continue
        yield Frame(start, body, size, msgid, source)
        at = stop


def _crc_table() -> NDArray[np.uint16]:
    table = np.zeros(256, dtype=np.uint16)
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
        table[byte] = value
    return table


CRC_TABLE = _crc_table()


def _intact(block: Bytes, seed: int) -> NDArray[np.bool_]:
    """Which rows end with the right checksum (CRC-16/MCRF4XX over all but the magic, then the seed)."""
    crc = np.full(len(block), 0xFFFF, dtype=np.uint16)
    for j in range(1, block.shape[1] - 2):
        crc = crc >> 8 ^ CRC_TABLE[(crc ^ block[:, j]) & 0xFF]
    crc = crc >> 8 ^ CRC_TABLE[(crc ^ seed) & 0xFF]
    sent = block[:, -2].astype(np.uint16) | block[:, -1].astype(np.uint16) << 8
    good: NDArray[np.bool_] = crc == sent
    return good


def layout(message: Any) -> np.dtype[Any]:
    """The NumPy structure of a message's payload on the wire, from pymavlink's class."""
    parts: list[Any] = []
    codes = re.findall(r"(\d*)([a-zA-Z])", message.unpacker.format)
    for name, (count, code) in zip(message.ordered_fieldnames, codes, strict=True):
        if code == "s":
            parts.append((name, f"S{count or 1}"))
        elif count:
            parts.append((name, _NUMPY[code], (int(count),)))
        else:
            parts.append((name, _NUMPY[code]))
    return np.dtype(parts)


def decode(
    data: bytes, found: list[Frame], message: Any
) -> tuple[NDArray[np.int64], dict[str, NDArray[Any]]]:
    """(which of the frames were intact, their fields) of frames that all hold one message type.

    Bytes that MAVLink 2 cut off a payload's end are zeros. Vectors of numbers are left out.
    """
    bytes_ = np.frombuffer(data, dtype=np.uint8)
    dtype = layout(message)
    body = np.zeros((len(found), dtype.itemsize), dtype=np.uint8)
    good = np.zeros(len(found), dtype=bool)
    shapes: dict[tuple[int, int], list[int]] = {}
    for k, frame in enumerate(found):
        shapes.setdefault((frame.body - frame.at, frame.size), []).append(k)
    for (head, size), rows in shapes.items():
        index = np.asarray(rows)
        starts = np.array([found[k].at for k in rows])
        block = np.lib.stride_tricks.sliding_window_view(bytes_, head + size + 2)[starts]
        good[index] = _intact(block, message.crc_extra)
        width = min(size, dtype.itemsize)
        body[index, :width] = block[:, head : head + width]
    values = np.ascontiguousarray(body[good]).view(dtype).reshape(-1)
    columns: dict[str, NDArray[Any]] = {}
    for name in dtype.names or ():
        column = values[name]
        if column.ndim > 1:
            continue
        if column.dtype.kind == "S":
            column = np.array(
                [bytes(x).split(b"\0")[0].decode("utf-8", "replace") for x in column], dtype=str
            )
        columns[name] = np.ascontiguousarray(column)
    return np.flatnonzero(good), columns
