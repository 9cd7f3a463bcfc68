"""Vireo: roll PI with roll-rate feedback, pitch damper, altitude and airspeed loops, mixed onto two elevons.

Source: the comparison of three fault detectors on the Vireo (Venkataraman, Bauer, Seiler, Vanek). From it:

    da = (-0.34 - 0.086/s) (phi_cmd - phi) + 0.06 p          K_A
    de = +0.05 q                                              K_PD; its figure has the minus sign outside
    elevon_left = de - da,  elevon_right = de + da            trailing edge down positive

With de = -0.05 q the short period would lose its damping (-0.95 +- 13.1j instead of -10.2 +- 11.9j).

Not in the source, designed here (gains marked assumed), with lift = (V_trim/V_ref)^2 / cos(phi) - 1:

    theta_ref = (k_h + k_ih/s) (h_ref - h) - k_hd h' + k_lift lift
    de        = (k_theta + k_itheta/s) (theta_ref - theta) + 0.05 (q - g tan(phi) sin(phi)/V) + k_de lift
    throttle  = (k_v + k_iv/s) (V_ref - V + k_e (h_ref - h))
    phi_cmd   = k_course (course_ref - course), limited

The pitch rate of a coordinated turn is taken off q so that the damper does not fight a banked corner; wings
level it is the damper of the source. Elevator has priority but leaves `roll_reserve` of elevon travel to
the ailerons; every integrator stops where its own command is limited.

With one elevon stuck the other must serve pitch and roll at once, and cannot. So the pitch loop has no
integral (k_itheta = 0; `lift` carries the elevator over the speed range): the roll integral then wins, the
wings stay level, the pitching moment that is left decides the airspeed, and k_e makes the throttle hold the
altitude at that speed. Stuck elevons from -7 to +5 deg about trim, the source's tolerable set, end in
straight flight within 20 m of the altitude, negative ones slow and positive ones fast. With a pitch
integral even 1 deg ends in a spiral dive.

Criteria: at least 6 dB and 60 deg in every loop at 15.4 m/s, altitude and airspeed slower than bank.
Margins, each loop broken at its command with the others closed, with the elevon's servo, the total delay of
0.05 s and the 92 Hz hold: roll 6.1 dB and 61 deg (the published gains), elevator 6.2 dB and 89 deg,
throttle 93 deg. Bandwidths (-3 dB): bank 1.8, altitude 1.1, course 0.6 rad/s. At 19 m/s roll and elevator
keep 3.2 and 2.9 dB, of which the published gains alone leave 3.9.
"""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import jit, minimum
from . import loops
from .loops import airspeed_hold, altitude_hold, bank_hold, bank_reference, control, pitch_hold
from .signals import Measured, Reference

RATE_HZ = 92.0


class Gains(NamedTuple):
    """Gains in SI and rad, units in UNITS. Limits are of the commands; roll_reserve is elevon travel."""

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
    elevon_min: float
    elevon_max: float
    roll_reserve: float


UNITS = loops.UNITS | {"elevon_min": "rad", "elevon_max": "rad", "roll_reserve": "rad"}


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
    bank_integral: float
    pitch_integral: float
    altitude_integral: float
    airspeed_integral: float


def init(gains: Gains, trim: Command, z: Measured) -> State:
    """The state that goes on in trim: with z as reference and measurement, the first command is `trim`.

    trim: the commands of the trimmed aircraft. z: what its sensors then read (bank may be that of a turn).
    """
    de = 0.5 * (trim.elevon_left + trim.elevon_right)
    da = 0.5 * (trim.elevon_right - trim.elevon_left)
    return State(
        bank_ref=z.phi,
        pitch_ref=z.theta,
        bank_integral=da - gains.roll_rate_kp * z.p,
        pitch_integral=de - loops.pitch_feed(gains, z.airspeed, z),
        altitude_integral=z.theta - loops.altitude_feed(gains, z.airspeed, z),
        airspeed_integral=trim.throttle,
    )


@control.register(Gains)
@jit
def step(g: Gains, s: State, ref: Reference, z: Measured, dt: float) -> tuple[State, Command]:
    """One control step of dt seconds: (next state, commands within their limits)."""
    phi_cmd = bank_reference(g, ref, z)
    ih, theta_ref = altitude_hold(g, s.altitude_integral, z.altitude, ref, z, dt)
    # K_PD and the pitch loop
    lo, hi = g.elevon_min + g.roll_reserve, g.elevon_max - g.roll_reserve
    it, de = pitch_hold(g, s.pitch_integral, theta_ref, ref, z, lo, hi, dt)
    # K_A, within what the elevator leaves of both elevons
    room = minimum(g.elevon_max - de, de - g.elevon_min)
    ib, da = bank_hold(g, s.bank_integral, phi_cmd, z.phi, z.p, room, dt)
    iv, throttle = airspeed_hold(g, s.airspeed_integral, z.airspeed, z.altitude, ref, dt)
    return State(phi_cmd, theta_ref, ib, it, ih, iv), Command(de - da, de + da, throttle)
