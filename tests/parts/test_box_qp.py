"""The box-constrained QP against its optimality conditions and an independent solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.parts.box_qp import solve_box_qp


def problem(seed: int, n: int, tight: float) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    M = rng.standard_normal((n, n + 1))
    H = M @ M.T + 10.0 ** rng.uniform(-6, 0) * np.eye(n)
    g = rng.standard_normal(n) * 10.0 ** rng.uniform(-2, 2)
    return H, g, -tight * rng.uniform(0.1, 1.0, n), tight * rng.uniform(0.1, 1.0, n)


def kkt_violation(H: np.ndarray, g: np.ndarray, lo: np.ndarray, hi: np.ndarray, x: np.ndarray) -> float:
    """Largest breach of: gradient 0 inside, not negative at lo, not positive at hi; relative to the terms in it."""
    gradient = H @ x + g
    breach = np.where(
        x <= lo, np.minimum(gradient, 0.0), np.where(x >= hi, np.maximum(gradient, 0.0), gradient)
    )
    return float(np.max(np.abs(breach)) / (np.max(np.abs(g)) + np.max(np.abs(H) @ np.abs(x))))


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 15), st.floats(0.01, 30.0), st.integers(0, 3))
def test_solution_meets_the_kkt_conditions_from_any_start(
    seed: int, n: int, tight: float, start: int
) -> None:
    H, g, lo, hi = problem(seed, n, tight)
    x = [np.zeros(n), lo.copy(), hi.copy(), 100.0 * np.sin(np.arange(n) + seed)][start]
    before = [a.copy() for a in (H, g, lo, hi)]
    steps = solve_box_qp(H, g, lo, hi, x)
    assert 0 < steps < 10 * n + 10
    assert (lo <= x).all() and (x <= hi).all()
    assert kkt_violation(H, g, lo, hi, x) < 1e-10
    for a, b in zip(before, (H, g, lo, hi), strict=True):
        assert np.array_equal(a, b)


def test_agrees_with_an_interior_point_solver() -> None:
    cp = pytest.importorskip("cvxpy")
    bound, free = 0, 0
    for seed in range(20):
        H, g, lo, hi = problem(seed, 10, 0.5)
        x, v = np.zeros(10), cp.Variable(10)
        assert solve_box_qp(H, g, lo, hi, x) > 0
        cost = 0.5 * cp.quad_form(v, cp.psd_wrap(H)) + g @ v
        cp.Problem(cp.Minimize(cost), [v >= lo, v <= hi]).solve(
            solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12
        )
        ours, theirs = (0.5 * y @ H @ y + g @ y for y in (x, np.clip(v.value, lo, hi)))
        assert ours <= theirs + 1e-9 * abs(theirs)
        assert np.max(np.abs(x - v.value)) < 1e-4
        bound += int(((x == lo) | (x == hi)).sum())
        free += int(((x > lo) & (x < hi)).sum())
    assert bound > 20 and free > 20  # both kinds of variable were there


def test_too_few_steps_are_reported_and_the_point_is_still_feasible() -> None:
    H, g, lo, hi = problem(3, 12, 0.05)
    x = np.zeros(12)
    full = solve_box_qp(H, g, lo, hi, x.copy())
    assert full > 2
    assert solve_box_qp(H, g, lo, hi, x, 1) == -1
    assert (lo <= x).all() and (x <= hi).all()
    assert 0.5 * x @ H @ x + g @ x <= 0.0  # not worse than the start
