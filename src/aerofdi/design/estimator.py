"""Output-estimation filters with a guaranteed gain: nominal or robust, frozen or gain-scheduled.

The plant (on nodes of the airspeed V, |Vdot| <= rate bound) maps (w, d) to (v, delta, y); w = Delta v with
any causal ||Delta|| <= 1 that satisfies the integral quadratic constraint of the multiplier below. Wanted: a
filter y -> deltahat such that

    ||W (deltahat - delta)|| <= gamma ||d||     along every airspeed trajectory within nodes and rate bound.

W is square, stable with a stable inverse: the filter estimates u = W deltahat and W^-1 is put behind it.
With psi = filtered [v; w], z = C1 x + D1 (w, d), eps = W delta = C2 x + D2 (w, d), y = C3 x + D3 (w, d), a
diagonal multiplier M, X(V) and Z(V) symmetric and polynomial in V, N = null([C3 D3]), at every node and both
rates Vdot:

    (X)  N' { He([I 0]' X [A B]) + [Xdot 0; 0 0] + [C2 D2]'[C2 D2] + [C1 D1]' M [C1 D1] - g2 E } N < 0
    (Z)       He([I 0]' Z [A B]) + [Zdot 0; 0 0]                   + [C1 D1]' M [C1 D1] - g2 E     < 0
    (Q)  X - Z > 0

Everything is affine in (X, Z, M, gamma^2). Derivation: with the storage S = x' Z x + (x - xF)' (X - Z) (x -
xF) the worst case over (x, w, d) compatible with y of Sdot + z' M z + |eps - u|^2 - gamma^2 |d|^2 is concave
by (X); xF' is the multiplier of x = xF, so the saddle lies at x = xF, u = eps, and its value is negative by
(Z). The conditions are exact for the chosen basis. Without uncertainty Z = 0 and (X) alone is the
Kalman-Yakubovich form of the H-infinity filter.

Multiplier x(jw) = c + sum_i [ l_i a_i^2 + h_i w^2 ] / (w^2 + a_i^2), all coefficients >= 0; for one pole this
is every m0 + m2 a^2/(w^2 + a^2) >= 0. Z may be indefinite: S along the loop of a stable plant follows from
positive-negative multipliers (Pfifer and Seiler 2016). Not modelled: several uncertainty blocks, non-square
W.

Symbols: g2 = gamma^2, E = diag(0 for x and w, I for d). Sources: paper "vireo_comparison" section
3.2.1 states the problem (Venkataraman and Seiler 2018, Theorem 2, not read); the conditions are derived as
above.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..core import Array, CannotJudge, WrongUse
from .lmi import Outcome
from .lpv import Basis, Gridded, connect, gridded


class Estimation(NamedTuple):
    """What is to be estimated.

    model: nodes V -> the plant with named signals. estimand: the output delta. error_weight: W as a one-input
    one-output system (den order = num order). uncertainty: (input w, output v) or None. psi_poles: a_i,
    rad/s.
    """

    model: Callable[[Array], Gridded]
    estimand: str
    measurements: tuple[str, ...]
    disturbances: tuple[str, ...]
    error_weight: Gridded
    uncertainty: tuple[str, str] | None = None
    psi_poles: tuple[float, ...] = (0.031,)


class Options(NamedTuple):
    """How it is solved. rate_bound: m/s^2. backoff: the second stage allows backoff * optimal gamma and
    widens X - Z.

    margin, margin2: every LMI holds with this much to spare in the scaled coordinates, first and second
    stage. multiplier_cost: price of the multiplier coefficients beside gamma^2, without which they may run
    off to infinity.
    """

    rate_bound: float = 0.0
    degree: int = 2
    backoff: float = 1.05
    margin: float = 1e-6
    margin2: float = 1e-4
    max_iter: int = 200
    time_limit_s: float = 240.0
    w_scale: float = 0.02
    multiplier_cost: float = 1e-7
    normal: float = 0.5
    time_scale: float = 10.0
    estimand_scale: float = 0.08
    gap: float = 5e-5
    gap2: float = 1e-3
    feasibility: float = 1e-6


class Filter(NamedTuple):
    """xF' = (A + Vdot A_rate) xF + B y, deltahat = C xF + D y on nodes V; shapes as in Gridded, A_rate like
    A.
    """

    V: Array
    A: Array
    A_rate: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    output: str

    def at_rate(self, rate: float = 0.0) -> Gridded:
        """The filter frozen at one Vdot, m/s^2."""
        return Gridded(
            self.V, self.A + rate * self.A_rate, self.B, self.C, self.D, self.inputs, (self.output,)
        )


class Extended(NamedTuple):
    """Plant, error weight and psi in one state, scaled: see `Scaling`. E: (m,) 1 for d, 0 for w. G: (ng, nz)
    generators of M.
    """

    V: Array
    A: Array
    B: Array
    C1: Array
    D1: Array
    C2: Array
    D2: Array
    C3: Array
    D3: Array
    E: Array
    G: Array


class Scaling(NamedTuple):
    """x = T x_scaled, t = t_scaled / time, eps = estimand * eps_scaled, (w, v) = w * (w, v)_scaled."""

    T: Array
    time: float
    estimand: float
    w: float


class Solution(NamedTuple):
    """Storage coefficients (degree + 1, n, n), multiplier coefficients and gamma, in scaled coordinates, with
    all that made them.
    """

    X: Array
    Z: Array
    multiplier: Array
    gamma: float
    gamma_optimal: float
    basis: Basis
    scaling: Scaling
    stage1: Outcome
    stage2: Outcome
    nodes: Array


def multiplier_generators(poles: Sequence[float]) -> Array:
    """Rows: diagonal of M for each generator 1, low-pass_i, high-pass_i over z = [v; psi_v,i; w; psi_w,i].

    The low-pass rows are 1/(s + a_i) with s in rad/s (their coefficients are then of the size of the others,
    which a/(s + a) is not where a is small).
    """
    k = len(poles) + 1
    one = np.eye(k)
    rows = [one[0]]
    rows += [one[i + 1] / a**2 for i, a in enumerate(poles)]
    rows += [one[0] - one[i + 1] for i in range(k - 1)]
    half = np.array(rows)
    return np.hstack((half, -half))


def _psi(poles: Sequence[float], signal: str) -> Gridded:
    """[1; a_i/(s + a_i)] on one signal."""
    a = np.asarray(poles, float)
    C = np.vstack((np.zeros((1, len(a))), np.eye(len(a))))
    D = np.zeros((len(a) + 1, 1))
    D[0] = 1.0
    names = [f"psi.{signal}.{k}" for k in range(len(a) + 1)]
    return gridded([0.0], -np.diag(a), a[:, None], C, D, (signal,), names)


def _weighted(weight: Gridded, estimand: str) -> Gridded:
    """The error weight as a block estimand -> 'eps'."""
    if len(weight.inputs) != 1 or len(weight.outputs) != 1 or not np.all(np.abs(weight.D) > 0):
        raise WrongUse("the error weight must be one transfer function with as many zeros as poles")
    zeros = np.linalg.eigvals(weight.A[0] - weight.B[0] @ weight.C[0] / weight.D[0, 0, 0])
    if np.linalg.eigvals(weight.A[0]).real.max(initial=-1.0) >= 0 or zeros.real.max(initial=-1.0) >= 0:
        raise WrongUse("the error weight and its inverse must be stable")
    return weight._replace(inputs=(estimand,), outputs=("eps",))


def extend(problem: Estimation, V: Array) -> Extended:
    """Plant + W + psi on the nodes, unscaled."""
    plant = problem.model(np.asarray(V, float))
    blocks = [plant, _weighted(problem.error_weight, problem.estimand)]
    w_in: tuple[str, ...] = ()
    z: tuple[str, ...] = ()
    if problem.uncertainty:
        w, v = problem.uncertainty
        psi_v, psi_w = _psi(problem.psi_poles, v), _psi(problem.psi_poles, w)
        blocks += [psi_v, psi_w]
        w_in, z = (w,), (*psi_v.outputs, *psi_w.outputs)
    names = (*w_in, *problem.disturbances)
    others = [k for k in plant.inputs if k not in names]
    if others:
        raise WrongUse(f"plant inputs {', '.join(others)} are neither disturbances nor the uncertainty")
    g = connect(blocks, names, (*z, "eps", *problem.measurements))
    nz = len(z)
    C1, D1 = g.C[:, :nz], g.D[:, :nz]
    G = multiplier_generators(problem.psi_poles) if nz else np.zeros((0, 0))
    E = np.array([0.0] * len(w_in) + [1.0] * len(problem.disturbances))
    C2, D2, C3, D3 = g.C[:, nz : nz + 1], g.D[:, nz : nz + 1], g.C[:, nz + 1 :], g.D[:, nz + 1 :]
    return Extended(g.V, g.A, g.B, C1, D1, C2, D2, C3, D3, E, G)


def balance(A: Array, B: Array, C: Array, normal: float = 0.5) -> Array:
    """T of x = T x_b for a stable system, with Gramians Wc = S^(1 + 2 normal), Wo = S^(1 - 2 normal), S the
    Hankel values.

    normal = 0 is balanced, 0.5 output-normal, -0.5 input-normal. Weak directions are kept at 1e-12 of the
    strongest.
    """
    from scipy.linalg import solve_continuous_lyapunov

    if np.linalg.eigvals(A).real.max() >= 0:
        raise CannotJudge(
            "the closed loop of the design model is not stable; an estimation gain does not exist"
        )

    def root(W: Array) -> Array:
        e, U = np.linalg.eigh(0.5 * (W + W.T))
        return np.asarray(U * np.sqrt(np.maximum(e, 1e-12 * e.max())))

    Lc = root(solve_continuous_lyapunov(A, -B @ B.T))
    Lo = root(solve_continuous_lyapunov(A.T, -C.T @ C))
    _, s, Vt = np.linalg.svd(Lo.T @ Lc)
    s = np.maximum(s, 1e-12 * s[0])
    return np.asarray(Lc @ Vt.T / s ** (0.5 + normal))


def scaling_for(e: Extended, options: Options) -> Scaling:
    """Time scale, signal scales and a balancing of the plant at the node nearest the middle."""
    unit = Scaling(np.eye(e.A.shape[1]), options.time_scale, options.estimand_scale, options.w_scale)
    s = apply(e, unit)
    k = len(e.V) // 2
    T = balance(s.A[k], s.B[k], np.vstack((s.C1[k], s.C2[k], s.C3[k])), options.normal)
    return unit._replace(T=T)


def apply(e: Extended, s: Scaling) -> Extended:
    """The same plant in scaled coordinates; gamma relates scaled eps to d, so gamma = scaled gamma *
    s.estimand.
    """
    Ti, r = np.linalg.inv(s.T), np.sqrt(s.time)
    wcol = np.where(e.E > 0, 1.0, s.w)
    return e._replace(
        A=Ti @ e.A @ s.T / s.time,
        B=Ti @ e.B * wcol / r,
        C1=e.C1 @ s.T / (r * s.w),
        D1=e.D1 * wcol / s.w,
        C2=e.C2 @ s.T / (r * s.estimand),
        D2=e.D2 * wcol / s.estimand,
        C3=e.C3 @ s.T / r,
        D3=e.D3 * wcol,
    )
