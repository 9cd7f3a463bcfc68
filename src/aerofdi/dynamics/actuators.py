"""Actuators: command -> transport delay -> (fault) -> servo with limits -> (fault) -> deflection the air
feels.

One row per servo: the surfaces in the order of the aircraft file, then the throttle (limits 0 and 1). The
servo is `parts.servo`, exact for a command held over the step; the delay is `parts.delay_line`. Where a
fault enters is stated in `faults`. Not modelled: backlash, hinge moments, supply voltage.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.delay_line import delay_fill, delay_step, delay_width
from ..parts.ops import lean, merged
from ..parts.servo import RATE, servo_coefficients, servo_step
from .faults import ABOUT, ADD, DRIVEN, FLOAT_TIME_S, FROZEN, GOAL, HOLD, LATER, SCALE, TRAILING
from .faults import RATE as FAULT_RATE


class Servo(NamedTuple):
    """One actuator as an aircraft file describes it, SI and rad: see `parts.servo`; delay_s is before the
    servo.
    """

    order: int
    bandwidth: float
    damping: float
    lower: float
    upper: float
    rate: float
    delay_s: float


class ActuatorParams(NamedTuple):
    """servo: (n, 8) rows of `servo_coefficients`. delay: (n,) in steps. dt_s: the step. trail: decay of
    floating.
    """

    servo: Array
    delay: Array
    dt_s: float
    trail: float


class ActuatorState(NamedTuple):
    """position, speed: (n,) of the servos. felt: (n,) what the air feels. line: (n, w) delay lines. row:
    (8,) scratch.
    """

    position: Array
    speed: Array
    felt: Array
    line: Array
    row: Array


def actuator_params(servos: Sequence[Servo], dt_s: float) -> ActuatorParams:
    """Exact coefficients for a step of dt_s seconds."""
    rows = [
        servo_coefficients(s.order, s.bandwidth, s.damping, s.lower, s.upper, s.rate, dt_s) for s in servos
    ]
    delays = np.array([s.delay_s / dt_s for s in servos])
    if not (np.isfinite(delays).all() and (delays >= 0).all()):
        raise WrongUse(f"an actuator's delay must be 0 s or more, got {[s.delay_s for s in servos]}")
    # A delay that is a whole number of steps up to rounding is one.
    whole = np.round(delays)
    delays = np.where(np.abs(delays - whole) < 1e-9, whole, delays)
    return ActuatorParams(np.array(rows).reshape(-1, 8), delays, dt_s, math.exp(-dt_s / FLOAT_TIME_S))


def actuator_state(params: ActuatorParams, trim: Any, extra_delay_s: float = 0.0) -> ActuatorState:
    """At rest in trim (n,), as if it had been commanded for ever; room for faults that delay by
    extra_delay_s more.
    """
    n = len(params.delay)
    longest = float(params.delay.max(initial=0.0)) + extra_delay_s / params.dt_s
    state = ActuatorState(
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, delay_width(longest + 1.0))), np.zeros(8)
    )
    actuators_rest(state, np.asarray(trim, float))
    return state


@lean
def actuators_rest(state: ActuatorState, trim: Array) -> None:
    """Put every servo at rest at trim (n,), its delay line full of that command."""
    for i in range(state.position.shape[0]):
        state.position[i] = state.felt[i] = trim[i]
        state.speed[i] = 0.0
        state.line[i, 0] = 0.0
        delay_fill(state.line[i], trim[i])


@merged
def actuators_step(params: ActuatorParams, state: ActuatorState, faults: Array, command: Array) -> None:
    """One step: command (n,) held over it -> position, speed and `felt` at its end. faults: (n, 7)
    `Modified.servo`.
    """
    for i in range(command.shape[0]):
        f, c = faults[i], params.servo[i]
        u = delay_step(state.line[i], command[i], params.delay[i] + f[LATER]) + f[ADD]
        x, v = state.position[i], state.speed[i]
        if f[HOLD] == FROZEN:
            v = 0.0
        elif f[HOLD] == TRAILING:
            moved = f[GOAL] + (x - f[GOAL]) * params.trail
            v = (moved - x) / params.dt_s
            x = moved
        else:
            u = f[GOAL] if f[HOLD] == DRIVEN else u
            if f[FAULT_RATE] < c[RATE]:
                for j in range(c.shape[0]):
                    state.row[j] = c[j]
                state.row[RATE] = f[FAULT_RATE]
                x, v = servo_step(state.row, x, v, u)
            else:
                x, v = servo_step(c, x, v, u)
        state.position[i], state.speed[i] = x, v
        state.felt[i] = f[ABOUT] + f[SCALE] * (x - f[ABOUT])
