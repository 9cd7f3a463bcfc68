"""Small dense quadratic programs with bounds, solved exactly: min 1/2 x'Hx + g'x, lo <= x <= hi.

Primal active set: the minimum over the free variables by Cholesky; if it lies outside the bounds, go as far
as the first bound and fix that variable there; if inside, free the bounded variable whose multiplier has
the wrong sign most. Every step lowers the cost or shortens the free set, so it ends after finitely many
steps at a point that meets the optimality (KKT) conditions to rounding. For up to a few dozen variables.
"""

from __future__ import annotations

import numpy as np

from ..core.types import Array
from .ops import jit, maximum, minimum, sqrt

LOWER, FREE, UPPER = -1, 0, 1


@jit
def _newton(H: Array, gradient: Array, index: Array, m: int, L: Array, y: Array) -> None:
    """y[:m] such that H[free, free] y = -gradient[free], by Cholesky in the work array L."""
    for i in range(m):
        for j in range(i + 1):
            total = H[int(index[i]), int(index[j])]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = sqrt(maximum(total, 1e-300)) if i == j else total / L[j, j]
    for i in range(m):
        total = -gradient[int(index[i])]
        for k in range(i):
            total -= L[i, k] * y[k]
        y[i] = total / L[i, i]
    for i in range(m - 1, -1, -1):
        total = y[i]
        for k in range(i + 1, m):
            total -= L[k, i] * y[k]
        y[i] = total / L[i, i]


@jit
def _gradient(H: Array, g: Array, x: Array, out: Array) -> None:
    """out = H x + g."""
    for i in range(len(x)):
        total = g[i]
        for j in range(len(x)):
            total += H[i, j] * x[j]
        out[i] = total


@jit
def _first_bound(x: Array, y: Array, index: Array, m: int, lo: Array, hi: Array) -> tuple[float, int]:
    """How far (0 to 1) x[free] may go by y, and the position in `index` of what stops it, -1 for nothing."""
    far, which = 1.0, -1
    for i in range(m):
        j = int(index[i])
        room = hi[j] - x[j] if y[i] > 0.0 else lo[j] - x[j]
        if y[i] != 0.0 and room / y[i] < far:
            far, which = maximum(room / y[i], 0.0), i
    return far, which


@jit
def _worst_multiplier(gradient: Array, side: Array, tolerance: float) -> int:
    """Index of the bounded variable whose cost falls most by leaving its bound, -1 where none does."""
    worst, which = tolerance, -1
    for i in range(len(side)):
        gain = side[i] * gradient[i]
        if side[i] != FREE and gain > worst:
            worst, which = gain, i
    return which


@jit
def solve_box_qp(H: Array, g: Array, lo: Array, hi: Array, x: Array, most: int = 200) -> int:
    """Solve in place, starting from x held to the bounds; the steps it took, -1 if `most` are too few.

    H: (n, n) symmetric positive definite. g, lo, hi, x: (n,), lo < hi. On -1 x is feasible and no worse
    than the start. Arrays other than x stay untouched.

    >>> import numpy as np
    >>> x = np.zeros(2)
    >>> steps = solve_box_qp(np.eye(2), np.array([-3.0, 0.5]), -np.ones(2), np.ones(2), x)
    >>> x.tolist()
    [1.0, -0.5]
    """
    n = len(x)
    side, index, y = np.zeros(n), np.zeros(n), np.zeros(n)
    gradient, L = np.zeros(n), np.zeros((n, n))
    size = 0.0
    for i in range(n):
        x[i] = minimum(maximum(x[i], lo[i]), hi[i])
        side[i] = (1.0 if x[i] >= hi[i] else 0.0) - (1.0 if x[i] <= lo[i] else 0.0)
        size = maximum(size, abs(g[i]))
        for j in range(n):
            size = maximum(size, abs(H[i, j]) * maximum(abs(lo[j]), abs(hi[j])))
    for step in range(most):
        _gradient(H, g, x, gradient)
        m = 0
        for i in range(n):
            if side[i] == FREE:
                index[m] = i
                m += 1
        _newton(H, gradient, index, m, L, y)
        far, which = _first_bound(x, y, index, m, lo, hi)
        for i in range(m):
            x[int(index[i])] += far * y[i]
        if which >= 0:
            j = int(index[which])
            side[j] = UPPER if y[which] > 0.0 else LOWER
            x[j] = hi[j] if y[which] > 0.0 else lo[j]
        else:
            _gradient(H, g, x, gradient)
            j = _worst_multiplier(gradient, side, 1e-13 * size)
            if j < 0:
                return step + 1
            side[j] = FREE
    return -1
