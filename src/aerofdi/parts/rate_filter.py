"""The Kalman filter of one angular rate pushed by known moments, gusts and a slowly wandering trim.

    w' = a w + u + d + c        rate, a < 0: aerodynamic damping; u: known angular acceleration
    d' = -d / T_d + noise       gusts: first-order Markov, standard deviation s_d
    c' = -c / T_c + noise       trim moment: the same, much slower, s_c
    y  = w + v                  measured rate, white noise s_v

In steady state the filter is a linear system with constant gain; its innovation is white while the model holds.
States are ordered (w, d, c). Source: filter-error method of flight-vehicle system identification.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.types import Array
from .lti import held_noise, hold
from .ops import lean


class Disturbance(NamedTuple):
    """Gust, trim and sensor noise of one axis: s_d, s_c in rad/s2; t_d, t_c in s; s_v in rad/s."""

    t_d: float
    s_d: float
    t_c: float
    s_c: float
    s_v: float


class RateFilter(NamedTuple):
    """ad (3, 3), bd (3,), steady gain k (3,), innovation variance s (rad/s)^2."""

    ad: Array
    bd: Array
    k: Array
    s: float


def rate_filter(a: float, noise: Disturbance, dt_s: float) -> RateFilter:
    """The steady-state filter of one axis at sample period dt_s (discrete algebraic Riccati equation)."""
    f = np.array([[a, 1.0, 1.0], [0.0, -1.0 / noise.t_d, 0.0], [0.0, 0.0, -1.0 / noise.t_c]])
    ad, bd = hold(f, np.array([[1.0], [0.0], [0.0]]), dt_s)
    density = np.diag([0.0, 2.0 * noise.s_d**2 / noise.t_d, 2.0 * noise.s_c**2 / noise.t_c])
    # Scaled so that the measurement noise is one: the equation then holds numbers of similar size.
    r = max(noise.s_v**2, 1e-12)
    p = _riccati(ad, held_noise(f, density, dt_s) / r + 1e-12 * np.eye(3))
    s = p[0, 0] + 1.0
    return RateFilter(ad, bd[:, 0].copy(), p[:, 0] / s, float(s * r))


def _riccati(a: Array, q: Array) -> Array:
    """Stabilising P = a P a' + q - a P c (c' P c + 1)^-1 c' P a', c = (1, 0, 0), by structure-preserving doubling.

    Each pass doubles the number of steps, so poles at the edge of the unit circle (a trim that wanders for minutes)
    cost a few passes more and nothing in accuracy.
    """
    x, g, h = a.T.copy(), np.diag([1.0, 0.0, 0.0]), q.copy()
    eye = np.eye(3)
    for _ in range(60):
        w = np.linalg.solve(eye + g @ h, np.hstack((x, g)))
        wx, wg = w[:, :3], w[:, 3:]
        step = x.T @ h @ wx
        g = g + x @ wg @ x.T
        h = h + 0.5 * (step + step.T)
        x = x @ wx
        if not np.isfinite(h).all():
            raise np.linalg.LinAlgError("the Riccati equation of this rate filter has no finite solution")
        if np.abs(step).max() <= 1e-13 * np.abs(h).max():
            return h
    raise np.linalg.LinAlgError("the Riccati equation of this rate filter does not converge")


@lean
def rate_filter_step(ad: Array, bd: Array, k: Array, x: Array, u: float, innovation: float) -> None:
    """Correct x (3,) with the innovation, then predict one step with the acceleration u; in place."""
    w = x[0] + k[0] * innovation
    d = x[1] + k[1] * innovation
    c = x[2] + k[2] * innovation
    x[0] = ad[0, 0] * w + ad[0, 1] * d + ad[0, 2] * c + bd[0] * u
    x[1] = ad[1, 1] * d
    x[2] = ad[2, 2] * c
