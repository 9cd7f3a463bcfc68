"""What a synthesis proves, computed again from the formulas, between the nodes as well as on them.

Scaled eigenvalue of a matrix F that should be negative: its largest eigenvalue over its largest absolute one.
A value below LIMIT = 1e-6 counts as negative: double precision does not carry the sign further through
matrices of this size.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from ..core import Array
from .estimator import Estimation, Extended, Filter, Options, Solution, apply, extend
from .lpv import interpolate
from .synthesis import inverse, null_space, solved

LIMIT = 1e-6


class LmiCheck(NamedTuple):
    """Largest scaled eigenvalue of each inequality at each airspeed, (N,); for (Q) of -(X - Z)."""

    V: Array
    X: Array
    Z: Array
    Q: Array

    @property
    def worst(self) -> Array:
        """(N,) the largest of the three."""
        return np.maximum(np.maximum(self.X, self.Z), self.Q)


def scaled_max(F: Array) -> float:
    """Largest eigenvalue over the largest absolute one; 0 for the zero matrix."""
    e = np.linalg.eigvalsh(0.5 * (F + F.T))
    top = float(np.abs(e).max()) if len(e) else 0.0
    return float(e[-1] / top) if top > 0.0 else 0.0


def _rates(sol: Solution, options: Options) -> tuple[float, ...]:
    moving = sol.basis.degree > 0 and options.rate_bound > 0
    return (options.rate_bound, 0.0, -options.rate_bound) if moving else (0.0,)


def _at(sol: Solution, V: Array) -> tuple[Array, Array, Array, Array]:
    """X, Z and their slopes in V over the airspeeds, (N, n, n) each."""
    f, s = sol.basis.values(V), sol.basis.slopes(V)
    return tuple(np.einsum("kb,bij->kij", c, P) for c in (f, s) for P in (sol.X, sol.Z))


def _multiplier(e: Extended, sol: Solution) -> Array:
    return np.diag(sol.multiplier @ e.G) if e.G.shape[0] else np.zeros((0, 0))


def check_lmis(problem: Estimation, sol: Solution, options: Options, V: Array) -> LmiCheck:
    """(X), (Z), (Q) of `estimator` at any airspeeds, from the plant there, by their formulas."""
    e = apply(extend(problem, V), sol.scaling)
    X, Z, Xv, Zv = _at(sol, e.V)
    g2 = (sol.gamma / sol.scaling.estimand) ** 2
    n, m = e.B.shape[1:]
    M = _multiplier(e, sol)
    robust = e.G.shape[0] > 0
    out = np.full((3, len(e.V)), -1.0)
    for k in range(len(e.V)):
        A, B = e.A[k], e.B[k]
        c1, c2 = np.hstack((e.C1[k], e.D1[k])), np.hstack((e.C2[k], e.D2[k]))
        supply = c1.T @ M @ c1 - g2 * np.diag(np.concatenate((np.zeros(n), e.E)))
        N = null_space(np.hstack((e.C3[k], e.D3[k])))
        for rate in _rates(sol, options):
            r = rate / sol.scaling.time

            def flow(P: Array, slope: Array, r: float = r, A: Array = A, B: Array = B) -> Array:
                return np.block([[A.T @ P + P @ A + r * slope, P @ B], [B.T @ P, np.zeros((m, m))]])

            out[0, k] = max(out[0, k], scaled_max(N.T @ (flow(X[k], Xv[k]) + supply + c2.T @ c2) @ N))
            if robust:
                out[1, k] = max(out[1, k], scaled_max(flow(Z[k], Zv[k]) + supply))
        out[2, k] = scaled_max(-(X[k] - Z[k]))
    return LmiCheck(e.V, *out)


def _scaled_core(problem: Estimation, sol: Solution, f: Filter) -> tuple[Array, ...]:
    """(A, A_rate, B, C, D) of y -> u = W deltahat in scaled coordinates, taken out of the finished filter.

    A finished filter is [core; W^-1], see `synthesis.reconstruct`: its last states are those of W^-1.
    """
    n, s = sol.X.shape[1], sol.scaling
    k = 1.0 / inverse(problem.error_weight).D[0, 0, 0] / s.estimand
    r = np.sqrt(s.time)
    return f.A[:, :n, :n] / s.time, f.A_rate[:, :n, :n], f.B[:, :n] / r, k * f.C[:, :, :n] / r, k * f.D


def check_dissipation(problem: Estimation, sol: Solution, options: Options, f: Filter, V: Array) -> Array:
    """(N,) largest scaled eigenvalue of Sdot + z'Mz + |u - eps|^2 - gamma^2 |d|^2 over (x, xF, w, d).

    The loop of the plant at V with the filter as it is run: exact at the nodes f.V, linear in V between them.
    S = x' Z x + (x - xF)' (X - Z) (x - xF). At most 0 means the gain is proved at that airspeed. Nominal
    filters have Z = 0, so S does not see x itself and the value is 0 up to rounding.
    """
    e = apply(extend(problem, V), sol.scaling)
    A, R, B, C, D = (interpolate(f.V, m, e.V) for m in _scaled_core(problem, sol, f))
    X, Z, Xv, Zv = _at(sol, e.V)
    n, m = e.B.shape[1:]
    g2 = (sol.gamma / sol.scaling.estimand) ** 2
    M = _multiplier(e, sol)
    P = np.block([[X, Z - X], [Z - X, X - Z]])
    slope = np.block([[Xv, Zv - Xv], [Zv - Xv, Xv - Zv]])
    worst = np.full(len(e.V), -np.inf)
    for k in range(len(e.V)):
        drive = np.vstack((e.B[k], B[k] @ e.D3[k]))
        err = np.hstack((D[k] @ e.C3[k] - e.C2[k], C[k], D[k] @ e.D3[k] - e.D2[k]))
        z = np.hstack((e.C1[k], np.zeros((e.C1.shape[1], n)), e.D1[k]))
        supply = z.T @ M @ z + err.T @ err - g2 * np.diag(np.concatenate((np.zeros(2 * n), e.E)))
        for rate in _rates(sol, options):
            r = rate / sol.scaling.time
            loop = np.block([[e.A[k], np.zeros((n, n))], [B[k] @ e.C3[k], A[k] + r * R[k]]])
            flow = loop.T @ P[k] + P[k] @ loop + r * slope[k]
            F = np.block([[flow, P[k] @ drive], [drive.T @ P[k], np.zeros((m, m))]]) + supply
            worst[k] = max(worst[k], scaled_max(F))
    return worst


def filter_poles(f: Filter, rate_bound: float, V: Array) -> Array:
    """Frozen poles of the filter as it is run, over the airspeeds and the rates -bound, 0, bound: (3, N,
    n).
    """
    A, R = interpolate(f.V, f.A, V), interpolate(f.V, f.A_rate, V)
    return np.linalg.eigvals(np.stack([A + r * R for r in (-rate_bound, 0.0, rate_bound)]))


def certificate(
    problem: Estimation, sol: Solution, options: Options, f: Filter, points: int = 161
) -> dict[str, Any]:
    """Everything a reader needs to trust or distrust a filter, as plain numbers and strings.

    on_grid_only: a scaled eigenvalue above LIMIT remains between the nodes, so gamma is proved at the nodes
    alone.
    """
    dense = np.linspace(sol.nodes[0], sol.nodes[-1], points) if len(sol.nodes) > 1 else sol.nodes
    at_nodes, between = check_lmis(problem, sol, options, sol.nodes), check_lmis(problem, sol, options, dense)
    loop = check_dissipation(problem, sol, options, f, dense)
    p = filter_poles(f, options.rate_bound if sol.basis.degree else 0.0, dense)
    worst = float(max(between.worst.max(), loop.max()))
    return {
        "gamma": sol.gamma,
        "gamma_optimal": sol.gamma_optimal,
        "status": solved(sol),
        "status_optimal": sol.stage1.status,
        "status_backed_off": sol.stage2.status,
        "solver": "clarabel",
        "solver_iterations": [sol.stage1.iterations, sol.stage2.iterations],
        "nodes": sol.nodes,
        "check_points": len(dense),
        "largest_scaled_eigenvalue_nodes": float(at_nodes.worst.max()),
        "largest_scaled_eigenvalue_between": float(between.worst.max()),
        "largest_scaled_eigenvalue_loop": float(loop.max()),
        "on_grid_only": worst > LIMIT,
        "proved": float(at_nodes.worst.max()) <= LIMIT,
        "order": int(f.A.shape[1]),
        "slowest_pole": float(p.real.max()),
        "fastest_pole": float(p.real.min()),
        "stable": bool(p.real.max() < 0.0),
    }


def refine(V: Array, check: Array, dense: Array, most: int = 6) -> Array:
    """The nodes plus the worst point of each interval where the check exceeds LIMIT, at most `most` new
    ones.
    """
    bad = []
    for lo, hi in itertools.pairwise(V):
        inside = np.flatnonzero((dense > lo + 1e-9) & (dense < hi - 1e-9))
        if len(inside) and check[inside].max() > LIMIT:
            j = inside[np.argmax(check[inside])]
            bad.append((check[j], dense[j]))
    new = [v for _, v in sorted(bad, reverse=True)[:most]]
    return np.unique(np.concatenate((V, new)))
