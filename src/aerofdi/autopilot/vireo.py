"""Vireo: roll PI with roll-rate feedback, pitch damper, altitude and airspeed loops, mixed onto two elevons.

Source: the comparison of three fault detectors on the Vireo (Venkataraman, Bauer, Seiler, Vanek). From it:

    da = (-0.34 - 0.086/s) (phi_cmd - phi) + 0.06 p          K_A
    de = +0.05 q                                              K_PD; its figure has the minus sign outside
    elevon_left = de - da,  elevon_right = de + da            trailing edge down positive

With de = -0.05 q the short period would lose its damping (-0.95 +- 13.1j instead of -10.2 +- 11.9j).

Not in the source, designed here (gains marked assumed):

    theta_ref = (k_h + k_ih/s) (h_ref - h) - k_hd h' + k_turn (1/cos(phi) - 1)
    de        = (k_theta + k_itheta/s) (theta - theta_ref) + 0.05 (q - g tan(phi) sin(phi) / V)
                + k_de (1/cos(phi) - 1)
    throttle  = (k_v + k_iv/s) (V_ref - V)
    phi_cmd   = k_course (course_ref - course), limited

The pitch rate of a coordinated turn is taken off q so that the damper does not fight a banked corner; wings
level it is the damper of the source. Elevator has priority but leaves `roll_reserve` of elevon travel to
the ailerons; every integrator stops where its own command is limited.

Criteria and margins at 15.4 m/s, each loop broken at its command, the others closed, with the elevon's
servo and the total delay of 0.05 s: roll 6.7 dB and 65 deg (as published gains give), elevator -14.5/+6.7
dB and 80 deg, throttle 25 dB and 73 deg (with a motor lag of 0.1 s). Bandwidths (-3 dB): bank 1.8, altitude
0.80, airspeed 0.72 rad/s. At 19 m/s the published roll and pitch gains alone leave 3.8 dB; nothing here is
scheduled with speed.
"""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import atan2, clip, jit, minimum
from .loops import load_rise, pi_control, turn_pitch_rate, wrap
from .signals import COURSE, HEADING, Measured, Reference

RATE_HZ = 92.0


class Gains(NamedTuple):
    """Gains in SI and rad; see UNITS. Integral gains are per second. Limits are of the commands."""

    roll_kp: float
    roll_ki: float
    roll_rate_kp: float
    pitch_kp: float
    pitch_ki: float
    pitch_rate_kp: float
    altitude_kp: float
    altitude_ki: float
    climb_kp: float
    turn_pitch: float
    turn_elevator: float
    airspeed_kp: float
    airspeed_ki: float
    course_kp: float
    bank_max: float
    pitch_min: float
    pitch_max: float
    altitude_error_max: float
    elevon_min: float
    elevon_max: float
    roll_reserve: float


UNITS = {
    "roll_kp": "rad/rad",
    "roll_ki": "rad/(rad s)",
    "roll_rate_kp": "rad/(rad/s)",
    "pitch_kp": "rad/rad",
    "pitch_ki": "rad/(rad s)",
    "pitch_rate_kp": "rad/(rad/s)",
    "altitude_kp": "rad/m",
    "altitude_ki": "rad/(m s)",
    "climb_kp": "rad/(m/s)",
    "turn_pitch": "rad",
    "turn_elevator": "rad",
    "airspeed_kp": "1/(m/s)",
    "airspeed_ki": "1/m",
    "course_kp": "rad/rad",
    "bank_max": "rad",
    "pitch_min": "rad",
    "pitch_max": "rad",
    "altitude_error_max": "m",
    "elevon_min": "rad",
    "elevon_max": "rad",
    "roll_reserve": "rad",
}


class Command(NamedTuple):
    """elevon_left, elevon_right: rad, trailing edge down positive. throttle: 0 to 1."""

    elevon_left: float
    elevon_right: float
    throttle: float


class State(NamedTuple):
    """bank_ref, pitch_ref:

    references of the inner loops at the last step, rad. The integrals hold the trim.
    """

    bank_ref: float
    pitch_ref: float
    roll_integral: float
    pitch_integral: float
    altitude_integral: float
    throttle_integral: float


def init(gains: Gains, trim: Command, z: Measured) -> State:
    """The state that goes on in trim: with z as reference and measurement, the first command is `trim`.

    trim: the commands of the trimmed aircraft. z: what its sensors then read (bank may be that of a turn).
    """
    de = 0.5 * (trim.elevon_left + trim.elevon_right)
    da = 0.5 * (trim.elevon_right - trim.elevon_left)
    pitch = z.theta - gains.turn_pitch * load_rise(z.phi) + gains.climb_kp * z.climb_rate
    return State(z.phi, z.theta, da - gains.roll_rate_kp * z.p, de - _pitch_feed(gains, z), pitch, trim.throttle)


@jit
def bank_reference(course_kp: float, bank_max: float, ref: Reference, z: Measured) -> float:
    """Bank to fly, rad: proportional to the heading or course error, or as the reference says; limited."""
    ahead = atan2(z.velocity_east, z.velocity_north) if ref.lateral == COURSE else z.psi
    steered = ref.lateral == COURSE or ref.lateral == HEADING
    bank = course_kp * wrap(ref.course - ahead) if steered else ref.bank
    return clip(bank, -bank_max, bank_max)


@jit
def _pitch_reference(
    g: Gains, integral: float, ref: Reference, z: Measured, dt: float
) -> tuple[float, float]:
    """Altitude loop: (integral, pitch reference)."""
    error = clip(ref.altitude - z.altitude, -g.altitude_error_max, g.altitude_error_max)
    feed = g.turn_pitch * load_rise(z.phi) - g.climb_kp * z.climb_rate
    return pi_control(g.altitude_kp, g.altitude_ki, integral, error, feed, g.pitch_min, g.pitch_max, dt)


@jit
def _pitch_feed(g: Gains, z: Measured) -> float:
    """K_PD on the pitch rate beyond that of the turn, and the elevator the turn needs, rad."""
    damper = g.pitch_rate_kp * (z.q - turn_pitch_rate(z.phi, z.airspeed))
    return damper + g.turn_elevator * load_rise(z.phi)


@jit
def step(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[State, Command]:
    """One control step of dt seconds: (next state, commands within their limits)."""
    phi_cmd = bank_reference(g.course_kp, g.bank_max, ref, z)
    ih, theta_ref = _pitch_reference(g, s.altitude_integral, ref, z, dt)
    # K_PD and the pitch loop; both are positive because trailing edge down pitches down.
    lo, hi = g.elevon_min + g.roll_reserve, g.elevon_max - g.roll_reserve
    it, de = pi_control(
        g.pitch_kp, g.pitch_ki, s.pitch_integral, z.theta - theta_ref, _pitch_feed(g, z), lo, hi, dt
    )
    # K_A, within what the elevator leaves of both elevons
    room = minimum(g.elevon_max - de, de - g.elevon_min)
    ir, da = pi_control(
        g.roll_kp, g.roll_ki, s.roll_integral, phi_cmd - z.phi, g.roll_rate_kp * z.p, -room, room, dt
    )
    iv, throttle = pi_control(
        g.airspeed_kp, g.airspeed_ki, s.throttle_integral, ref.airspeed - z.airspeed, 0.0, 0.0, 1.0, dt
    )
    return State(phi_cmd, theta_ref, ir, it, ih, iv), Command(de - da, de + da, throttle)
