"""Aerosonde: airspeed, altitude and course hold by successive loop closure, 20 Hz.

The unknown-input-observer study flies an autopilot with a sampling period of 0.05 s that tracks airspeed,
altitude and course and says no more; the structure is that of Beard and McLain's textbook, whose aircraft
it is. Elevator trailing edge down positive; positive aileron (left down, right up) and rudder roll right.
Gains (all assumed) designed here:

    phi_ref   = k_chi (chi_ref - chi), limited
    da        = (k_phi + k_iphi/s) (phi_ref - phi) - k_p p
    theta_ref = (k_h + k_ih/s) (h_ref - h) - k_hd h' + lift feed-forward, limited
    de        = (k_theta + k_itheta/s) (theta_ref - theta) + k_q q + lift feed-forward
    throttle  = (k_v + k_iv/s) (V_ref - V)
    dr        = trim

The rudder of this parameter set rolls three times more than it yaws (Cl 0.105, Cn -0.032), so a damper on
it would work against the ailerons; the Dutch roll is damped by itself (0.42) and the rudder stays at trim.

Criteria: at least 20 dB and 45 deg in every loop from 18 to 25 m/s. Margins at 18 m/s, each loop broken at
its command with the others closed, with the 50 rad/s servo and the 20 Hz hold: aileron 24 dB, 72 deg;
elevator 28 dB up, 16 dB down, 47 deg; throttle 94 deg. Bandwidths: bank 3.5, course 0.7, altitude 0.9,
airspeed 1.9 rad/s.
"""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import jit
from . import loops
from .loops import airspeed_hold, altitude_hold, bank_hold, bank_reference, control, pitch_hold
from .signals import Measured, Reference

RATE_HZ = 20.0


class Gains(NamedTuple):
    """Gains in SI and rad, units in UNITS. Limits are of the commands;"""

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
    course_kp: float
    bank_max: float
    elevator_max: float
    aileron_max: float


UNITS = loops.UNITS | {"elevator_max": "rad", "aileron_max": "rad"}


class Command(NamedTuple):
    """elevator, ailerons (trailing edge down), rudder (rolls right): rad. throttle: 0 to 1."""

    elevator: float
    aileron_left: float
    aileron_right: float
    rudder: float
    throttle: float


class State(NamedTuple):
    """bank_ref, pitch_ref:

    references of the inner loops at the last step, rad. The integrals hold the trim.
    """

    bank_ref: float
    pitch_ref: float
    bank_integral: float
    pitch_integral: float
    altitude_integral: float
    airspeed_integral: float
    rudder: float


def init(gains: Gains, trim: Command, z: Measured) -> State:
    """The state that goes on in trim: with z as reference and measurement, the first command is `trim`.

    trim: the commands of the trimmed aircraft. z: what its sensors then read (bank may be that of a turn).
    """
    return State(
        bank_ref=z.phi,
        pitch_ref=z.theta,
        bank_integral=trim.aileron_left - gains.roll_rate_kp * z.p,
        pitch_integral=trim.elevator - loops.pitch_feed(gains, z.airspeed, z),
        altitude_integral=z.theta - loops.altitude_feed(gains, z.airspeed, z),
        airspeed_integral=trim.throttle,
        rudder=trim.rudder,
    )


@control.register(Gains)
@jit
def step(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[State, Command]:
    """One control step of dt seconds: (next state, commands within their limits)."""
    phi_ref = bank_reference(g, ref, z)
    ih, theta_ref = altitude_hold(g, s.altitude_integral, z.altitude, ref, z, dt)
    it, de = pitch_hold(g, s.pitch_integral, theta_ref, ref, z, -g.elevator_max, g.elevator_max, dt)
    ib, da = bank_hold(g, s.bank_integral, phi_ref, z.phi, z.p, g.aileron_max, dt)
    iv, throttle = airspeed_hold(g, s.airspeed_integral, z.airspeed, z.altitude, ref, dt)
    return State(phi_ref, theta_ref, ib, it, ih, iv, s.rudder), Command(de, da, -da, s.rudder, throttle)
