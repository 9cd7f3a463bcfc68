"""Filter error: maximum likelihood of the innovations of a Kalman filter that knows about gusts.

Output error is the special case without gusts. With them the prediction-error argument makes the fit consistent in
closed loop, where equation error is biased. Given the damping a and the noise (T_d, s_d/s_v, s_c/s_v) the
innovation is linear in every other coefficient, so only those four numbers are searched (variable projection):

    innovation(y) = sum_l theta_l * innovation response to regressor l + white noise
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.types import Array
from ..parts.ops import jit
from ..parts.rate_filter import Disturbance, RateFilter, rate_filter, rate_filter_step
from .data import Training
from .equation_error import regressors

TRIM_TIME_S = 60.0
SETTLE_S = 2.0
SEARCH_SAMPLES = 12_000
# Weak priors, mean and standard deviation of the logarithm: damping in 1/s of small aircraft, gust time in s.
DAMPING = {"p": (math.log(8.0), 0.7), "q": (math.log(6.0), 0.7), "r": (math.log(2.0), 0.7)}
# Where commands are logged slower than 5 Hz, the error of holding them looks like a fast gust, so less is known.
GUST_TIME = {"fast": (math.log(1.0), 0.35), "slow": (math.log(0.5), 0.8)}
SHORTEST_GUST_S = 0.1


class AxisFit(NamedTuple):
    """One axis at one delay and lag: damping a, theta and covariance of the rest, noise, innovation std, cost."""

    a: float
    theta: Array
    covariance: Array
    noise: Disturbance
    innovation_std: float
    cost: float
    search: Array


@jit
def innovation_responses(
    ad: Array, bd: Array, k: Array, inputs: Array, known: Array, rate: Array, starts: Array
) -> Array:
    """(n, m + 1): minus the innovation caused by each input column alone, then the innovation of the rate itself.

    inputs (n, m) accelerations per unit coefficient; known (n,) acceleration with a fixed coefficient; rate (n,);
    starts (n,) true where the filter begins anew.
    """
    n, m = inputs.shape
    out = np.empty((n, m + 1))
    state = np.zeros((m + 1, 3))
    for i in range(n):
        if starts[i]:
            state[:, :] = 0.0
            state[m, 0] = rate[i]
        for j in range(m):
            out[i, j] = state[j, 0]
            rate_filter_step(ad, bd, k, state[j], inputs[i, j], -state[j, 0])
        e = rate[i] - state[m, 0]
        out[i, m] = e
        rate_filter_step(ad, bd, k, state[m], known[i], e)
    return out


class Columns(NamedTuple):
    """One axis as a table: rate (n,), own = (V - 1) w, inputs (n, m) with free coefficients, known (n,) acceleration
    with given ones, starts of segments and the samples to use (n,)."""

    rate: Array
    own: Array
    inputs: Array
    known: Array
    starts: Array
    use: Array


def columns(training: Training, axis: int, delay_s: float, lag_s: float) -> Columns:
    """All segments in one table; `own` is (V - 1) w, the part of the damping that airspeed changes."""
    parts = []
    for s in training.segments:
        x = regressors(training, s, axis, delay_s, lag_s)[:, 1:]
        n = len(s.t)
        starts = np.arange(n) == 0
        use = np.arange(n) * training.dt_s >= SETTLE_S
        parts.append((s.rates[:, axis], (s.speed - 1.0) * s.rates[:, axis], x, np.zeros(n), starts, use))
    return Columns(*(np.concatenate(p) for p in zip(*parts, strict=True)))


def _filter(search: Array, dt: float) -> tuple[float, Disturbance, RateFilter]:
    a = -math.exp(search[0])
    noise = Disturbance(math.exp(search[1]), math.exp(search[2]), TRIM_TIME_S, math.exp(search[3]), 1.0)
    return a, noise, rate_filter(a, noise, dt)


def _responses(search: Array, c: Columns, dt: float) -> tuple[float, Disturbance, RateFilter, Array]:
    a, noise, f = _filter(search, dt)
    response = innovation_responses(f.ad, f.bd, f.k, c.inputs, c.known + a * c.own, c.rate, c.starts)
    if not np.isfinite(response).all():
        raise np.linalg.LinAlgError("the filter of these search values is not finite")
    return a, noise, f, response


def _cost(
    search: Array, c: Columns, dt: float, damping: tuple[float, float], gust: tuple[float, float]
) -> float:
    if np.any(np.abs(search) > 18.0) or search[1] < math.log(SHORTEST_GUST_S):
        return 1e12
    try:
        *_, response = _responses(search, c, dt)
    except (np.linalg.LinAlgError, ValueError):
        return 1e12
    x, y = response[c.use, :-1], response[c.use, -1]
    theta = np.linalg.lstsq(x, y, rcond=None)[0]
    variance = float(np.mean((y - x @ theta) ** 2))
    penalty = 0.5 * ((search[0] - damping[0]) / damping[1]) ** 2
    penalty += 0.5 * ((search[1] - gust[0]) / gust[1]) ** 2
    return 0.5 * len(y) * math.log(max(variance, 1e-18)) + penalty


def search_axis(
    c: Columns, dt: float, rate: str, command_period_s: float = 0.0, damping: float | None = None
) -> Array:
    """log(-a), log T_d, log s_d/s_v, log s_c/s_v of largest likelihood (Nelder-Mead from two starts).

    damping: -a in 1/s where it is known, to be kept.
    """
    from scipy.optimize import minimize

    n = min(len(c.rate), SEARCH_SAMPLES)
    part = Columns(*(x[:n] for x in c))
    prior = DAMPING[rate] if damping is None else (math.log(damping), 0.01)
    gust = GUST_TIME["slow" if command_period_s > 0.2 else "fast"]
    starts = ([prior[0], math.log(0.3), 5.0, 1.0], [prior[0], math.log(1.5), 3.0, 0.0])
    options: Any = {"maxiter": 250, "xatol": 0.03, "fatol": 0.1}
    found = [
        minimize(_cost, x0, args=(part, dt, prior, gust), method="Nelder-Mead", options=options)
        for x0 in starts
    ]
    return np.asarray(min(found, key=lambda r: r.fun).x)


def solve_axis(search: Array, c: Columns, dt: float) -> AxisFit:
    """The linear part for given search values: theta, its covariance, the noise in physical units."""
    a, noise, f, response = _responses(search, c, dt)
    x, y = response[c.use, :-1], response[c.use, -1]
    theta = np.linalg.lstsq(x, y, rcond=None)[0]
    e = y - x @ theta
    variance = float(np.mean(e**2))
    covariance = np.linalg.pinv(x.T @ x) * variance
    unit = math.sqrt(variance / f.s)
    scaled = Disturbance(noise.t_d, noise.s_d * unit, noise.t_c, noise.s_c * unit, unit)
    cost = 0.5 * len(y) * math.log(max(variance, 1e-18))
    return AxisFit(a, theta, covariance, scaled, math.sqrt(variance), cost, search)


def simulated(fit: AxisFit, c: Columns, dt: float) -> Array:
    """The rate that commands, air angles and the other measured rates explain alone: no feedback of the rate."""
    from scipy.signal import lfilter

    u = c.inputs @ fit.theta + c.known + fit.a * c.own
    pole = math.exp(fit.a * dt)
    out = np.empty(len(u))
    for i, j in zip(*_bounds(c.starts), strict=True):
        out[i:j], _ = lfilter([0.0, (1.0 - pole) / -fit.a], [1.0, -pole], u[i:j], zi=[c.rate[i]])
    return out


def _bounds(starts: Array) -> tuple[list[int], list[int]]:
    first = np.flatnonzero(starts)
    return list(first), [*first[1:], len(starts)]


def simulation_r2(fit: AxisFit, c: Columns, dt: float) -> float:
    """R2 of the simulated against the measured rate (mean removed), settled samples only."""
    e = (c.rate - simulated(fit, c, dt))[c.use]
    return float(1.0 - np.var(e) / np.var(c.rate[c.use]))
