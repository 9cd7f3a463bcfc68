"""Linear matrix inequalities, assembled directly for Clarabel and always re-evaluated afterwards.

    minimise c'theta  subject to  F_b(theta) = F_b0 + sum_k theta_k F_bk <= -margin_b I  for every block b
                                  theta_k >= 0                                           for k in a list

Symmetric matrix unknowns are held by their upper triangle, column by column.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..core import Array, MissingExtra

SOLVED = "solved"
ALMOST = "almost solved"
Progress = Callable[[str, float], None]


class Outcome(NamedTuple):
    """What the solver said: status in words, theta or None, objective, iterations, wall-clock seconds."""

    status: str
    theta: Array | None
    objective: float
    iterations: int
    seconds: float


def triangle(n: int) -> tuple[Array, Array]:
    """Row and column of each unknown of a symmetric n x n matrix: upper triangle, column by column."""
    c = np.repeat(np.arange(n), np.arange(1, n + 1))
    r = np.concatenate([np.arange(k + 1) for k in range(n)]) if n else c
    return r, c


def svec(F: Array) -> Array:
    """Upper triangles (..., n(n+1)/2), off-diagonal entries times sqrt 2, so that <F, G> = svec(F) .
    svec(G).
    """
    r, c = triangle(F.shape[-1])
    return np.asarray(F[..., r, c] * np.where(r == c, 1.0, np.sqrt(2.0)))


def unpack(theta: Array, n: int) -> Array:
    """The symmetric matrix (..., n, n) whose upper triangle is the last axis of theta."""
    r, c = triangle(n)
    out = np.zeros((*theta.shape[:-1], n, n))
    out[..., r, c] = theta
    out[..., c, r] = theta
    return out


def product_map(U: Array, W: Array) -> Array:
    """Matrix of the linear map triangle(P) -> svec(U' P W + W' P U): (m(m+1)/2, n(n+1)/2); U, W are (n,
    m).
    """
    n, m = U.shape
    r, c = triangle(n)
    i, j = triangle(m)
    one = U[r][:, i] * W[c][:, j] + U[r][:, j] * W[c][:, i]
    two = U[c][:, i] * W[r][:, j] + U[c][:, j] * W[r][:, i]
    full = one + np.where((r != c)[:, None], two, 0.0)
    return np.asarray((full * np.where(i == j, 1.0, np.sqrt(2.0))).T)


@dataclass
class Problem:
    """Unknowns by name, blocks by coefficient; see the module."""

    sizes: dict[str, int] = field(default_factory=dict)
    _blocks: list[tuple[int, Array, Array, float]] = field(default_factory=list)
    _nonnegative: list[int] = field(default_factory=list)

    def unknown(self, name: str, size: int, nonnegative: bool = False) -> slice:
        """Reserve `size` unknowns; returns their place in theta."""
        start = self.count
        self.sizes[name] = size
        if nonnegative:
            self._nonnegative += list(range(start, start + size))
        return slice(start, start + size)

    @property
    def count(self) -> int:
        """Length of theta."""
        return sum(self.sizes.values())

    def place(self, name: str) -> slice:
        """Where an unknown lies in theta."""
        start = 0
        for key, size in self.sizes.items():
            if key == name:
                return slice(start, start + size)
            start += size
        raise KeyError(name)

    def block(self, constant: Array, terms: dict[str, Array], margin: float) -> None:
        """F = constant + sum over unknowns of terms[name] @ theta[name] <= -margin I; terms are (m(m+1)/2,
        size).
        """
        m = constant.shape[0]
        F = np.zeros((m * (m + 1) // 2, self.count))
        for name, matrix in terms.items():
            F[:, self.place(name)] = matrix
        self._blocks.append((m, svec(constant), F, margin))

    def solve(
        self,
        objective: dict[str, Array | float],
        max_iter: int = 200,
        time_limit_s: float = 300.0,
        gap: float = 1e-6,
        feasibility: float = 1e-8,
    ) -> Outcome:
        """Minimise the objective with Clarabel to the relative gap and feasibility given; never longer than
        the limits.
        """
        try:
            import clarabel
            from scipy import sparse
        except ImportError as error:
            raise MissingExtra("LMI synthesis needs clarabel; pip install 'aerofdi[design]'") from error
        q = np.zeros(self.count)
        for name, value in objective.items():
            q[self.place(name)] = value
        rows: list[Any] = []
        rhs, cones = [], []
        if self._nonnegative:
            pick = sparse.csc_matrix(
                (-np.ones(len(self._nonnegative)), (range(len(self._nonnegative)), self._nonnegative)),
                shape=(len(self._nonnegative), self.count),
            )
            rows.append(pick)
            rhs.append(np.zeros(len(self._nonnegative)))
            cones.append(clarabel.NonnegativeConeT(len(self._nonnegative)))
        for m, constant, F, margin in self._blocks:
            rows.append(sparse.csc_matrix(F))
            rhs.append(-constant - margin * svec(np.eye(m)))
            cones.append(clarabel.PSDTriangleConeT(m))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_iter = max_iter
        settings.time_limit = time_limit_s
        settings.tol_gap_abs = settings.tol_gap_rel = gap
        settings.tol_feas = feasibility
        start = time.perf_counter()
        zero = sparse.csc_matrix((self.count, self.count))
        A = sparse.vstack(rows, format="csc")
        out = clarabel.DefaultSolver(zero, q, A, np.concatenate(rhs), cones, settings).solve()
        seconds = time.perf_counter() - start
        status = _words(str(out.status))
        theta = np.asarray(out.x, float) if status in (SOLVED, ALMOST) else None
        return Outcome(status, theta, float(out.obj_val), int(out.iterations), seconds)


def _words(status: str) -> str:
    """Clarabel's status in words; only a full solution is called solved."""
    known = {
        "Solved": SOLVED,
        "AlmostSolved": ALMOST,
        "PrimalInfeasible": "infeasible",
        "AlmostPrimalInfeasible": "almost infeasible",
        "DualInfeasible": "unbounded",
        "AlmostDualInfeasible": "almost unbounded",
        "MaxIterations": "iteration limit",
        "MaxTime": "time limit",
        "NumericalError": "numerical error",
        "InsufficientProgress": "insufficient progress",
    }
    return known.get(status, status)
