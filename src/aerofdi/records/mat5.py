"""A look through the structure of a MATLAB 5 file before SciPy reads it.

SciPy's reader believes the number of cells or structure elements a file claims, and on a damaged file loops
over billions of them. Here each claim is held against the bytes that are left.
"""

from __future__ import annotations

import math
import struct
import zlib

MI_MATRIX, MI_COMPRESSED = 14, 15
CELL, STRUCT, OBJECT = 1, 2, 3
MAX_UNPACKED = 2 << 30
DEEPEST = 20


class Damaged(ValueError):
    """The structure contradicts itself."""


def _tag(data: memoryview, at: int, order: str) -> tuple[int, int, int, int]:
    """(type, size, where the data starts, where the next element starts) of the element at `at`."""
    if at + 8 > len(data):
        raise Damaged("cut off within an element")
    first, second = struct.unpack_from(f"{order}II", data, at)
    if first >> 16:
        # Small element: size and type share a word, up to 4 bytes of data follow.
        return first & 0xFFFF, min(first >> 16, 4), at + 4, at + 8
    end = at + 8 + second
    if end > len(data):
        raise Damaged("an element claims more bytes than there are")
    return first, second, at + 8, end if first == MI_COMPRESSED else end + (-second) % 8


def _dimensions(data: memoryview, at: int, size: int, order: str) -> int:
    if size % 4 or size > 256:
        raise Damaged("an array has impossible dimensions")
    dims = struct.unpack_from(f"{order}{size // 4}i", data, at)
    if any(d < 0 for d in dims):
        raise Damaged("an array has negative dimensions")
    return math.prod(dims)


def _matrix(data: memoryview, order: str, depth: int) -> None:
    """Check one array: the content of a miMATRIX element."""
    if depth > DEEPEST or not len(data):
        return
    _, size, at, following = _tag(data, 0, order)
    if size < 4:
        raise Damaged("an array has no flags")
    kind = struct.unpack_from(f"{order}I", data, at)[0] & 0xFF
    if kind not in (CELL, STRUCT, OBJECT):
        return
    _, size, at, following = _tag(data, following, order)
    count = _dimensions(data, at, size, order)
    _, _, _, following = _tag(data, following, order)  # name
    if kind == OBJECT:
        _, _, _, following = _tag(data, following, order)
    if kind != CELL:
        _, _, at, following = _tag(data, following, order)
        length = struct.unpack_from(f"{order}i", data, at)[0]
        _, size, _, following = _tag(data, following, order)
        if length <= 0 or size % length:
            raise Damaged("a structure has impossible field names")
        count *= size // length
    if 8 * count > len(data) - following:
        raise Damaged(f"an array claims {count} elements, more than the file can hold")
    for _ in range(count):
        kind, size, at, following = _tag(data, following, order)
        if kind == MI_MATRIX:
            _matrix(data[at : at + size], order, depth + 1)


def check_mat5(data: bytes) -> None:
    """Raise Damaged (a ValueError) where a MATLAB 5 file claims more elements than it has bytes for."""
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise Damaged("the header names no byte order")
    whole = memoryview(data)
    at = 128
    while at + 8 <= len(whole):
        kind, size, start, at = _tag(whole, at, order)
        part = whole[start : start + size]
        if kind == MI_COMPRESSED:
            unpacked = zlib.decompressobj().decompress(part, MAX_UNPACKED)
            part = memoryview(unpacked)
            if len(part) < 8:
                raise Damaged("a packed element is cut off")
            kind, size, start, _ = _tag(part, 0, order)
            part = part[start : start + size]
        if kind == MI_MATRIX:
            _matrix(part, order, 0)
