"""A look through the structure of a MATLAB 5 file before SciPy reads it.

SciPy's reader believes the number of cells or structure elements a file claims, and on a damaged file loops
over billions of them. Here each claim is held against the bytes that are left.
"""

from __future__ import annotations

import math
import struct
import zlib

MI_MATRIX, MI_COMPRESSED = 14, 15
# Element type -> bytes of one item.
ITEM = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13))
CELL, STRUCT, OBJECT, CHAR, SPARSE = 1, 2, 3, 4, 5
NUMERIC = range(6, 16)
COMPLEX = 0x0800
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
        kind, size, start, end, following = first & 0xFFFF, first >> 16, at + 4, at + 8, at + 8
        if size > 4:
            raise Damaged("a small element claims more than 4 bytes")
    else:
        kind, size, start, end = first, second, at + 8, at + 8 + second
        following = end if kind == MI_COMPRESSED else end + (-size) % 8
    if end > len(data):
        raise Damaged("an element claims more bytes than there are")
    if kind not in (MI_MATRIX, MI_COMPRESSED) and (kind not in ITEM or size % ITEM[kind]):
        raise Damaged(f"an element is of unknown type {kind}, or its size does not fit its type")
    return kind, size, start, following


def _dimensions(data: memoryview, at: int, size: int, order: str) -> int:
    if size % 4 or size > 256:
        raise Damaged("an array has impossible dimensions")
    dims = struct.unpack_from(f"{order}{size // 4}i", data, at)
    if any(d < 0 for d in dims):
        raise Damaged("an array has negative dimensions")
    return math.prod(dims)


def _numbers(data: memoryview, at: int, order: str, count: int) -> int:
    """Check one part (real or imaginary) of a numeric array; where the next element starts."""
    kind, size, _, following = _tag(data, at, order)
    if kind not in NUMBERS or size != count * ITEM[kind]:
        raise Damaged("an array's numbers do not fit its dimensions")
    return following


def _nested(data: memoryview, at: int, order: str, count: int, depth: int) -> None:
    """Check the cells of a cell array, or the fields of a structure."""
    if 8 * count > len(data) - at:
        raise Damaged(f"an array claims {count} elements, more than the file can hold")
    for _ in range(count):
        kind, size, start, at = _tag(data, at, order)
        if kind != MI_MATRIX:
            raise Damaged("a cell or field holds no array")
        _matrix(data[start : start + size], order, depth + 1)


def _fields(data: memoryview, at: int, order: str) -> tuple[int, int]:
    """(number of fields, where the first one starts) of a structure."""
    kind, size, start, following = _tag(data, at, order)
    length = struct.unpack_from(f"{order}i", data, start)[0] if size == 4 and kind == 5 else 0
    kind, size, _, following = _tag(data, following, order)
    if length <= 0 or size % length or kind not in (1, 2):
        raise Damaged("a structure has impossible field names")
    return size // length, following


def _matrix(data: memoryview, order: str, depth: int) -> None:
    """Check one array: the content of a miMATRIX element."""
    if not len(data):
        return
    if depth > DEEPEST:
        raise Damaged("arrays are nested too deeply")
    kind, size, at, following = _tag(data, 0, order)
    if size != 8 or kind != 6:
        raise Damaged("an array has no flags")
    flags = struct.unpack_from(f"{order}I", data, at)[0]
    kind = flags & 0xFF
    if kind not in (CELL, STRUCT, OBJECT, CHAR, SPARSE, *NUMERIC):
        raise Damaged(f"an array of class {kind} (object or function) cannot be read; save plain arrays")
    number, size, at, following = _tag(data, following, order)
    if number != 5:
        raise Damaged("an array has no dimensions")
    count = _dimensions(data, at, size, order)
    number, _, _, following = _tag(data, following, order)
    if number not in (1, 2):
        raise Damaged("an array has no name")
    parts = 2 if flags & COMPLEX else 1
    if kind in NUMERIC:
        for _ in range(parts):
            following = _numbers(data, following, order, count)
    elif kind == CHAR:
        number, size, _, _ = _tag(data, following, order)
        if number not in ITEM or size > 8 * count:
            raise Damaged("a text does not fit its dimensions")
    elif kind == SPARSE:
        for _ in range(2 + parts):
            _, _, _, following = _tag(data, following, order)
    else:
        if kind == OBJECT:
            _, _, _, following = _tag(data, following, order)
        if kind != CELL:
            fields, following = _fields(data, following, order)
            count *= fields
        _nested(data, following, order, count, depth)


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
