"""What every controller shares: a PI that does not wind up, angles, exact first-order filters, turns."""

from __future__ import annotations

from ..parts.ops import atan2, clip, cos, exp, floor, jit, maximum, pi, sin, tan, where

GRAVITY = 9.80665


@jit
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi), rad."""
    return angle - 2.0 * pi * floor((angle + pi) / (2.0 * pi))


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
    """(integral, output) of kp error + integral + feed within [lo, hi], ki in 1/s;

    the integral holds the trim.
    """
    integral = integrate(integral, ki * error, kp * error + integral + feed, lo, hi, dt)
    return integral, clip(kp * error + integral + feed, lo, hi)


@jit
def lag(state: float, u: float, pole: float, dt: float) -> float:
    """y' = pole (u - y), exact for u held over the step."""
    return u + (state - u) * exp(-pole * dt)


@jit
def bank_for_turn(speed: float, turn_rate: float) -> float:
    """Bank of a coordinated level turn, rad: tan(phi) = V turn_rate / g."""
    return atan2(speed * turn_rate, GRAVITY)


@jit
def turn_pitch_rate(phi: float, speed: float) -> float:
    """Pitch rate of a coordinated level turn at bank phi (held within 70 deg), rad/s:

    g tan(phi) sin(phi) / V.
    """
    phi = clip(phi, -1.22, 1.22)
    return GRAVITY * tan(phi) * sin(phi) / maximum(speed, 1.0)


@jit
def load_rise(phi: float) -> float:
    """How much more lift a level turn at bank phi (held within 70 deg) needs, as a share: 1/cos(phi) - 1."""
    return 1.0 / cos(clip(phi, -1.22, 1.22)) - 1.0
