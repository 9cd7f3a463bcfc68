"""The loop: wind, sensors, autopilot, actuators, faults and the plant, step after step, compiled as one
piece.

At step k, time t = k dt:

    1  the air and the faults of this instant; the state's derivative
    2  sensors that are due read the true values
    3  the autopilot, if due, reads the last readings and sets its commands
    4  servos move from t to t + dt under command + excitation
    5  the plant goes from t to t + dt, deflections linear in time over the step, wind held

so a sensor and a command stamped t know nothing later than t, and act from t on. `advance` is specialised
by the types inside its parameters (aerodynamics, propulsion, controller) and cached on disk once per
combination. The same source runs in plain Python.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..autopilot import guidance
from ..autopilot.loops import control
from ..autopilot.signals import Measured
from ..core.types import Array
from ..dynamics.actuators import ActuatorParams, ActuatorState, actuators_step
from ..dynamics.faults import FaultState, FaultTable, Modified, faults_now
from ..dynamics.plant import derivative, outputs, rk4_step
from ..dynamics.rigid_body import to_ned
from ..dynamics.sensors import (
    SensorParams,
    SensorState,
    sensors_due,
    sensors_start,
    sensors_step,
    true_values,
)
from ..dynamics.types import Effects, Outputs, State, Surfaces, Wind
from ..dynamics.wind import WindParams, WindState, wind_advance, wind_now, wind_start
from ..parts.ops import lean, merged

AIR = 6  # truth columns after those of sensors: wind north, east, down, and its rotation p, q, r
DIVERGED = 1e4  # m/s or rad/s: beyond this the flight is over


class Params(NamedTuple):
    """What a flight is made of; nothing here changes during it.

    feed: (15,) place in SensorState.reading of each field of autopilot.Measured, the one after the last
    sensor for none. route: (n,) field of the controller's Command for each servo, -1 where it stays at
    `trim` (n,). Steps of dt between: control_every, record_every (0: record no truth).
    """

    plant: Any
    wind: WindParams
    actuators: ActuatorParams
    sensors: SensorParams
    faults: FaultTable
    plan: guidance.Plan
    gains: Any
    feed: np.ndarray
    route: np.ndarray
    trim: Array
    dt: float
    control_every: int
    record_every: int


class Memory(NamedTuple):
    """Arrays the loop changes as it goes. command, excitation, total: (n,) per servo. truth: (25,) as
    sensors.TRUE.
    """

    wind: WindState
    actuators: ActuatorState
    sensors: SensorState
    faults: FaultState
    modified: Modified
    command: Array
    excitation: Array
    total: Array
    truth: Array


class Record(NamedTuple):
    """measured: all sensors' samples in one row, at sensors.offset. command: (control instants, n).

    reference: (control instants, 4) bank, pitch (rad), airspeed, altitude. truth: (record instants, 25 + 6
    + n + m).
    """

    measured: Array
    command: Array
    reference: Array
    truth: Array


class Motion(NamedTuple):
    """What moves from step to step: next step k, the plant, the autopilot's and the guidance's states."""

    k: int
    plant: State
    pilot: Any
    guide: guidance.State


@merged
def _surfaces(felt: Array) -> Surfaces:
    """The deflections as the plant's tuple of eight; felt has the throttle after the surfaces."""
    n = felt.shape[0] - 1
    return (
        felt[0],
        felt[1] if n > 1 else 0.0,
        felt[2] if n > 2 else 0.0,
        felt[3] if n > 3 else 0.0,
        felt[4] if n > 4 else 0.0,
        felt[5] if n > 5 else 0.0,
        felt[6] if n > 6 else 0.0,
        felt[7] if n > 7 else 0.0,
    )


@merged
def _effects(e: Array) -> Effects:
    return Effects(e[0], e[1], e[2], e[3], e[4], e[5])


@merged
def measured(f: np.ndarray, r: Array) -> Measured:
    """The last readings as the autopilot sees them; the place after the last sensor always reads 0."""
    return Measured(
        r[f[0]], r[f[1]], r[f[2]], r[f[3]], r[f[4]], r[f[5]], r[f[6]], r[f[7]],
        r[f[8]], r[f[9]], r[f[10]], r[f[11]], r[f[12]], r[f[13]], r[f[14]],
    )  # fmt: skip


@merged
def _look(truth: Array, x: State, z: Outputs) -> None:
    """Fill the true values of this instant."""
    true_values(x, z, to_ned(x.e0, x.e1, x.e2, x.e3, x.u, x.v, x.w), truth)


@merged
def _record_truth(truth: Array, felt: Array, size: Array, out: Array, row: int, x: State, wind: Wind) -> None:
    n = truth.shape[0]
    for i in range(n):
        out[row, i] = truth[i]
    north, east, down = to_ned(x.e0, x.e1, x.e2, x.e3, wind.u, wind.v, wind.w)
    out[row, n], out[row, n + 1], out[row, n + 2] = wind.north + north, wind.east + east, wind.down + down
    out[row, n + 3], out[row, n + 4], out[row, n + 5] = wind.p, wind.q, wind.r
    n += AIR
    for i in range(felt.shape[0]):
        out[row, n + i] = felt[i]
    n += felt.shape[0]
    for i in range(size.shape[0]):
        out[row, n + i] = size[i]


@merged
def _record_command(route: np.ndarray, trim: Array, command: Any, kept: Array, out: Array, row: int) -> None:
    """Route the controller's commands to the servos, and put them on record."""
    for i in range(kept.shape[0]):
        kept[i] = command[route[i]] if route[i] >= 0 else trim[i]
        out[row, i] = kept[i]


@merged
def _record_reference(
    out: Array, row: int, bank: float, pitch: float, airspeed: float, altitude: float
) -> None:
    out[row, 0], out[row, 1], out[row, 2], out[row, 3] = bank, pitch, airspeed, altitude


@merged
def _flies(x: State) -> bool:
    """False once anything is not finite or absurd; NaN compares false."""
    speed = x.u * x.u + x.v * x.v + x.w * x.w
    spin = x.p * x.p + x.q * x.q + x.r * x.r
    return speed < DIVERGED * DIVERGED and spin < DIVERGED * DIVERGED and x.engine * x.engine < 1e12


@lean
def advance(
    p: Params, m: Memory, out: Record, motion: Motion, seed: int, run: int, stop: int, request: int
) -> Motion:
    """Steps motion.k .. stop - 1; returns the motion at `stop`, or earlier where the flight has diverged.

    Step 0 also draws the first turbulence and the turn-on biases, and fills the sensors' delay lines with
    the first true values (every sensor samples at step 0).
    """
    x, pilot, guide = motion.plant, motion.pilot, motion.guide
    felt, last = m.actuators.felt, m.actuators.felt.shape[0] - 1
    k = motion.k
    while k < stop and _flies(x):
        t = k * p.dt
        if k == 0:
            wind_start(p.wind, m.wind, seed, run)
        wind = wind_now(p.wind, m.wind, -x.down)
        if t >= p.faults.first_s - 1e-9:
            faults_now(p.faults, m.faults, m.modified, m.actuators.position, t, m.truth[7], m.truth[8])
        effects = _effects(m.modified.effects)
        surfaces, throttle = _surfaces(felt), felt[last]
        k1 = derivative(p.plant, x, surfaces, throttle, wind, effects)
        recording = p.record_every > 0 and k % p.record_every == 0
        sensing = sensors_due(p.sensors, k)
        if sensing or recording:
            _look(m.truth, x, outputs(p.plant, x, k1, wind))
        if k == 0:
            sensors_start(p.sensors, m.sensors, m.truth, seed, run)
        if sensing:
            sensors_step(p.sensors, m.sensors, m.modified.sensor, m.truth, out.measured, seed, run, k, t)
        if recording:
            row = k // p.record_every
            _record_truth(m.truth, felt, m.faults.size, out.truth, row, x, wind)
        if k % p.control_every == 0:
            z = measured(p.feed, m.sensors.reading)
            guide, ref = guidance.step(p.plan, guide, z, t, request)
            pilot, command = control(p.gains, pilot, ref, z, p.dt * p.control_every)
            row = k // p.control_every
            _record_command(p.route, p.trim, command, m.command, out.command, row)
            _record_reference(out.reference, row, pilot.bank_ref, pilot.pitch_ref, ref.airspeed, ref.altitude)
        for i in range(last + 1):
            m.total[i] = m.command[i] + m.excitation[i]
        actuators_step(p.actuators, m.actuators, m.modified.servo, m.total)
        x = rk4_step(p.plant, x, k1, surfaces, throttle, _surfaces(felt), felt[last], wind, effects, p.dt)
        wind_advance(p.wind, m.wind, seed, run, k, t, m.truth[6], p.dt)
        k += 1
    return Motion(k, x, pilot, guide)
