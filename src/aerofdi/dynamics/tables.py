"""Aerodynamics by wind-tunnel tables: base over (alpha, beta), increments of each surface, rate tables.

    C  = base(alpha, beta) + elevator(alpha, d) + flap(alpha, d) + rates
    Cl += 1/2 sgn(d) aileron(alpha, sgn(d) beta, |d|)                      d = right, d = -left
    [CY, Cn] += -sgn(d) share rudder(alpha, -sgn(d) beta, -|d|)            each rudder half, at its own deflection
    Cl += CY of the half times arm / span
    [CY, Cl, Cn] += sgn(p^) roll_rate(alpha, |p^|) + sgn(r^) yaw_rate(alpha, |r^|)

Linear interpolation. Outside the tables alpha, beta and rates are held at the edge; deflections go on linearly.
The propeller-wash axis of the tables is read once, at the advance ratio of the aircraft file, when the parameters are
made. Source of the rules: the open simulation of the Ultra Stick 120 (UASLab/OpenFlight).
Not modelled: icing of the tables (Effects.icing does nothing here), stall hysteresis.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..core.types import Array
from ..parts.ops import inline, where
from .aero import AirData, aero_inputs, coefficients, dot, iced
from .lookup import held, locate
from .types import Coefficients, Surfaces


class TableAero(NamedTuple):
    """Axes in rad, data arrays with coefficients in the last place; see the top of this file.

    alpha (n,), beta (m,), base (n, m, 6). aileron_d (k,), aileron (n, m, k). rudder_d (k,), rudder (n, m, k, 2).
    elevator_d (k,), elevator (n, k, 3). flap_d, flap alike. p_alpha, p_hat, p_table (., ., 3); r_ alike.
    top: (share, share * arm / span), bottom alike. Cm_q, CL_q per rad.
    """

    alpha: Array
    beta: Array
    base: Array
    aileron_d: Array
    aileron: Array
    rudder_d: Array
    rudder: Array
    elevator_d: Array
    elevator: Array
    flap_d: Array
    flap: Array
    p_alpha: Array
    p_hat: Array
    p_table: Array
    r_alpha: Array
    r_hat: Array
    r_table: Array
    top: tuple[float, float]
    bottom: tuple[float, float]
    Cm_q: float
    CL_q: float


class TableControl(NamedTuple):
    """Weights of the surfaces in the inputs elevator, aileron_left, aileron_right, rudder_top, rudder_bottom, flap."""

    weights: tuple[Surfaces, Surfaces, Surfaces, Surfaces, Surfaces, Surfaces]


@aero_inputs.register(TableControl)
@inline
def table_inputs(control: TableControl, d: Surfaces, eta: float) -> Coefficients:
    """The six inputs, in the places of Coefficients: elevator, aileron left, right, rudder top, bottom, flap."""
    w = control.weights
    return Coefficients(dot(w[0], d), dot(w[1], d), dot(w[2], d), dot(w[3], d), dot(w[4], d), dot(w[5], d))


@iced.register(TableAero)
@inline
def iced_tables(aero: TableAero, eta: float) -> float:
    """Tables have no icing coefficients."""
    return eta


@inline
def _plane(table: Array, i: int, f: float, j: int, g: float, n: int) -> float:
    """Coefficient n of a table with two axes, (i, f) and (j, g) from `locate`."""
    a = table[i, j, n] + g * (table[i, j + 1, n] - table[i, j, n])
    b = table[i + 1, j, n] + g * (table[i + 1, j + 1, n] - table[i + 1, j, n])
    return a + f * (b - a)


@inline
def _aileron(aero: TableAero, i: int, f: float, beta: float, d: float) -> float:
    """Rolling moment of one aileron, d positive for a deflection that rolls left on the right wing."""
    s = where(d < 0.0, -1.0, 1.0)
    j, g = held(aero.beta, s * beta)
    k, h = locate(aero.aileron_d, s * d)
    return (
        0.5
        * s
        * (_plane(aero.aileron, i, f, j, g, k) * (1.0 - h) + _plane(aero.aileron, i, f, j, g, k + 1) * h)
    )


@inline
def _rudder(aero: TableAero, i: int, f: float, beta: float, d: float) -> tuple[float, float]:
    """CY and Cn of the whole rudder at d."""
    s = where(d < 0.0, -1.0, 1.0)
    j, g = held(aero.beta, -s * beta)
    k, h = locate(aero.rudder_d, -s * d)
    low, high = aero.rudder[:, :, k, :], aero.rudder[:, :, k + 1, :]
    CY = _plane(low, i, f, j, g, 0) * (1.0 - h) + _plane(high, i, f, j, g, 0) * h
    Cn = _plane(low, i, f, j, g, 1) * (1.0 - h) + _plane(high, i, f, j, g, 1) * h
    return -s * CY, -s * Cn


@coefficients.register(TableAero)
@inline
def table_coefficients(
    aero: TableAero, eta: float, air: AirData, d: Any, p_hat: float, q_hat: float, r_hat: float
) -> Coefficients:
    """The equations at the top of this file; d holds the six inputs of `table_inputs`."""
    beta = air.beta
    i, f = held(aero.alpha, air.alpha)
    j, g = held(aero.beta, beta)
    ke, he = locate(aero.elevator_d, d.CD)
    kf, hf = locate(aero.flap_d, d.Cn)
    top_CY, top_Cn = _rudder(aero, i, f, beta, d.Cl)
    low_CY, low_Cn = _rudder(aero, i, f, beta, d.Cm)
    CY = aero.top[0] * top_CY + aero.bottom[0] * low_CY
    Cl = aero.top[1] * top_CY + aero.bottom[1] * low_CY
    Cl += _aileron(aero, i, f, beta, d.CL) + _aileron(aero, i, f, beta, -d.CY)
    Cn = aero.top[0] * top_Cn + aero.bottom[0] * low_Cn
    sp = where(p_hat < 0.0, -1.0, 1.0)
    ip, fp = held(aero.p_alpha, air.alpha)
    jp, gp = held(aero.p_hat, sp * p_hat)
    sr = where(r_hat < 0.0, -1.0, 1.0)
    ir, fr = held(aero.r_alpha, air.alpha)
    jr, gr = held(aero.r_hat, sr * r_hat)
    CY += sp * _plane(aero.p_table, ip, fp, jp, gp, 0) + sr * _plane(aero.r_table, ir, fr, jr, gr, 0)
    Cl += sp * _plane(aero.p_table, ip, fp, jp, gp, 1) + sr * _plane(aero.r_table, ir, fr, jr, gr, 1)
    Cn += sp * _plane(aero.p_table, ip, fp, jp, gp, 2) + sr * _plane(aero.r_table, ir, fr, jr, gr, 2)
    CD = _plane(aero.elevator, i, f, ke, he, 0) + _plane(aero.flap, i, f, kf, hf, 0)
    CL = _plane(aero.elevator, i, f, ke, he, 1) + _plane(aero.flap, i, f, kf, hf, 1) + aero.CL_q * q_hat
    Cm = _plane(aero.elevator, i, f, ke, he, 2) + _plane(aero.flap, i, f, kf, hf, 2) + aero.Cm_q * q_hat
    return Coefficients(
        CD + _plane(aero.base, i, f, j, g, 0),
        CY + _plane(aero.base, i, f, j, g, 1),
        CL + _plane(aero.base, i, f, j, g, 2),
        Cl + _plane(aero.base, i, f, j, g, 3),
        Cm + _plane(aero.base, i, f, j, g, 4),
        Cn + _plane(aero.base, i, f, j, g, 5),
    )
