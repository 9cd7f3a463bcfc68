"""Linear interpolation in tables with one to three axes; outside a table its edge is held unless extrapolated."""

from __future__ import annotations

from ..core.types import Array
from ..parts.ops import clip, inline


@inline
def locate(axis: Array, x: float) -> tuple[int, float]:
    """Cell i and fraction f with x = axis[i] + f (axis[i+1] - axis[i]); f leaves [0, 1] outside the axis.

    NaN gives cell 0 and f = NaN. The axis increases strictly and has at least two entries.
    """
    lo, hi = 0, len(axis) - 1
    while hi - lo > 1:
        mid = (lo + hi) // 2
        if x >= axis[mid]:
            lo = mid
        else:
            hi = mid
    return lo, (x - axis[lo]) / (axis[lo + 1] - axis[lo])


@inline
def held(axis: Array, x: float) -> tuple[int, float]:
    """As `locate`, with f held within [0, 1]."""
    i, f = locate(axis, x)
    return i, clip(f, 0.0, 1.0)


@inline
def linear(axis: Array, table: Array, x: float) -> float:
    """Table (n,) at x, edges held."""
    i, f = held(axis, x)
    return table[i] + f * (table[i + 1] - table[i])


@inline
def bilinear(rows: Array, columns: Array, table: Array, x: float, y: float) -> float:
    """Table (n, k) at (x, y), edges held."""
    i, f = held(rows, x)
    j, g = held(columns, y)
    a = table[i, j] + g * (table[i, j + 1] - table[i, j])
    b = table[i + 1, j] + g * (table[i + 1, j + 1] - table[i + 1, j])
    return a + f * (b - a)
