"""The LMIs of estimator.py put together, solved in two stages, and turned into an explicit filter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core import Array, CannotJudge
from .estimator import Estimation, Extended, Filter, Options, Scaling, Solution, apply, extend, scaling_for
from .lmi import ALMOST, SOLVED, Outcome, Problem, Progress, product_map, triangle, unpack
from .lpv import Basis, Gridded, basis_for, connect, interpolate


def null_space(M: Array) -> Array:
    """Orthonormal columns N with M N = 0."""
    _, s, Vt = np.linalg.svd(M)
    rank = int(np.sum(s > s[0] * 1e-12)) if len(s) else 0
    return np.asarray(Vt[rank:].T)


def _rates(basis: Basis, options: Options) -> tuple[float, ...]:
    bound = options.rate_bound
    return (bound, -bound) if basis.degree and bound > 0 else (0.0,)


def _gather(maps: Array, f: Array) -> Array:
    """One column group for each basis function: (rows, (degree + 1) * n(n+1)/2)."""
    return np.hstack([value * maps for value in f])


class Given(NamedTuple):
    """What the second stage holds fixed: gamma^2 and the multiplier of the first."""

    g2: float
    m: Array | None


def _node_blocks(
    p: Problem, e: Extended, k: int, basis: Basis, s: Scaling, options: Options, given: Given | None
) -> None:
    """Add (X), (Z) and (Q) of node k. given = None: gamma^2 and M are unknown; else X - Z >= t I with t
    unknown.
    """
    n, m = e.B.shape[1:]
    robust = e.G.shape[0] > 0
    f, slope = basis.values(e.V[k : k + 1])[0], basis.slopes(e.V[k : k + 1])[0]
    top, drive = np.hstack((np.eye(n), np.zeros((n, m)))), np.hstack((e.A[k], e.B[k]))
    margin = options.margin if given is None else options.margin2
    c1, c2 = np.hstack((e.C1[k], e.D1[k])), np.hstack((e.C2[k], e.D2[k]))
    E = np.diag(np.concatenate((np.zeros(n), e.E)))
    N = null_space(np.hstack((e.C3[k], e.D3[k])))
    sides = [("X", N)] + ([("Z", np.eye(n + m))] if robust else [])
    for name, S in sides:
        He = product_map(top @ S, drive @ S)
        dot = product_map(top @ S, 0.5 * top @ S)
        static: dict[str, Array] = {}
        constant = S.T @ c2.T @ c2 @ S if name == "X" else np.zeros((S.shape[1],) * 2)
        if given is None:
            static["g2"] = -svec_of(S.T @ E @ S)[:, None]
        else:
            constant = constant - given.g2 * S.T @ E @ S
        if robust and given is not None and given.m is not None:
            constant = constant + S.T @ c1.T @ np.diag(given.m @ e.G) @ c1 @ S
        elif robust:
            static["m"] = np.stack([svec_of(S.T @ c1.T @ np.diag(g) @ c1 @ S) for g in e.G], axis=1)
        for rate in _rates(basis, options):
            terms = {name: _gather(He, f) + _gather(dot, rate / s.time * slope), **static}
            p.block(constant, terms, margin)
    one = product_map(np.eye(n), 0.5 * np.eye(n))
    width: dict[str, Array] = {"X": -_gather(one, f)}
    if robust:
        width["Z"] = _gather(one, f)
    if given is not None:
        width["t"] = svec_of(np.eye(n))[:, None]
    p.block(np.zeros((n, n)), width, margin if given is None else 0.0)


def svec_of(F: Array) -> Array:
    """svec of one symmetric matrix."""
    r, c = triangle(F.shape[0])
    return np.asarray(F[r, c] * np.where(r == c, 1.0, math.sqrt(2.0)))


def _stage(
    e: Extended, basis: Basis, s: Scaling, options: Options, given: Given | None
) -> tuple[Problem, Outcome]:
    p = Problem()
    size = (basis.degree + 1) * len(triangle(e.A.shape[1])[0])
    p.unknown("X", size)
    if e.G.shape[0]:
        p.unknown("Z", size)
    if e.G.shape[0] and (given is None or given.m is None):
        p.unknown("m", e.G.shape[0], nonnegative=True)
    p.unknown("g2" if given is None else "t", 1)
    for k in range(len(e.V)):
        _node_blocks(p, e, k, basis, s, options, given)
    goal: dict[str, Array | float] = {"g2": 1.0} if given is None else {"t": -1.0}
    if "m" in p.sizes:
        goal["m"] = options.multiplier_cost
    gap = options.gap if given is None else options.gap2
    return p, p.solve(goal, options.max_iter, options.time_limit_s, gap, options.feasibility)


def _storage(p: Problem, theta: Array, name: str, n: int, basis: Basis) -> Array:
    if name not in p.sizes:
        return np.zeros((basis.degree + 1, n, n))
    return unpack(theta[p.place(name)].reshape(basis.degree + 1, -1), n)


def _need(outcome: Outcome, what: str, V: Array) -> Array:
    if outcome.theta is None:
        raise CannotJudge(
            f"{what} over {len(V)} airspeeds {V[0]:g} to {V[-1]:g} m/s ended with '{outcome.status}' after "
            f"{outcome.iterations} iterations and {outcome.seconds:.0f} s; narrow the airspeed range, lower the rate "
            f"bound or the uncertainty, or raise time_limit_s"
        )
    return outcome.theta


def _second_stage(
    e: Extended, basis: Basis, s: Scaling, options: Options, g2: float, m: Array
) -> tuple[Problem, Outcome, Array]:
    """The widest X - Z at g2. Numerical trouble is met by a smaller margin, then by holding the multiplier of
    the first stage.
    """
    small = options._replace(margin2=0.1 * options.margin2)
    for o, held in ((options, None), (small, None), (small, m)):
        p, out = _stage(e, basis, s, o, Given(g2, held))
        if out.status == SOLVED or out.status == "infeasible":
            break
    if "m" in p.sizes and out.theta is not None:
        m = np.maximum(out.theta[p.place("m")], 0.0)
    return p, out, m


def solve(problem: Estimation, V: Array, options: Options, progress: Progress | None = None) -> Solution:
    """Both stages on the nodes V: the smallest gamma, then the widest X - Z at backoff * gamma.

    Raises CannotJudge with the solver's word where a stage is infeasible or runs into its limit.
    """
    V = np.atleast_1d(np.asarray(V, float))
    say = progress or (lambda text, share: None)
    raw = extend(problem, V)
    s = scaling_for(raw, options)
    e = apply(raw, s)
    basis = basis_for(V, options.degree)
    n = e.A.shape[1]
    say(f"smallest gain on {len(V)} nodes", 0.0)
    p, one = _stage(e, basis, s, options, None)
    theta = _need(one, "the smallest gain", V)
    best = math.sqrt(max(float(theta[p.place("g2")][0]), 0.0))
    m = np.maximum(theta[p.place("m")], 0.0) if e.G.shape[0] else np.zeros(0)
    say(f"gain {best * s.estimand:.5f} ({one.status}); widening", 0.5)
    gamma = options.backoff * best
    p, two, m = _second_stage(e, basis, s, options, gamma**2, m)
    theta = _need(two, "the backed-off filter", V)
    X, Z = (_storage(p, theta, name, n, basis) for name in ("X", "Z"))
    say(f"done ({two.status})", 1.0)
    return Solution(X, Z, m, gamma * s.estimand, best * s.estimand, basis, s, one, two, V)


def filter_matrices(e: Extended, sol: Solution) -> tuple[Array, ...]:
    """(A, A_rate, B, C, D) of the central filter y -> u on e's nodes, scaled, exactly as derived in
    estimator.py.
    """
    f, slope = sol.basis.values(e.V), sol.basis.slopes(e.V)
    g2 = (sol.gamma / sol.scaling.estimand) ** 2
    n, ny = e.A.shape[1], e.C3.shape[1]
    out = []
    for k in range(len(e.V)):
        X, Z = np.tensordot(f[k], sol.X, 1), np.tensordot(f[k], sol.Z, 1)
        Zv = np.tensordot(slope[k], sol.Z, 1)
        A, B, C1, D1, C3, D3 = (m[k] for m in (e.A, e.B, e.C1, e.D1, e.C3, e.D3))
        M = np.diag(sol.multiplier @ e.G) if e.G.shape[0] else np.zeros((0, 0))
        R = D1.T @ M @ D1 - g2 * np.diag(e.E)
        S = B.T @ Z + D1.T @ M @ C1
        # [R D3'; D3 0] [what; mu] = [-S xF; y - C3 xF], solved for xF and y at once.
        K = np.block([[R, D3.T], [D3, np.zeros((ny, ny))]])
        rhs = np.block([[-S, np.zeros((len(R), ny))], [-C3, np.eye(ny)]])
        sol_k = np.linalg.solve(K, rhs)
        what, mu = sol_k[: len(R)], sol_k[len(R) :]
        state = np.hstack((np.eye(n), np.zeros((n, ny))))
        flow = X @ (A @ state + B @ what) + A.T @ Z @ state + C1.T @ M @ (C1 @ state + D1 @ what) + C3.T @ mu
        Q = X - Z
        full = np.linalg.solve(Q, flow)
        u = e.C2[k] @ state + e.D2[k] @ what
        out.append((full[:, :n], np.linalg.solve(Q, Zv), full[:, n:], u[:, :n], u[:, n:]))
    return tuple(np.array(m) for m in zip(*out, strict=True))


def reconstruct(problem: Estimation, sol: Solution, V: Array) -> Filter:
    """The filter y -> deltahat on nodes V (not necessarily the nodes it was synthesised on), in SI."""
    V = np.atleast_1d(np.asarray(V, float))
    s = sol.scaling
    e = apply(extend(problem, V), s)
    A, A_rate, B, C, D = filter_matrices(e, sol)
    y = problem.measurements
    u = Gridded(
        V, A * s.time, B * math.sqrt(s.time), C * math.sqrt(s.time) * s.estimand, D * s.estimand, y, ("u",)
    )
    weight = inverse(problem.error_weight)._replace(inputs=("u",), outputs=("estimate",))
    g = connect([u, weight], y, ("estimate",))
    slope = np.zeros_like(g.A)
    # t = t_scaled / time: A grows by `time`, and Zdot, given per scaled second, shrinks by it.
    slope[:, : A.shape[1], : A.shape[1]] = A_rate
    return Filter(V, g.A, slope, g.B, g.C, g.D, y, "estimate")


def inverse(g: Gridded) -> Gridded:
    """The inverse of a one-input one-output system with a direct term."""
    k = 1.0 / g.D
    return g._replace(A=g.A - g.B @ (k * g.C), B=g.B @ k, C=-k * g.C, D=k)


def filter_at(f: Filter, V: Array, rate: float = 0.0) -> Gridded:
    """The filter as it is run: matrices linear in V between its nodes, held beyond the ends."""
    v = np.atleast_1d(np.asarray(V, float))
    A, R, B, C, D = (interpolate(f.V, m, v) for m in (f.A, f.A_rate, f.B, f.C, f.D))
    return Gridded(v, A + rate * R, B, C, D, f.inputs, (f.output,))


def solved(sol: Solution) -> str:
    """'solved' only where both stages were."""
    both = {sol.stage1.status, sol.stage2.status}
    return SOLVED if both == {SOLVED} else ALMOST
