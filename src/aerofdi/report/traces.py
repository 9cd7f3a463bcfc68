"""Signals for a page: thinned to an envelope of least and largest values, so that no spike is lost, and packed."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.types import Array
from ..pipeline.types import Span

GAP_PERIODS = 5.0
LEVELS = 32767


class Trace(NamedTuple):
    """One curve. t (n,) in s; low and high (n,) equal for a line, apart for a band. role: measured, explained,
    reference, truth, band or a number that picks a colour. step: held between samples.
    """

    name: str
    t: Array
    low: Array
    high: Array
    role: str
    step: bool = False


class Panel(NamedTuple):
    """One plot. levels: (value, text) of horizontal lines. low, high: limits always shown (NaN: from the data)."""

    title: str
    unit: str
    traces: tuple[Trace, ...]
    levels: tuple[tuple[float, str], ...] = ()
    low: float = math.nan
    high: float = math.nan
    note: str = ""


def line(name: str, t: Array, value: Array, role: str, step: bool = False) -> Trace:
    """A curve of one value a time."""
    return Trace(name, t, value, value, role, step)


def thin(trace: Trace, span: Span, points: int, windows: Sequence[Span] = ()) -> tuple[Array, Array, Array]:
    """(t, low, high), at most about 2 `points` outside the windows, every sample within them.

    Outside, samples that share one of `points` equal parts of the span become their least and largest value. A NaN
    row stands in every gap (more than five median periods, or a non-finite sample).
    """
    t = np.asarray(trace.t, float)
    good = np.isfinite(trace.low) & np.isfinite(trace.high) & np.isfinite(t)
    whole = np.cumsum(~good)[good]
    t, low, high = t[good], np.asarray(trace.low, float)[good], np.asarray(trace.high, float)[good]
    if not len(t):
        return t, low, high
    steps = np.diff(t)
    period = float(np.median(steps[steps > 0])) if (steps > 0).any() else math.inf
    broken = np.concatenate(([False], (steps > GAP_PERIODS * period) | (np.diff(whole) > 0)))
    if len(t) > 2 * points:
        part = np.floor((t - span[0]) / max(span[1] - span[0], 1e-9) * points)
        inside = np.zeros(len(t), dtype=bool)
        for a, b in windows:
            inside |= (t >= a) & (t <= b)
        new = np.concatenate(([True], np.diff(part) != 0)) | inside | broken
        new[1:] |= inside[:-1]
        at = np.flatnonzero(new)
        last = np.append(at[1:], len(t)) - 1
        t, broken = 0.5 * (t[at] + t[last]), broken[at]
        low, high = np.minimum.reduceat(low, at), np.maximum.reduceat(high, at)
    at = np.flatnonzero(broken)
    before = 0.5 * (t[at - 1] + t[at])
    return np.insert(t, at, before), np.insert(low, at, np.nan), np.insert(high, at, np.nan)


class Packer:
    """Collects packed clocks of one flight, so that curves on one clock share it."""

    def __init__(self, span: Span, points: int, windows: Sequence[Span] = ()):
        self.span, self.points, self.windows = span, points, windows
        self.clocks: list[str] = []

    def pack(self, trace: Trace) -> dict[str, Any]:
        """The curve as JSON: 16-bit steps of its own range, base64; times as 32-bit floats since the span's start."""
        t, low, high = thin(trace, self.span, self.points, self.windows)
        clock = _text((t - self.span[0]).astype("<f4"))
        if clock not in self.clocks:
            self.clocks.append(clock)
        least = float(np.nanmin(low)) if len(low) else 0.0
        largest = float(np.nanmax(high)) if len(high) else 0.0
        unit = (largest - least) / (2 * LEVELS) or 1.0
        out: dict[str, Any] = {
            "name": trace.name, "role": trace.role, "clock": self.clocks.index(clock), "zero": least + LEVELS * unit,
            "unit": unit, "low": _steps(low, least, unit),
        }  # fmt: skip
        if not np.array_equal(low, high, equal_nan=True):
            out["high"] = _steps(high, least, unit)
        return out | ({"step": True} if trace.step else {})


def _steps(value: Array, least: float, unit: float) -> str:
    """-32768 is NaN."""
    steps = np.where(np.isfinite(value), np.round((value - least) / unit) - LEVELS, -LEVELS - 1)
    return _text(steps.astype("<i2"))


def _text(array: np.ndarray) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")
