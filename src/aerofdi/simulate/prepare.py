"""From a scenario to the numbers of its loop: aircraft, trim, wind, servos, sensors, autopilot, faults."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..aircraft import Aircraft, load_aircraft
from ..aircraft.types import ACTUATOR_ORDER
from ..autopilot import Autopilot, Measured, autopilot_of, guidance
from ..autopilot.signals import BANK, COURSE, HEADING, TRACK
from ..core.errors import WrongUse
from ..core.types import Array
from ..dynamics.actuators import ActuatorParams, Servo, actuator_params
from ..dynamics.build import plant_params
from ..dynamics.faults import THROTTLE, Fault, FaultTable, fault_table
from ..dynamics.sensors import Sensor, sensor_order, sensor_params, whole_steps
from ..dynamics.trim import Trim, trim
from ..dynamics.types import State, Wind
from ..dynamics.wind import WindParams, forming_filters, low_altitude, shear_factor, wind_params
from ..scenarios import Scenario
from .loop import Params

LATERAL = {"bank": BANK, "heading": HEADING, "course": COURSE, "track": TRACK}
VANES = ("alpha", "beta")
IMU = ("ax", "ay", "az")
MINIMUM_RATE_HZ = 100.0


class Prepared(NamedTuple):
    """A scenario ready to fly; nothing in it depends on the seed.

    params: of the loop, with sensor offsets and start values for `steps` steps. plant: first state. pilot:
    first state of the autopilot. servos: surfaces, then "throttle". sensors: in the order of
    params.sensors. extra_delay: longest delay faults add to servos and to sensors, s. ideal: channels with
    a sensor nobody specified.
    """

    scenario: Scenario
    aircraft: Aircraft
    autopilot: Autopilot
    trim: Trim
    params: Params
    steps: int
    plant: State
    pilot: Any
    servos: tuple[str, ...]
    sensors: tuple[Sensor, ...]
    extra_delay: float
    ideal: tuple[str, ...]


def _changed_ns(aircraft: str) -> int:
    """When an aircraft file given by path was last written, ns; 0 for a shipped one."""
    return os.stat(aircraft).st_mtime_ns if aircraft.endswith(".toml") and os.path.exists(aircraft) else 0


@lru_cache(maxsize=16)
def _aircraft(name: str, changed_ns: int) -> Aircraft:
    return load_aircraft(name)


def changed_aircraft(aircraft: Aircraft, parameters: Mapping[str, tuple[float, float]]) -> Aircraft:
    """The aircraft with some numbers replaced (value in SI) or multiplied (NaN, factor)."""
    if not parameters:
        return aircraft
    numbers = dict(aircraft.numbers)
    for path, (value, factor) in parameters.items():
        if path not in numbers:
            raise WrongUse(
                f"aircraft {aircraft.name!r} has no number {path!r}; see `aerofdi info {aircraft.name}`"
            )
        old = numbers[path]
        new = factor * np.asarray(old.value) if math.isnan(value) else np.asarray(float(value))
        numbers[path] = old._replace(value=float(new) if new.ndim == 0 else new)
    return replace(aircraft, numbers=numbers)


def _rates(s: Scenario, autopilot: Autopilot) -> tuple[float, int, int]:
    """Step in s, steps between autopilot instants and between truth records."""
    control = autopilot.module.RATE_HZ if math.isnan(s.rates.control) else s.rates.control
    if math.isnan(s.rates.dynamics):
        dynamics = control * math.ceil(MINIMUM_RATE_HZ / control - 1e-9)
    else:
        dynamics = s.rates.dynamics
    dt = 1.0 / dynamics
    record = control if math.isnan(s.rates.record) else s.rates.record
    return dt, whole_steps(control, dt, "the autopilot"), whole_steps(record, dt, "the record of truth")


def _servos(aircraft: Aircraft, dt: float) -> tuple[tuple[str, ...], Array, ActuatorParams]:
    rows = [
        Servo(ACTUATOR_ORDER[f.actuator], f.bandwidth, f.damping, f.lower, f.upper, f.rate_limit, f.delay)
        for f in aircraft.surfaces
    ]
    rows.append(Servo(0, 1.0, 1.0, 0.0, 1.0, math.inf, 0.0))
    names = (*(f.name for f in aircraft.surfaces), THROTTLE)
    return names, np.array([(r.lower, r.upper) for r in rows]), actuator_params(rows, dt)


def _sensors(s: Scenario, aircraft: Aircraft, control_hz: float) -> tuple[list[Sensor], tuple[str, ...]]:
    """The aircraft's sensors with the scenario's changes; what the autopilot needs beside them is ideal."""
    own = {c: Sensor(c, a.rate, a.noise) for c, a in aircraft.sensors.items()}
    needed = [c for c in (*Measured._fields, *IMU) if c not in VANES]
    ideal = tuple(c for c in needed if c not in own and c not in s.sensors)
    own |= {c: Sensor(c, control_hz) for c in needed if c not in own}
    for channel, changes in s.sensors.items():
        own[channel] = Sensor(**{**own.get(channel, Sensor(channel, control_hz))._asdict(), **changes})
    return [x._replace(sigma=x.sigma * s.noise_factor) for x in own.values()], ideal


def _wind(s: Scenario, span: float, dt: float) -> WindParams:
    w = s.wind
    north, east = -w.speed * math.cos(w.direction), -w.speed * math.sin(w.direction)
    filters = None
    if w.turbulence is not None:
        sigma, length = w.turbulence.sigma, w.turbulence.length
        if sigma is None or length is None:
            sigma, length = low_altitude(s.start.altitude, w.turbulence.wind_20ft)  # type: ignore[assignment]
        filters = forming_filters(w.turbulence.model, sigma, length, s.start.airspeed, span)
    gusts = [(g.start_s, *g.velocity, *g.length, float(g.stays)) for g in w.gusts]
    return wind_params(dt, (north, east, -w.up), w.reference_height, w.roughness, filters, gusts)


def _plan(s: Scenario, autopilot: Autopilot) -> guidance.Plan:
    track = s.guidance.track
    columns = s.columns()
    return guidance.plan(
        columns["t_s"],
        columns["airspeed"],
        columns["altitude"],
        np.unwrap(columns["angle"]) if s.guidance.lateral in ("heading", "course") else columns["angle"],
        LATERAL[s.guidance.lateral],
        track.north if track else (),
        track.east if track else (),
        autopilot.guidance,
    )


def _first_readings(t: Trim, x: State, wind: Wind, heading: float) -> Measured:
    """What ideal sensors read in trim."""
    velocity = t.airspeed * math.cos(t.climb_angle)
    return Measured(
        x.p, x.q, x.r, t.phi, t.theta, heading, t.airspeed, t.alpha, t.beta, t.altitude,
        t.airspeed * math.sin(t.climb_angle), x.north, x.east,
        velocity * math.cos(heading) + wind.north, velocity * math.sin(heading) + wind.east,
    )  # fmt: skip


def _delay_room(faults: tuple[Fault, ...]) -> float:
    return sum(f.value for f in faults if f.mode == "delayed")


def _faults(
    s: Scenario,
    aircraft: Aircraft,
    servos: tuple[str, ...],
    limits: Array,
    rest: Array,
    sensors: list[str],
    dt: float,
) -> FaultTable:
    if any(f.mode == "icing" for f in s.faults) and not aircraft.has_icing:
        raise WrongUse(
            f"scenario {s.name!r}: aircraft {aircraft.name!r} has no [aero.icing] factors, so icing would do nothing; "
            f"add them to the aircraft file or fly another aircraft"
        )
    return fault_table(s.faults, servos[:-1], limits, rest, sensors, dt)


def prepare(scenario: Scenario) -> Prepared:
    """Everything about a flight but its seed; the last scenarios prepared are remembered.

    Raises WrongUse for what does not fit together, NoTrim where the aircraft cannot fly steadily at the start.
    Nothing may write into what it returns.
    """
    key = (repr(scenario), _changed_ns(scenario.aircraft))
    if key not in _RECENT:
        while len(_RECENT) >= REMEMBERED:
            _RECENT.pop(next(iter(_RECENT)), None)
        _RECENT[key] = _prepare(scenario)
    return _RECENT[key]


REMEMBERED = 32
_RECENT: dict[tuple[str, int], Prepared] = {}


def _prepare(s: Scenario) -> Prepared:
    aircraft = changed_aircraft(_aircraft(s.aircraft, _changed_ns(s.aircraft)), s.parameters)
    autopilot = autopilot_of(aircraft.autopilot, s.autopilot, s.variant, who=f"scenario {s.name!r}")
    dt, control_every, record_every = _rates(s, autopilot)
    plant = plant_params(aircraft)
    steady = trim(aircraft, s.start.airspeed, s.start.altitude, climb_angle=s.start.climb_angle, params=plant)
    servos, limits, actuators = _servos(aircraft, dt)
    rest = np.array([*steady.surfaces[: len(servos) - 1], steady.throttle])
    wind = _wind(s, aircraft.number("reference.span"), dt)
    sensors, ideal = _sensors(s, aircraft, 1.0 / (dt * control_every))
    order = [sensors[i] for i in sensor_order(sensors, dt)]
    delay_faults = any(q.mode == "delayed" and q.target.startswith("sensor.") for q in s.faults)
    channels = [q.channel for q in order]
    params = Params(
        plant=plant,
        wind=wind,
        actuators=actuators,
        sensors=sensor_params(order, dt, delay_faults),
        faults=_faults(s, aircraft, servos, limits, rest, channels, dt),
        plan=_plan(s, autopilot),
        gains=autopilot.gains,
        feed=np.array(
            [channels.index(c) if c in channels else len(channels) for c in Measured._fields], np.int64
        ),
        route=_route(s, autopilot, aircraft, servos),
        trim=rest,
        dt=dt,
        control_every=control_every,
        record_every=record_every,
    )
    x, pilot = _first_states(s, autopilot, steady, wind, servos, rest)
    steps = max(1, round(s.duration_s / dt))
    room = _delay_room(s.faults)
    return Prepared(
        s, aircraft, autopilot, steady, params, steps, x, pilot, servos, tuple(order), room, ideal
    )


def _route(s: Scenario, autopilot: Autopilot, aircraft: Aircraft, servos: tuple[str, ...]) -> Any:
    """Field of the controller's Command for each servo, -1 for none."""
    command = autopilot.module.Command._fields
    unknown = [c for c in command if c not in servos]
    if unknown:
        raise WrongUse(
            f"scenario {s.name!r}: autopilot {autopilot.name!r} commands {', '.join(unknown)}, "
            f"but aircraft {aircraft.name!r} has {', '.join(servos)}"
        )
    return np.array([command.index(n) if n in command else -1 for n in servos], np.int64)


def _first_states(
    s: Scenario, autopilot: Autopilot, steady: Trim, wind: WindParams, servos: tuple[str, ...], rest: Array
) -> tuple[State, Any]:
    """Plant and autopilot in trim at the start, in the steady wind of that height."""
    f = shear_factor(wind, s.start.altitude)
    air = Wind(f * wind.steady[0], f * wind.steady[1], f * wind.steady[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    x = steady.placed(s.start.north, s.start.east, s.start.heading, air)
    module = autopilot.module
    first = module.Command(**{n: float(rest[servos.index(n)]) for n in module.Command._fields})
    return x, module.init(autopilot.gains, first, _first_readings(steady, x, air, s.start.heading))
