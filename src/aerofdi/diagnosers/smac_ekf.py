"""The one small filter of SMAC-FDI: an extended Kalman filter of the three turn rates.

    omega' = I^-1 (Gamma - omega x I omega)                                                              (1)
    L = qbar S b (CL0 + CLbeta beta + sum CL_i delta_i + CLp pbar + CLr rbar)                            (2)
    M = qbar S c (CM0 + CMalpha alpha + sum CM_i delta_i + CMq qbar_)
    N = qbar S b (CN0 + CNbeta beta + sum CN_i delta_i + CNp pbar + CNr rbar)

    pbar = b p / 2V, qbar_ = c q / 2V, rbar = b r / 2V, qbar = rho V^2 / 2. The residual is y - x(k|k-1), y
    = [p q r].

Symbols: F(k) continuous transition matrix, phi = I + F Ts, R_w density of the process noise ((rad/s)^2/s),
R_wk its discrete covariance (4), R_v covariance of the measured rates ((rad/s)^2), Sigma error covariance
stored as its lower triangle [11 21 22 31 32 33].

The source is the paper "smac", sections 2 and 3.1 and Table A1, with these misprints corrected: the
prediction is x + x' Ts (a transpose is printed); A32p = A31q (A32q = A31p is printed); R_wk(3,2) has A2 F32
(A2 F21 is printed); the phi(i,j) in the formulas of R_wk are the entries of F(k), as in phi(tau) = I + F
tau. C_Np is not in the paper and is zero there; with it F(k) gains two terms. Not modelled: servos, lift
and drag, anything but the three rates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core import Array, WrongUse
from ..parts.ops import inline


class RateModel(NamedTuple):
    """Numbers of the filter; made by `rate_model`.

    dt: s. rho: kg/m3. v_min: airspeeds below are taken as this, m/s. constants (17,): A11q A12r A21p/2 A21r
    A31q A32r (1); V F / qbar of the entries 11 13 22 31 33 (m/s / Pa / s); diagonals of R_w ((rad/s)2/s)
    and R_v ((rad/s)2). force (3, 3 + nu): angular acceleration per qbar of [1, alpha, beta, surfaces],
    1/s2/Pa.
    """

    dt: float
    rho: float
    v_min: float
    constants: Array
    force: Array

    @property
    def process_noise(self) -> Array:
        """Diagonal of R_w, (3,)."""
        return self.constants[11:14]

    @property
    def rate_noise(self) -> Array:
        """Diagonal of R_v, (3,)."""
        return self.constants[14:17]


def transition_coefficients(
    inertia: Array, S: float, b: float, c: float, V: float, CLp: float, CLr: float, CMq: float, CNr: float,
    CNp: float = 0.0,
) -> dict[str, float]:  # fmt: skip
    """The 17 coefficients of F(k) of section 3.1.2 by their names, at airspeed V.

    inertia (3, 3) kg m2 is the matrix of (1), so I13 is its entry (the paper prints +0.5 there); it must be
    symmetric with I12 = I23 = 0. A..qbar are in 1/s per Pa, the others are pure numbers.
    """
    _check_inertia(inertia)
    Ixx, Iyy, Izz, Ixz = inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 2]
    D1 = Ixx * Izz - Ixz**2
    N1 = Ixz * (Ixx - Iyy + Izz)
    k = S * b**2 / (2.0 * D1 * V)
    a12r = (Iyy * Izz - Ixz**2 - Izz**2) / D1
    a21r, a21p = (Izz - Ixx) / Iyy, 2.0 * Ixz / Iyy
    a31q = (Ixx**2 - Ixx * Iyy + Ixz**2) / D1
    return {
        "A11qbar": k * (Izz * CLp - Ixz * CNp),
        "A11q": -N1 / D1, "A12p": -N1 / D1, "A12r": a12r, "A13q": a12r,
        "A13qbar": k * (Izz * CLr - Ixz * CNr),
        "A21r": a21r, "A23p": a21r, "A21p": a21p, "A23r": -a21p,
        "A22qbar": S * c**2 * CMq / (2.0 * V * Iyy),
        "A31q": a31q, "A32p": a31q, "A32r": N1 / D1, "A33q": N1 / D1,
        "A31qbar": k * (Ixx * CNp - Ixz * CLp),
        "A33qbar": k * (Ixx * CNr - Ixz * CLr),
    }  # fmt: skip


def _check_inertia(inertia: Array) -> None:
    inertia = np.asarray(inertia, float)
    if inertia.shape != (3, 3) or not np.allclose(inertia, inertia.T) or inertia[0, 1] or inertia[1, 2]:
        raise WrongUse(
            "SMAC needs a symmetric (3, 3) inertia matrix with I12 = I23 = 0 (an aircraft symmetric left to right), "
            f"but was given {inertia.tolist()}"
        )
    if (np.linalg.eigvalsh(inertia) <= 0).any():
        raise WrongUse(
            f"the inertia matrix {inertia.tolist()} is not positive definite; check its signs and units"
        )


def rate_model(
    inertia: Array, S: float, b: float, c: float, rho: float,
    static: Array, surfaces: Array, rates: Array,
    dt: float, r_w: float | Array = 2.0, r_v: float | Array = 0.1, torque_scale: float = 1.0, v_min: float = 1.0,
) -> RateModel:  # fmt: skip
    """Fold an aircraft's numbers into the filter's.

    static (3, 3): [C0, C_alpha, C_beta] of the moments L, M, N. surfaces (3, nu): the moment coefficients
    per rad of each surface. rates (3, 3): coefficients of pbar, qbar_, rbar. r_w, r_v: diagonals of R_w and
    R_v (defaults of section 3.1.4). torque_scale multiplies every aerodynamic torque of the model (0.75:
    the paper's model error). Raises WrongUse on an inertia the equations do not hold for or a non-positive
    period, density or size.
    """
    inertia = np.asarray(inertia, float)
    if not min(S, b, c, rho, dt, torque_scale, v_min) > 0:
        raise WrongUse("SMAC needs S, b, c, rho, dt, torque_scale and v_min above 0")
    if rates[0][1] or rates[1][0] or rates[1][2] or rates[2][1]:
        raise WrongUse(
            "the turn-rate model has no coupling of pitch rate with roll and yaw; those entries must be 0"
        )
    a = transition_coefficients(
        inertia, S, b, c, 1.0, rates[0][0], rates[0][2], rates[1][1], rates[2][2], rates[2][0]
    )
    volume = np.array([S * b, S * c, S * b])[:, None]
    force = np.linalg.solve(inertia, volume * np.hstack([static, surfaces])) * torque_scale
    damping = [a[k] * torque_scale for k in ("A11qbar", "A13qbar", "A22qbar", "A31qbar", "A33qbar")]
    gyro = [a["A11q"], a["A12r"], 0.5 * a["A21p"], a["A21r"], a["A31q"], a["A32r"]]
    three = np.ones(3)
    return RateModel(
        float(dt), float(rho), float(v_min),
        np.concatenate([gyro, damping, three * r_w, three * r_v]), np.ascontiguousarray(force),
    )  # fmt: skip


@inline
def input_acceleration(
    m: RateModel, V: float, alpha: float, beta: float, z: Array, first: int, n: int, i: int
) -> float:
    """The part of omega'_i that does not depend on the rates, rad/s2: qbar force [1, alpha, beta, u] with
    u = z[first:first + n] + z[first + n:first + 2 n], the commands and what is added to them."""
    force = m.force
    total = float(force[i, 0]) + float(force[i, 1]) * alpha + float(force[i, 2]) * beta
    for j in range(n):
        total += float(force[i, 3 + j]) * (float(z[first + j]) + float(z[first + n + j]))
    return 0.5 * m.rho * V * V * total


@inline
def rate_derivative(
    m: RateModel, p: float, q: float, r: float, d: float, a0: float, a1: float, a2: float
) -> tuple[float, float, float]:
    """omega' of (1), rad/s2; d = qbar / V, a: the part that does not depend on the rates."""
    c = m.constants
    g0, g1, g2, g3, g4, g5 = float(c[0]), float(c[1]), float(c[2]), float(c[3]), float(c[4]), float(c[5])
    k0, k1, k2, k3, k4 = float(c[6]), float(c[7]), float(c[8]), float(c[9]), float(c[10])
    pd = a0 + d * (k0 * p + k1 * r) + q * (g0 * p + g1 * r)
    qd = a1 + d * k2 * q + g2 * (p * p - r * r) + g3 * p * r
    rd = a2 + d * (k3 * p + k4 * r) + q * (g4 * p + g5 * r)
    return pd, qd, rd


@inline
def transition(
    m: RateModel, p: float, q: float, r: float, d: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """F(k) of section 3.1.2 by rows, 1/s; d = qbar / V."""
    c = m.constants
    g0, g1, g2, g3, g4, g5 = float(c[0]), float(c[1]), float(c[2]), float(c[3]), float(c[4]), float(c[5])
    k0, k1, k2, k3, k4 = float(c[6]), float(c[7]), float(c[8]), float(c[9]), float(c[10])
    return (
        d * k0 + g0 * q, g0 * p + g1 * r, d * k1 + g1 * q,
        2.0 * g2 * p + g3 * r, d * k2, g3 * p - 2.0 * g2 * r,
        d * k3 + g4 * q, g4 * p + g5 * r, d * k4 + g5 * q,
    )  # fmt: skip


@inline
def process_noise(
    f11: float, f12: float, f13: float, f21: float, f22: float, f23: float, f31: float, f32: float, f33: float,
    w1: float, w2: float, w3: float, T: float,
) -> tuple[float, float, float, float, float, float]:  # fmt: skip
    """R_wk = integral of (I + F t) R_w (I + F t)' over [0, T], lower triangle; w = diagonal of R_w. Exact
    (4).
    """
    c = T * T * T / 3.0
    A1 = w1 * T * T * (0.5 + T * f11 / 3.0)
    A2 = w2 * T * T * (0.5 + T * f22 / 3.0)
    A3 = w3 * T * T * (0.5 + T * f33 / 3.0)
    return (
        w1 * T * (1.0 + f11 * T) + c * (w1 * f11 * f11 + w2 * f12 * f12 + w3 * f13 * f13),
        A1 * f21 + A2 * f12 + w3 * c * f13 * f23,
        w2 * T * (1.0 + f22 * T) + c * (w2 * f22 * f22 + w1 * f21 * f21 + w3 * f23 * f23),
        A1 * f31 + A3 * f13 + w2 * c * f12 * f32,
        A2 * f32 + A3 * f23 + w1 * c * f21 * f31,
        w3 * T * (1.0 + f33 * T) + c * (w3 * f33 * f33 + w1 * f31 * f31 + w2 * f32 * f32),
    )


@inline
def _measurement_update(
    K: Array, c: Array, n0: float, n1: float, n2: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Steps 1 to 3 with K = [x, Sigma], c the constants: the correction L n and the lower triangle of
    Sigma(k|k) = (I - L) Sigma = L R_v.
    """
    s11, s21, s22, s31, s32, s33 = (
        float(K[3]),
        float(K[4]),
        float(K[5]),
        float(K[6]),
        float(K[7]),
        float(K[8]),
    )
    v1, v2, v3 = float(c[14]), float(c[15]), float(c[16])
    # Inverse of S = Sigma + R_v through its cofactors.
    a, b, h, d, e, f = s11 + v1, s21, s22 + v2, s31, s32, s33 + v3
    i11, i21, i22 = h * f - e * e, d * e - b * f, a * f - d * d
    i31, i32, i33 = b * e - h * d, b * d - a * e, a * h - b * b
    scale = 1.0 / (a * i11 + b * i21 + d * i31)
    l11 = (s11 * i11 + s21 * i21 + s31 * i31) * scale
    l12 = (s11 * i21 + s21 * i22 + s31 * i32) * scale
    l13 = (s11 * i31 + s21 * i32 + s31 * i33) * scale
    l21 = (s21 * i11 + s22 * i21 + s32 * i31) * scale
    l22 = (s21 * i21 + s22 * i22 + s32 * i32) * scale
    l23 = (s21 * i31 + s22 * i32 + s32 * i33) * scale
    l31 = (s31 * i11 + s32 * i21 + s33 * i31) * scale
    l32 = (s31 * i21 + s32 * i22 + s33 * i32) * scale
    l33 = (s31 * i31 + s32 * i32 + s33 * i33) * scale
    return (
        l11 * n0 + l12 * n1 + l13 * n2, l21 * n0 + l22 * n1 + l23 * n2, l31 * n0 + l32 * n1 + l33 * n2,
        l11 * v1, l21 * v1, l22 * v2, l31 * v1, l32 * v2, l33 * v3,
    )  # fmt: skip


@inline
def ekf_step(
    m: RateModel, K: Array, y: Array, V: float, a0: float, a1: float, a2: float, axes: Array
) -> None:
    """One cycle of section 3.1.1: axes[:, 0] = residual y - x(k|k-1); K = [x, Sigma] (9,) becomes the
    prediction for k+1.

    y: p, q, r lead it. V: airspeed, m/s, positive. a0, a1, a2: the acceleration at k by everything but the
    rates, rad/s2 (`input_acceleration`). Everything must be finite; the caller sees to that.
    """
    c = m.constants
    p, q, r = float(K[0]), float(K[1]), float(K[2])
    n0, n1, n2 = float(y[0]) - p, float(y[1]) - q, float(y[2]) - r
    axes[0, 0], axes[1, 0], axes[2, 0] = n0, n1, n2
    dp, dq, dr, s11, s21, s22, s31, s32, s33 = _measurement_update(K, c, n0, n1, n2)
    p, q, r = p + dp, q + dq, r + dr
    dyn = 0.5 * m.rho * V
    T = m.dt
    f11, f12, f13, f21, f22, f23, f31, f32, f33 = transition(m, p, q, r, dyn)
    pd, qd, rd = rate_derivative(m, p, q, r, dyn, a0, a1, a2)
    K[0], K[1], K[2] = p + T * pd, q + T * qd, r + T * rd  # step 5
    w11, w21, w22, w31, w32, w33 = process_noise(
        f11, f12, f13, f21, f22, f23, f31, f32, f33, float(c[11]), float(c[12]), float(c[13]), T
    )
    # Step 4: Sigma(k+1|k) = phi Sigma phi' + R_wk, phi = I + F T.
    f11, f12, f13, f21, f22, f23 = 1.0 + T * f11, T * f12, T * f13, T * f21, 1.0 + T * f22, T * f23
    f31, f32, f33 = T * f31, T * f32, 1.0 + T * f33
    a11, a12, a13 = _times(f11, f12, f13, s11, s21, s22, s31, s32, s33)
    a21, a22, a23 = _times(f21, f22, f23, s11, s21, s22, s31, s32, s33)
    a31, a32, a33 = _times(f31, f32, f33, s11, s21, s22, s31, s32, s33)
    K[3] = a11 * f11 + a12 * f12 + a13 * f13 + w11
    K[4] = a21 * f11 + a22 * f12 + a23 * f13 + w21
    K[5] = a21 * f21 + a22 * f22 + a23 * f23 + w22
    K[6] = a31 * f11 + a32 * f12 + a33 * f13 + w31
    K[7] = a31 * f21 + a32 * f22 + a33 * f23 + w32
    K[8] = a31 * f31 + a32 * f32 + a33 * f33 + w33


@inline
def _times(
    a: float, b: float, c: float, s11: float, s21: float, s22: float, s31: float, s32: float, s33: float
) -> tuple[float, float, float]:
    """Row [a b c] times the symmetric matrix of lower triangle s."""
    return a * s11 + b * s21 + c * s31, a * s21 + b * s22 + c * s32, a * s31 + b * s32 + c * s33
