"""The LPV observer online: exact discretisation, no bumps, honest status, elevons put together again.

The filters here are made by hand so that the right answer is known; those of the paper are tested with their
design.
"""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from aerofdi.core import Design, Flight, Series, Status, WrongUse, bind, check_diagnoser, run
from aerofdi.diagnosers import lpv_observer
from aerofdi.parts.delay_line import delay_line, delay_step
from aerofdi.parts.servo import servo_coefficients, servo_step

DEG = math.pi / 180
DT = 1 / 92
DELAY = 0.05
SERVO = np.array([servo_coefficients(2, 62.8, 0.77, -30 * DEG, 20 * DEG, 338 * DEG, DT)] * 2)
PAIR = ("elevon_left", "elevon_right")
SPEEDS = np.linspace(12.0, 20.0, 5)


def axis(n, ny, seed):
    """A stable LPV filter with fast poles (to -460 rad/s, as the designs have) and a slope in Vdot."""
    random = np.random.default_rng(seed)
    fast = np.diag(-np.geomspace(2.0, 460.0, n))
    A = np.stack([fast + 0.3 * random.standard_normal((n, n)) * V / 12 for V in SPEEDS])
    rate = np.stack([0.05 * random.standard_normal((n, n)) for _ in SPEEDS])
    B, D = random.standard_normal((5, n, ny)), 0.1 * random.standard_normal((5, 1, ny))
    C = random.standard_normal((5, 1, n)) * np.linspace(1, 2, 5)[:, None, None]
    return {"V": SPEEDS, "A": A, "A_rate": rate, "B": B, "C": C, "D": D}


def design(lat=None, lon=None):
    params = {f"lat.{k}": v for k, v in (lat or axis(6, 3, 1)).items()}
    params |= {f"lon.{k}": v for k, v in (lon or axis(4, 1, 2)).items()}
    params |= {"trim.V": SPEEDS, "trim.elevator": np.linspace(-10, 0.5, 5) * DEG, "trim.alpha": np.zeros(5)}
    params |= {"rate_bound": np.array(8.0), "airspeed": np.array([12.0, 20.0])}
    return Design("lpv_observer", {"mixing": [[1.0, -1.0], [1.0, 1.0]]}, "", params, {})


def straight(ny, gain):
    """A filter of one state that matters not, whose estimate is gain . y: the right answer is then known."""
    one = np.ones((5, 1, 1))
    zero = np.zeros((5, 1, ny))
    return {
        "V": SPEEDS, "A": -one, "A_rate": 0 * one, "B": zero, "C": one,
        "D": np.tile(gain, (5, 1)).reshape(5, 1, ny),
    }  # fmt: skip


def known():
    """p carries the true aileron and q the true elevator, less trim."""
    return design(straight(3, np.array([0.0, 0.0, 1.0])), straight(1, np.array([1.0])))


def fly(d, fault_s=12.0, stuck=-8 * DEG, surface=1, duration=25.0, speed=15.0, noise=0.0):
    """Commands through the true actuators; p and q say what the surfaces do."""
    n = round(duration / DT)
    t = DT * np.arange(n)
    airspeed = speed(t) if callable(speed) else np.full(n, speed)
    airspeed = airspeed + noise * np.random.default_rng(5).normal(size=n)
    trim = np.interp(airspeed, SPEEDS, d.params.trim_elevator)
    aileron, elevator = 4 * DEG * np.sin(2 * t), 2 * DEG * np.sin(0.6 * t)
    command = np.stack([trim + elevator - aileron, trim + elevator + aileron], axis=1)
    position = np.zeros((n, 2))
    for s in range(2):
        x, v, line = command[0, s], 0.0, delay_line(DELAY / DT, command[0, s])
        for k in range(n):
            position[k, s] = x
            x, v = servo_step(SERVO[s], x, v, delay_step(line, command[k, s], DELAY / DT))
    position[t >= fault_s, surface] = trim[0] + stuck
    columns = {
        "reference.phi": (0 * t, "rad"), "phi": (0 * t, "rad"),
        "p": ((position[:, 1] - position[:, 0]) / 2, "rad/s"),
        "q": ((position[:, 0] + position[:, 1]) / 2 - trim, "rad/s"), "airspeed": (airspeed, "m/s"),
        "command.elevon_left": (command[:, 0], "rad"), "command.elevon_right": (command[:, 1], "rad"),
    }  # fmt: skip
    return Flight({name: Series(t, x, unit) for name, (x, unit) in columns.items()})


def diagnoser(made=None, **change):
    return lpv_observer.from_design(made or known(), PAIR, SERVO, DELAY, DT, group="elevon", **change)


def verdict(d, flight):
    sample = bind(flight, d.inputs, d.dt_s)
    return sample.t_s, run(d, sample)[1]


@pytest.mark.parametrize(("V", "Vdot"), [(12.0, -8.0), (15.0, 0.0), (16.0, 4.0), (20.0, 8.0)])
def test_at_a_node_the_bank_is_the_exact_zero_order_hold(V, Vdot):
    made = design()
    bank = lpv_observer.discretise(made.params, "lat", 8.0, DT)
    p = made.params

    def at(name):
        table = p[f"lat.{name}"]
        return np.array([np.interp(V, SPEEDS, x) for x in table.reshape(5, -1).T]).reshape(table.shape[1:])

    A, B = at("A") + Vdot * at("A_rate"), at("B")
    joined = expm(np.block([[A, B], [np.zeros((3, 9))]]) * DT)
    random = np.random.default_rng(0)
    x, work = random.standard_normal(6), np.zeros(6)
    mine = x.copy()
    for _ in range(50):
        y = random.standard_normal(3)
        out = lpv_observer.bank_step(bank, V, Vdot, y, mine, work)
        assert out == pytest.approx((at("C") @ x + at("D") @ y)[0], rel=1e-9, abs=1e-12)
        x = joined[:6, :6] @ x + joined[:6, 6:] @ y
        np.testing.assert_allclose(mine, x, rtol=1e-9, atol=1e-12)


def test_between_nodes_the_interpolation_error_is_small_and_shrinks():
    p = design().params
    error = []
    for nodes in (17, 33, 65):
        bank = lpv_observer.discretise(p, "lat", 8.0, DT, nodes)
        fine = lpv_observer.discretise(p, "lat", 8.0, DT, 2 * nodes - 1)
        error.append(np.abs(0.5 * (bank.A[:-1] + bank.A[1:]) - fine.A[1::2]).max())
    assert error[1] < 1e-4 and error[2] < error[1] < error[0]


def test_no_bump_while_the_airspeed_sweeps_the_grid():
    made = design()
    bank = lpv_observer.discretise(made.params, "lat", 8.0, DT)
    x, work, y = np.zeros(6), np.zeros(6), np.array([0.1, -0.2, 0.3])
    speeds = np.arange(12.5, 19.5, 0.5 * DT)
    out = np.array([lpv_observer.bank_step(bank, V, 0.5, y, x, work) for V in speeds])[500:]
    # A switch would show as a jump far above the typical change between samples.
    assert np.abs(np.diff(out)).max() < 20 * np.median(np.abs(np.diff(out)))


def test_healthy_residual_is_nothing_and_a_stuck_elevon_shows_on_its_own_side():
    d = diagnoser()
    for surface in (0, 1):
        t, v = verdict(d, fly(d, surface=surface))
        before = (t > 6.0) & (t < 12.0)
        assert np.abs(v.residual[before]).max() < 1e-12
        assert not v.detected[t < 12.0].any()
        assert v.active[:, surface + 1].any() and not v.active[:, 2 - surface].any()
        true = np.interp(15.0, SPEEDS, d.params.trim_elevator) - 8 * DEG
        assert v.estimate[-1, surface + 1] == pytest.approx(true, abs=1e-3)


def test_airspeed_and_its_rate_are_followed_and_bounded():
    d = diagnoser()
    state = lpv_observer.init(d.params)
    state.speed[0] = 12.0
    for k in range(round(20 / DT)):
        V, Vdot = lpv_observer._schedule(d.params, state, 12.0 + 0.3 * k * DT)
    assert Vdot == pytest.approx(0.3, abs=1e-4)
    # A ramp is followed with the lag 2/w of a critically damped second-order filter, here 2 s.
    assert pytest.approx(12.0 + 0.3 * (20 - DT) - 0.3 * 2.0, abs=0.01) == V
    for _ in range(200):
        V, Vdot = lpv_observer._schedule(d.params, state, 500.0)
    assert V == 20.0 and Vdot == 8.0


def test_out_of_the_envelope_only_when_it_lasts():
    d = diagnoser(persist_s=1.0)
    for low, lost in ((11.0, True), (13.0, False)):
        speed = lambda t, low=low: np.where(t > 8.0, low, 15.0)
        t, v = verdict(d, fly(d, fault_s=99.0, speed=speed))
        assert (v.status[t > 20.0] == Status.OUT_OF_ENVELOPE).all() == lost
        assert (v.status[(t > 5.1) & (t < 8.0)] == Status.OK).all()
    dip = lambda t: np.where((t > 8.0) & (t < 8.3), 11.0, 15.0)
    t, v = verdict(d, fly(d, fault_s=99.0, speed=dip))
    assert (v.status[t > 5.1] == Status.OK).all()


def test_contract():
    d = diagnoser(design(), threshold=1e-3)
    check_diagnoser(d, fly(d, noise=0.3))
    d = diagnoser()
    check_diagnoser(d, fly(d))


def test_a_design_that_does_not_fit_is_refused():
    with pytest.raises(WrongUse, match="mixing"):
        lpv_observer.from_design(known(), ("rudder",), SERVO[:1], DELAY, DT)


def test_states_are_counted():
    assert lpv_observer.state_count(diagnoser(design()))["total"] == 6 + 4 + 4
