"""What a scenario is, in SI and rad. Plain records; `simulate` turns them into a flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ..core.types import Array
from ..dynamics.faults import Fault

LATERAL = ("bank", "heading", "course", "track")


class Start(NamedTuple):
    """Trimmed flight at t = 0: m/s, m, rad; straight, climbing at climb_angle (rad)."""

    airspeed: float
    altitude: float
    heading: float = 0.0
    north: float = 0.0
    east: float = 0.0
    climb_angle: float = 0.0


class Point(NamedTuple):
    """One break point of the guidance at t_s: airspeed (m/s), altitude (m), angle (rad: bank, heading or
    course).
    """

    t_s: float
    airspeed: float
    altitude: float
    angle: float


class Track(NamedTuple):
    """Waypoints flown round and round, m."""

    north: tuple[float, ...]
    east: tuple[float, ...]


class Guidance(NamedTuple):
    """What the autopilot is asked to fly: break points with linear ramps between them (two at one time: a
    step).

    lateral: what the angle of the points is, or "track".
    """

    lateral: str
    points: tuple[Point, ...]
    track: Track | None = None


class Turbulence(NamedTuple):
    """model: "dryden" or "von_karman". sigma, length: (u, v, w), m/s and m; None: of the standard at
    wind_20ft (m/s)

    and the start altitude.
    """

    model: str
    wind_20ft: float = 0.0
    sigma: tuple[float, float, float] | None = None
    length: tuple[float, float, float] | None = None


class Gust(NamedTuple):
    """A 1-cosine gust: air velocity (u, v, w) in body axes (m/s), build-up lengths (m), whether it stays."""

    start_s: float
    velocity: tuple[float, float, float]
    length: tuple[float, float, float]
    stays: bool = True


class WindSpec(NamedTuple):
    """speed (m/s) at reference_height (m), blowing from `direction` (rad, clockwise from north), upwards at
    `up` m/s;

    roughness (m) of the logarithmic shear, 0 for none.
    """

    speed: float = 0.0
    direction: float = 0.0
    up: float = 0.0
    reference_height: float = 6.096
    roughness: float = 0.0
    turbulence: Turbulence | None = None
    gusts: tuple[Gust, ...] = ()


class Rates(NamedTuple):
    """Hz; NaN: dynamics is the lowest multiple of the control rate from 100 Hz, control that of the
    autopilot,

    record (of truth) that of control.
    """

    dynamics: float
    control: float
    record: float


CALM = WindSpec()
DEFAULT_RATES = Rates(float("nan"), float("nan"), float("nan"))


@dataclass(frozen=True)
class Scenario:
    """What shall happen in one flight.

    sensors: channel -> the numbers that differ from the aircraft's (sigma, rate_hz, bias, bias_sigma,
    drift, walk, delay_s), SI; noise_factor multiplies every sigma. autopilot: changes to the aircraft's
    [autopilot] table, as written; variant: one of its variants. parameters: dotted path of an aircraft
    number -> (value in SI or NaN, factor).
    """

    name: str
    title: str
    aircraft: str
    duration_s: float
    seed: int
    start: Start
    guidance: Guidance
    wind: WindSpec = CALM
    sensors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    noise_factor: float = 1.0
    autopilot: Mapping[str, Any] = field(default_factory=dict)
    variant: str = ""
    faults: tuple[Fault, ...] = ()
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rates: Rates = DEFAULT_RATES
    path: Path | None = None

    def columns(self) -> dict[str, Array]:
        """The guidance points as columns t_s, airspeed, altitude, angle."""
        import numpy as np

        table = np.array(self.guidance.points, float).reshape(-1, 4)
        return dict(zip(Point._fields, table.T, strict=True))
