"""Estimation filters: published and Riccati gains, and that each gain really bounds what the filter does."""

import numpy as np
import pytest

from aerofdi.core import CannotJudge, WrongUse
from aerofdi.design.certificates import LIMIT, certificate, check_dissipation, check_lmis
from aerofdi.design.estimator import Estimation, Options, extend
from aerofdi.design.lmi import SOLVED
from aerofdi.design.lpv import Gridded, connect, gain, gridded, hinf_norm, response, transfer
from aerofdi.design.synthesis import filter_at, inverse, reconstruct, solve
from aerofdi.design.worst_case_gain import all_pass

pytest.importorskip("clarabel")
ONE = np.array([15.4])
THREE = np.array([12.0, 16.0, 20.0])
POLES = (0.031,)
SCALE = {"lat": 0.02, "lon": 0.5}


def options(axis, **change):
    return Options(w_scale=SCALE[axis], **change)


def made(axes, axis, robust, V, **change):
    problem = axes[axis].problem(robust, POLES)
    o = options(axis, **change)
    sol = solve(problem, V, o)
    return problem, o, sol, reconstruct(problem, sol, V)


@pytest.fixture(scope="module")
def single(axes):
    """The four filters at 15.4 m/s."""
    return {(a, r): made(axes, a, r, ONE) for a in ("lat", "lon") for r in (False, True)}


@pytest.fixture(scope="module")
def scheduled(axes):
    """The longitudinal robust filter and the lateral nominal one on three nodes at +-8 m/s^2."""
    return {k: made(axes, *k, THREE, rate_bound=8.0) for k in (("lon", True), ("lat", False))}


def error_loop(problem, f, V, rate=0.0):
    """(w, d) -> (v, W e) with the filter in place."""
    plant = problem.model(np.atleast_1d(V))
    weight = problem.error_weight._replace(inputs=("e",), outputs=("ebar",))
    first = (problem.uncertainty[1],) if problem.uncertainty else ()
    blocks = [plant, filter_at(f, V, rate), gain("e", {"estimate": 1.0, "delta": -1.0}), weight]
    return connect(blocks, plant.inputs, (*first, "ebar"))


@pytest.mark.parametrize(("axis", "gamma"), [("lat", 0.080955), ("lon", 0.063833)])
def test_nominal_gain_is_the_published_one_and_is_attained(single, axis, gamma):
    problem, _, sol, f = single[axis, False]
    assert sol.gamma_optimal == pytest.approx(gamma, abs=1e-5)
    assert sol.stage1.status == sol.stage2.status == SOLVED
    top, _ = hinf_norm(error_loop(problem, f, ONE))
    # At most the backed-off bound, and no filter is better than the optimum.
    assert sol.gamma_optimal * (1 - 1e-4) <= top <= sol.gamma * (1 + 1e-6)


@pytest.mark.parametrize("axis", ["lat", "lon"])
def test_nominal_gain_is_that_of_the_riccati_equations(axes, single, axis):
    slycot = pytest.importorskip("slycot")
    e = extend(axes[axis].problem(False, POLES), ONE)
    n, m = e.B.shape[1:]
    ny = e.C3.shape[1]
    B = np.hstack((e.B[0], np.zeros((n, 1))))
    C = np.vstack((e.C2[0], e.C3[0]))
    D = np.block([[e.D2[0], -np.ones((1, 1))], [e.D3[0], np.zeros((ny, 1))]])
    gamma, *_ = slycot.sb10ad(n, m + 1, ny + 1, 1, ny, 1e100, e.A[0].copy(), B, C, D)
    assert single[axis, False][2].gamma_optimal == pytest.approx(gamma, rel=1e-4)


@pytest.mark.parametrize(("axis", "zero"), [("lat", 0.4128), ("lon", 0.1232)])
def test_estimating_zero_is_worse(axes, single, axis, zero):
    problem = axes[axis].problem(False, POLES)
    e = extend(problem, ONE)
    silent = Gridded(ONE, e.A, e.B, e.C2, e.D2, tuple("abcdefg"[: e.B.shape[2]]), ("eps",))
    top, _ = hinf_norm(silent)
    assert top == pytest.approx(zero, abs=1e-4)
    assert single[axis, False][2].gamma < 0.7 * top


def test_robust_gains_and_orders(single):
    lat, lon = single["lat", True], single["lon", True]
    assert lon[2].gamma_optimal == pytest.approx(0.09031, rel=0.01)
    assert 0.080955 < lat[2].gamma_optimal < 0.095
    assert 0.083 < lat[2].gamma < 0.095
    assert lat[3].A.shape[1] == 15 and lon[3].A.shape[1] == 13


@pytest.mark.parametrize("axis", ["lat", "lon"])
def test_robust_gain_holds_under_the_scaled_small_gain_test(single, axis):
    """sigma(diag(D, 1) T diag(1/D, 1/gamma)) <= 1, |D|^2 the multiplier, proves the gain for every Delta at once."""
    problem, _, sol, f = single[axis, True]
    loop = error_loop(problem, f, ONE)
    w = np.concatenate(([0.0], np.logspace(-4, 5, 3000)))
    c, low, high = sol.multiplier
    a = POLES[0]
    x = (c + low / (w * w + a * a) + high * w * w / (w * w + a * a)) * (
        sol.scaling.estimand / sol.scaling.w
    ) ** 2
    T, D = response(loop, w)[0], np.sqrt(x)
    T[:, 0, :] *= D[:, None]
    T[:, :, 0] /= D[:, None]
    T[:, :, 1:] /= sol.gamma
    s = np.linalg.svd(T, compute_uv=False)[:, 0]
    assert 0.5 < s.max() <= 1.0 + 1e-6


@pytest.mark.parametrize("axis", ["lat", "lon"])
def test_robust_gain_holds_for_random_uncertainties(single, axis):
    problem, _, sol, f = single[axis, True]
    rng = np.random.default_rng(5)
    loop = error_loop(problem, f, ONE)
    worst = 0.0
    for _ in range(25):
        angle, w = rng.uniform(-np.pi, np.pi), 10.0 ** rng.uniform(-2, 2.5)
        delta = all_pass(np.exp(1j * angle), w, loop.outputs[0], loop.inputs[0])
        top, _ = hinf_norm(connect([loop, delta], problem.disturbances, ("ebar",)), tol=1e-6)
        worst = max(worst, top)
    assert worst <= sol.gamma
    # Something happened: the uncertainty does cost more than none.
    assert worst > hinf_norm(loop.select(problem.disturbances, ("ebar",)))[0]


def test_a_nominal_filter_breaks_its_nominal_gain_under_uncertainty(axes, single):
    problem = axes["lon"].problem(True, POLES)
    _, _, sol, f = single["lon", False]
    loop = error_loop(problem, f, ONE)
    delta = [all_pass(np.exp(1j * a), 20.0, "v", "w") for a in np.linspace(-3, 3, 13)]
    worst = max(hinf_norm(connect([loop, d], problem.disturbances, ("ebar",)), tol=1e-6)[0] for d in delta)
    assert worst > sol.gamma


@pytest.mark.parametrize("key", [("lon", True), ("lat", False)])
def test_scheduled_filter_keeps_its_gain_on_moving_airspeeds(scheduled, key):
    """A lower bound over airspeed trajectories by power iteration on the sampled time-varying loop."""
    problem, _, sol, _ = scheduled[key]
    wide = reconstruct(problem, sol, np.linspace(12, 20, 33))
    dt, n = 0.02, 400
    t = dt * np.arange(n)
    best = 0.0
    for V, rate in ((16 + 4 * np.sin(2.0 * t), 8.0 * np.cos(2.0 * t)), (np.full(n, 12.0), np.zeros(n))):
        best = max(best, time_varying_gain(problem, wide, V, rate, dt))
    assert 0.3 * sol.gamma < best <= sol.gamma


def time_varying_gain(problem, f, V, rate, dt):
    from aerofdi.parts.lti import hold

    steps = []
    for v, r in zip(V, rate, strict=True):
        g = error_loop(problem, f, np.array([v]), r).select(problem.disturbances, ("ebar",))
        steps.append((*hold(g.A[0], g.B[0], dt), g.C[0], g.D[0]))
    rng = np.random.default_rng(0)
    d = rng.normal(size=(len(V), len(problem.disturbances)))
    gain_now = 0.0
    for _ in range(12):
        d /= np.linalg.norm(d)
        x, e = np.zeros(len(steps[0][0])), np.zeros(len(V))
        for k, (A, B, C, D) in enumerate(steps):
            e[k] = (C @ x + D @ d[k])[0]
            x = A @ x + B @ d[k]
        gain_now = np.linalg.norm(e)
        # The adjoint, backwards in time, turns the error into the disturbance that matters most.
        q = np.zeros_like(x)
        for k in range(len(V) - 1, -1, -1):
            A, B, C, D = steps[k]
            d[k] = B.T @ q + D[0] * e[k]
            q = A.T @ q + C[0] * e[k]
    return gain_now


def test_certificates_hold_on_the_nodes_and_fail_for_another_filter(scheduled):
    for problem, o, sol, f in scheduled.values():
        assert check_lmis(problem, sol, o, sol.nodes).worst.max() <= LIMIT
        assert check_dissipation(problem, sol, o, f, sol.nodes).max() <= LIMIT
        broken = f._replace(B=1.5 * f.B)
        assert check_dissipation(problem, sol, o, broken, sol.nodes).max() > 1e-4
        tight = sol._replace(gamma=0.9 * sol.gamma_optimal)
        assert check_lmis(problem, tight, o, sol.nodes).worst.max() > LIMIT


def test_the_certificate_reports_what_lacks_between_nodes(scheduled):
    problem, o, sol, f = scheduled["lon", True]
    c = certificate(problem, sol, o, f, 41)
    assert c["largest_scaled_eigenvalue_between"] > LIMIT and c["on_grid_only"] and c["stable"]


def test_only_the_robust_filter_is_scheduled_by_the_rate(scheduled):
    assert np.abs(scheduled["lon", True][3].A_rate).max() > 1e-6
    assert np.abs(scheduled["lat", False][3].A_rate).max() == 0.0


def test_scheduling_costs_gain_only_where_the_aircraft_makes_it(scheduled, single):
    # +-8 m/s^2 costs the lateral axis a factor of three and the longitudinal one next to nothing.
    assert scheduled["lat", False][2].gamma_optimal > 2.5 * single["lat", False][2].gamma_optimal
    assert scheduled["lon", True][2].gamma_optimal < 1.1 * single["lon", True][2].gamma_optimal
    # The gains of twenty nodes are those of the ends.
    assert scheduled["lon", True][2].gamma_optimal == pytest.approx(0.09662, rel=0.01)
    assert scheduled["lat", False][2].gamma_optimal == pytest.approx(0.2659, rel=0.02)


def test_clarabel_direct_equals_cvxpy(axes):
    """The nominal longitudinal problem written once more, in cvxpy, unscaled."""
    cp = pytest.importorskip("cvxpy")
    problem = axes["lon"].problem(False, POLES)
    from aerofdi.design.estimator import apply, scaling_for
    from aerofdi.design.synthesis import null_space

    o = options("lon")
    raw = extend(problem, ONE)
    s = scaling_for(raw, o)
    e = apply(raw, s)
    n, m = e.B.shape[1:]
    X, g2 = cp.Variable((n, n), symmetric=True), cp.Variable()
    A, B = e.A[0], e.B[0]
    N = null_space(np.hstack((e.C3[0], e.D3[0])))
    c2 = np.hstack((e.C2[0], e.D2[0]))
    E = np.diag(np.r_[np.zeros(n), np.ones(m)])
    flow = cp.bmat([[A.T @ X + X @ A, X @ B], [B.T @ X, np.zeros((m, m))]])
    F = N.T @ (flow + c2.T @ c2 - g2 * E) @ N
    cp.Problem(cp.Minimize(g2), [0.5 * (F + F.T) << 0, X >> 0]).solve(solver="CLARABEL")
    assert np.sqrt(g2.value) * s.estimand == pytest.approx(solve(problem, ONE, o).gamma_optimal, rel=1e-3)


def test_a_hopeless_problem_ends_with_its_reason_in_bounded_time(axes):
    problem = axes["lat"].problem(True, POLES)
    loud = problem.model(ONE)

    def shout(V):
        g = loud.at(V)
        return g._replace(C=np.concatenate((200.0 * g.C[:, :1], g.C[:, 1:]), axis=1))

    with pytest.raises(CannotJudge, match=r"airspeeds 15\.4 to 15\.4 m/s ended with"):
        solve(problem._replace(model=shout), ONE, options("lat", max_iter=60, time_limit_s=20.0))
    with pytest.raises(CannotJudge, match="ended with 'iteration limit'"):
        solve(problem, ONE, options("lat", max_iter=3))


def test_wrong_problems_are_refused():
    plant = gridded(
        [1.0], [[-1.0]], [[1.0, 0.0]], [[1.0], [1.0]], [[0.0, 0.0], [0.0, 1.0]], ["d", "n"], ["delta", "y"]
    )
    weight = transfer([1.0, 2.0], [1.0, 1.0], "e", "ebar")
    good = Estimation(lambda V: plant.at(V), "delta", ("y",), ("d", "n"), weight)
    assert solve(good, [1.0], Options()).gamma < 2.0
    with pytest.raises(WrongUse, match="plant inputs n are neither"):
        solve(good._replace(disturbances=("d",)), [1.0], Options())
    with pytest.raises(WrongUse, match="as many zeros as poles"):
        solve(good._replace(error_weight=transfer([1.0], [1.0, 1.0], "e", "ebar")), [1.0], Options())
    with pytest.raises(WrongUse, match="must be stable"):
        solve(good._replace(error_weight=transfer([1.0, -2.0], [1.0, 1.0], "e", "ebar")), [1.0], Options())
    unstable = plant._replace(A=-plant.A)
    with pytest.raises(CannotJudge, match="not stable"):
        solve(good._replace(model=lambda V: unstable.at(V)), [1.0], Options())
    one = connect([weight, inverse(weight)._replace(inputs=("ebar",), outputs=("back",))], ["e"], ["back"])
    np.testing.assert_allclose(response(one, [0.1, 3.0])[0, :, 0, 0], 1.0, atol=1e-12)
