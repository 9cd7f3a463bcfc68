"""The tuning formulas of SMAC against simulations of the equations they come from."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from aerofdi.aircraft import load_aircraft
from aerofdi.core import CannotJudge, WrongUse
from aerofdi.design import smac_tuning as tune
from aerofdi.design.smac import PAPER, aircraft_rate_model, commanded_surfaces
from aerofdi.diagnosers.smac_ekf import ekf_step, input_acceleration
from aerofdi.dynamics.trim import trim

DEG = math.pi / 180.0


@pytest.fixture(scope="module")
def model():
    aircraft = load_aircraft("ducard")
    condition = trim(aircraft)
    return aircraft_rate_model(aircraft, condition, commanded_surfaces(aircraft), PAPER), condition


def filtered(model, condition, deflection, n=3000):
    """Residuals of the real filter when the rates stay zero and the commands deviate: deflection(k) -> (5,)
    rad.
    """
    at_trim = np.array(condition.surfaces[:5])
    K, axes, out = np.array([0.0, 0, 0, 1, 0, 1, 0, 0, 1]), np.zeros((3, 5)), np.zeros((n, 3))
    for k in range(n):
        z = np.concatenate([at_trim + deflection(k), np.zeros(5)])
        accel = [
            input_acceleration(model, condition.airspeed, condition.alpha, 0.0, z, 0, 5, i) for i in range(3)
        ]
        ekf_step(model, K, np.zeros(3), condition.airspeed, *accel, axes)
        out[k] = axes[:, 0]
    return out


def test_model_is_at_rest_in_trim_and_has_the_torques_of_the_aircraft_reduced_by_a_quarter(model):
    m, condition = model
    assert np.abs(filtered(m, condition, lambda k: np.zeros(5), 200)).max() < 1e-9
    # B of the facts, (p, q, r) per rad of each surface at 30 m/s, computed elsewhere from the same aircraft.
    B = [
        [-41.148, 41.148, -5.878, 5.878, -2.864],
        [2.054, 2.054, 14.388, 14.388, 0],
        [1.821, -1.821, 0.260, -0.260, 14.663],
    ]
    qbar = 0.5 * m.rho * condition.airspeed**2
    assert m.force[:, 3:] * qbar == pytest.approx(0.75 * np.array(B), abs=0.4)


@pytest.mark.parametrize("surface", range(5))
def test_steady_and_excited_residuals_of_a_stuck_surface(model, surface):
    """(11) and the amplitude in (16): a surface stays in trim while its command deviates by 2 deg, or
    swings at 1 Hz.
    """
    m, condition = model
    e = np.eye(5)[surface] * 2.0 * DEG
    last = filtered(m, condition, lambda k: e)[-1]
    assert last == pytest.approx(
        -tune.residual_response(m, condition.airspeed).real[:, surface] * 2.0 * DEG, rel=5e-3, abs=2e-6
    )  # the filter is nonlinear, the formula is not
    w = 2.0 * math.pi
    swung = filtered(m, condition, lambda k: e * math.sin(w * m.dt * k))[-1000:]
    expected = tune.residual_response(m, condition.airspeed, w)[:, surface] * 2.0 * DEG
    assert np.abs(swung).max(axis=0) == pytest.approx(np.abs(expected), rel=0.01, abs=2e-6)


def test_filter_gain_is_where_the_covariance_settles(model):
    m, condition = model
    L, _ = tune.filter_gain(m, condition.airspeed)
    K, axes = np.array([0.0, 0, 0, 1, 0, 1, 0, 0, 1]), np.zeros((3, 5))
    z = np.concatenate([condition.surfaces[:5], np.zeros(5)])
    accel = [input_acceleration(m, condition.airspeed, condition.alpha, 0.0, z, 0, 5, i) for i in range(3)]
    for _ in range(2000):
        ekf_step(m, K, np.zeros(3), condition.airspeed, *accel, axes)
    S = np.array([[K[3], K[4], K[6]], [K[4], K[5], K[7]], [K[6], K[7], K[8]]])
    assert pytest.approx(S @ np.linalg.inv(S + np.diag(m.rate_noise)), rel=1e-6, abs=1e-9) == L
    assert (tune.stiffness(m, condition.airspeed) > 0).all()  # (10)


@settings(max_examples=60, deadline=None)
@given(st.floats(1, 60), st.floats(5, 60), st.floats(0.002, 0.2), st.floats(0.0, 0.05), st.floats(0.0, 0.05))
def test_window_is_empty_exactly_where_13_says(b, stiff, fault, torque, noise):
    gamma = torque + noise
    if fault <= tune.smallest_detectable(gamma):
        with pytest.raises(CannotJudge, match="torque error" if torque >= noise else "noise"):
            tune.threshold_window(b, stiff, fault, {"torque error": torque, "noise": noise})
        return
    w = tune.threshold_window(b, stiff, fault, {"torque error": torque, "noise": noise})
    assert w.low == pytest.approx(tune.steady_residual(b, stiff, 0.0, gamma))
    assert w.high == pytest.approx(tune.steady_residual(b, stiff, fault, -gamma))
    assert w.low < w.high


def test_empty_window_says_how_far_to_go():
    with pytest.raises(
        CannotJudge, match=r"reduce 'torque error' from 1\.50 deg to below 0\.80 deg"
    ) as error:
        tune.threshold_window(
            41.0, 25.0, 2.0 * DEG, {"torque error": 1.5 * DEG, "noise": 0.2 * DEG}, "the roll axis"
        )
    assert "3.40 deg as the smallest fault" in str(error.value) and "roll" in str(error.value)
    with pytest.raises(CannotJudge, match="and the others together"):
        tune.threshold_window(41.0, 25.0, 2.0 * DEG, {"torque error": 1.5 * DEG, "noise": 1.2 * DEG})


def test_excited_residual_solves_the_differential_equation():
    """(15) integrated numerically ends in (16)."""
    b, stiff, A, w, deviation = 41.0, 25.0, 2.0 * DEG, 2.0 * math.pi, 1.0 * DEG
    c1, c2, phi0 = tune.excited_residual(b, stiff, A, w, deviation)
    x = solve_ivp(
        lambda t, x: -stiff * x + b * (deviation - A * math.sin(w * t)), (0, 10), [0.0], rtol=1e-9, atol=1e-12,
        t_eval=np.linspace(9, 10, 50),
    )  # fmt: skip
    assert x.y[0] == pytest.approx(c1 - c2 * np.sin(w * x.t - phi0), abs=1e-8)


def test_smallest_amplitude_keeps_sound_and_dead_apart():
    """With it, the answers of a sound and of a dead surface in a noisy command are so many deviations apart."""
    w, dt, n, answer, std, deviations = 2.0 * math.pi, 0.02, 50, 0.6, 0.01, 4.0
    wave = np.sin(w * dt * np.arange(n))
    noise = std * np.random.default_rng(0).standard_normal((4000, n))
    quadrature = 2.0 / n * noise @ wave
    A = tune.smallest_amplitude(quadrature.std(), answer, deviations)
    heard = 2.0 / n * (noise - answer * A * wave) @ wave
    assert -heard.mean() / heard.std() == pytest.approx(deviations, rel=0.05)
    with pytest.raises(WrongUse, match="positive"):
        tune.smallest_amplitude(std, 0.0, deviations)


def test_lambda_max_is_the_mean_of_the_rectified_sine():
    t = np.linspace(0.0, 1.0, 100_001)
    assert np.mean(np.abs(0.035 * np.sin(2 * np.pi * t))) == pytest.approx(tune.lambda_max(0.035), rel=1e-4)
    assert tune.lambda_max(2.0 * DEG) == pytest.approx(0.0222, abs=1e-4)  # Example 1


def test_mean_settles_in_the_time_asked():
    """(18): a first-order filter at the frequency of (19) is within epsilon of a constant after the time."""
    f = tune.mean_frequency(0.05, 1.6)
    assert math.exp(-2.0 * math.pi * f * 1.6) == pytest.approx(0.05)
    assert (1.0 - tune.share(f, 0.02)) ** round(1.6 / 0.02) == pytest.approx(0.05)
    with pytest.raises(WrongUse, match="epsilon"):
        tune.mean_frequency(1.5, 1.0)


@given(st.floats(0.05, 3.0), st.floats(-3.0, 3.0), st.integers(0, 3))
def test_lone_loop_inverts_the_shared_answer(size, angle, twins):
    loop = cmath.rect(size, angle)
    if abs(1 + (1 + twins) * loop) < 0.05 or abs(1 + twins * loop) < 0.05:
        return
    answer = -loop / (1 + (1 + twins) * loop)
    assert tune.lone_loop(answer, twins) == pytest.approx(loop, rel=1e-6)


@given(st.floats(0.1, 1.0), st.floats(-3, 3), st.floats(0.1, 1.0), st.floats(-1.2, 1.2))
def test_common_answer_hears_both_in_full(a, angle, b, turn):
    shared, alone = cmath.rect(a, angle), cmath.rect(b, angle + turn)
    reference = tune.common_answer(shared, alone)
    assert min((shared / reference).real, (alone / reference).real) >= 1.0 - 1e-9
    # Nothing shorter than the nearest point of the segment would do, nothing longer hears both.
    nearest = min(abs(shared + s * (alone - shared)) for s in np.linspace(0, 1, 2001))
    assert abs(reference) == pytest.approx(nearest, rel=1e-3)


def test_opposite_delay_cancels_a_sine():
    w, dt = 2.0 * math.pi, 0.02
    answer = 0.8 * cmath.exp(1j * (math.pi - w * 0.12))  # against the excitation, 0.12 s late
    k = np.arange(500)
    excitation, command = np.sin(w * dt * k), np.imag(answer * np.exp(1j * w * dt * k))
    lag = tune.opposite_delay(answer, w, dt)
    assert lag == 6
    assert (
        np.abs(np.sin(w * dt * (k - lag)) + command / 0.8).max()
        < 1e-6
        < np.abs(excitation + command / 0.8).max()
    )


def test_filters_that_do_not_converge_are_refused():
    with pytest.raises(WrongUse, match="R_w"):
        tune.steady_residual(1.0, -2.0, 0.1)
