"""Ducard's aircraft: attitude loops on independent surfaces, wide enough to answer a 1 Hz excitation.

The single-model active fault isolation study flies straight and level at 30 m/s with an autopilot it does
not describe, adds 2 deg at 1 Hz to one surface's command, and takes the answer of the autopilot in that
surface's own command as the sign of health. That sets the criterion here: with d the excitation of a
surface and c the amplitude of the autopilot's answer in its command at 1 Hz, the evaluator sees about 2/pi
(d - c) with d = 2 deg and compares with 0.01 rad, so c/d must be well above 0.55. Left and right share
every axis, so c/d is half the complementary sensitivity T(2 pi j) for ailerons and elevators: |T| must be
above 1.1, which means loops with their resonance at 1 Hz. Gains maximise c/d under max |S| <= 1.6 with
gyros of 0.08 rad/s and attitude of 0.1 deg a sample at 50 Hz:

    c/d at 1 Hz            aileron 0.65, elevator 0.65, rudder 0.76
    max |S|, phase margin  aileron 1.56, 43 deg; elevator 1.56, 44 deg; rudder 1.55, 60 deg
    gain margins           at least 11.9 dB up, 30 dB down
    bandwidths             altitude 0.41, airspeed 0.44, course 0.26 rad/s

The rudder holds sideslip to zero by its integral: a rudder that sticks off centre is then answered by a
rudder command that runs away from it, where without the integral the sideslip alone would balance it.

Attitude and rates go through a filter that knows they are angle and derivative (steady-state Kalman gains of
phi'' = white noise at the control period, gyros as noisy as published); measured yaw rate gets a slower one.
Surfaces in the file's signs: ailerons and elevators trailing edge up, rudder yaws right.

    phi_ref   = k_psi (psi_ref - psi), limited
    da        = (k_phi + k_iphi/s) (phi_ref - phi) - k_p p          aileron_left = -da, aileron_right = da
    theta_ref = (k_h + k_ih/s) (h_ref - h) - k_hd h' + lift feed-forward, limited
    de        = (k_theta + k_itheta/s) (theta_ref - theta) - k_q q + lift feed-forward        both elevators
    dr        = k_ibeta/s beta - k_r (r - g sin(phi)/V)                               beta low-passed
    throttle  = (k_v + k_iv/s) (V_ref - V)
"""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import jit, maximum, sin
from . import loops
from .loops import (
    GRAVITY,
    airspeed_hold,
    altitude_hold,
    bank_hold,
    bank_reference,
    control,
    lag,
    pi_control,
    pitch_hold,
    wrap,
)
from .signals import Measured, Reference

RATE_HZ = 50.0


class Gains(NamedTuple):
    """Gains in SI and rad, units in UNITS. Limits are of the commands.

    attitude_X_Y, heading_X_Y: correction of the predicted X by the difference between the measured and the
    predicted Y, for roll and pitch and for yaw, at the control period of 1/RATE_HZ.
    """

    bank_kp: float
    bank_ki: float
    roll_rate_kp: float
    yaw_rate_kp: float
    sideslip_ki: float
    sideslip_pole: float
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
    course_kp: float
    bank_max: float
    altitude_pole: float
    airspeed_pole: float
    attitude_angle_angle: float
    attitude_angle_rate: float
    attitude_rate_angle: float
    attitude_rate_rate: float
    heading_angle_angle: float
    heading_angle_rate: float
    heading_rate_angle: float
    heading_rate_rate: float
    elevator_max: float
    aileron_max: float
    rudder_max: float


UNITS = loops.UNITS | {
    "yaw_rate_kp": "rad/(rad/s)",
    "sideslip_ki": "rad/(rad s)",
    "sideslip_pole": "rad/s",
    "altitude_pole": "rad/s",
    "airspeed_pole": "rad/s",
    "attitude_angle_angle": "rad/rad",
    "attitude_angle_rate": "rad/(rad/s)",
    "attitude_rate_angle": "(rad/s)/rad",
    "attitude_rate_rate": "(rad/s)/(rad/s)",
    "heading_angle_angle": "rad/rad",
    "heading_angle_rate": "rad/(rad/s)",
    "heading_rate_angle": "(rad/s)/rad",
    "heading_rate_rate": "(rad/s)/(rad/s)",
    "elevator_max": "rad",
    "aileron_max": "rad",
    "rudder_max": "rad",
}


class Command(NamedTuple):
    """Ailerons and elevators (trailing edge up), rudder (yaws right): rad. throttle: 0 to 1."""

    aileron_left: float
    aileron_right: float
    elevator_left: float
    elevator_right: float
    rudder: float
    throttle: float


class State(NamedTuple):
    """bank_ref, pitch_ref: references of the inner loops at the last step, rad. The integrals hold the trim.

    phi .. r: filtered attitude and rates, predicted to the next step. altitude, climb_rate, airspeed:
    low-passed.
    """

    bank_ref: float
    pitch_ref: float
    bank_integral: float
    pitch_integral: float
    altitude_integral: float
    airspeed_integral: float
    rudder_integral: float
    sideslip: float
    phi: float
    p: float
    theta: float
    q: float
    psi: float
    r: float
    altitude: float
    climb_rate: float
    airspeed: float


def init(gains: Gains, trim: Command, z: Measured) -> State:
    """The state that goes on in trim: with z as reference and measurement, the first command is `trim`.

    trim: the commands of the trimmed aircraft. z: what its sensors then read (bank may be that of a turn).
    """
    return State(
        bank_ref=z.phi,
        pitch_ref=z.theta,
        bank_integral=0.5 * (trim.aileron_right - trim.aileron_left) - gains.roll_rate_kp * z.p,
        pitch_integral=0.5 * (trim.elevator_left + trim.elevator_right)
        - loops.pitch_feed(gains, z.airspeed, z),
        altitude_integral=z.theta - loops.altitude_feed(gains, z.airspeed, z),
        airspeed_integral=trim.throttle,
        rudder_integral=trim.rudder - gains.yaw_rate_kp * _yaw_beyond_turn(z),
        sideslip=z.beta,
        phi=z.phi,
        p=z.p,
        theta=z.theta,
        q=z.q,
        psi=z.psi,
        r=z.r,
        altitude=z.altitude,
        climb_rate=z.climb_rate,
        airspeed=z.airspeed,
    )


@jit
def _yaw_beyond_turn(z: Measured) -> float:
    """Yaw rate beyond that of a coordinated level turn, rad/s."""
    return z.r - GRAVITY * sin(z.phi) / maximum(z.airspeed, 1.0)


@jit
def _filtered(g: Gains, s: State, z: Measured, dt: float) -> Measured:
    """The measurement with attitude, rates, altitude, climb rate and airspeed replaced by their filtered
    values.
    """
    e, w = z.phi - s.phi, z.p - s.p
    phi = s.phi + g.attitude_angle_angle * e + g.attitude_angle_rate * w
    p = s.p + g.attitude_rate_angle * e + g.attitude_rate_rate * w
    e, w = z.theta - s.theta, z.q - s.q
    theta = s.theta + g.attitude_angle_angle * e + g.attitude_angle_rate * w
    q = s.q + g.attitude_rate_angle * e + g.attitude_rate_rate * w
    e, w = wrap(z.psi - s.psi), z.r - s.r
    psi = s.psi + g.heading_angle_angle * e + g.heading_angle_rate * w
    r = s.r + g.heading_rate_angle * e + g.heading_rate_rate * w
    airspeed = lag(s.airspeed, z.airspeed, g.airspeed_pole, dt)
    altitude = lag(s.altitude, z.altitude, g.altitude_pole, dt)
    climb = lag(s.climb_rate, z.climb_rate, g.altitude_pole, dt)
    return Measured(
        p, q, r, phi, theta, psi, airspeed, z.alpha, z.beta, altitude, climb,
        z.north, z.east, z.velocity_north, z.velocity_east,
    )  # fmt: skip


@control.register(Gains)
@jit
def step(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[State, Command]:
    """One control step of dt seconds: (next state, commands within their limits)."""
    z = _filtered(g, s, z, dt)
    phi_ref = bank_reference(g, ref, z)
    ih, theta_ref = altitude_hold(g, s.altitude_integral, z.altitude, ref, z, dt)
    it, de = pitch_hold(g, s.pitch_integral, theta_ref, ref, z, -g.elevator_max, g.elevator_max, dt)
    ib, da = bank_hold(g, s.bank_integral, phi_ref, z.phi, z.p, g.aileron_max, dt)
    beta = lag(s.sideslip, z.beta, g.sideslip_pole, dt)
    damper = g.yaw_rate_kp * _yaw_beyond_turn(z)
    ir, dr = pi_control(0.0, g.sideslip_ki, s.rudder_integral, beta, damper, -g.rudder_max, g.rudder_max, dt)
    iv, throttle = airspeed_hold(g, s.airspeed_integral, z.airspeed, z.altitude, ref, dt)
    return (
        State(
            phi_ref, theta_ref, ib, it, ih, iv, ir, beta,
            z.phi + dt * z.p, z.p, z.theta + dt * z.q, z.q, z.psi + dt * z.r, z.r,
            z.altitude, z.climb_rate, z.airspeed,
        ),
        Command(-da, da, de, de, dr, throttle),
    )  # fmt: skip
