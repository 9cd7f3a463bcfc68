"""Wind: steady with a logarithmic shear, Dryden and von Karman turbulence, discrete 1-cosine gusts.

Turbulence is white noise through shaping filters, at the scenario's airspeed V and altitude h (held for a
flight; frozen field). Symbols: sigma intensity (m/s), L scale length (m), b span (m), s the Laplace
variable, T = L/V.

    Dryden       Hu = sigma sqrt(2T/pi) / (1 + T s)
                 Hv, Hw = sigma sqrt(T/pi) (1 + sqrt(3) T s) / (1 + T s)^2
    von Karman   Hu = sigma sqrt(2T/pi) (1 + 0.25 T s) / (1 + 1.357 T s + 0.1987 (T s)^2)
                 Hv, Hw = sigma sqrt(T/pi) (1 + 2.7478 T s + 0.3398 (T s)^2)
                          / (1 + 2.9958 T s + 1.9754 (T s)^2 + 0.1539 (T s)^3)
    both         Hp = sigma_w sqrt(0.8/V) (pi/4b)^(1/6) / (Lw^(1/3) (1 + 4b/(pi V) s))
                 q = -1/V s / (1 + 4b/(pi V) s) w,    r = 1/V s / (1 + 3b/(pi V) s) v

for noise of one-sided density 1 per rad/s (MIL-F-8785C 3.7.2, 3.7.5; the signs are those of a frozen field:
air turning at q moves down by -q x, at r to the right by r x). The von Karman forms are rational fits,
within 0.85 dB of the exact densities for omega T < 30. Below 1000 ft (3.7.3.1, h and L in ft):

    Lw = h,   Lu = Lv = h / (0.177 + 0.000823 h)^1.2,   sigma_w = 0.1 W20,   sigma_u,v = sigma_w / (...)^0.4

The noise is held over each step and the filters are exact for it (matrix exponential), started in their
stationary distribution. Turbulence and gusts act along body axes. Not modelled: variation of sigma and L
during a flight, the turn of turbulence axes towards the wind near the ground, gust gradients over the span.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.ops import cos, lean, log, maximum, merged, pi
from ..parts.random import normal4
from .types import Wind

FOOT = 0.3048
LOW_ALTITUDE = 1000.0 * FOOT
LIGHT, MODERATE, SEVERE = 15.0 * 0.514444, 30.0 * 0.514444, 45.0 * 0.514444
"""Wind at 20 ft for light, moderate and severe turbulence, m/s (15, 30 and 45 knots)."""

STATES = 4  # of each axis's filter; shorter ones are padded with states that stay 0
TURBULENCE_CHANNEL, START_CHANNEL = 0, 1  # random channels: 0, and 1 to 4 for the first state of each axis
START, AMP_U, AMP_V, AMP_W, LEN_U, LEN_V, LEN_W, STAYS = range(8)


class WindParams(NamedTuple):
    """Numbers of one scenario's wind.

    steady: (3,) north, east, down at shear_height, m/s. roughness: length z0 of the logarithmic shear, m; 0
    for none. A (n, 4, 4), B (n, 4), C (n, 2, 4): filters of the axes u, v, w, p (n = 4, or 0 in calm air)
    of four states; outputs velocity (or p) and rotation (r for v, q for w). start (n, 4, 4): root of the
    stationary covariance. gusts: (m, 8) start time, amplitudes u v w, lengths u v w, 1 where the gust stays
    after building up.
    """

    steady: Array
    shear_height: float
    roughness: float
    A: Array
    B: Array
    C: Array
    start: Array
    gusts: Array


class WindState(NamedTuple):
    """x: (n, 4) filter states. way: (m,) distance flown into each gust, m."""

    x: Array
    way: Array


def low_altitude(altitude: float, wind_20ft: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(sigma_u, sigma_v, sigma_w) in m/s and (Lu, Lv, Lw) in m of MIL-F-8785C below 1000 ft; held below 10
    ft.

    >>> sigma, length = low_altitude(50.0, MODERATE)
    >>> [round(s, 2) for s in sigma], [round(x) for x in length]
    ([2.47, 2.47, 1.54], [202, 202, 50])
    """
    if not altitude <= LOW_ALTITUDE:
        raise WrongUse(
            f"turbulence from wind_20ft is defined up to 1000 ft ({LOW_ALTITUDE} m), not at {altitude} m; "
            f"give sigma and length instead"
        )
    h = max(altitude / FOOT, 10.0)
    ratio = 0.177 + 0.000823 * h
    sigma_w = 0.1 * wind_20ft
    horizontal, length = sigma_w / ratio**0.4, h / ratio**1.2 * FOOT
    return (horizontal, horizontal, sigma_w), (length, length, h * FOOT)


def forming_filters(
    model: str, sigma: Any, length: Any, airspeed: float, span: float
) -> list[tuple[Array, Array, Array]]:
    """Continuous (A, B, C) of the axes u, v, w, p, driven by noise of one-sided density 1 per rad/s.

    model: "dryden" or "von_karman". sigma, length: three each, m/s and m. C has two rows: the velocity (or
    p), and the rotation (r for v, q for w, 0 for u and p).
    """
    if model not in _FORMS:
        raise WrongUse(f"turbulence {model!r} is not known; known are {', '.join(_FORMS)}")
    if not (np.all(np.asarray(sigma) >= 0) and np.all(np.asarray(length) > 0) and airspeed > 0 and span > 0):
        raise WrongUse(
            f"turbulence needs sigma >= 0, length, airspeed and span > 0; "
            f"given {sigma}, {length}, {airspeed}, {span}"
        )
    along, across = _FORMS[model]
    out = []
    for axis, (s, L) in enumerate(zip(sigma, length, strict=True)):
        num, den = along if axis == 0 else across
        T = L / airspeed
        gain = s * math.sqrt((2.0 if axis == 0 else 1.0) * T / math.pi)
        a, b, c = _companion(num, den, T, gain)
        tau = (0.0, 3.0, 4.0)[axis] * span / (math.pi * airspeed)
        out.append(_with_rotation(a, b, c, tau, (0.0, 1.0, -1.0)[axis] / airspeed))
    tau = 4.0 * span / (math.pi * airspeed)
    gain = sigma[2] * math.sqrt(0.8 / airspeed) * (math.pi / (4 * span)) ** (1 / 6) / length[2] ** (1 / 3)
    out.append((np.array([[-1 / tau]]), np.array([1 / tau]), np.array([[gain], [0.0]])))
    return out


# (numerator, denominator) in T s, lowest power first, of the along-track and the across-track filters.
_FORMS = {
    "dryden": (([1.0], [1.0, 1.0]), ([1.0, math.sqrt(3.0)], [1.0, 2.0, 1.0])),
    "von_karman": (
        ([1.0, 0.25], [1.0, 1.357, 0.1987]),
        ([1.0, 2.7478, 0.3398], [1.0, 2.9958, 1.9754, 0.1539]),
    ),
}


def _companion(num: list[float], den: list[float], T: float, gain: float) -> tuple[Array, Array, Array]:
    """Controllable form of gain num(T s)/den(T s), in states scaled so that all are of one size."""
    n = len(den) - 1
    a = np.diag(np.ones(n - 1), 1)
    a[-1] = -np.array(den[:n]) / den[n]
    b = np.zeros(n)
    b[-1] = 1.0 / den[n]
    c = np.zeros((1, n))
    c[0, : len(num)] = gain * np.array(num)
    return a / T, b / T, c


def _with_rotation(a: Array, b: Array, c: Array, tau: float, scale: float) -> tuple[Array, Array, Array]:
    """Add the output scale s/(1 + tau s) y, with one more state; a row of zeros where scale is 0."""
    n = len(b)
    if scale == 0.0:
        return a, b, np.vstack([c, np.zeros(n)])
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[n, :n], big[n, n] = a, c / tau, -1.0 / tau
    out = np.zeros((2, n + 1))
    out[0, :n], out[1, :n], out[1, n] = c, c * scale / tau, -scale / tau
    return big, np.append(b, 0.0), out


def _held(a: Array, b: Array, dt_s: float) -> tuple[Array, Array, Array]:
    """Exact step of x' = a x + b n for noise n held over dt (unit normals drive it), and its stationary
    root."""
    from scipy.linalg import cholesky, expm, solve_discrete_lyapunov

    n = len(b)
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[:n, n] = a, b
    step = expm(big * dt_s)
    # Held noise of variance pi/dt has the one-sided density 1 per rad/s at low frequency.
    phi, gamma = step[:n, :n], step[:n, n] * math.sqrt(math.pi / dt_s)
    return phi, gamma, cholesky(solve_discrete_lyapunov(phi, np.outer(gamma, gamma)), lower=True)


def wind_params(
    dt_s: float,
    steady: Any = (0.0, 0.0, 0.0),
    shear_height: float = 20.0 * FOOT,
    roughness: float = 0.0,
    filters: list[tuple[Array, Array, Array]] | None = None,
    gusts: Any = (),
) -> WindParams:
    """Everything `wind_now` and `wind_advance` need.

    steady: north, east, down, m/s, at shear_height (m). roughness: z0 of the logarithmic shear in m
    (MIL-F-8785C: 0.0457 for terminal flight phases, 0.6096 otherwise), 0 for none. filters: from
    `forming_filters`. gusts: rows as in WindParams.
    """
    if roughness and not 0 < roughness < shear_height:
        raise WrongUse(
            f"wind shear needs 0 < roughness < shear_height, got {roughness} m and {shear_height} m"
        )
    table = np.asarray(gusts, float).reshape(-1, 8)
    if not (np.isfinite(table).all() and (table[:, LEN_U : LEN_W + 1] > 0).all()):
        raise WrongUse("gusts need finite numbers and lengths above 0 m")
    n = len(filters) if filters else 0
    A, B, C = np.zeros((n, STATES, STATES)), np.zeros((n, STATES)), np.zeros((n, 2, STATES))
    start = np.zeros((n, STATES, STATES))
    for i, (a, b, c) in enumerate(filters or []):
        m = len(b)
        C[i, :, :m] = c
        if c.any():
            A[i, :m, :m], B[i, :m], start[i, :m, :m] = _held(a, b, dt_s)
    return WindParams(np.asarray(steady, float), float(shear_height), float(roughness), A, B, C, start, table)


def wind_state(params: WindParams) -> WindState:
    """A state of the right shape, all zeros; `wind_start` draws its turbulence."""
    return WindState(np.zeros(params.B.shape), np.zeros(len(params.gusts)))


@lean
def wind_start(params: WindParams, state: WindState, seed: int, run: int) -> None:
    """Draw the first turbulence from the stationary distribution; no distance flown into any gust."""
    for i in range(params.B.shape[0]):
        draw = normal4(seed, run, START_CHANNEL + i, i)
        for row in range(STATES):
            total = 0.0
            for col in range(STATES):
                total += params.start[i, row, col] * draw[col]
            state.x[i, row] = total
    for i in range(state.way.shape[0]):
        state.way[i] = 0.0


@merged
def _output(c: Array, x: Array, i: int) -> tuple[float, float]:
    """Velocity and rotation of axis i."""
    x0, x1, x2, x3 = x[i, 0], x[i, 1], x[i, 2], x[i, 3]
    return (
        c[i, 0, 0] * x0 + c[i, 0, 1] * x1 + c[i, 0, 2] * x2 + c[i, 0, 3] * x3,
        c[i, 1, 0] * x0 + c[i, 1, 1] * x1 + c[i, 1, 2] * x2 + c[i, 1, 3] * x3,
    )


@merged
def _turbulence(c: Array, x: Array) -> tuple[float, float, float, float, float, float]:
    """u, v, w, p, q, r of the filters."""
    u = v = w = p = q = r = 0.0
    # Loops over the axes rather than numbered calls: a compiled function is made anew for every literal
    # argument.
    for axis in range(c.shape[0]):
        velocity, rotation = _output(c, x, axis)
        if axis == 0:
            u = velocity
        elif axis == 1:
            v, r = velocity, rotation
        elif axis == 2:
            w, q = velocity, rotation
        else:
            p = velocity
    return u, v, w, p, q, r


@lean
def _gust(amplitude: float, length: float, stays: float, way: float) -> float:
    """1-cosine of MIL-F-8785C 3.7.4: builds up over `length`, then stays, or dies away over the same
    length."""
    if way <= 0.0:
        return 0.0
    if way >= length and stays > 0.0:
        return amplitude
    return 0.5 * amplitude * (1.0 - cos(pi * way / length)) if way < 2.0 * length else 0.0


@merged
def shear_factor(params: WindParams, altitude: float) -> float:
    """Wind at this altitude over that at shear_height, ln(h/z0)/ln(h_ref/z0); held below 3 ft, 1 without
    shear."""
    if params.roughness <= 0.0:
        return 1.0
    h = maximum(altitude, maximum(0.9144, params.roughness))
    return log(h / params.roughness) / log(params.shear_height / params.roughness)


@merged
def wind_now(params: WindParams, state: WindState, altitude: float) -> Wind:
    """The air's velocity and rotation now, at this altitude (m)."""
    f = shear_factor(params, altitude)
    u, v, w, p, q, r = _turbulence(params.C, state.x)
    for i in range(params.gusts.shape[0]):
        g, way = params.gusts[i], state.way[i]
        u += _gust(g[AMP_U], g[LEN_U], g[STAYS], way)
        v += _gust(g[AMP_V], g[LEN_V], g[STAYS], way)
        w += _gust(g[AMP_W], g[LEN_W], g[STAYS], way)
    return Wind(f * params.steady[0], f * params.steady[1], f * params.steady[2], u, v, w, p, q, r)


@merged
def wind_advance(
    params: WindParams, state: WindState, seed: int, run: int, k: int, t: float, airspeed: float, dt: float
) -> None:
    """From t to t + dt: one step of the filters (step number k names their noise) and of the way into
    gusts."""
    for block in range(params.B.shape[0] // 4):
        noise = normal4(seed, run, TURBULENCE_CHANNEL + block, k)
        for i in range(4):
            _filter_step(params.A, params.B, state.x, 4 * block + i, noise[i])
    for i in range(params.gusts.shape[0]):
        if t >= params.gusts[i, START] - 1e-9:
            state.way[i] += airspeed * dt


@merged
def _filter_step(a: Array, b: Array, x: Array, i: int, noise: float) -> None:
    """x <- a x + b noise of axis i."""
    x0, x1, x2, x3 = x[i, 0], x[i, 1], x[i, 2], x[i, 3]
    x[i, 0] = a[i, 0, 0] * x0 + a[i, 0, 1] * x1 + a[i, 0, 2] * x2 + a[i, 0, 3] * x3 + b[i, 0] * noise
    x[i, 1] = a[i, 1, 0] * x0 + a[i, 1, 1] * x1 + a[i, 1, 2] * x2 + a[i, 1, 3] * x3 + b[i, 1] * noise
    x[i, 2] = a[i, 2, 0] * x0 + a[i, 2, 1] * x1 + a[i, 2, 2] * x2 + a[i, 2, 3] * x3 + b[i, 2] * noise
    x[i, 3] = a[i, 3, 0] * x0 + a[i, 3, 1] * x1 + a[i, 3, 2] * x2 + a[i, 3, 3] * x3 + b[i, 3] * noise
