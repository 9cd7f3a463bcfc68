"""Turbulence has the published spectra, gusts the published shape, shear the published law, signs those of
physics.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from aerofdi.core.errors import WrongUse
from aerofdi.dynamics.wind import (
    LIGHT,
    MODERATE,
    forming_filters,
    low_altitude,
    shear_factor,
    wind_advance,
    wind_now,
    wind_params,
    wind_start,
    wind_state,
)
from aerofdi.parts.ops import jit

DT = 0.01
CASES = [(15.4, 50.0, 0.97), (25.0, 100.0, 2.9), (30.0, 150.0, 3.1)]  # airspeed, altitude, span


def response(p, axis, row, omega, dt=DT):
    """|H|^2 of the discrete filter as a one-sided density per rad/s, and H itself (for phases)."""
    z = np.exp(1j * omega * dt)
    pencil = z[:, None, None] * np.eye(4) - p.A[axis]
    h = np.linalg.solve(pencil, p.B[axis][:, None])[:, :, 0] @ p.C[axis, row]
    return np.abs(h) ** 2 * dt / math.pi, h


def continuous(model, sigma, length, V, b, omega):
    """|H(j omega)|^2 of (u, v, w, p, q, r), written from the transfer functions and not from the code."""
    s = 1j * omega
    Tu, Tv, Tw = (L / V for L in length)
    if model == "dryden":
        u = sigma[0] * np.sqrt(2 * Tu / np.pi) / (1 + Tu * s)
        v, w = (
            sg * np.sqrt(T / np.pi) * (1 + np.sqrt(3) * T * s) / (1 + T * s) ** 2
            for sg, T in ((sigma[1], Tv), (sigma[2], Tw))
        )
    else:
        u = sigma[0] * np.sqrt(2 * Tu / np.pi) * (1 + 0.25 * Tu * s)
        u = u / (1 + 1.357 * Tu * s + 0.1987 * (Tu * s) ** 2)
        v, w = (
            sg * np.sqrt(T / np.pi) * (1 + 2.7478 * T * s + 0.3398 * (T * s) ** 2)
            / (1 + 2.9958 * T * s + 1.9754 * (T * s) ** 2 + 0.1539 * (T * s) ** 3)
            for sg, T in ((sigma[1], Tv), (sigma[2], Tw))
        )  # fmt: skip
    p = sigma[2] * np.sqrt(0.8 / V) * (np.pi / (4 * b)) ** (1 / 6)
    p = p / (length[2] ** (1 / 3) * (1 + 4 * b / (np.pi * V) * s))
    q = -w * s / V / (1 + 4 * b / (np.pi * V) * s)
    r = v * s / V / (1 + 3 * b / (np.pi * V) * s)
    return [np.abs(x) ** 2 for x in (u, v, w, p, q, r)]


def analytic(model, sigma, length, V, b, omega):
    """The densities of MIL-F-8785C per rad/s: (u, v, w, p, q, r)."""
    x = [omega * L / V for L in length]
    scale = [s**2 * L / (np.pi * V) for s, L in zip(sigma, length, strict=True)]
    if model == "dryden":
        u = 2 * scale[0] / (1 + x[0] ** 2)
        v, w = (scale[i] * (1 + 3 * x[i] ** 2) / (1 + x[i] ** 2) ** 2 for i in (1, 2))
    else:
        y = [(1.339 * a) ** 2 for a in x]
        u = 2 * scale[0] / (1 + y[0]) ** (5 / 6)
        v, w = (scale[i] * (1 + 8 / 3 * y[i]) / (1 + y[i]) ** (11 / 6) for i in (1, 2))
    p = sigma[2] ** 2 / (V * length[2]) * 0.8 * (np.pi * length[2] / (4 * b)) ** (1 / 3)
    p = p / (1 + (4 * b * omega / (np.pi * V)) ** 2)
    q = w * (omega / V) ** 2 / (1 + (4 * b * omega / (np.pi * V)) ** 2)
    r = v * (omega / V) ** 2 / (1 + (3 * b * omega / (np.pi * V)) ** 2)
    return [u, v, w, p, q, r]


OUTPUTS = [(0, 0), (1, 0), (2, 0), (3, 0), (2, 1), (1, 1)]  # axis, row of u v w p q r


@pytest.mark.parametrize("model", ["dryden", "von_karman"])
@pytest.mark.parametrize(("V", "h", "b"), CASES)
def test_frequency_response_over_two_decades(model, V, h, b):
    sigma, length = low_altitude(h, MODERATE)
    params = wind_params(DT, filters=forming_filters(model, sigma, length, V, b))
    for i, (axis, row) in enumerate(OUTPUTS):
        omega = V / length[min(axis, 2)] * np.logspace(-1, 1, 81)
        form = continuous(model, sigma, length, V, b, omega)[i]
        density = analytic(model, sigma, length, V, b, omega)[i]
        ours, _ = response(params, axis, row, omega)
        assert np.abs(10 * np.log10(ours / form)).max() < 0.1, "uvwpqr"[i]
        assert np.abs(10 * np.log10(ours / density)).max() < 1.0, "uvwpqr"[i]


@pytest.mark.parametrize("model", ["dryden", "von_karman"])
def test_rotation_follows_the_frozen_field(model):
    """At low frequency q = -w'/V and r = +v'/V: a field frozen in space, seen by an aircraft flying into
    it.
    """
    V = 20.0
    params = wind_params(DT, filters=forming_filters(model, (1, 1, 1), (80.0, 70.0, 60.0), V, 2.0))
    omega = np.array([0.05])
    _, v = response(params, 1, 0, omega)
    _, r = response(params, 1, 1, omega)
    _, w = response(params, 2, 0, omega)
    _, q = response(params, 2, 1, omega)
    np.testing.assert_allclose(r / v, 1j * omega / V, rtol=2e-2)
    np.testing.assert_allclose(q / w, -1j * omega / V, rtol=2e-2)


@jit
def _fly(params, state, seed, run, out, dt, V):
    wind_start(params, state, seed, run)
    for k in range(out.shape[1]):
        w = wind_now(params, state, 50.0)
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k], out[5, k] = w.u, w.v, w.w, w.p, w.q, w.r
        wind_advance(params, state, seed, run, k, k * dt, V, dt)


@pytest.mark.parametrize("model", ["dryden", "von_karman"])
def test_64_runs_of_2000_s_agree_in_third_octaves_and_in_standard_deviation(model):
    """Every third-octave band and every variance lies within its chi-squared interval, p = 1e-3 over all of
    them.

    Deterministic: the seed is fixed. A filter wrong by 0.5 dB in a band above 0.1 Hz fails here.
    """
    V, h, b = 25.0, 50.0, 2.9
    sigma, length = low_altitude(h, MODERATE)
    dt, n, runs = 0.02, 100_000, 64
    params = wind_params(dt, filters=forming_filters(model, sigma, length, V, b))
    state, out = wind_state(params), np.empty((6, n))
    window = np.hanning(n)
    window /= np.sqrt(np.mean(window**2))
    f = np.fft.rfftfreq(n, dt)
    power = np.zeros((6, len(f)))
    variance = np.zeros((6, runs))
    for run in range(runs):
        _fly(params, state, 11, run, out, dt, V)
        power += np.abs(np.fft.rfft(out * window)) ** 2 * 2 * dt / n
        variance[:, run] = np.mean(out**2, axis=1)
    power /= runs
    edges = 0.005 * 2.0 ** (np.arange(31) / 3)
    p_each = 1e-3 / (6 * len(edges))
    for i, (axis, row) in enumerate(OUTPUTS):
        density = 2 * math.pi * response(params, axis, row, 2 * math.pi * f, dt)[0]  # per Hz
        for lo, hi in pairwise(edges):
            band = (f >= lo) & (f < hi)
            # A Hann window makes neighbours dependent: 1/1.5 of the bins are free; the spectrum's slope in a
            # third octave is too small to matter.
            freedom = 2 * band.sum() * runs / 1.5
            ratio = power[i, band].mean() / density[band].mean()
            low, high = stats.chi2.ppf([p_each / 2, 1 - p_each / 2], freedom) / freedom
            assert low < ratio < high, (model, "uvwpqr"[i], lo, ratio)
        true = np.trapezoid(density, f)
        spread = math.sqrt(np.trapezoid(density**2, f) / (n * dt * runs))
        assert abs(variance[i].mean() - true) < stats.norm.isf(p_each / 2) * spread
    if model == "dryden":
        np.testing.assert_allclose(np.sqrt(variance[:3].mean(1)), sigma, rtol=0.02)


def test_first_sample_is_already_stationary():
    sigma, length = low_altitude(60.0, LIGHT)
    params = wind_params(DT, filters=forming_filters("von_karman", sigma, length, 20.0, 2.0))
    state, first = wind_state(params), np.empty((6, 3000))
    for run in range(3000):
        _fly(params, state, 3, run, first[:, run : run + 1], DT, 20.0)
    std = [np.sqrt(p @ p) for p in (params.C[a, r] @ params.start[a] for a, r in OUTPUTS)]
    np.testing.assert_allclose(first.std(axis=1), std, rtol=4.5 / np.sqrt(2 * 3000))


def test_turbulence_depends_on_seed_and_run_only():
    params = wind_params(DT, filters=forming_filters("dryden", (1, 1, 1), (50, 50, 50), 20.0, 2.0))
    state, a, b, c = wind_state(params), np.empty((6, 50)), np.empty((6, 50)), np.empty((6, 50))
    _fly(params, state, 3, 4, a, DT, 20.0)
    _fly(params, state, 3, 5, b, DT, 20.0)
    _fly(params, state, 3, 4, c, DT, 20.0)
    assert (a == c).all() and (a != b).all()


def test_low_altitude_scales_are_those_of_the_standard():
    """50 m: Lu = Lv = 200 m, Lw = 50 m is the row Beard & McLain print; sigma_w is a tenth of W20."""
    sigma, length = low_altitude(50.0, MODERATE)
    assert length == pytest.approx((202.29, 202.29, 50.0), abs=0.01)
    assert sigma[2] == pytest.approx(0.1 * 30 * 0.514444)
    assert sigma[0] / sigma[2] == pytest.approx((0.177 + 0.000823 * 50 / 0.3048) ** -0.4)
    top, _ = low_altitude(304.8, MODERATE)
    assert top[0] == pytest.approx(top[2])  # isotropic where the low-altitude model ends
    with pytest.raises(WrongUse, match="1000 ft"):
        low_altitude(400.0, MODERATE)


def gust_run(rows, V=20.0, n=40, dt=0.05):
    params = wind_params(dt, gusts=rows)
    state, out = wind_state(params), np.empty((6, n))
    _fly(params, state, 0, 0, out, dt, V)
    return out


def test_gust_builds_up_as_one_minus_cosine_and_stays():
    out = gust_run([[0.5, 0.0, -1.5, 0.0, 1.0, 10.0, 1.0, 1.0]])
    k = np.arange(40)
    way = np.clip((k * 0.05 - 0.5) * 20.0, 0.0, 10.0)
    np.testing.assert_allclose(out[1], -0.75 * (1 - np.cos(np.pi * way / 10.0)), atol=1e-12)
    assert (out[1, :11] == 0).all() and out[1, 11] != 0  # starts at t = 0.5 s, not a step early or late
    assert out[1, -1] == -1.5 and (out[[0, 2, 3, 4, 5]] == 0).all()


def test_gust_that_passes_dies_away_over_the_same_length():
    out = gust_run([[0.5, 2.0, 0.0, 3.0, 4.0, 1.0, 8.0, 0.0]])
    assert out[0].max() == pytest.approx(2.0) and out[2].max() == pytest.approx(3.0, rel=1e-2)
    assert out[0, -1] == 0.0 and out[2, -1] == 0.0
    np.testing.assert_allclose(out[0, 10:19], out[0, 18:9:-1], atol=1e-12)


@settings(deadline=None)
@given(h=st.floats(2.0, 120.0))
def test_shear_is_the_logarithmic_law(h):
    params = wind_params(DT, steady=(3.0, -1.0, 0.0), shear_height=6.096, roughness=0.0457)
    assert shear_factor(params, h) == pytest.approx(math.log(h / 0.0457) / math.log(6.096 / 0.0457))
    w = wind_now(params, wind_state(params), h)
    assert w.north / w.east == pytest.approx(-3.0)
    assert shear_factor(params, -5.0) == shear_factor(params, 0.9)


@pytest.mark.parametrize(
    "bad",
    [
        {"roughness": 10.0, "shear_height": 5.0},
        {"gusts": [[0, 1, 0, 0, 0.0, 1, 1, 1]]},
        {"gusts": [[math.nan, 1, 0, 0, 1, 1, 1, 1]]},
    ],
)
def test_impossible_wind_is_refused(bad):
    with pytest.raises(WrongUse):
        wind_params(DT, **bad)


def test_impossible_turbulence_is_refused():
    with pytest.raises(WrongUse, match="dryden, von_karman"):
        forming_filters("kolmogorov", (1, 1, 1), (1, 1, 1), 20.0, 2.0)
    with pytest.raises(WrongUse, match="span"):
        forming_filters("dryden", (1, 1, 1), (1, 1, 1), 20.0, 0.0)
