"""Linear blocks keep the promises of their mathematics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core import WrongUse
from aerofdi.parts.bessel import bessel_sections, sections_settle, sections_step
from aerofdi.parts.lti import held_noise, hold, lti_advance, lti_output
from aerofdi.parts.rate_filter import Disturbance, rate_filter, rate_filter_step


@settings(deadline=None, max_examples=25)
@given(st.integers(2, 6), st.floats(0.5, 15.0))
def test_bessel_is_minus_three_decibel_at_its_bandwidth(order, bandwidth):
    dt = 0.01
    sos = bessel_sections(order, bandwidth, dt)
    z = np.exp(1j * bandwidth * dt)
    gain = np.prod([(b0 + b1 / z + b2 / z**2) / (1 + a1 / z + a2 / z**2) for b0, b1, b2, a1, a2 in sos])
    assert 20 * math.log10(abs(gain)) == pytest.approx(-3.0103, abs=0.01)


def test_bessel_does_not_ring_and_settles_where_it_is_told():
    sos = bessel_sections(5, 2.0, 0.02)
    state = np.zeros((len(sos), 2))
    y = [sections_step(sos, state, 1.0) for _ in range(600)]
    assert max(y) < 1.01 and y[-1] == pytest.approx(1.0, abs=1e-9)
    sections_settle(sos, state, 3.0)
    assert sections_step(sos, state, 3.0) == pytest.approx(3.0, abs=1e-12)


def test_a_bandwidth_above_nyquist_is_refused():
    with pytest.raises(WrongUse, match="Nyquist"):
        bessel_sections(5, 400.0, 0.01)


def test_hold_is_the_solution_of_the_differential_equation():
    a, b = np.array([[0.0, 1.0], [-4.0, -0.4]]), np.array([[0.0], [4.0]])
    ad, bd = hold(a, b, 0.1)
    x, fine = np.array([0.3, -1.0]), np.array([0.3, -1.0])
    work = np.zeros(2)
    lti_advance(ad, bd, x, np.array([0.7]), work)
    n = 20_000
    for _ in range(n):
        k1 = a @ fine + b[:, 0] * 0.7
        k2 = a @ (fine + 0.05 / n * k1) + b[:, 0] * 0.7
        fine = fine + 0.1 / n * k2
    np.testing.assert_allclose(x, fine, atol=1e-9)
    y = np.zeros(1)
    lti_output(np.array([[1.0, 2.0]]), np.array([[3.0]]), x, np.array([0.7]), y)
    assert y[0] == pytest.approx(x[0] + 2 * x[1] + 2.1)


def test_held_noise_is_the_integral():
    a, q = np.array([[-2.0, 1.0], [0.0, -3.0]]), np.diag([0.5, 2.0])
    steps = np.linspace(0, 0.2, 4001)
    values = [(e := hold(a, np.zeros((2, 1)), s)[0]) @ q @ e.T for s in steps]
    np.testing.assert_allclose(held_noise(a, q, 0.2), np.trapezoid(values, steps, axis=0), rtol=1e-6)


@pytest.mark.parametrize(
    "noise", [Disturbance(0.5, 2.0, 60.0, 0.3, 0.02), Disturbance(0.1, 8.0, 60.0, 0.01, 1e-6)]
)
def test_innovations_of_the_rate_filter_are_white_with_the_stated_variance(noise):
    dt, a, n = 0.02, -8.0, 60_000
    f = rate_filter(a, noise, dt)
    rng = np.random.default_rng(3)
    m = np.array([[a, 1.0, 1.0], [0.0, -1 / noise.t_d, 0.0], [0.0, 0.0, -1 / noise.t_c]])
    q = held_noise(m, np.diag([0.0, 2 * noise.s_d**2 / noise.t_d, 2 * noise.s_c**2 / noise.t_c]), dt)
    root = np.linalg.cholesky(q + 1e-18 * np.eye(3))
    plant, x, e = np.zeros(3), np.zeros(3), np.empty(n)
    for k in range(n):
        u = math.sin(0.01 * k)
        e[k] = plant[0] + noise.s_v * rng.standard_normal() - x[0]
        rate_filter_step(f.ad, f.bd, f.k, x, u, e[k])
        plant = f.ad @ plant + f.bd * u + root @ rng.standard_normal(3)
    e = e[500:]
    assert np.var(e) == pytest.approx(f.s, rel=0.03)
    for lag in (1, 2, 5, 20):
        assert abs(np.corrcoef(e[:-lag], e[lag:])[0, 1]) < 4.5 / math.sqrt(n)


@settings(deadline=None, max_examples=10)
@given(st.floats(-40, -0.5), st.floats(0.1, 5), st.floats(1e-4, 20), st.floats(1e-6, 5), st.floats(1e-5, 0.1))
def test_the_steady_gain_solves_the_riccati_equation(a, t_d, s_d, s_c, s_v):
    noise, dt = Disturbance(t_d, s_d, 60.0, s_c, s_v), 0.02
    f = rate_filter(a, noise, dt)
    m = np.array([[a, 1.0, 1.0], [0.0, -1 / t_d, 0.0], [0.0, 0.0, -1 / 60.0]])
    q = held_noise(m, np.diag([0.0, 2 * s_d**2 / t_d, 2 * s_c**2 / 60.0]), dt) + 1e-12 * s_v**2 * np.eye(3)
    # Plain iteration of the filter's covariance ends at the same gain.
    p = q.copy()
    for _ in range(15_000):
        k = p[:, 0] / (p[0, 0] + s_v**2)
        p = f.ad @ (p - np.outer(k, p[0])) @ f.ad.T + q
    np.testing.assert_allclose(f.k, p[:, 0] / (p[0, 0] + s_v**2), rtol=2e-4, atol=1e-6)
    closed = f.ad @ (np.eye(3) - np.outer(f.k, [1.0, 0.0, 0.0]))
    assert np.abs(np.linalg.eigvals(closed)).max() < 1.0
