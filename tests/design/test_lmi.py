"""The LMI layer: its algebra, and that a solver's failure is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.design.lmi import SOLVED, Problem, product_map, svec, triangle, unpack

pytest.importorskip("clarabel")


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 5), st.integers(1, 6), st.integers(0, 9999))
def test_product_map_is_the_linear_map(n, m, seed):
    rng = np.random.default_rng(seed)
    U, W, P = rng.normal(size=(n, m)), rng.normal(size=(n, m)), rng.normal(size=(n, n))
    P = P + P.T
    r, c = triangle(n)
    np.testing.assert_allclose(product_map(U, W) @ P[r, c], svec(U.T @ P @ W + W.T @ P @ U), atol=1e-10)
    np.testing.assert_array_equal(unpack(P[r, c], n), P)


def lyapunov(A):
    """max t with A'P + PA <= -t I, P <= I; unbounded below 0 only where A is not stable."""
    n = len(A)
    p = Problem()
    p.unknown("P", n * (n + 1) // 2)
    p.unknown("t", 1)
    one = svec(np.eye(n))[:, None]
    p.block(np.zeros((n, n)), {"P": product_map(np.eye(n), A), "t": one}, 0.0)
    p.block(-np.eye(n), {"P": product_map(np.eye(n), 0.5 * np.eye(n))}, 0.0)
    return p


def test_solution_satisfies_what_was_asked():
    A = np.array([[-1.0, 4.0], [0.0, -2.0]])
    p = lyapunov(A)
    out = p.solve({"t": -1.0})
    assert out.status == SOLVED
    P, t = unpack(out.theta[:3], 2), out.theta[3]
    assert t > 0.1
    assert np.linalg.eigvalsh(A.T @ P + P @ A).max() <= -t + 1e-6
    assert np.linalg.eigvalsh(P).max() <= 1 + 1e-6


def test_infeasible_and_limits_are_said_in_words():
    p = Problem()
    p.unknown("x", 1)
    p.block(np.eye(2), {"x": svec(np.diag([1.0, -1.0]))[:, None]}, 0.0)
    out = p.solve({"x": 1.0})
    assert out.status == "infeasible" and out.theta is None
    A = np.array([[-1.0, 4.0], [0.0, -2.0]])
    assert lyapunov(A).solve({"t": -1.0}, max_iter=2).status == "iteration limit"
