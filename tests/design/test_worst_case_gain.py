"""Worst-case gains: the frozen formula, the uncertainty that attains it, and the bound over trajectories."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core import CannotJudge, WrongUse
from aerofdi.design.certificates import LIMIT
from aerofdi.design.estimator import Options
from aerofdi.design.lmi import SOLVED
from aerofdi.design.lpv import Gridded, gridded, hinf_norm, response
from aerofdi.design.lpv_observer_check import analysis_loop
from aerofdi.design.synthesis import reconstruct, solve
from aerofdi.design.worst_case_gain import (
    Uncertain,
    all_pass,
    at_rate,
    check_upper_bound,
    closed_by,
    frozen_gain,
    upper_bound,
)

pytest.importorskip("clarabel")
WIDE = (0.031, 10.0, 60.0, 200.0)


@pytest.fixture(scope="module")
def loops(axes):
    """-delta -> e with the robust filters of 15.4 m/s, at that airspeed; and the longitudinal one on two nodes."""
    out = {}
    for axis, scale in (("lat", 0.02), ("lon", 0.5)):
        problem = axes[axis].problem(True, (0.031,))
        f = reconstruct(problem, solve(problem, [15.4], Options(w_scale=scale)), [15.4])
        out[axis] = analysis_loop(axes[axis], f, [15.4])
        if axis == "lon":
            out["moving"] = analysis_loop(axes[axis], f, [12.0, 20.0])
    return out


@pytest.mark.parametrize("axis", ["lat", "lon"])
def test_upper_bound_with_several_poles_meets_the_exact_frozen_gain(loops, axis):
    exact = frozen_gain(at_rate(loops[axis])).gain
    u = upper_bound(loops[axis], poles=WIDE)
    assert u.status == SOLVED
    assert exact * (1 - 1e-6) <= u.gain <= 1.01 * exact
    assert check_upper_bound(loops[axis], u, 1.0, 0.0, WIDE, loops[axis].V).max() <= LIMIT
    tight = u._replace(gain=0.98 * exact)
    assert check_upper_bound(loops[axis], tight, 1.0, 0.0, WIDE, loops[axis].V).max() > LIMIT


@pytest.mark.parametrize("axis", ["lat", "lon"])
def test_the_returned_uncertainty_is_real_and_attains_the_gain(loops, axis):
    g = at_rate(loops[axis])
    worst = frozen_gain(g)
    delta = all_pass(worst.delta, worst.w_rad_s)
    assert hinf_norm(delta)[0] == pytest.approx(1.0, abs=1e-9)
    top, where = hinf_norm(closed_by(g, delta))
    assert top == pytest.approx(worst.gain, rel=1e-5)
    assert where == pytest.approx(worst.w_rad_s, rel=1e-2)


def test_random_uncertainties_never_beat_the_exact_gain(loops):
    g = at_rate(loops["lon"])
    exact = frozen_gain(g).gain
    nominal, _ = hinf_norm(g.select(("d1",), ("e1",)))
    rng = np.random.default_rng(2)
    tries = []
    for _ in range(40):
        delta = all_pass(np.exp(1j * rng.uniform(-np.pi, np.pi)), 10.0 ** rng.uniform(-1, 3))
        tries.append(hinf_norm(closed_by(g, delta), tol=1e-6)[0])
    assert max(tries) <= exact * (1 + 1e-9)
    assert max(tries) > nominal


@settings(max_examples=25, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-2.0, 3.0), st.floats(0.1, 1.0))
def test_all_pass_interpolates_the_complex_number(angle, decade, size):
    w = 10.0**decade
    want = size * np.exp(1j * angle)
    if abs(np.sin(angle)) < 1e-6:
        return
    block = all_pass(want, w)
    np.testing.assert_allclose(response(block, [w])[0, 0, 0, 0], want, atol=1e-9)
    np.testing.assert_allclose(np.abs(response(block, [0.0, 0.3 * w, 9 * w])[0, :, 0, 0]), size, rtol=1e-9)
    assert (np.linalg.eigvals(block.A[0]).real < 0).all()


def test_bound_over_trajectories_of_the_aircraft_is_above_every_frozen_gain(loops):
    g = loops["moving"]
    frozen = max(frozen_gain(at_rate(g), k).gain for k in range(2))
    u = upper_bound(g, rate_bound=8.0, degree=1)
    assert u.status == SOLVED
    assert frozen < u.gain < 3.0 * frozen


def test_bound_grows_with_uncertainty_and_with_the_rate():
    # An oscillator whose stiffness moves: swinging it in step pumps energy.
    V = np.array([1.0, 1.5, 2.0])
    A = np.array([[[0.0, 1.0], [-(v**2), -0.6]] for v in V])
    B, C = np.tile(np.eye(2), (3, 1, 1)), np.tile([[0.3, 0.0], [0.0, 1.0]], (3, 1, 1))
    g = Uncertain(V, A, np.zeros_like(A), B, C, np.zeros((3, 2, 2)))
    gains = [[upper_bound(g, bound=b, rate_bound=r).gain for r in (0.0, 0.2)] for b in (0.2, 0.4)]
    assert gains[0][0] < gains[0][1] and gains[1][0] < gains[1][1]
    assert gains[0][0] < gains[1][0] and gains[0][1] < gains[1][1]
    assert max(frozen_gain(at_rate(g), k, bound=0.4).gain for k in range(3)) <= gains[1][0] * (1 + 1e-6)


def toy(a, b, c, d):
    """w -> v = a/(s+1), with the other entries first order as well."""
    A, B = -np.eye(1), np.ones((1, 2))
    return gridded([1.0], A, B * [[1.0, b]], [[a], [c]], [[0.0, 0.0], [0.0, d]], ("w", "d"), ("v", "e"))


def test_gain_is_infinite_where_the_uncertainty_can_destabilise():
    assert frozen_gain(toy(1.2, 1.0, 1.0, 0.0)).gain == np.inf
    assert np.isfinite(frozen_gain(toy(0.5, 1.0, 1.0, 0.0)).gain)
    with pytest.raises(CannotJudge, match="gain may be infinite"):
        upper_bound_of(toy(1.2, 1.0, 1.0, 0.0))


def upper_bound_of(g: Gridded):
    return upper_bound(Uncertain(g.V, g.A, np.zeros_like(g.A), g.B, g.C, g.D))


def test_by_hand():
    # M(0) = [0.5 1; 1 0]: worst of z/(1 - 0.5 z) over the unit disc is 2, at z = 1.
    worst = frozen_gain(toy(0.5, 1.0, 1.0, 0.0))
    assert worst.gain == pytest.approx(2.0) and worst.w_rad_s == 0.0 and worst.delta == pytest.approx(1.0)
    assert upper_bound_of(toy(0.5, 1.0, 1.0, 0.0)).gain == pytest.approx(2.0, rel=1e-2)


def test_wrong_use():
    g = toy(0.5, 1.0, 1.0, 0.0)
    with pytest.raises(WrongUse, match="norm bound"):
        upper_bound(Uncertain(g.V, g.A, g.A, g.B, g.C, g.D), bound=-1.0)
