"""The loops controllers are made of; every function takes the gains it names from any Gains record.

All errors are reference minus measurement; the sign of a gain follows the sign of its surface. Integrals
are in the unit of what they drive, hold its trim, and never wind up (`pi_control`).
"""

from __future__ import annotations

from typing import Any

from ..parts.dispatch import by_type
from ..parts.ops import atan2, clip, cos, exp, floor, jit, maximum, pi, sin, tan, where
from .signals import COURSE, HEADING, Measured, Reference

GRAVITY = 9.80665

control = by_type("autopilot")
"""control(gains, state, ref, z, dt) -> (State, Command): the step of the controller these gains belong to."""

# Units of the gains used here, and of the command limits every controller has.
UNITS = {
    "bank_kp": "rad/rad",
    "bank_ki": "rad/(rad s)",
    "roll_rate_kp": "rad/(rad/s)",
    "pitch_kp": "rad/rad",
    "pitch_ki": "rad/(rad s)",
    "pitch_rate_kp": "rad/(rad/s)",
    "lift_elevator": "rad",
    "altitude_kp": "rad/m",
    "altitude_ki": "rad/(m s)",
    "climb_kp": "rad/(m/s)",
    "lift_pitch": "rad",
    "trim_airspeed": "m/s",
    "energy_kp": "1/s",
    "altitude_error_max": "m",
    "pitch_min": "rad",
    "pitch_max": "rad",
    "airspeed_kp": "1/(m/s)",
    "airspeed_ki": "1/m",
    "course_kp": "rad/rad",
    "bank_max": "rad",
}


@jit
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi), rad."""
    return angle - 2.0 * pi * floor((angle + pi) / (2.0 * pi))


@jit
def lag(state: float, u: float, pole: float, dt: float) -> float:
    """y' = pole (u - y), exact for u held over the step."""
    return u + (state - u) * exp(-pole * dt)


@jit
def turn_pitch_rate(phi: float, speed: float) -> float:
    """Pitch rate of a coordinated level turn, rad/s: g tan(phi) sin(phi) / V, phi held within 70 deg."""
    phi = clip(phi, -1.22, 1.22)
    return GRAVITY * tan(phi) * sin(phi) / maximum(speed, 1.0)


@jit
def lift_rise(g: Any, airspeed: float, phi: float) -> float:
    """How much more lift coefficient than at trim_airspeed with wings level a level turn at this airspeed needs.

    As a share of the latter: (trim_airspeed/V)^2 / cos(phi) - 1, phi held within 70 deg.
    """
    ratio = g.trim_airspeed / maximum(airspeed, 1.0)
    return ratio * ratio / cos(clip(phi, -1.22, 1.22)) - 1.0


@jit
def integrate(integral: float, rate: float, output: float, lo: float, hi: float, dt: float) -> float:
    """One step of an integrator that never winds up.

    output is the unlimited sum the integral is part of. Where it is beyond a limit the integral may only move
    back (conditional integration), and the integral never crosses a limit by itself.
    """
    pushes = ((output >= hi) and (rate > 0.0)) or ((output <= lo) and (rate < 0.0))
    return clip(integral + where(pushes, 0.0, rate * dt), lo, hi)


@jit
def pi_control(
    kp: float, ki: float, integral: float, error: float, feed: float, lo: float, hi: float, dt: float
) -> tuple[float, float]:
    """(integral, output): kp error + integral + feed within [lo, hi], integral' = ki error without windup."""
    integral = integrate(integral, ki * error, kp * error + integral + feed, lo, hi, dt)
    return integral, clip(kp * error + integral + feed, lo, hi)


@jit
def bank_reference(g: Any, ref: Reference, z: Measured) -> float:
    """Bank to fly, rad:

    course_kp times the heading or course error, or as the reference says; within bank_max.
    """
    ahead = atan2(z.velocity_east, z.velocity_north) if ref.lateral == COURSE else z.psi
    steered = ref.lateral == COURSE or ref.lateral == HEADING
    bank = g.course_kp * wrap(ref.course - ahead) if steered else ref.bank
    return clip(bank, -g.bank_max, g.bank_max)


@jit
def bank_hold(
    g: Any, integral: float, bank_ref: float, phi: float, p: float, room: float, dt: float
) -> tuple[float, float]:
    """(integral, aileron within +-room): (bank_kp + bank_ki/s)(bank_ref - phi) + roll_rate_kp p."""
    return pi_control(g.bank_kp, g.bank_ki, integral, bank_ref - phi, g.roll_rate_kp * p, -room, room, dt)


@jit
def altitude_feed(g: Any, airspeed: float, z: Measured) -> float:
    """What the pitch reference gets besides the altitude error:

    the lift wanted, damping by climb rate; rad.
    """
    return g.lift_pitch * lift_rise(g, airspeed, z.phi) - g.climb_kp * z.climb_rate


@jit
def altitude_hold(
    g: Any, integral: float, altitude: float, ref: Reference, z: Measured, dt: float
) -> tuple[float, float]:
    """(integral, pitch reference):

    (altitude_kp + altitude_ki/s)(reference - altitude) + feed, all limited.
    """
    error = clip(ref.altitude - altitude, -g.altitude_error_max, g.altitude_error_max)
    return pi_control(
        g.altitude_kp,
        g.altitude_ki,
        integral,
        error,
        altitude_feed(g, ref.airspeed, z),
        g.pitch_min,
        g.pitch_max,
        dt,
    )


@jit
def pitch_feed(g: Any, airspeed: float, z: Measured) -> float:
    """Pitch damper on the rate beyond that of the turn, and the elevator the lift wanted needs, rad."""
    damper = g.pitch_rate_kp * (z.q - turn_pitch_rate(z.phi, z.airspeed))
    return damper + g.lift_elevator * lift_rise(g, airspeed, z.phi)


@jit
def pitch_hold(
    g: Any, integral: float, pitch_ref: float, ref: Reference, z: Measured, lo: float, hi: float, dt: float
) -> tuple[float, float]:
    """(integral, elevator within [lo, hi]): (pitch_kp + pitch_ki/s)(pitch_ref - theta) + feed."""
    feed = pitch_feed(g, ref.airspeed, z)
    return pi_control(g.pitch_kp, g.pitch_ki, integral, pitch_ref - z.theta, feed, lo, hi, dt)


@jit
def airspeed_hold(
    g: Any, integral: float, airspeed: float, altitude: float, ref: Reference, dt: float
) -> tuple[float, float]:
    """(integral, throttle within [0, 1]): (airspeed_kp + airspeed_ki/s) times the airspeed error plus energy_kp times
    the altitude error (limited), so that the throttle answers a lack of energy and not of speed alone."""
    height = clip(ref.altitude - altitude, -g.altitude_error_max, g.altitude_error_max)
    error = ref.airspeed - airspeed + g.energy_kp * height
    return pi_control(g.airspeed_kp, g.airspeed_ki, integral, error, 0.0, 0.0, 1.0, dt)
