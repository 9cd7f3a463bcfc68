"""What was really wrong in a flight, as the scores need it."""

from __future__ import annotations

import math

import numpy as np

from ..core import Flight
from .score import Fault

PREFIX = "fault."


def faults_of(flight: Flight) -> tuple[Fault, ...]:
    """The faults of a flight by onset: from `meta["faults"]`, else from truth `fault.<target>.<mode>`.

    A truth channel is the size of the fault while it is active and NaN (or 0) else; each stretch is one
    fault, its size the median. Empty where nothing is known: look at `flight.truth` before calling such a
    flight healthy.
    """
    if "faults" in flight.meta:
        rows = [
            Fault(
                f["target"],
                f["mode"],
                float(f["start_s"]),
                _number(f.get("end_s"), math.inf),
                _number(f.get("value")),
            )
            for f in flight.meta["faults"]
        ]
    else:
        rows = [f for name in flight.truth if name.startswith(PREFIX) for f in _stretches(flight, name)]
    return tuple(sorted(rows, key=lambda f: f.start_s))


def _number(x: object, missing: float = math.nan) -> float:
    return missing if x is None else float(x)  # type: ignore[arg-type]


def _stretches(flight: Flight, name: str) -> list[Fault]:
    series = flight.truth[name]
    target, _, mode = name.removeprefix(PREFIX).rpartition(".")
    on = np.isfinite(series.value) & (series.value != 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], on, [False])).astype(int)))
    out = []
    for start, stop in edges.reshape(-1, 2):
        end = float(series.t_s[stop]) if stop < len(series.t_s) else math.inf
        out.append(
            Fault(target, mode, float(series.t_s[start]), end, float(np.median(series.value[start:stop])))
        )
    return out


def value_at(flight: Flight, name: str, t_s: float) -> float:
    """The true value of a channel at an instant (last one known), the measured one where there is no truth,
    else NaN.
    """
    for table in (flight.truth, flight.measured):
        if name in table:
            i = int(np.searchsorted(table[name].t_s, t_s, side="right")) - 1
            return float(table[name].value[i]) if i >= 0 else math.nan
    return math.nan
