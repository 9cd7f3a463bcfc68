"""A servo of order 0, 1 or 2 with position and rate limits, stepped exactly between its limits.

    order 0    x = u
    order 1    x' = w (u - x)
    order 2    x'' = w^2 (u - x) - 2 zeta w x'

with u the command held over the step, first clipped to the position limits. The linear part is the exact
zero-order-hold solution (matrix exponential), in the error e = u - x so that rest stays rest to the bit:

    x+ = x + b1 e + a12 v        v+ = b2 e + a22 v        v = dx/dt

then the speed v+ and the move x+ - x are held within the rate limit, and x+ within the stops, which take the
speed away. The rate limit acts on the motion, never on the command; where it binds, the position is within
one step of slewing of the limited equation. A transport delay comes before the servo: see `parts.delay_line`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..core.errors import WrongUse
from .ops import clip, lean, maximum, minimum

B1, A12, B2, A22, LOWER, UPPER, RATE, PERIOD = range(8)
WIDTH = 8


def servo_coefficients(
    order: int,
    bandwidth: float,
    damping: float = 1.0,
    lower: float = -math.inf,
    upper: float = math.inf,
    rate: float = math.inf,
    dt_s: float = 0.01,
) -> NDArray[np.float64]:
    """The numbers `servo_step` needs, (8,): b1, a12, b2, a22, lower, upper, rate limit, period.

    order: 0, 1 or 2. bandwidth: w in rad/s (order 0 ignores it). damping: zeta (order 2 only). lower, upper:
    position limits; rate: speed limit per second, in the unit of the position. dt_s: step in s.

    >>> c = servo_coefficients(1, 50.0, dt_s=0.01)
    >>> x, v = servo_step(c, 0.0, 0.0, 1.0)
    >>> round(x, 12) == round(1 - math.exp(-0.5), 12)
    True
    """
    if order not in (0, 1, 2):
        raise WrongUse(f"a servo has order 0, 1 or 2, not {order!r}")
    if order > 0 and not (bandwidth > 0 and math.isfinite(bandwidth)):
        raise WrongUse(f"a servo of order {order} needs a bandwidth above 0 rad/s, not {bandwidth!r}")
    if order == 2 and not (damping > 0 and math.isfinite(damping)):
        raise WrongUse(f"a servo of order 2 needs a damping ratio above 0, not {damping!r}")
    if not (lower < upper and rate > 0 and dt_s > 0):
        raise WrongUse(
            f"a servo needs lower < upper, a rate limit and a period above 0; "
            f"given {lower}, {upper}, {rate}, {dt_s}"
        )
    b1, a12, b2, a22 = _linear_part(order, bandwidth, damping, dt_s)
    return np.array([b1, a12, b2, a22, lower, upper, rate, dt_s])


def _linear_part(order: int, w: float, zeta: float, dt: float) -> tuple[float, float, float, float]:
    if order == 0:
        return 1.0, 0.0, 0.0, 0.0
    if order == 1:
        decay = math.exp(-w * dt)
        return -math.expm1(-w * dt), 0.0, w * decay, 0.0
    from scipy.linalg import expm

    phi = expm(np.array([[0.0, 1.0], [-w * w, -2.0 * zeta * w]]) * dt)
    return 1.0 - phi[0, 0], phi[0, 1], -phi[1, 0], phi[1, 1]


@lean
def servo_step(c: NDArray[np.float64], x: float, v: float, command: float) -> tuple[float, float]:
    """One step of a servo: (position, speed) now, command held over the step -> (position, speed) at its end.

    c: (8,) from `servo_coefficients` (a row of an (n, 8) table will do).
    """
    e = clip(command, c[LOWER], c[UPPER]) - x
    rate, reach = c[RATE], c[RATE] * c[PERIOD]
    moved = x + clip(c[B1] * e + c[A12] * v, -reach, reach)
    speed = clip(c[B2] * e + c[A22] * v, -rate, rate)
    # A stop takes the speed away, but only the speed that points into it.
    speed = minimum(speed, 0.0) if moved >= c[UPPER] else speed
    speed = maximum(speed, 0.0) if moved <= c[LOWER] else speed
    return clip(moved, c[LOWER], c[UPPER]), speed
