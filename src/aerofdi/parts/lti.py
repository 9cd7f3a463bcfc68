"""Linear time-invariant systems: exact discretisation at design time, one step at run time."""

from __future__ import annotations

import numpy as np

from ..core.types import Array
from .ops import lean


def hold(a: Array, b: Array, dt_s: float) -> tuple[Array, Array]:
    """Exact discretisation for inputs held over each step: x+ = Ad x + Bd u.

    a (n, n), b (n, m) of x' = a x + b u; matrix exponential of the joined system.

    >>> ad, bd = hold(np.array([[-1.0]]), np.array([[1.0]]), 0.1)
    >>> bool(np.isclose(ad[0, 0] + bd[0, 0], 1.0))
    True
    """
    from scipy.linalg import expm

    n, m = b.shape
    joined = np.zeros((n + m, n + m))
    joined[:n, :n] = a
    joined[:n, n:] = b
    e = expm(joined * dt_s)
    return e[:n, :n].copy(), e[:n, n:].copy()


def held_noise(a: Array, q: Array, dt_s: float) -> Array:
    """Covariance of the noise that a white input of spectral density q (n, n) adds over one step (Van Loan)."""
    from scipy.linalg import expm

    n = len(a)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n] = -a
    block[:n, n:] = q
    block[n:, n:] = a.T
    e = expm(block * dt_s)
    covariance = e[n:, n:].T @ e[:n, n:]
    return 0.5 * (covariance + covariance.T)


@lean
def lti_output(c: Array, d: Array, x: Array, u: Array, y: Array) -> None:
    """y = c x + d u, written into y."""
    for i in range(c.shape[0]):
        total = 0.0
        for j in range(c.shape[1]):
            total += c[i, j] * x[j]
        for j in range(d.shape[1]):
            total += d[i, j] * u[j]
        y[i] = total


@lean
def lti_advance(a: Array, b: Array, x: Array, u: Array, work: Array) -> None:
    """x <- a x + b u in place; work is scratch of the length of x."""
    for i in range(a.shape[0]):
        total = 0.0
        for j in range(a.shape[1]):
            total += a[i, j] * x[j]
        for j in range(b.shape[1]):
            total += b[i, j] * u[j]
        work[i] = total
    for i in range(a.shape[0]):
        x[i] = work[i]
