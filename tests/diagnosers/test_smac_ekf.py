"""The rate filter of SMAC-FDI: its Jacobian, its process noise and its covariance against independent
derivations.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec

from aerofdi.core import WrongUse
from aerofdi.diagnosers import smac_ekf as ekf

# Table A1 of the paper, typed here again so that the test does not read what the product reads.
INERTIA = np.array([[2.56, 0.0, 0.5], [0.0, 10.9, 0.0], [0.5, 0.0, 11.3]])
S, B, C, RHO, TS = 1.8, 3.1, 0.58, 1.225, 0.02
STATIC = np.array([[0.0, 0.0, -0.013], [0.0208, -0.0903, 0.0], [0.0, 0.0, 0.0867]])
SURFACES = np.array(
    [[-0.03395, 0.03395, -0.00485, 0.00485, 0.0], [0.0389, 0.0389, 0.2725, 0.2725, 0.0], [0, 0, 0, 0, 0.0534]]
)
RATES = np.array([[-0.192, 0.0, 0.0361], [0.0, -9.83, 0.0], [0.0, 0.0, -0.214]])


def model(**change):
    numbers = dict(
        inertia=INERTIA, S=S, b=B, c=C, rho=RHO, static=STATIC, surfaces=SURFACES, rates=RATES, dt=TS
    )
    return ekf.rate_model(**(numbers | change))


def rigid_body(omega, V, alpha, beta, u, rates=RATES, inertia=INERTIA):
    """(1) and (2) written as vectors, nothing shared with the product."""
    qbar = 0.5 * RHO * V**2
    reduced = omega * np.array([B, C, B]) / (2 * V)
    coefficients = STATIC @ [1.0, alpha, beta] + SURFACES @ u + rates @ reduced
    torque = qbar * S * np.array([B, C, B]) * coefficients
    return np.linalg.solve(inertia, torque - np.cross(omega, inertia @ omega))


def acceleration(m, V, alpha, beta, u):
    """The command carries 30 % of u, the excitation the rest: only their sum may matter."""
    z = np.concatenate([[np.nan], 0.3 * u, 0.7 * u])
    return [ekf.input_acceleration(m, V, alpha, beta, z, 1, len(u), i) for i in range(3)]


def filter_derivative(m, omega, V, alpha, beta, u):
    accel = acceleration(m, V, alpha, beta, u)
    return np.array(ekf.rate_derivative(m, *omega, 0.5 * RHO * V, *accel))


finite = st.floats(-2.0, 2.0)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(finite, finite, finite),
    st.floats(12, 60),
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.floats(-1, 1),
)
def test_rate_equations_and_jacobian(omega, V, alpha, beta, nr):
    omega, u = np.array(omega), np.array([0.1, -0.2, 0.05, 0.3, -0.1])
    rates = RATES.copy()
    rates[2, 0] = nr  # C_Np, which the paper does not have
    m = model(rates=rates)
    want = rigid_body(omega, V, alpha, beta, u, rates)
    assert filter_derivative(m, omega, V, alpha, beta, u) == pytest.approx(want, abs=1e-9, rel=1e-9)
    # omega' is quadratic in omega, so central differences are exact but for rounding.
    h = 0.1
    jac = [
        (
            rigid_body(omega + h * e, V, alpha, beta, u, rates)
            - rigid_body(omega - h * e, V, alpha, beta, u, rates)
        )
        for e in np.eye(3)
    ]
    F = np.reshape(ekf.transition(m, *omega, 0.5 * RHO * V), (3, 3))
    assert pytest.approx(np.array(jac).T / (2 * h), abs=1e-8, rel=1e-8) == F


def test_seventeen_coefficients_rebuild_the_jacobian():
    """F(k) assembled from the named coefficients exactly as the paper lays them out."""
    V, (p, q, r) = 30.0, (0.7, -0.4, 0.9)
    a = ekf.transition_coefficients(INERTIA, S, B, C, V, -0.192, 0.0361, -9.83, -0.214)
    assert len(a) == 17
    Q = 0.5 * RHO * V**2
    F = [
        [a["A11qbar"] * Q + a["A11q"] * q, a["A12p"] * p + a["A12r"] * r, a["A13qbar"] * Q + a["A13q"] * q],
        [a["A21p"] * p + a["A21r"] * r, a["A22qbar"] * Q, a["A23p"] * p + a["A23r"] * r],
        [a["A31qbar"] * Q + a["A31q"] * q, a["A32p"] * p + a["A32r"] * r, a["A33qbar"] * Q + a["A33q"] * q],
    ]
    assert np.ravel(F) == pytest.approx(np.array(ekf.transition(model(), p, q, r, 0.5 * RHO * V)), rel=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(-20, 20), min_size=9, max_size=9), st.lists(st.floats(0.01, 5), min_size=3, max_size=3)
)
def test_process_noise_is_the_integral(entries, w):
    F = np.reshape(entries, (3, 3))

    def integrand(t):
        phi = np.eye(3) + F * t
        return phi @ np.diag(w) @ phi.T

    want = quad_vec(integrand, 0.0, TS, epsabs=1e-14, epsrel=1e-12)[0]
    got = ekf.process_noise(*entries, *w, TS)
    assert got == pytest.approx(
        [want[i, j] for i, j in ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))], rel=1e-9
    )
    # The printed R_wk(3,2) has F21 where F32 belongs: off by w2^2 Ts^2/2 (F32 - F21) to first order.
    printed = got[4] + w[1] * TS**2 * (0.5 + TS * F[1, 1] / 3) * (F[1, 0] - F[2, 1])
    assert printed != pytest.approx(want[2, 1], rel=1e-9, abs=1e-12) or abs(F[1, 0] - F[2, 1]) < 1e-6


def test_one_cycle_equals_the_textbook():
    m = model()
    rng = np.random.default_rng(0)
    x, P = np.array([0.2, -0.1, 0.3]), np.eye(3)
    K, axes = np.array([*x, 1.0, 0, 1, 0, 0, 1]), np.zeros((3, 1))
    for _ in range(200):
        y, V, u = rng.normal(0, 0.3, 3), 30 + rng.normal(0, 5), rng.normal(0, 0.1, 5)
        ekf.ekf_step(m, K, y, V, *acceleration(m, V, 0.08, 0.01, u), axes)
        assert axes[:, 0] == pytest.approx(y - x)
        L = P @ np.linalg.inv(P + 0.1 * np.eye(3))
        x, P = x + L @ (y - x), (np.eye(3) - L) @ P
        F = np.reshape(ekf.transition(m, *x, 0.5 * RHO * V), (3, 3))
        x = x + TS * filter_derivative(m, x, V, 0.08, 0.01, u)
        w = quad_vec(lambda t, F=F: (np.eye(3) + F * t) @ (2.0 * np.eye(3)) @ (np.eye(3) + F * t).T, 0, TS)[0]
        P = (np.eye(3) + TS * F) @ P @ (np.eye(3) + TS * F).T + w
        assert K[:3] == pytest.approx(x, rel=1e-9, abs=1e-12)
        assert K[3:] == pytest.approx(P[np.tril_indices(3)], rel=1e-9, abs=1e-12)
    assert np.linalg.eigvalsh(P).min() > 0


def test_torque_scale():
    full, less = model(), model(torque_scale=0.75)
    args = (np.zeros(3), 30.0, 0.1, 0.02, np.full(5, 0.1))
    assert filter_derivative(less, *args) == pytest.approx(0.75 * filter_derivative(full, *args))


@pytest.mark.parametrize("bad", [np.diag([1.0, -1.0, 1.0]), np.ones((3, 3)), np.eye(2)])
def test_impossible_inertia_is_refused(bad):
    with pytest.raises(WrongUse, match="inertia"):
        model(inertia=bad)
