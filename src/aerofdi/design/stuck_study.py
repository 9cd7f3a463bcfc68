"""Choosing an observer by what it is for: stuck surfaces in closed-loop flight over the airspeed range.

Every candidate sees the same flights: level legs and turns at several airspeeds, one surface stuck at an
angle about trim, light turbulence. Candidates are `core.Diagnoser` values, so any bank can be compared, not
only the filters of this room.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..core import Diagnoser, Flight, Status, Verdict, bind, run
from ..dynamics.faults import Fault
from ..scenarios.types import Guidance, Point, Scenario, Start, Turbulence, WindSpec
from ..simulate import fly
from .lmi import Progress

DEG = math.pi / 180.0


class Case(NamedTuple):
    """One flight. angle: rad about trim, NaN for a healthy flight. bank: rad, reached before the fault."""

    airspeed: float
    surface: str
    angle: float
    bank: float
    seed: int


class Row(NamedTuple):
    """One diagnoser on one flight.

    delay_s: first alarm after the fault, NaN where none within the window. first: the surface named first.
    false_alarm: any alarm before the fault. error: median of estimate minus truth on the stuck surface, rad,
    2 s after the fault to the end. healthy: largest |residual| before the fault, rad; faulty: largest after
    it on the stuck surface. share_ok: samples with status OK after settling.
    """

    diagnoser: str
    case: Case
    delay_s: float
    first: str
    false_alarm: bool
    error: float
    healthy: float
    faulty: float
    share_ok: float


def scenario_of(aircraft: str, case: Case, fault_s: float, window_s: float, altitude: float) -> Scenario:
    """Level flight at the airspeed, a bank from 10 s before the fault (0: straight), the fault at fault_s."""
    points = [Point(0.0, case.airspeed, altitude, 0.0), Point(fault_s - 10.0, case.airspeed, altitude, 0.0)]
    points.append(Point(fault_s - 8.0, case.airspeed, altitude, case.bank))
    healthy = not math.isfinite(case.angle)
    faults = () if healthy else (Fault(case.surface, "stuck", fault_s, value=case.angle, about="trim"),)
    wind = WindSpec(2.0, 4.5, turbulence=Turbulence("dryden", 2.0))
    return Scenario(
        "stuck_study", "", aircraft, fault_s + window_s, case.seed, Start(case.airspeed, altitude),
        Guidance("bank", tuple(points)), wind, faults=faults,
    )  # fmt: skip


def _first(d: Diagnoser, out: Verdict, after: np.ndarray) -> tuple[int, str]:
    """Index of the first alarm among `after`, and the surface of the largest active score then."""
    hit = np.flatnonzero(out.detected & after)
    if not len(hit):
        return -1, ""
    k = int(hit[0])
    scores = np.where(out.active[k, 1:], np.nan_to_num(out.score[k, 1:], nan=-np.inf), -np.inf)
    return k, d.hypotheses[1 + int(np.argmax(scores))].fault


def judge(name: str, d: Diagnoser, flight: Flight, case: Case, fault_s: float) -> Row:
    """One diagnoser on one flight."""
    sample = bind(flight, d.inputs, d.dt_s, who=d.name)
    _, out = run(d, sample)
    t = sample.t_s
    before, after = (t >= d.settle_s) & (t < fault_s), t >= fault_s
    k, first = _first(d, out, after)
    names = [h.fault for h in d.hypotheses[1:]]
    j = names.index(case.surface)
    truth = flight.truth[f"surface.{case.surface}"]
    late = t >= fault_s + 2.0
    error = out.estimate[late, 1 + j] - np.interp(t[late], truth.t_s, truth.value)
    return Row(
        name,
        case,
        float(t[k] - fault_s) if k >= 0 else math.nan,
        first,
        bool((out.detected & before).any()),
        float(np.nanmedian(error)) if np.isfinite(error).any() else math.nan,
        float(np.nanmax(np.abs(out.residual[before]))),
        float(np.nanmax(np.abs(out.residual[after, j]))),
        float(np.mean(out.status[t >= d.settle_s] == Status.OK)),
    )


def stuck_study(
    aircraft: str,
    diagnosers: Mapping[str, Diagnoser],
    airspeeds: Sequence[float],
    angles_deg: Sequence[float],
    surfaces: Sequence[str],
    banks_deg: Sequence[float] = (0.0, 30.0),
    seeds: Sequence[int] = (1,),
    fault_s: float = 30.0,
    window_s: float = 15.0,
    altitude: float = 100.0,
    progress: Progress | None = None,
) -> list[Row]:
    """Every diagnoser on every flight of airspeeds x angles (deg about trim) x surfaces x banks (deg) x
    seeds.
    """
    cases = [
        Case(V, s, angle * DEG, bank * DEG, seed)
        for V in airspeeds
        for s in surfaces
        for angle in angles_deg
        for bank in banks_deg
        for seed in seeds
    ]
    rows = []
    for k, case in enumerate(cases):
        if progress:
            progress(f"flight {k + 1} of {len(cases)}", k / len(cases))
        flight = fly(scenario_of(aircraft, case, fault_s, window_s, altitude))
        rows += [judge(name, d, flight, case, fault_s) for name, d in diagnosers.items()]
    return rows


def summary(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Per diagnoser: share detected, isolated among detected, false alarms, median delay, |error| and signal
    over noise.
    """
    out = {}
    for name in dict.fromkeys(r.diagnoser for r in rows):
        mine = [r for r in rows if r.diagnoser == name]
        seen = [r for r in mine if math.isfinite(r.delay_s)]
        errors = [abs(r.error) for r in mine if math.isfinite(r.error)]
        out[name] = {
            "flights": float(len(mine)),
            "detected": len(seen) / len(mine),
            "isolated": sum(r.first == r.case.surface for r in seen) / len(seen) if seen else math.nan,
            "false_alarms": sum(r.false_alarm for r in mine) / len(mine),
            "median_delay_s": float(np.median([r.delay_s for r in seen])) if seen else math.nan,
            "slowest_s": float(np.max([r.delay_s for r in seen])) if seen else math.nan,
            "median_error_deg": float(np.median(errors)) / DEG if errors else math.nan,
            "largest_healthy_deg": float(np.max([r.healthy for r in mine])) / DEG,
            "smallest_faulty_deg": float(np.min([r.faulty for r in mine])) / DEG,
        }
    return out
