"""Where a flight was airborne, under autopilot, and with its surfaces commanded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Flight, Series

STEP_S = 0.2
MOVING_S = 5.0
SHORTEST_S = 5.0
SMOOTH = 75
MAX_STEPS = 2_000_000
Span = tuple[float, float]
Mask = NDArray[np.bool_]


def _held(series: Series, t: Array, before: float = 0.0) -> Array:
    """The last value at each instant; `before` ahead of the first one."""
    finite = np.isfinite(series.value)
    stamps, value = series.t_s[finite], series.value[finite]
    if not len(stamps):
        return np.full(len(t), before)
    index = np.searchsorted(stamps, t, side="right") - 1
    return np.where(index >= 0, value[np.maximum(index, 0)], before)


def _moving(series: Series, t: Array) -> Mask:
    """Whether the value changed within the last MOVING_S seconds."""
    finite = np.isfinite(series.value)
    stamps, value = series.t_s[finite], series.value[finite]
    changed = np.concatenate(([False], np.diff(value) != 0)) if len(value) else np.zeros(0, dtype=bool)
    total = np.concatenate(([0], np.cumsum(changed)))
    now = np.searchsorted(stamps, t, side="right")
    then = np.searchsorted(stamps, t - MOVING_S, side="right")
    moved: Mask = total[now] > total[then]
    return moved


def _mean(x: Array) -> Array:
    """Centred mean over SMOOTH samples; shorter at the ends."""
    total = np.concatenate(([0.0], np.cumsum(x)))
    k = np.arange(len(x))
    low, high = np.maximum(k - SMOOTH, 0), np.minimum(k + SMOOTH + 1, len(x))
    return (total[high] - total[low]) / (high - low)


def _airborne(flight: Flight, t: Array) -> tuple[Mask, str]:
    """Airborne by the autopilot's own word; else by speed; else by how much the aircraft turns."""
    m = flight.measured
    if "airborne" in m:
        return _held(m["airborne"], t) > 0.5, "the autopilot's own estimate"
    if "airspeed" in m:
        speed = _held(m["airspeed"], t)
        return speed > 0.5 * float(np.quantile(speed, 0.9)), "airspeed above half of its 90 % quantile"
    if "groundspeed" in m:
        # Against the wind it may be near zero for a while.
        speed = _mean(_held(m["groundspeed"], t))
        return speed > 0.3 * float(np.quantile(speed, 0.9)), "groundspeed above 0.3 of its 90 % quantile"
    rates = [_held(m[k], t) for k in ("p", "q", "r") if k in m]
    if not rates:
        return np.ones(len(t), dtype=bool), "not known, taken as airborne"
    turning = np.sqrt(_mean(np.sum(np.square(rates), axis=0)))
    return turning > 0.2 * float(np.quantile(turning, 0.9)), "rates of turn above 0.2 of their 90 % quantile"


def _runs(mask: Mask, t: Array) -> list[Span]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(int), [0]))))
    last = len(t) - 1
    return [(float(t[i]), float(t[min(j, last)])) for i, j in zip(edges[::2], edges[1::2], strict=True)]


def flown(flight: Flight) -> tuple[list[Span], list[str]]:
    """Spans (t0, t1) that are armed, airborne, under autopilot and with at least one surface command moving.

    Returned with them: one sentence per condition, saying how it was known or that the flight does not tell.
    Spans shorter than 5 s are dropped. A condition whose channel is absent is taken as met.
    """
    t0, t1 = flight.span_s
    if not t1 > t0:
        return [], ["the flight has no samples"]
    step = max(STEP_S, (t1 - t0) / MAX_STEPS)
    t = np.arange(t0, t1, step)
    mask, how = _airborne(flight, t)
    said = [f"airborne: {how}"]
    if "armed" in flight.measured:
        mask &= _held(flight.measured["armed"], t, before=1.0) > 0.5
        said.append("armed: the autopilot's own state")
    modes = set(flight.meta.get("autopilot_modes", ()))
    mode = flight.measured.get("mode")
    if mode is not None and mode.codes and modes:
        numbers = [number for number, name in mode.codes.items() if name in modes]
        first = float(mode.value[0]) if len(mode.value) else 0.0
        mask &= np.isin(_held(mode, t, before=first), numbers)
        said.append("under autopilot: by mode")
    else:
        said.append("under autopilot: not known, the flight has no mode")
    commands = [series for name, series in flight.measured.items() if name.startswith("command.")]
    if commands:
        mask &= np.any([_moving(series, t) for series in commands], axis=0)
        said.append("surface commands moving within the last 5 s")
    return [(a, b) for a, b in _runs(mask, t) if b - a >= SHORTEST_S], said
