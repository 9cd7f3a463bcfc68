"""Rigid body with an x-z plane of symmetry: attitude, rotation, translation. Body axes forward-right-down, NED.

Quaternion e0..e3 turns body into north-east-down (scalar first). Inertia tensor [Jx 0 -Jxz; 0 Jy 0; -Jxz 0 Jz].
"""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import atan2, clip, cos, inline, sin, sqrt


class Inertia(NamedTuple):
    """Moments and product of inertia about the centre of gravity, kg m2; Jxz = integral of x z dm."""

    Jx: float
    Jy: float
    Jz: float
    Jxz: float


@inline
def quaternion(phi: float, theta: float, psi: float) -> tuple[float, float, float, float]:
    """Unit quaternion of the Euler angles yaw-pitch-roll.

    >>> [round(float(e), 6) for e in quaternion(0.0, 0.0, 3.141592653589793)]
    [0.0, 0.0, 0.0, 1.0]
    """
    cf, sf = cos(0.5 * phi), sin(0.5 * phi)
    ct, st = cos(0.5 * theta), sin(0.5 * theta)
    cp, sp = cos(0.5 * psi), sin(0.5 * psi)
    return (
        cp * ct * cf + sp * st * sf,
        cp * ct * sf - sp * st * cf,
        cp * st * cf + sp * ct * sf,
        sp * ct * cf - cp * st * sf,
    )


@inline
def euler(e0: float, e1: float, e2: float, e3: float) -> tuple[float, float, float]:
    """phi, theta, psi of a quaternion whose length need not be exactly one."""
    s = 1.0 / sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    e0, e1, e2, e3 = e0 * s, e1 * s, e2 * s, e3 * s
    phi = atan2(2.0 * (e0 * e1 + e2 * e3), e0 * e0 + e3 * e3 - e1 * e1 - e2 * e2)
    st = clip(2.0 * (e0 * e2 - e1 * e3), -1.0, 1.0)
    # asin by atan2 keeps full accuracy near the horizon and needs one name less.
    theta = atan2(st, sqrt((1.0 - st) * (1.0 + st)))
    psi = atan2(2.0 * (e0 * e3 + e1 * e2), e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3)
    return phi, theta, psi


@inline
def to_ned(
    e0: float, e1: float, e2: float, e3: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """A body vector in north-east-down axes (unit quaternion)."""
    return (
        (e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3) * x
        + 2.0 * (e1 * e2 - e0 * e3) * y
        + 2.0 * (e1 * e3 + e0 * e2) * z,
        2.0 * (e1 * e2 + e0 * e3) * x
        + (e0 * e0 - e1 * e1 + e2 * e2 - e3 * e3) * y
        + 2.0 * (e2 * e3 - e0 * e1) * z,
        2.0 * (e1 * e3 - e0 * e2) * x
        + 2.0 * (e2 * e3 + e0 * e1) * y
        + (e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3) * z,
    )


@inline
def to_body(
    e0: float, e1: float, e2: float, e3: float, n: float, e: float, d: float
) -> tuple[float, float, float]:
    """A north-east-down vector in body axes (unit quaternion)."""
    return to_ned(e0, -e1, -e2, -e3, n, e, d)


@inline
def quaternion_rate(
    e0: float, e1: float, e2: float, e3: float, p: float, q: float, r: float
) -> tuple[float, float, float, float]:
    """Time derivative of the attitude quaternion for body rates p, q, r in rad/s."""
    return (
        0.5 * (-p * e1 - q * e2 - r * e3),
        0.5 * (p * e0 + r * e2 - q * e3),
        0.5 * (q * e0 - r * e1 + p * e3),
        0.5 * (r * e0 + q * e1 - p * e2),
    )


@inline
def angular_acceleration(
    J: Inertia, h: float, p: float, q: float, r: float, L: float, M: float, N: float
) -> tuple[float, float, float]:
    """Solve J w_dot = (L, M, N) - w x (J w + (h, 0, 0)).

    h is the angular momentum of a rotor along body x, N m s; L, M, N are the moments about the centre of gravity.
    """
    hx = J.Jx * p - J.Jxz * r + h
    hy = J.Jy * q
    hz = J.Jz * r - J.Jxz * p
    mx = L - (q * hz - r * hy)
    my = M - (r * hx - p * hz)
    mz = N - (p * hy - q * hx)
    inv = 1.0 / (J.Jx * J.Jz - J.Jxz * J.Jxz)
    return (J.Jz * mx + J.Jxz * mz) * inv, my / J.Jy, (J.Jxz * mx + J.Jx * mz) * inv
