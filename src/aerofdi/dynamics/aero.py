"""Aerodynamics by stability derivatives, with stall blend and icing; the air data every kind needs.

Symbols: alpha angle of attack, beta sideslip, p^ = p b/2V, q^ = q c/2V, r^ = r b/2V, rates relative to the air.

    CL = (1 - s)(CL_0 + CL_alpha alpha) + s 2 sgn(alpha) sin^2(alpha) cos(alpha) + CL_q q^ + sum CL_i d_i
    CD = CD_0 + CD_alpha alpha + CD_alpha2 alpha^2 + CD_beta2 beta^2 + CD_q q^ + k (CL - CL_min_drag)^2 + sum CD_i |d_i|
    CY = CY_0 + CY_beta beta + CY_p p^ + CY_r r^ + sum CY_i d_i        (Cl and Cn alike)
    Cm = Cm_0 + Cm_alpha alpha + Cm_q q^ + sum Cm_i d_i

s is the sigmoid of Beard & McLain, Small Unmanned Aircraft, (4.9), with rate M and angle alpha_0. Icing multiplies
every coefficient C by 1 + eta K_C. Each surface has its own column of six control derivatives.
Not modelled: unsteady aerodynamics beyond alpha-dot derivatives, hysteresis of the stall, propeller wash.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..parts.dispatch import by_type
from ..parts.ops import atan2, exp, inline, maximum, sqrt
from .types import Coefficients, State, Surfaces, Wind

TINY_AIRSPEED = 1e-3


class AirData(NamedTuple):
    """Velocity relative to the air in body axes, its size and angles, and the rates relative to the air.

    V_xz is its part in the plane of symmetry; ca, sa, cb, sb are cosine and sine of alpha and beta.
    """

    u: float
    v: float
    w: float
    V: float
    V_xz: float
    alpha: float
    beta: float
    ca: float
    sa: float
    cb: float
    sb: float
    p: float
    q: float
    r: float


class Derivatives(NamedTuple):
    """Coefficients free of surfaces, per rad and per dimensionless rate; also holds their icing factors K."""

    CL_0: float
    CL_alpha: float
    CL_q: float
    CD_0: float
    CD_alpha: float
    CD_alpha2: float
    CD_beta2: float
    CD_q: float
    CY_0: float
    CY_beta: float
    CY_p: float
    CY_r: float
    Cl_0: float
    Cl_beta: float
    Cl_p: float
    Cl_r: float
    Cm_0: float
    Cm_alpha: float
    Cm_q: float
    Cn_0: float
    Cn_beta: float
    Cn_p: float
    Cn_r: float


class DerivativeAero(NamedTuple):
    """Parameters of the kind "derivatives".

    clean: coefficients without ice. ice: factor K of each. CD_induced, CL_min_drag: the polar.
    stall_rate, stall_alpha: M (0 for no blend) and alpha_0 in rad.
    """

    clean: Derivatives
    ice: Derivatives
    CD_induced: float
    CL_min_drag: float
    stall_rate: float
    stall_alpha: float


class ControlDerivatives(NamedTuple):
    """clean: six rows CD, CY, CL, Cl, Cm, Cn of N_SURFACES derivatives, per rad. ice: K times clean, entry by entry.

    Tuples, not arrays: an array inside a tuple costs reference counting at every use.
    """

    clean: tuple[Surfaces, Surfaces, Surfaces, Surfaces, Surfaces, Surfaces]
    ice: tuple[Surfaces, Surfaces, Surfaces, Surfaces, Surfaces, Surfaces]


coefficients = by_type("coefficients")
"""coefficients(aero, ice, air_data, inputs, p_hat, q_hat, r_hat) -> Coefficients, by the kind of aerodynamics."""

aero_inputs = by_type("aero_inputs")
"""aero_inputs(control, surfaces, eta) -> six floats gathered from the deflections, by the kind of control."""

iced = by_type("iced")
"""iced(aero, eta) -> the parameters with ice of severity eta, to be used in place of aero."""


@inline
def air_data(x: State, wind: Wind, wind_u: float, wind_v: float, wind_w: float) -> AirData:
    """Air data for a state, the turbulence in `wind` and the steady wind already turned into body axes."""
    u = x.u - wind_u - wind.u
    v = x.v - wind_v - wind.v
    w = x.w - wind_w - wind.w
    xz = u * u + w * w
    V_xz = maximum(sqrt(xz), TINY_AIRSPEED)
    V = maximum(sqrt(xz + v * v), TINY_AIRSPEED)
    per_V, per_xz = 1.0 / V, 1.0 / V_xz
    return AirData(
        u, v, w, V, V_xz,
        atan2(w, u), atan2(v, V_xz),
        u * per_xz, w * per_xz, V_xz * per_V, v * per_V,
        x.p - wind.p, x.q - wind.q, x.r - wind.r,
    )  # fmt: skip


@inline
def stall_blend(rate: float, alpha_0: float, alpha: float) -> float:
    """Share of the flat plate in the lift, 0 to 1; Beard & McLain (4.10)."""
    a = exp(-rate * (alpha - alpha_0))
    b = exp(rate * (alpha + alpha_0))
    return (1.0 + a + b) / ((1.0 + a) * (1.0 + b))


@iced.register(DerivativeAero)
@inline
def iced_derivatives(aero: DerivativeAero, eta: float) -> Derivatives:
    """Every coefficient C times 1 + eta K_C; unknown_input (30) in its corrected form."""
    c, k = aero.clean, aero.ice
    return Derivatives(
        c.CL_0 * (1.0 + eta * k.CL_0),
        c.CL_alpha * (1.0 + eta * k.CL_alpha),
        c.CL_q * (1.0 + eta * k.CL_q),
        c.CD_0 * (1.0 + eta * k.CD_0),
        c.CD_alpha * (1.0 + eta * k.CD_alpha),
        c.CD_alpha2 * (1.0 + eta * k.CD_alpha2),
        c.CD_beta2 * (1.0 + eta * k.CD_beta2),
        c.CD_q * (1.0 + eta * k.CD_q),
        c.CY_0 * (1.0 + eta * k.CY_0),
        c.CY_beta * (1.0 + eta * k.CY_beta),
        c.CY_p * (1.0 + eta * k.CY_p),
        c.CY_r * (1.0 + eta * k.CY_r),
        c.Cl_0 * (1.0 + eta * k.Cl_0),
        c.Cl_beta * (1.0 + eta * k.Cl_beta),
        c.Cl_p * (1.0 + eta * k.Cl_p),
        c.Cl_r * (1.0 + eta * k.Cl_r),
        c.Cm_0 * (1.0 + eta * k.Cm_0),
        c.Cm_alpha * (1.0 + eta * k.Cm_alpha),
        c.Cm_q * (1.0 + eta * k.Cm_q),
        c.Cn_0 * (1.0 + eta * k.Cn_0),
        c.Cn_beta * (1.0 + eta * k.Cn_beta),
        c.Cn_p * (1.0 + eta * k.Cn_p),
        c.Cn_r * (1.0 + eta * k.Cn_r),
    )


@inline
def dot(c: Surfaces, d: Surfaces) -> float:
    """Sum of products over the N_SURFACES places."""
    return (
        c[0] * d[0] + c[1] * d[1] + c[2] * d[2] + c[3] * d[3]
        + c[4] * d[4] + c[5] * d[5] + c[6] * d[6] + c[7] * d[7]
    )  # fmt: skip


@aero_inputs.register(ControlDerivatives)
@inline
def derivative_inputs(control: ControlDerivatives, d: Surfaces, eta: float) -> Coefficients:
    """Sum over the surfaces of their control derivatives times deflection (|deflection| for drag)."""
    c, k = control.clean, control.ice
    size = (abs(d[0]), abs(d[1]), abs(d[2]), abs(d[3]), abs(d[4]), abs(d[5]), abs(d[6]), abs(d[7]))
    return Coefficients(
        dot(c[0], size) + eta * dot(k[0], size),
        dot(c[1], d) + eta * dot(k[1], d),
        dot(c[2], d) + eta * dot(k[2], d),
        dot(c[3], d) + eta * dot(k[3], d),
        dot(c[4], d) + eta * dot(k[4], d),
        dot(c[5], d) + eta * dot(k[5], d),
    )


@coefficients.register(DerivativeAero)
@inline
def derivative_coefficients(
    aero: DerivativeAero, c: Any, air: AirData, d: Any, p_hat: float, q_hat: float, r_hat: float
) -> Coefficients:
    """The equations at the top of this file; c is the result of `iced`, d that of `aero_inputs`."""
    alpha, beta = air.alpha, air.beta
    lift = c.CL_0 + c.CL_alpha * alpha
    if aero.stall_rate > 0.0:
        s = stall_blend(aero.stall_rate, aero.stall_alpha, alpha)
        lift = (1.0 - s) * lift + s * 2.0 * abs(air.sa) * air.sa * air.ca
    CL = lift + c.CL_q * q_hat + d.CL
    polar = CL - aero.CL_min_drag
    CD = (
        c.CD_0
        + c.CD_alpha * alpha
        + c.CD_alpha2 * alpha * alpha
        + c.CD_beta2 * beta * beta
        + c.CD_q * q_hat
        + aero.CD_induced * polar * polar
        + d.CD
    )
    return Coefficients(
        CD,
        c.CY_0 + c.CY_beta * beta + c.CY_p * p_hat + c.CY_r * r_hat + d.CY,
        CL,
        c.Cl_0 + c.Cl_beta * beta + c.Cl_p * p_hat + c.Cl_r * r_hat + d.Cl,
        c.Cm_0 + c.Cm_alpha * alpha + c.Cm_q * q_hat + d.Cm,
        c.Cn_0 + c.Cn_beta * beta + c.Cn_p * p_hat + c.Cn_r * r_hat + d.Cn,
    )
