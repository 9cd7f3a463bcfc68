"""Gridded systems: interconnection, interpolation and norms against python-control."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core import WrongUse
from aerofdi.design.lpv import (
    basis_for,
    connect,
    from_control,
    gain,
    gridded,
    hinf_norm,
    poles,
    response,
    to_control,
    transfer,
)

from .conftest import lateral, longitudinal

control = pytest.importorskip("control")


def random_system(seed, n=4, m=2, p=2, V=(10.0, 14.0, 20.0)):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(len(V), n, n))
    A -= (1.0 + np.abs(np.linalg.eigvals(A).real).max()) * np.eye(n)
    B, C, D = (rng.normal(size=(len(V), *s)) for s in ((n, m), (p, n), (p, m)))
    return gridded(V, A, B, C, D, [f"u{k}" for k in range(m)], [f"y{k}" for k in range(p)])


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_feedback_is_that_of_python_control_at_every_node(seed):
    g, k = random_system(seed), random_system(seed + 1)
    k = k._replace(D=0.1 * k.D, inputs=("y0", "y1"), outputs=("z0", "z1"))
    sums = [gain(f"u{i}", {f"r{i}": 1.0, f"z{i}": -1.0}) for i in range(2)]
    loop = connect([g, k, *sums], ["r0", "r1"], ["y0", "y1"])
    w = np.array([0.1, 1.0, 7.0])
    ours = response(loop, w)
    for node, (gc, kc) in enumerate(zip(to_control(g), to_control(k), strict=True)):
        for i, x in enumerate(w):
            G, K = gc(1j * x), kc(1j * x)
            np.testing.assert_allclose(
                ours[node, i], np.linalg.solve(np.eye(2) + G @ K, G), rtol=1e-8, atol=1e-10
            )


def test_round_trip_through_python_control_keeps_matrices_and_names():
    g = random_system(3)
    back = from_control(g.V, to_control(g))
    assert back.inputs == g.inputs and back.outputs == g.outputs
    for a, b in zip(g[:5], back[:5], strict=True):
        np.testing.assert_array_equal(a, b)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_hinf_norm_is_the_supremum(seed):
    g = random_system(seed, n=5)
    top, where = hinf_norm(g, 1)
    s = np.linalg.svd(response(g, np.logspace(-3, 3, 4001))[1], compute_uv=False)[:, 0]
    assert s.max() <= top * (1 + 1e-9) and s.max() >= top * (1 - 1e-3)
    if np.isfinite(where):
        assert np.linalg.svd(response(g, [where])[1, 0], compute_uv=False)[0] == pytest.approx(top, rel=1e-8)


def test_hinf_norm_of_a_sharp_resonance_is_found_between_grid_frequencies():
    zeta, wn = 1e-4, 3.3337
    g = transfer([wn**2], [1.0, 2 * zeta * wn, wn**2], "u", "y")
    assert hinf_norm(g)[0] == pytest.approx(1.0 / (2 * zeta * np.sqrt(1 - zeta**2)), rel=1e-6)
    assert hinf_norm(transfer([1.0], [1.0, -1.0], "u", "y"))[0] == np.inf


def test_interpolation_is_linear_between_nodes_and_held_beyond_them():
    g = random_system(1)
    mid = g.at(12.0)
    np.testing.assert_allclose(mid.A[0], 0.5 * (g.A[0] + g.A[1]))
    np.testing.assert_array_equal(g.at(99.0).B[0], g.B[-1])


def test_basis_slopes_are_derivatives():
    b = basis_for(np.array([12.0, 20.0]), 3)
    V, h = np.linspace(12, 20, 7), 1e-5
    np.testing.assert_allclose(b.slopes(V), (b.values(V + h) - b.values(V - h)) / (2 * h), atol=1e-9)
    assert basis_for(np.array([15.4])).degree == 0


def test_refusals_name_the_signal():
    g = random_system(1)
    with pytest.raises(WrongUse, match="nobody makes: u1"):
        connect([g], ["u0"], ["y0"])
    with pytest.raises(WrongUse, match="more than once: y0"):
        connect([g, g], ["u0", "u1"], ["y0"])
    with pytest.raises(WrongUse, match="different airspeed nodes"):
        other = random_system(2, V=(10.0, 20.0))._replace(inputs=("y0", "y1"), outputs=("u0", "u1"))
        connect([g, other], [], ["y0"])
    with pytest.raises(WrongUse, match="algebraic loop"):
        connect([gain("a", {"b": 1.0}), gain("b", {"a": 1.0})], [], ["a"])
    with pytest.raises(WrongUse, match="increase strictly"):
        gridded([2.0, 1.0], np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]], ["u"], ["y"])


def test_the_fixture_has_the_published_modes():
    lat, lon = (np.linalg.eigvals(f([12.0, 15.4, 20.0])[0]) for f in (lateral, longitudinal))
    roll = np.abs(lat).max(axis=1)
    pair = np.abs(lat[np.abs(lat.imag) > 1e-6].reshape(3, 2))[:, 0]
    np.testing.assert_allclose(roll, [8.79, 11.61, 15.35], atol=0.01)
    np.testing.assert_allclose(pair, [3.43, 4.063, 4.99], atol=0.01)
    np.testing.assert_allclose(np.abs(lon[:, 0]), [11.21, 14.468, 18.81], atol=0.01)
    assert poles(transfer([1.0], [1.0, 3.0], "u", "y"))[0, 0] == -3.0
