"""Ultra Stick 120: the baseline autopilot of its university, and the sideslip loop of its split-rudder study.

Published law (gains of the public flight code; ailerons: right trailing edge down, left up positive, rolls
left; elevator trailing edge down positive; rudder trailing edge left positive):

    da        = (-0.52 - 0.20/s) (phi_ref - phi) + 0.07 p
    de        = (-0.84 - 0.23/s) (theta_ref - theta) + 0.08 q
    dr        = 0.065 s/(s + 2) r                                     baseline yaw damper
    phi_ref   = 1.2 (psi_ref - psi), limited to 45 deg
    theta_ref = (0.021 + 0.0017/s) (h_ref - h_f)                      f: low pass at 2 rad/s
    throttle  = (0.091 + 0.02/s) (V_ref - V_f)

The split-rudder study replaces the yaw damper by a tracker of zero sideslip and keeps a yaw-rate gain; both
rudder halves get the same command (its gains are not published and marked assumed):

    dr = (k_b + k_ib/s) (0 - beta) + k_r r

One law holds both: gains that are zero switch a part off. Every PI stops integrating where its surface is
limited.

Linear closed loop at 23 m/s with the 8 Hz actuators: sideslip loop with heading held, slowest pole -0.081
rad/s (12.3 s) and least damping 0.69; baseline least damping 0.32 (Dutch roll). Turn feed-forward gains are
designed here.
"""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import jit
from . import loops
from .loops import (
    airspeed_hold,
    altitude_hold,
    bank_hold,
    bank_reference,
    control,
    lag,
    pi_control,
    pitch_hold,
)
from .signals import Measured, Reference

RATE_HZ = 50.0


class Gains(NamedTuple):
    """Gains in SI and rad, units in UNITS. Poles in rad/s. Limits are of the commands."""

    bank_kp: float
    bank_ki: float
    roll_rate_kp: float
    pitch_kp: float
    pitch_ki: float
    pitch_rate_kp: float
    lift_elevator: float
    altitude_kp: float
    altitude_ki: float
    climb_kp: float
    lift_pitch: float
    trim_airspeed: float
    altitude_error_max: float
    pitch_min: float
    pitch_max: float
    airspeed_kp: float
    airspeed_ki: float
    energy_kp: float
    lowpass_pole: float
    course_kp: float
    bank_max: float
    washout_kp: float
    washout_pole: float
    beta_kp: float
    beta_ki: float
    yaw_rate_kp: float
    elevator_max: float
    aileron_max: float
    rudder_max: float


UNITS = loops.UNITS | {
    "lowpass_pole": "rad/s",
    "washout_kp": "rad/(rad/s)",
    "washout_pole": "rad/s",
    "beta_kp": "rad/rad",
    "beta_ki": "rad/(rad s)",
    "yaw_rate_kp": "rad/(rad/s)",
    "elevator_max": "rad",
    "aileron_max": "rad",
    "rudder_max": "rad",
}


class Command(NamedTuple):
    """Surfaces in rad: elevator and ailerons trailing edge down, rudders trailing edge left positive. throttle 0-1."""

    elevator: float
    aileron_left: float
    aileron_right: float
    rudder_top: float
    rudder_bottom: float
    throttle: float


class State(NamedTuple):
    """bank_ref, pitch_ref: references of the inner loops at the last step, rad. The integrals hold the trim.

    altitude, airspeed: low-passed measurements. yaw_rate: the slow part of r that the washout takes off.
    """

    bank_ref: float
    pitch_ref: float
    bank_integral: float
    pitch_integral: float
    altitude_integral: float
    airspeed_integral: float
    beta_integral: float
    altitude: float
    airspeed: float
    yaw_rate: float


def init(gains: Gains, trim: Command, z: Measured) -> State:
    """The state that goes on in trim: with z as reference and measurement, the first command is `trim`.

    trim: the commands of the trimmed aircraft. z: what its sensors then read (bank may be that of a turn).
    """
    return State(
        bank_ref=z.phi,
        pitch_ref=z.theta,
        bank_integral=trim.aileron_right - gains.roll_rate_kp * z.p,
        pitch_integral=trim.elevator - loops.pitch_feed(gains, z.airspeed, z),
        altitude_integral=z.theta - loops.altitude_feed(gains, z.airspeed, z),
        airspeed_integral=trim.throttle,
        beta_integral=trim.rudder_top + gains.beta_kp * z.beta - gains.yaw_rate_kp * z.r,
        altitude=z.altitude,
        airspeed=z.airspeed,
        yaw_rate=z.r,
    )


@jit
def _rudder(g: Gains, s: State, z: Measured, dt: float) -> tuple[float, float]:
    """(integral, rudder): sideslip tracker, yaw-rate gain and washed-out yaw damper in one."""
    feed = g.yaw_rate_kp * z.r + g.washout_kp * (z.r - s.yaw_rate)
    return pi_control(g.beta_kp, g.beta_ki, s.beta_integral, -z.beta, feed, -g.rudder_max, g.rudder_max, dt)


@control.register(Gains)
@jit
def step(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[State, Command]:
    """One control step of dt seconds: (next state, commands within their limits)."""
    altitude, airspeed = (
        lag(s.altitude, z.altitude, g.lowpass_pole, dt),
        lag(s.airspeed, z.airspeed, g.lowpass_pole, dt),
    )
    phi_ref = bank_reference(g, ref, z)
    ih, theta_ref = altitude_hold(g, s.altitude_integral, altitude, ref, z, dt)
    it, de = pitch_hold(g, s.pitch_integral, theta_ref, ref, z, -g.elevator_max, g.elevator_max, dt)
    ib, da = bank_hold(g, s.bank_integral, phi_ref, z.phi, z.p, g.aileron_max, dt)
    ir, dr = _rudder(g, s, z, dt)
    iv, throttle = airspeed_hold(g, s.airspeed_integral, airspeed, altitude, ref, dt)
    yaw_rate = lag(s.yaw_rate, z.r, g.washout_pole, dt)
    return (
        State(phi_ref, theta_ref, ib, it, ih, iv, ir, altitude, airspeed, yaw_rate),
        Command(de, -da, da, dr, dr, throttle),
    )
