"""Worst-case gain of a parameter-varying system with one dynamic uncertainty: an upper bound, an exact frozen
gain, a culprit.

The system maps (w, d) to (v, e), w = Delta v, ||Delta|| <= bound, Delta linear and time-invariant, one signal
in, one out.

Upper bound over every airspeed trajectory within the nodes and |Vdot| <= rate bound: the least gamma for
which symmetric P(V) = sum_k f_k(V) P_k (any sign) and multiplier coefficients m_i >= 0 exist with, at every
node and both rates,

    He([I 0]' P [A B]) + [Pdot 0; 0 0] + sum_i m_i (z_vi' z_vi - z_wi' z_wi) + e' e - gamma^2 diag(0, 0, I) < 0

z_i = the signals through 1, a_i/(s + a_i) or s/(s + a_i). P may be indefinite because the multipliers are
positive-negative and the frozen system is stable without Delta (Pfifer and Seiler 2016, Theorem 2). Proved at
the nodes; `check_upper_bound` tells how much is lacking between them.

Frozen gain, exact for one d and one e: at each frequency M(jw) = [a b; c g], a from w to v; with |a| < 1 the
set of g + c b delta/(1 - a delta), |delta| <= 1, is a disc of centre g + c b conj(a)/(1 - |a|^2) and radius
|c b|/(1 - |a|^2). The gain is infinite where |a| reaches 1. The worst delta = exp(j phi) at the worst
frequency is attained by a real first-order all-pass +-(s - beta)/(s + beta).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core import Array, CannotJudge, WrongUse
from .certificates import scaled_max
from .estimator import balance, multiplier_generators
from .lmi import ALMOST, Problem, product_map, unpack
from .lpv import Basis, Gridded, basis_for, connect, gridded, interpolate, response, transfer
from .synthesis import svec_of


class Uncertain(NamedTuple):
    """x' = (A + Vdot A_rate) x + B (w, d), (v, e) = C x + D (w, d): first input w, first output v."""

    V: Array
    A: Array
    A_rate: Array
    B: Array
    C: Array
    D: Array


class UpperBound(NamedTuple):
    """gain; status of the solver in words; seconds; multiplier coefficients (1, then low- and high-pass per
    pole).

    P (degree + 1, n, n), T, time, basis: the storage in the scaled coordinates of `upper_bound`.
    """

    gain: float
    status: str
    seconds: float
    multiplier: Array
    P: Array
    T: Array
    basis: Basis


class Frozen(NamedTuple):
    """Exact worst-case gain of one frozen system; w_rad_s: where; delta: the complex number that does it."""

    gain: float
    w_rad_s: float
    delta: complex


def at_rate(g: Uncertain, rate: float = 0.0) -> Gridded:
    """The system frozen at one Vdot."""
    m, p = g.B.shape[2], g.C.shape[1]
    inputs = ("w", *(f"d{k}" for k in range(1, m)))
    outputs = ("v", *(f"e{k}" for k in range(1, p)))
    return Gridded(g.V, g.A + rate * g.A_rate, g.B, g.C, g.D, inputs, outputs)


def _with_psi(g: Uncertain, poles: Sequence[float]) -> tuple[Uncertain, int]:
    """psi = [1; a_i/(s + a_i)] on v and w appended; outputs [psi_v; psi_w; e]. Returns it and the rows of
    psi.
    """
    k = len(poles)
    n = g.A.shape[1]
    N = len(g.V)
    a = np.asarray(poles, float)
    A = np.zeros((N, n + 2 * k, n + 2 * k))
    A[:, :n, :n] = g.A
    R = np.zeros_like(A)
    R[:, :n, :n] = g.A_rate
    B = np.zeros((N, n + 2 * k, g.B.shape[2]))
    B[:, :n] = g.B
    for i in range(k):
        A[:, n + i, :n], B[:, n + i] = a[i] * g.C[:, 0], a[i] * g.D[:, 0]
        A[:, n + i, n + i] = A[:, n + k + i, n + k + i] = -a[i]
        B[:, n + k + i, 0] = a[i]
    rows = 2 * (k + 1)
    p = g.C.shape[1] - 1
    C, D = np.zeros((N, rows + p, n + 2 * k)), np.zeros((N, rows + p, g.B.shape[2]))
    C[:, 0, :n], D[:, 0] = g.C[:, 0], g.D[:, 0]
    D[:, k + 1, 0] = 1.0
    for i in range(k):
        C[:, 1 + i, n + i] = C[:, k + 2 + i, n + k + i] = 1.0
    C[:, rows:, :n], D[:, rows:] = g.C[:, 1:], g.D[:, 1:]
    return Uncertain(g.V, A, R, B, C, D), rows


def _scaled(g: Uncertain, time: float, normal: float) -> tuple[Uncertain, Array]:
    k = len(g.V) // 2
    r = math.sqrt(time)
    T = balance(g.A[k] / time, g.B[k] / r, g.C[k] / r, normal)
    Ti = np.linalg.inv(T)
    return Uncertain(g.V, Ti @ g.A @ T / time, Ti @ g.A_rate @ T / time, Ti @ g.B / r, g.C @ T / r, g.D), T


def _rates(basis: Basis, bound: float) -> tuple[float, ...]:
    return (bound, -bound) if basis.degree and bound > 0 else (0.0,)


def _assemble(
    s: Uncertain, rows: int, G: Array, basis: Basis, rate_bound: float, time: float, margin: float
) -> Problem:
    """The LMIs of the upper bound at every node and rate; s is scaled."""
    n, m = s.B.shape[1:]
    p = Problem()
    p.unknown("P", (basis.degree + 1) * n * (n + 1) // 2)
    p.unknown("m", len(G), nonnegative=True)
    p.unknown("g2", 1)
    top = np.hstack((np.eye(n), np.zeros((n, m))))
    dot = product_map(top, 0.5 * top)
    E = np.diag(np.concatenate((np.zeros(n + 1), np.ones(m - 1))))
    for k in range(len(s.V)):
        f, slope = basis.values(s.V[k : k + 1])[0], basis.slopes(s.V[k : k + 1])[0]
        out = np.hstack((s.C[k], s.D[k]))
        z, e = out[:rows], out[rows:]
        static = {
            "m": np.stack([svec_of(z.T @ np.diag(row) @ z) for row in G], axis=1),
            "g2": -svec_of(E)[:, None],
        }
        for rate in _rates(basis, rate_bound):
            He = product_map(top, np.hstack((s.A[k] + rate * s.A_rate[k], s.B[k])))
            maps = np.hstack([c * He + rate / time * d * dot for c, d in zip(f, slope, strict=True)])
            p.block(e.T @ e, {"P": maps, **static}, margin)
    return p


def upper_bound(
    g: Uncertain,
    bound: float = 1.0,
    rate_bound: float = 0.0,
    poles: Sequence[float] = (0.031,),
    degree: int = 2,
    margin: float = 1e-7,
    time_limit_s: float = 240.0,
    w_scale: float = 1.0,
) -> UpperBound:
    """The bound over trajectories for ||Delta|| <= bound; see the module.

    Raises CannotJudge where the frozen system is unstable, or the solver finds no bound within its limits
    (then the gain may be infinite).
    """
    if bound < 0:
        raise WrongUse(f"a norm bound of {bound} was given; it must not be negative")
    time, basis = 10.0, basis_for(g.V, degree)
    r = math.sqrt(bound) * w_scale if bound else 0.0
    B, C, D = g.B.copy(), g.C.copy(), g.D.copy()
    B[:, :, 0] *= r
    D[:, :, 0] *= r
    # v through sqrt(bound) as well, so that w = Delta v keeps its balance.
    left = math.sqrt(bound) / w_scale
    C[:, 0], D[:, 0] = C[:, 0] * left, D[:, 0] * left
    wide, rows = _with_psi(Uncertain(g.V, g.A, g.A_rate, B, C, D), poles)
    s, T = _scaled(wide, time, 0.5)
    G = multiplier_generators(poles)
    p = _assemble(s, rows, G, basis, rate_bound, time, margin)
    out = p.solve({"g2": 1.0, "m": 1e-8}, 200, time_limit_s, 1e-5, 1e-6)
    if out.theta is None:
        raise CannotJudge(
            f"no worst-case gain for ||Delta|| <= {bound:g} over {len(g.V)} airspeeds: the solver ended with "
            f"'{out.status}' after {out.iterations} iterations; the gain may be infinite: lower the uncertainty or the "
            f"rate bound"
        )
    n = s.A.shape[1]
    P = unpack(out.theta[p.place("P")].reshape(basis.degree + 1, -1), n)
    gain = math.sqrt(max(float(out.theta[p.place("g2")][0]), 0.0))
    return UpperBound(gain, out.status, out.seconds, out.theta[p.place("m")], P, T, basis)


def frozen_gain(g: Gridded, node: int = 0, bound: float = 1.0, w_rad_s: Array | None = None) -> Frozen:
    """Exact worst-case gain of one node with one w, v, d and e over all frequencies; see the module."""
    if len(g.inputs) != 2 or len(g.outputs) != 2:
        raise WrongUse(
            f"the exact formula is for inputs (w, d) and outputs (v, e); given {g.inputs} and {g.outputs}"
        )
    one = Gridded(
        g.V[node : node + 1],
        g.A[node][None],
        g.B[node][None],
        g.C[node][None],
        g.D[node][None],
        g.inputs,
        g.outputs,
    )
    w = np.concatenate(([0.0], np.logspace(-4, 4, 1601))) if w_rad_s is None else np.asarray(w_rad_s, float)
    if g.order and np.linalg.eigvals(g.A[node]).real.max() >= 0:
        return Frozen(math.inf, 0.0, 0j)
    for _ in range(3):
        top, M = _disc(one, w, bound)
        k = int(np.argmax(top))
        if not math.isfinite(top[k]):
            return Frozen(math.inf, float(w[k]), _worst_delta(M[k]))
        near = np.linspace(w[max(k - 1, 0)], w[min(k + 1, len(w) - 1)], 41)
        w = np.unique(np.concatenate((near, w[k : k + 1])))
    top, M = _disc(one, w, bound)
    k = int(np.argmax(top))
    return Frozen(float(top[k]), float(w[k]), _worst_delta(M[k]))


def _disc(g: Gridded, w: Array, bound: float) -> tuple[Array, Array]:
    """Worst gain at each frequency, and M with w scaled by the bound."""
    M = response(g, w)[0]
    M = M * np.array([[bound, 1.0], [bound, 1.0]])
    a, b, c, d = M[:, 0, 0], M[:, 0, 1], M[:, 1, 0], M[:, 1, 1]
    rest = 1.0 - np.abs(a) ** 2
    safe = np.where(rest > 0, rest, 1.0)
    top = np.abs(d + c * b * np.conj(a) / safe) + np.abs(c * b) / safe
    return np.where(rest > 0, top, np.inf), M


def _worst_delta(M: Array) -> complex:
    """delta of size one that reaches the far edge of the disc."""
    a, b, c, d = M[0, 0], M[0, 1], M[1, 0], M[1, 1]
    if abs(a) >= 1.0:
        return complex(1.0 / a)
    if c * b == 0:
        return 1.0 + 0j
    rest = 1.0 - abs(a) ** 2
    centre = d + c * b * np.conj(a) / rest
    turn = centre / abs(centre) if abs(centre) > 0 else 1.0
    z = (centre + abs(c * b) / rest * turn - d) / (c * b)
    return complex(z / (1.0 + a * z))


def all_pass(delta: complex, w_rad_s: float, inp: str = "v", out: str = "w") -> Gridded:
    """Real first-order all-pass +-(s - beta)/(s + beta) of size |delta| that equals delta at s = j w; +-1
    where it is real.
    """
    size, angle = abs(delta), math.atan2(delta.imag, delta.real)
    if w_rad_s == 0.0 or abs(math.sin(angle)) < 1e-9:
        return gridded(
            [0.0],
            np.zeros((0, 0)),
            np.zeros((0, 1)),
            np.zeros((1, 0)),
            [[math.copysign(size, math.cos(angle))]],
            (inp,),
            (out,),
        )
    # (jw - beta)/(jw + beta) has the angle pi - 2 atan(w/beta), between 0 and pi.
    sign = 1.0 if angle > 0 else -1.0
    positive = angle if angle > 0 else angle + math.pi
    beta = w_rad_s / math.tan(0.5 * (math.pi - positive))
    return transfer([sign * size, -sign * size * beta], [1.0, beta], inp, out)


def closed_by(g: Gridded, delta: Gridded) -> Gridded:
    """The loop w = Delta v closed: the remaining inputs to the remaining outputs."""
    block = delta._replace(inputs=(g.outputs[0],), outputs=(g.inputs[0],))
    return connect([g, block], g.inputs[1:], g.outputs[1:])


def check_upper_bound(
    g: Uncertain,
    u: UpperBound,
    bound: float,
    rate_bound: float,
    poles: Sequence[float],
    V: Array,
    w_scale: float = 1.0,
) -> Array:
    """Largest scaled eigenvalue of the LMI at any airspeeds V, from matrices interpolated there; at most 0
    proves the bound.
    """
    v = np.atleast_1d(np.asarray(V, float))
    r, left = math.sqrt(bound) * w_scale, math.sqrt(bound) / w_scale
    A, R, B, C, D = (interpolate(g.V, m, v) for m in (g.A, g.A_rate, g.B, g.C, g.D))
    B, C, D = B.copy(), C.copy(), D.copy()
    B[:, :, 0] *= r
    D[:, :, 0] *= r
    C[:, 0], D[:, 0] = C[:, 0] * left, D[:, 0] * left
    wide, rows = _with_psi(Uncertain(v, A, R, B, C, D), poles)
    time = 10.0
    Ti, q = np.linalg.inv(u.T), math.sqrt(time)
    M = np.diag(
        np.concatenate((u.multiplier @ multiplier_generators(poles), np.ones(wide.C.shape[1] - rows)))
    )
    m = wide.B.shape[2]
    cost = u.gain**2 * np.diag(np.concatenate((np.zeros(len(u.T) + 1), np.ones(m - 1))))
    worst = np.full(len(v), -np.inf)
    for k in range(len(v)):
        P, slope = (
            np.tensordot(c[0], u.P, 1) for c in (u.basis.values(v[k : k + 1]), u.basis.slopes(v[k : k + 1]))
        )
        out = np.hstack((wide.C[k] @ u.T / q, wide.D[k]))
        Bs = Ti @ wide.B[k] / q
        for rate in _rates(u.basis, rate_bound):
            As = Ti @ (wide.A[k] + rate * wide.A_rate[k]) @ u.T / time
            flow = np.block([[As.T @ P + P @ As + rate / time * slope, P @ Bs], [Bs.T @ P, np.zeros((m, m))]])
            worst[k] = max(worst[k], scaled_max(flow + out.T @ M @ out - cost))
    return worst


def proved(u: UpperBound) -> bool:
    """Whether the solver finished; an almost-solved bound is not passed off as one."""
    return u.status != ALMOST
