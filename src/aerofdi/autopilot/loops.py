"""Parts every controller shares: a PI that does not wind up, angle wrapping, exact first-order filters, bank for a turn."""

from __future__ import annotations

from ..parts.ops import atan2, clip, exp, floor, jit, pi, where

GRAVITY = 9.80665


@jit
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi), rad."""
    return angle - 2.0 * pi * floor((angle + pi) / (2.0 * pi))


@jit
def integrate(integral: float, rate: float, output: float, lo: float, hi: float, dt: float) -> float:
    """One step of an integrator that never winds up: integral + rate dt, kept within [lo, hi] by what it drives.

    output is the unlimited sum the integral is part of. Where it is already beyond a limit the integral may only move
    back (conditional integration), and it never crosses a limit by itself.
    """
    pushes = ((output >= hi) and (rate > 0.0)) or ((output <= lo) and (rate < 0.0))
    return clip(integral + where(pushes, 0.0, rate * dt), lo, hi)


@jit
def lag(state: float, u: float, pole: float, dt: float) -> float:
    """y' = pole (u - y), exact for u held over the step."""
    return u + (state - u) * exp(-pole * dt)


@jit
def bank_for_turn(speed: float, turn_rate: float) -> float:
    """Bank of a coordinated level turn, rad: tan(phi) = V turn_rate / g."""
    return atan2(speed * turn_rate, GRAVITY)
