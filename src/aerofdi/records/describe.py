"""What a flight holds, in numbers: what `aerofdi info FLIGHT` prints."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core import Flight, Series
from .spans import flown

GAP_PERIODS = 5.0
TABLES = ("measured", "output", "truth")


def _gaps(series: Series) -> dict[str, Any]:
    """Intervals without a finite sample longer than five median periods."""
    t = series.t_s[np.isfinite(series.value)]
    period = series.period_s
    if len(t) < 2 or not np.isfinite(period):
        return {"count": 0, "longest_s": 0.0, "at_s": None}
    steps = np.diff(t)
    wide = steps > GAP_PERIODS * period
    at = int(np.argmax(steps))
    longest = float(steps[at]) if wide.any() else 0.0
    return {"count": int(wide.sum()), "longest_s": longest, "at_s": float(t[at]) if wide.any() else None}


def describe_series(name: str, table: str, series: Series) -> dict[str, Any]:
    """One channel: unit, count, rate, span, gaps, share of repeated values, range or names of codes."""
    value, t = series.value, series.t_s
    finite = value[np.isfinite(value)]
    period = series.period_s
    names = None
    if series.codes is not None:
        names = [series.codes.get(int(code), f"unknown {code:g}") for code in np.unique(finite)]
    return {
        "name": name,
        "table": table,
        "unit": series.unit,
        "count": len(t),
        "rate_hz": 1.0 / period if np.isfinite(period) and period > 0 else None,
        "span_s": [float(t[0]), float(t[-1])] if len(t) else None,
        "gaps": _gaps(series),
        "repeats": series.repeats,
        "repeated_share": float(np.mean(np.diff(value) == 0)) if len(value) > 1 else 0.0,
        "nonfinite_share": float(1.0 - len(finite) / len(value)) if len(value) else 0.0,
        "range": [float(finite.min()), float(finite.max())] if len(finite) and names is None else None,
        "values": names,
    }


def _modes(flight: Flight) -> list[dict[str, Any]]:
    series = flight.measured.get("mode")
    if series is None or not len(series.t_s):
        return []
    codes = series.codes or {}
    starts = np.concatenate(([0], np.flatnonzero(np.diff(series.value) != 0) + 1))
    ends = [*series.t_s[starts[1:]].tolist(), flight.span_s[1]]
    return [
        {
            "mode": codes.get(int(series.value[k]), f"unknown {series.value[k]:g}"),
            "t0_s": float(series.t_s[k]),
            "t1_s": e,
        }
        for k, e in zip(starts, ends, strict=True)
        if np.isfinite(series.value[k])
    ]


def describe(flight: Flight) -> dict[str, Any]:
    """Everything a person wants to know of a record before trusting a verdict on it; plain JSON values.

    Keys: source, format, profile, aircraft, clock, span_s, duration_s, channels (see describe_series), modes,
    flown (spans airborne under autopilot with moving surfaces) and how they are known, surface_signs, signs,
    groups, assumed, notes, events, parameters (their number).
    """
    meta = flight.meta
    spans, known_by = flown(flight)
    return {
        **{key: meta.get(key, "") for key in ("source", "format", "profile", "aircraft", "clock", "signs")},
        "span_s": list(flight.span_s),
        "duration_s": flight.duration_s,
        "channels": [
            describe_series(n, table, s) for table in TABLES for n, s in getattr(flight, table).items()
        ],
        "modes": _modes(flight),
        "flown": [list(span) for span in spans],
        "flown_known_by": known_by,
        **{key: dict(meta.get(key, {})) for key in ("surface_signs", "groups", "aliases")},
        **{key: list(meta.get(key, [])) for key in ("assumed", "notes")},
        "events": len(flight.events),
        "parameters": len(flight.parameters),
    }
