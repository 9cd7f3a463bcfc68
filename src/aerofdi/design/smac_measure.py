"""What a SMAC design measures in simulated healthy flight: answers to excitation, noise, gusts. No fault is
ever flown.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..core import Array, CannotJudge, Design, Flight, Series, bind, run
from ..diagnosers import smac as online
from ..diagnosers import smac_types as t
from ..dynamics.trim import Trim
from ..dynamics.wind import low_altitude
from ..scenarios import Guidance, Point, Scenario, Start, Turbulence, WindSpec
from ..simulate import fly, fly_with
from .exciter import exciter, fourier_answer
from .smac_spec import Spec

Progress = Callable[[str, float], None]


class Answers(NamedTuple):
    """Measured on the healthy loop without noise: complex R0 of every surface at its frequency, (nu,), and
    omega (nu,).
    """

    value: Array
    omega: Array


def level_flight(aircraft: Aircraft, condition: Trim, duration_s: float, **changes: Any) -> Scenario:
    """Straight and level flight from trim, the scenario every measurement here is made in."""
    V, h = condition.airspeed, condition.altitude
    settings: dict[str, Any] = {"name": "smac design", "title": "straight and level", "seed": 1}
    return Scenario(
        aircraft=str(aircraft.path), duration_s=duration_s, start=Start(V, h),
        guidance=Guidance("heading", (Point(0.0, V, h, 0.0),)), **(settings | changes),
    )  # fmt: skip


def dryden(altitude: float, sigma: float) -> WindSpec:
    """Dryden gusts of the same standard deviation (m/s) along all axes, with the scale lengths of the
    altitude (m).
    """
    _, length = low_altitude(min(altitude, 300.0), 1.0)
    return WindSpec(turbulence=Turbulence("dryden", 0.0, (sigma,) * 3, (length[0], length[1], length[2])))


def measure_answers(
    aircraft: Aircraft,
    condition: Trim,
    surfaces: tuple[str, ...],
    omega: Array,
    spec: Spec,
    progress: Progress,
    **changes: Any,
) -> Answers:
    """R0 of every surface: one noise-free flight each surface excited in turn at a quarter of A, whole
    periods at the end of each turn compared. changes: of the scenario (faults, to see what is left of an
    answer)."""
    turn, pause = 8.0, 6.0
    n = len(surfaces)
    start = 2.0 + (turn + pause) * np.arange(n)
    amplitude = np.full(n, 0.25 * math.radians(spec.amplitude_deg))
    d = exciter(surfaces, amplitude, omega, start, start + turn, spec.dt_s)
    progress("measuring the answers of the closed loop", 0.1)
    flight = fly_with(
        level_flight(aircraft, condition, float(start[-1] + turn), noise_factor=0.0, **changes), [d]
    ).flight
    if flight.meta["diverged"]:
        raise CannotJudge(
            f"aircraft {aircraft.name!r} does not survive an excitation of {spec.amplitude_deg / 4} deg"
        )
    out = []
    for i, s in enumerate(surfaces):
        periods = max(1, math.floor(4.0 * omega[i] / (2.0 * math.pi)))
        stop = start[i] + turn
        t0 = stop - periods * 2.0 * math.pi / omega[i]
        grid = np.arange(t0, stop - 1e-9, spec.dt_s)
        command, excitation = (
            _at(flight.measured[f"{kind}.{s}"], grid) for kind in ("command", "excitation")
        )
        out.append(fourier_answer(command, excitation, float(omega[i]), spec.dt_s))
    return Answers(np.array(out), omega)


def _at(series: Series, grid: Array) -> Array:
    return np.asarray(series.value[np.searchsorted(series.t_s, grid + 1e-9, side="right") - 1])


class Noise(NamedTuple):
    """What healthy flights show. level (3,): standard deviation of the residuals behind both low-passes,
    rad/s; slow (3,): behind the estimate's filter. gusty (3,): the first in gusts. floor, activity: of the
    vanes, rad2."""

    level: Array
    slow: Array
    gusty: Array
    floor: float
    activity: float


def _listen(
    params: t.Params, surfaces: tuple[str, ...], flight: Flight, spec: Spec
) -> tuple[Array, Array, float]:
    """Standard deviations of the two filtered residuals, and vane activity, of one healthy flight."""
    d = online.from_design(_as_design(params, surfaces, ("",) * len(surfaces)))
    some = flight.measured[f"command.{surfaces[0]}"]
    zero = some._replace(value=np.zeros(len(some.value)))
    flight = flight.with_measured(**{f"excitation.{s}": zero for s in surfaces})
    sample = bind(flight, d.inputs, d.dt_s, who="smac design")
    _, verdict = run(d, sample)
    after = sample.t_s > 10.0
    level = np.sqrt(np.mean(verdict.residual[after, :3] ** 2, axis=0))
    activity = np.mean(_vane_activity(params.detector, sample.z[after]))
    # The estimate's filter is slower than LP1 and LP2 together: apply it to their output, which it dominates.
    from scipy.signal import lfilter

    a = params.detector.a_estimate
    slow = lfilter([a], [1.0, a - 1.0], verdict.residual[after, :3], axis=0)
    return level, np.sqrt(np.mean(slow**2, axis=0)), float(activity)


def _vane_activity(d: t.Detector, z: Array) -> Array:
    """The wind measure of the diagnoser before its last filter, rad2."""
    from scipy.signal import lfilter

    vanes = z[:, [t.ALPHA, t.BETA]]
    if not np.isfinite(vanes).all():
        return np.zeros(len(z))
    fast, slow = (
        lfilter([a], [1.0, a - 1.0], vanes, axis=0, zi=(1.0 - a) * vanes[:1])[0] for a in (d.a_fast, d.a_slow)
    )
    return np.sum((fast - slow) ** 2, axis=1)


def _as_design(params: t.Params, surfaces: tuple[str, ...], groups: tuple[str, ...]) -> Design:
    return Design("smac", {"surfaces": list(surfaces), "groups": list(groups)}, "", t.flatten(params), {})


def measure_noise(
    aircraft: Aircraft,
    condition: Trim,
    surfaces: tuple[str, ...],
    params: t.Params,
    spec: Spec,
    progress: Progress,
) -> Noise:
    """Healthy flights with sensor noise, in still air and in Dryden gusts of spec.wind m/s, through the
    diagnoser.
    """
    progress("flying healthy in still air", 0.5)
    base = level_flight(aircraft, condition, spec.calibration_s, seed=spec.seed)
    level, slow, floor = _listen(params, surfaces, fly(base), spec)
    progress("flying healthy in gusts", 0.7)
    gusts = dryden(condition.altitude, spec.wind)
    windy = level_flight(aircraft, condition, spec.calibration_s, seed=spec.seed + 1, wind=gusts)
    gusty, _, activity = _listen(params, surfaces, fly(windy), spec)
    return Noise(level, slow, gusty, floor, activity)
