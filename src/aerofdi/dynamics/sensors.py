"""Sensors: every channel with its own rate, noise, bias, drift and delay, and the faults of `faults`.

    z = x(t - delay) + bias + turn-on bias + drift t + walk(t) + sigma n

with n a standard normal number per sample; the turn-on bias is drawn once per run, the walk has the
standard deviation walk sqrt(t). Heading and course are wrapped to [-pi, pi). A sensor samples every
`period` steps of the loop, at the loop's time, and its reading holds until the next. Not modelled:
quantisation, bandwidth other than the delay, misalignment, correlation between axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import NamedTuple

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.delay_line import delay_fill, delay_step, delay_width
from ..parts.ops import cos, floor, lean, merged, pi, sin, sqrt
from ..parts.random import normal4
from .faults import S_ADD, S_FROZEN, S_LATER, S_OFF, S_SIGMA
from .types import Outputs, State

TRUE = {
    "p": "rad/s", "q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad", "psi": "rad",
    "airspeed": "m/s", "alpha": "rad", "beta": "rad", "altitude": "m", "climb_rate": "m/s",
    "north": "m", "east": "m", "velocity_north": "m/s", "velocity_east": "m/s",
    "ax": "m/s2", "ay": "m/s2", "az": "m/s2", "u": "m/s", "v": "m/s", "w": "m/s",
    "groundspeed": "m/s", "course": "rad", "engine_speed": "rad/s", "fuel_mass": "kg",
}  # fmt: skip
"""Channel -> unit of everything a sensor may look at; the first 15 in the order of `autopilot.Measured`.

u, v, w are the velocity relative to the air in body axes; velocity_north and _east are over ground.
"""

NOISE_CHANNEL, WALK_CHANNEL, TURN_ON_CHANNEL, FAULT_CHANNEL = 64, 128, 192, 256
WRAPPED = ("psi", "course")


class Sensor(NamedTuple):
    """One channel, in its SI unit: rate_hz samples per second; sigma per sample; bias; bias_sigma of the
    turn-on

    bias; drift per s; walk per root of a second; delay_s.
    """

    channel: str
    rate_hz: float
    sigma: float = 0.0
    bias: float = 0.0
    bias_sigma: float = 0.0
    drift: float = 0.0
    walk: float = 0.0
    delay_s: float = 0.0


class SensorParams(NamedTuple):
    """One row per sensor, sorted by period.

    source: index into TRUE. number: (n, 7) sigma, bias, bias_sigma, drift, walk, delay in steps, 1 where
    wrapped. groups: (g, 3) first, one past the last, period in steps. offset: (n,) place of each sensor's
    samples in the record. delayed: 1 where any delay or delay fault needs the true values of every step.
    dt_s: the step.
    """

    source: np.ndarray
    number: Array
    groups: np.ndarray
    offset: np.ndarray
    delayed: int
    dt_s: float


class SensorState(NamedTuple):
    """reading: (n + 1,) last readings, then a 0. seen: (n,) the (delayed) true values behind them.

    turn_on, walk: (n,) biases. line: (n, w) delay lines of true values. taken: (g,) samples so far.
    """

    reading: Array
    seen: Array
    turn_on: Array
    walk: Array
    line: Array
    taken: np.ndarray


SIGMA, BIAS, BIAS_SIGMA, DRIFT, WALK, DELAY, WRAP = range(7)


def whole_steps(rate_hz: float, dt_s: float, who: str) -> int:
    """Steps of dt_s between samples at rate_hz; WrongUse unless that is a whole number."""
    if not rate_hz > 0:
        raise WrongUse(f"{who}: the rate must be above 0 Hz, got {rate_hz}")
    steps = 1.0 / (rate_hz * dt_s)
    if round(steps) < 1 or abs(steps - round(steps)) > 1e-6 * steps:
        raise WrongUse(
            f"{who}: {rate_hz:g} Hz is not a whole fraction of the dynamics rate {1 / dt_s:g} Hz; "
            f"choose rates that divide it"
        )
    return round(steps)


def sensor_params(sensors: Sequence[Sensor], dt_s: float, delay_faults: bool = False) -> SensorParams:
    """Numbers for a loop of step dt_s; sensors come out sorted by period (then as given): see
    `sensor_order`.
    """
    order = sensor_order(sensors, dt_s)
    rows = [sensors[i] for i in order]
    names = list(TRUE)
    for s in rows:
        if s.channel not in TRUE:
            raise WrongUse(f"sensor {s.channel!r} is not a channel; channels are {', '.join(names)}")
        if not (s.sigma >= 0 and s.bias_sigma >= 0 and s.walk >= 0 and s.delay_s >= 0):
            raise WrongUse(f"sensor {s.channel!r}: sigma, bias_sigma, walk and delay must be 0 or more")
    periods = [whole_steps(s.rate_hz, dt_s, f"sensor {s.channel!r}") for s in rows]
    starts = [i for i in range(len(rows)) if i == 0 or periods[i] != periods[i - 1]]
    ends = [*starts[1:], len(rows)]
    number = [
        (s.sigma, s.bias, s.bias_sigma, s.drift, s.walk, _steps(s.delay_s, dt_s), float(s.channel in WRAPPED))
        for s in rows
    ]
    return SensorParams(
        np.array([names.index(s.channel) for s in rows], dtype=np.int64),
        np.array(number, float).reshape(-1, 7),
        np.array([(a, b, periods[a]) for a, b in zip(starts, ends, strict=True)], np.int64).reshape(-1, 3),
        np.zeros(len(rows), dtype=np.int64),
        int(delay_faults or any(s.delay_s > 0 for s in rows)),
        dt_s,
    )


def _steps(delay_s: float, dt_s: float) -> float:
    steps = delay_s / dt_s
    return float(round(steps)) if abs(steps - round(steps)) < 1e-9 else steps


def sensor_order(sensors: Sequence[Sensor], dt_s: float) -> list[int]:
    """The order in which `sensor_params` puts the sensors: by period, then as given."""
    return sorted(
        range(len(sensors)), key=lambda i: whole_steps(sensors[i].rate_hz, dt_s, sensors[i].channel)
    )


def sensor_offsets(params: SensorParams, steps: int) -> tuple[SensorParams, list[int]]:
    """The params with places for `steps` steps of the loop, and how many samples each sensor takes."""
    counts = []
    for first, last, period in params.groups:
        counts += [-(-steps // int(period))] * int(last - first)
    offset = np.concatenate(([0], np.cumsum(counts)))[:-1].astype(np.int64)
    return params._replace(offset=offset), counts


def sensor_state(params: SensorParams, extra_delay_s: float = 0.0) -> SensorState:
    """All zeros; `sensors_start` draws the turn-on biases. extra_delay_s: room for faults that delay more."""
    n = len(params.source)
    longest = float(params.number[:, DELAY].max(initial=0.0)) + extra_delay_s / params.dt_s
    width = delay_width(longest + 1.0) if params.delayed else 2
    return SensorState(
        np.zeros(n + 1),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros((n, width)),
        np.zeros(len(params.groups), np.int64),
    )


@merged
def true_values(x: State, z: Outputs, velocity: tuple[float, float, float], truth: Array) -> None:
    """Fill truth (25,) in the order of TRUE. velocity: north, east, down over ground, m/s."""
    truth[0], truth[1], truth[2] = x.p, x.q, x.r
    truth[3], truth[4], truth[5] = z.phi, z.theta, z.psi
    truth[6], truth[7], truth[8] = z.airspeed, z.alpha, z.beta
    truth[9], truth[10] = z.altitude, z.climb_rate
    truth[11], truth[12], truth[13], truth[14] = x.north, x.east, velocity[0], velocity[1]
    truth[15], truth[16], truth[17] = z.ax, z.ay, z.az
    truth[18] = z.airspeed * cos(z.beta) * cos(z.alpha)
    truth[19] = z.airspeed * sin(z.beta)
    truth[20] = z.airspeed * cos(z.beta) * sin(z.alpha)
    truth[21], truth[22], truth[23], truth[24] = z.groundspeed, z.course, x.engine, x.fuel


@lean
def sensors_start(params: SensorParams, state: SensorState, truth: Array, seed: int, run: int) -> None:
    """Before the first step: turn-on biases drawn, delay lines full of the first true values."""
    state.taken[:] = 0
    for i in range(params.source.shape[0]):
        draw = normal4(seed, run, TURN_ON_CHANNEL + i // 4, i)
        state.turn_on[i] = params.number[i, BIAS_SIGMA] * draw[i % 4]
        state.walk[i] = 0.0
        state.reading[i] = 0.0
        if params.delayed:
            state.line[i, 0] = 0.0
            delay_fill(state.line[i], truth[params.source[i]])


@merged
def _reading(n: Array, s: SensorState, i: int, fault: Array, t: float, noise: float) -> float:
    """What sensor i says about the (delayed) true value it sees."""
    z = s.seen[i] + n[BIAS] + s.turn_on[i] + n[DRIFT] * t + s.walk[i] + n[SIGMA] * noise + fault[S_ADD]
    return z - 2.0 * pi * floor((z + pi) / (2.0 * pi)) if n[WRAP] > 0.0 else z


@merged
def sensors_due(params: SensorParams, k: int) -> bool:
    """Whether step k must fill `truth` for `sensors_step`: any sensor samples, or a delay line needs its
    input.
    """
    due = params.delayed > 0
    for g in range(params.groups.shape[0]):
        due = due or k % params.groups[g, 2] == 0
    return due


@merged
def sensors_step(
    params: SensorParams,
    state: SensorState,
    faults: Array,
    truth: Array,
    record: Array,
    seed: int,
    run: int,
    k: int,
    t: float,
) -> None:
    """Step k at time t: the sensors that are due read `truth` (25,).

    Their readings go to state.reading and, NaN where a sensor is off, to `record` at offset + sample
    number. faults: (n, 5) `Modified.sensor`.
    """
    for i in range(params.source.shape[0]):
        x = truth[params.source[i]]
        if params.delayed:
            x = delay_step(state.line[i], x, params.number[i, DELAY] + faults[i, S_LATER])
        state.seen[i] = x
    for g in range(params.groups.shape[0]):
        first, last, period = params.groups[g, 0], params.groups[g, 1], params.groups[g, 2]
        if k % period != 0:
            continue
        draw, block = (0.0, 0.0, 0.0, 0.0), -1
        for i in range(first, last):
            # Four sensors share a draw; ideal ones need none.
            if params.number[i, SIGMA] > 0.0 and i // 4 != block:
                block = i // 4
                draw = normal4(seed, run, NOISE_CHANNEL + block, k)
            if params.number[i, WALK] > 0.0 and k > 0:
                step = normal4(seed, run, WALK_CHANNEL + i // 4, k)
                state.walk[i] += params.number[i, WALK] * sqrt(period * params.dt_s) * step[i % 4]
            place = params.offset[i] + state.taken[g]
            if faults[i, S_OFF] > 0.0:
                record[place] = nan
                continue
            if faults[i, S_FROZEN] == 0.0:
                state.reading[i] = _reading(params.number[i], state, i, faults[i], t, draw[i % 4])
                if faults[i, S_SIGMA] > 0.0:
                    extra = normal4(seed, run, FAULT_CHANNEL + i // 4, k)
                    state.reading[i] += faults[i, S_SIGMA] * extra[i % 4]
            record[place] = state.reading[i]
        state.taken[g] += 1
