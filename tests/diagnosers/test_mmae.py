"""Multiple-model estimation: the filters are the Riccati ones, the bank recovers, the contract holds."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from aerofdi.core import Channels, Flight, Series, Status, WrongUse, bind, check_diagnoser, run
from aerofdi.design.mmae import Tuning, design_mmae
from aerofdi.diagnosers import mmae
from aerofdi.parts.bessel import sections_step
from aerofdi.parts.lti import hold
from aerofdi.parts.servo import servo_coefficients, servo_step

DEG = math.pi / 180
DT = 1 / 92
# Lateral model of the Vireo with separate elevons, paper "vireo_comparison" (17).
A = np.array(
    [[-0.574, 1.12, -15.3, 9.78], [-3.99, -11.3, 2.5, 0], [0.311, -1.49, -0.944, 0], [0, 1, 0.0683, 0]]
)
B = np.array([[0.245, -0.245], [100.5, -100.5], [4.805, -4.805], [0, 0]])
STATES, PAIR = ("v", "p", "r", "phi"), ("elevon_left", "elevon_right")
SERVO = np.array([servo_coefficients(2, 62.8, 0.77, -30 * DEG, 20 * DEG, 338 * DEG, DT)] * 2)
TUNING = Tuning(
    state_std={"v": 0.7, "p": 2 * DEG, "r": 2 * DEG, "phi": 2 * DEG},
    measured={"r": 0.2 * DEG, "phi": 0.2 * DEG},
    weight={"p": 1.0, "r": 0.0, "phi": 36.0},
    delay=4,
)


def design(**change):
    return design_mmae(A, B, STATES, PAIR, PAIR, SERVO, DT, TUNING._replace(**change), group="elevon")


BANK = mmae.from_design(design(rule=mmae.TEXTBOOK))


def fly(onset, stuck=-5 * DEG, surface=1, duration=None, seed=0, noise=1.0):
    """The linear lateral model under the paper's roll loop, with turns and an elevator that moves as under
    any altitude loop (with a constant one a left and a right elevon stuck look the same in the lateral
    motion).
    """
    n = round((duration or onset + 20) / DT)
    Ad, Bd = hold(A, B, DT)
    random = np.random.default_rng(seed)
    x, servo, integral = np.zeros(4), np.full((2, 2), [-3.6 * DEG, 0.0]), 0.0
    sent = [np.full(2, -3.6 * DEG)] * 6
    rows = []
    for k in range(n):
        t = k * DT
        bank = 30 * DEG if t % 20 > 14 else 0.0
        z = x + noise * np.array([0, 0.5, 0.5, 0.5]) * DEG * random.standard_normal(4)
        integral += DT * (bank - z[3])
        aileron = -0.34 * (bank - z[3]) - 0.086 * integral + 0.06 * z[1]
        lift = 0.5 * DEG * math.sin(0.7 * t) + (4 * DEG * -math.expm1(onset - t) if t > onset else 0.0)
        command = np.array([-1.0, 1.0]) * aileron - 3.6 * DEG + lift
        sent = [command, *sent[:-1]]
        u = 0.4 * sent[4] + 0.6 * sent[5]
        for i in range(2):
            servo[i] = servo_step(SERVO[i], servo[i, 0], servo[i, 1], u[i])
        position = servo[:, 0].copy()
        if t >= onset:
            position[surface] = -3.6 * DEG + stuck
        rows.append([t, z[1], z[2], z[3], *command])
        x = Ad @ x + Bd @ position
    r = np.array(rows)
    names = {
        "p": "rad/s",
        "r": "rad/s",
        "phi": "rad",
        "command.elevon_left": "rad",
        "command.elevon_right": "rad",
    }
    return Flight({n: Series(r[:, 0], r[:, j + 1], u) for j, (n, u) in enumerate(names.items())})


def verdict(d, flight):
    sample = bind(flight, d.inputs, d.dt_s)
    return sample.t_s, run(d, sample)[1]


def test_state_count_is_42_not_43():
    assert mmae.state_count(design()) == {"filters": 38, "actuators": 4, "low_passes": 30, "total": 42}
    # Down-sampled to 46 Hz two delay states a channel are enough: 30, not 31.
    half = design_mmae(A, B, STATES, PAIR, PAIR, SERVO, 2 * DT, TUNING._replace(delay=2))
    assert mmae.state_count(half)["total"] == 30


def test_gains_are_the_fixed_point_of_the_time_varying_filter():
    """An independent judge: iterate predict and correct from P = 1 until nothing changes."""
    d = design()
    p = d.params
    measured = np.flatnonzero(p["measured"])
    for i in range(3):
        live = p["A"].shape[1] - (0 if p["stuck"][i] >= 0 else 1)
        a, c = p["A"][i, :live, :live], p["H"][i][measured][:, :live]
        Q = np.zeros((live, live))
        Q[:4, :4] = np.diag([0.7**2] + [(2 * DEG) ** 2] * 3)
        if p["stuck"][i] >= 0:
            Q[-1, -1] = 1e-6
        R = np.eye(2) * (0.2 * DEG) ** 2
        P = np.eye(live)
        for _ in range(8000):
            M = a @ P @ a.T + Q
            S = c @ M @ c.T + R
            L = np.linalg.solve(S, c @ M).T
            P = (np.eye(live) - L @ c) @ M
        np.testing.assert_allclose(p["L"][i, :live][:, measured], L, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(p["S_inv"][i][np.ix_(measured, measured)], np.linalg.inv(S), rtol=1e-6)
        if p["stuck"][i] >= 0:
            assert p["std"][i] == pytest.approx(math.sqrt(P[-1, -1]), rel=1e-6)
    assert max(d.certificate["riccati_residual"]) < 1e-10
    assert max(d.certificate["slowest_pole"]) < 1.0
    assert d.certificate["observable_rank"] == [0, 0, 0]


def test_the_delay_chain_delays_by_its_length():
    p = design().params
    x = np.zeros(13)
    x[2] = 1.0
    seen = []
    for _ in range(6):
        seen.append((p["H"][0] @ x)[1])
        x = p["A"][0] @ x
    assert seen[:4] == [0.0] * 4 and seen[4] == 1.0


@pytest.mark.parametrize("healthy_s", [5.0, 20.0, 60.0])
def test_any_healthy_time_before_the_fault_leaves_it_detectable(healthy_s):
    for rule in (mmae.PAPER, mmae.TEXTBOOK):
        d = mmae.from_design(design(rule=rule))
        t, v = verdict(d, fly(healthy_s))
        assert not v.detected[t < healthy_s].any()
        late = t > healthy_s + 15
        assert v.active[late, 2].mean() > 0.95, rule
        assert not v.active[late, 1].any()
        assert np.all(np.abs(v.estimate[late, 2] + 8.6 * DEG) < 3 * v.estimate_std[late, 2])


def by_the_book(made, d, sample):
    """(scores, residuals) from the paper's equations written out: matrices, products of probabilities, scipy's density.

    Only good samples; the floor is applied after (14) or (4) as in the paper, "the lower limits are set as 0.01".
    """
    P, tuning = made.params, made.spec["tuning"]
    measured, weight = P["measured"] > 0.5, np.array([1.0, 0.0, 36.0])
    z = sample.z
    u = np.array([[c, 0.0] for c in z[0, 3:5]])
    x = np.array([P["start"] @ z[0, :3] for _ in range(3)])
    x[1, -1], x[2, -1] = z[0, 3], z[0, 4]
    before, p = np.tile(z[0, :3], (3, 1)), np.array([0.98, 0.01, 0.01])
    memory = np.zeros((3, 3, len(P["low"]), 2))
    scores, residuals = [], []
    for k, row in enumerate(z):
        evidence, likelihood = np.zeros(3), np.ones(3)
        for i in range(3):
            x[i] = P["A"][i] @ x[i] + P["B"][i] @ u[:, 0]
            ahead = P["H"][i] @ x[i]
            r = row[:3] - np.where(measured, ahead, before[i])
            before[i] = ahead
            x[i] = x[i] + P["L"][i][:, measured] @ r[measured]
            if tuning["rule"] == mmae.TEXTBOOK:
                S = np.linalg.inv(P["S_inv"][i][np.ix_(measured, measured)])
                evidence[i] = 0.5 * r[measured] @ np.linalg.solve(S, r[measured])
                likelihood[i] = multivariate_normal(np.zeros(2), S).pdf(r[measured])
            else:
                low = [sections_step(P["low"], memory[i, j], r[j]) if weight[j] else 0.0 for j in range(3)]
                evidence[i] = weight @ np.square(low)
                likelihood[i] = math.exp(-0.04 * evidence[i])
        for a in range(2):
            u[a] = servo_step(SERVO[a], u[a, 0], u[a, 1], row[3 + a])
        if k >= d.settle_s / d.dt_s and (tuning["rule"] == mmae.TEXTBOOK or np.sum(evidence > 0.08) >= 2):
            p = np.maximum(likelihood * p / np.sum(likelihood * p), 0.01)
        scores.append(p / p.sum())
        residuals.append(evidence)
    return np.array(scores), np.array(residuals)


@pytest.mark.parametrize("rule", [mmae.PAPER, mmae.TEXTBOOK])
def test_probabilities_are_those_of_the_equations_written_out(rule):
    made = design(rule=rule)
    d = mmae.from_design(made)
    sample = bind(fly(8.0, duration=16.0), d.inputs, d.dt_s)
    v = run(d, sample)[1]
    scores, residuals = by_the_book(made, d, sample)
    np.testing.assert_allclose(v.residual, residuals, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(v.score, scores, rtol=1e-7, atol=1e-9)
    assert scores[0, 0] > 0.97 and scores[-1, 2] > 0.97, "something happened"


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 50.0), st.integers(1, 5000))
def test_however_long_it_was_healthy_the_way_back_is_bounded(per_sample, samples):
    """Plain products of likelihoods reach zero and stay there; here log(1/floor) nats more always turn it
    over.
    """
    params = BANK.params._replace(log_beta=np.zeros(3))
    state = mmae.init(params)
    healthy, faulty = np.array([0.0, per_sample, per_sample]), np.array([1.0, 1.0, 0.0])
    plain = np.array([0.98, 0.01, 0.01])
    for _ in range(samples):
        mmae._update(params, state, healthy)
        plain = plain * np.exp(-healthy)
        plain = plain / plain.sum()
    assert np.exp(state.log_p).min() >= 0.01 - 1e-12
    for _ in range(math.ceil(math.log(1 / 0.01)) + 1):
        mmae._update(params, state, faulty)
        plain = plain * np.exp(-faulty)
        plain = plain / plain.sum()
    assert np.exp(state.log_p[2]) > 0.5
    assert per_sample * samples < 10.0 or plain[2] < 0.5


def test_estimates_are_about_neutral_whatever_trim_the_model_is_about():
    """Equal trims of a pair cancel in B; what is left to see is that they are taken off and put back."""
    flight = fly(10.0)
    about_neutral = verdict(mmae.from_design(design()), flight)[1]
    made = design_mmae(A, B, STATES, PAIR, PAIR, SERVO, DT, TUNING, trim=(-0.0624, -0.0624))
    about_trim = verdict(mmae.from_design(made), flight)[1]
    np.testing.assert_allclose(about_trim.estimate, about_neutral.estimate, atol=1e-9)
    np.testing.assert_allclose(about_trim.score, about_neutral.score, atol=1e-9)
    assert about_trim.estimate[-1, 2] < -6 * DEG


def test_left_and_right_are_told_apart():
    d = mmae.from_design(design())
    for surface in (0, 1):
        _, v = verdict(d, fly(20.0, surface=surface))
        assert v.active[-1].tolist() == [False, surface == 0, surface == 1]


def test_the_gate_keeps_noise_out():
    d = mmae.from_design(design())
    _, v = verdict(d, fly(30.0, duration=30.0))
    assert np.isfinite(v.residual).all() and v.residual[:, 0].max() < 0.08
    assert (v.score[:, 0] > 0.97).all() and not v.detected.any()


def test_probabilities_sum_to_one_and_a_reset_restores_the_prior():
    d = mmae.from_design(design())
    flight = fly(10.0)
    t, v = verdict(d, flight)
    np.testing.assert_allclose(v.score.sum(axis=1), 1.0, atol=1e-12)
    assert v.detected[-1]
    stamps = flight.measured["p"].t_s
    press = Series(stamps, (stamps > 25.0).astype(float), "1")
    t, again = verdict(d, flight.with_measured(**{"event.reset": press}))
    assert not again.detected[t > 25.1].any() and again.detected[t < 25.0].any()
    np.testing.assert_allclose(again.score[-1], [0.98, 0.01, 0.01], atol=1e-6)


def test_a_long_gap_restarts_and_a_short_one_does_not():
    d = mmae.from_design(design())
    sample = bind(fly(30.0, duration=30.0), d.inputs, d.dt_s)
    for length, restarts in ((20, False), (200, True)):
        z = sample.z.copy()
        z[1000 : 1000 + length, 2] = np.nan
        v = run(d, sample._replace(z=z))[1]
        assert (v.status[1000 : 1000 + length] == Status.NONFINITE).all()
        assert (v.status[1000 + length] == Status.NOT_READY) == restarts
        assert not v.detected.any()


def test_contract():
    check_diagnoser(mmae.from_design(design()), fly(12.0))


def test_wrong_names_are_refused():
    with pytest.raises(WrongUse, match="rudder"):
        design_mmae(A, B, STATES, PAIR, ("rudder",), SERVO, DT, TUNING)
    with pytest.raises(WrongUse, match="state_std needs v"):
        design(state_std={"p": 1.0, "r": 1.0, "phi": 1.0})
    with pytest.raises(WrongUse, match="floor"):
        design(floor=0.5)


def test_channels_are_declared():
    d = mmae.from_design(design())
    assert isinstance(d.inputs, Channels)
    assert d.inputs.names == ("p", "r", "phi", "command.elevon_left", "command.elevon_right", "event.reset")
    assert d.inputs.units == ("rad/s", "rad/s", "rad", "rad", "rad", "1")
