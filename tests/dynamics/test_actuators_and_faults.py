"""Faults do to a servo what the catalogue says, at the instant it says, and end when it says."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core.errors import WrongUse
from aerofdi.dynamics.actuators import Servo, actuator_params, actuator_state, actuators_step
from aerofdi.dynamics.faults import MODES, Fault, fault_state, fault_table, faults_now

DT = 0.01
SURFACES = ("elevon_left", "elevon_right")
LIMITS = [(-0.5, 0.35), (-0.5, 0.35), (0.0, 1.0)]
TRIM = (-0.06, -0.05, 0.4)
QUICK = Servo(1, 50.0, 1.0, -0.5, 0.35, 6.0, 0.05)
THROTTLE = Servo(0, 1.0, 1.0, 0.0, 1.0, math.inf, 0.0)


def fly(faults, command, n=200, servo=QUICK, alpha=0.0, beta=0.0, sensors=("p",)):
    """Positions (n + 1, 3) and felt deflections of both elevons and the throttle; row k is time k * DT."""
    params = actuator_params([servo, servo, THROTTLE], DT)
    state = actuator_state(params, TRIM, extra_delay_s=1.0)
    table = fault_table(faults, SURFACES, LIMITS, TRIM, sensors, DT)
    fstate, modified = fault_state(table, 3, len(sensors))
    x, felt, effects, size = [state.position.copy()], [state.felt.copy()], [], []
    for k in range(n):
        faults_now(table, fstate, modified, state.position, k * DT, alpha, beta)
        effects.append(modified.effects.copy())
        size.append(fstate.size.copy())
        actuators_step(params, state, modified.servo, np.asarray(command(k), float))
        x.append(state.position.copy())
        felt.append(state.felt.copy())
    return np.array(x), np.array(felt), np.array(effects), np.array(size)


def wave(k):
    return (0.1 * math.sin(0.3 * k), TRIM[1] + 0.1 * math.sin(0.2 * k), 0.5)


def test_healthy_servo_follows_its_delayed_command_exactly():
    """5 samples of delay: a step at sample 10 moves nothing up to row 15 and follows the exponential from
    there.
    """
    x, felt, _, _ = fly([], lambda k: (0.03 if k >= 10 else TRIM[0], TRIM[1], 0.4))
    assert (x[:16, 0] == TRIM[0]).all()
    t = DT * np.arange(1, 40)
    np.testing.assert_allclose(x[16:55, 0], 0.03 + (TRIM[0] - 0.03) * np.exp(-50 * t), rtol=1e-9)
    np.testing.assert_array_equal(felt, x)
    assert (x[:, 1] == TRIM[1]).all() and (x[:, 2] == 0.4).all()


def test_stuck_at_a_value_about_trim_and_about_neutral():
    for about, goal in (("trim", TRIM[1] - 0.0873), ("neutral", -0.0873)):
        x, _, _, _ = fly([Fault("elevon_right", "stuck", 0.5, value=-0.0873, about=about)], wave)
        healthy = fly([], wave)[0]
        np.testing.assert_array_equal(x[:51], healthy[:51])  # untouched up to the onset, and on it
        assert x[51, 1] != healthy[51, 1]
        np.testing.assert_allclose(x[90:, 1], goal, atol=1e-7)
        np.testing.assert_array_equal(x[:, 0], healthy[:, 0])  # the other elevon is another servo


def test_stuck_where_it_is_keeps_the_position_of_the_onset_not_the_command_not_zero():
    x, _, _, _ = fly([Fault("elevon_right", "stuck", 0.5, 1.5)], wave)
    healthy = fly([], wave)[0]
    assert (x[50:151, 1] == healthy[50, 1]).all()
    assert abs(healthy[50, 1] - wave(50)[1]) > 0.01 and abs(healthy[50, 1]) > 0.01
    np.testing.assert_allclose(x[190:, 1], healthy[190:, 1], atol=1e-9)  # and comes back to life


def test_fault_acts_at_its_onset_not_a_delay_later():
    x, _, _, _ = fly([Fault("elevon_left", "hardover", 0.3, value=1.0)], lambda k: TRIM)
    assert (x[:31, 0] == TRIM[0]).all() and x[31, 0] > TRIM[0]


def test_hardover_runs_to_the_stop_at_the_rate_limit():
    x, _, _, _ = fly(
        [Fault("elevon_right", "hardover", 0.0, value=-1.0)], lambda k: TRIM, servo=QUICK._replace(rate=2.0)
    )
    np.testing.assert_allclose(np.diff(x[:18, 1]), -2.0 * DT)
    assert x[-1, 1] == pytest.approx(-0.5)


def test_loss_of_effectiveness_scales_what_the_air_feels_not_the_servo():
    for about, centre in (("neutral", 0.0), ("trim", TRIM[1])):
        x, felt, _, _ = fly(
            [Fault("elevon_right", "loss_of_effectiveness", 0.2, value=0.4, about=about)], wave
        )
        np.testing.assert_array_equal(x, fly([], wave)[0])
        np.testing.assert_allclose(felt[21:, 1], centre + 0.6 * (x[21:, 1] - centre), rtol=1e-12)


def test_offset_and_oscillation_pass_through_the_servo_and_respect_its_stops():
    x, _, _, _ = fly([Fault("elevon_left", "offset", 0.2, value=0.1)], lambda k: TRIM)
    assert x[-1, 0] == pytest.approx(TRIM[0] + 0.1)
    x, _, _, _ = fly([Fault("elevon_left", "offset", 0.2, value=5.0)], lambda k: TRIM)
    assert x[-1, 0] == pytest.approx(0.35)
    x, _, _, _ = fly(
        [Fault("elevon_left", "oscillating", 0.5, value=0.1, frequency_hz=0.5)], lambda k: TRIM, n=1000
    )
    swing = x[450:, 0] - TRIM[0]
    assert swing.max() == pytest.approx(0.1 / math.hypot(1, math.pi / 50), rel=1e-3)
    crossings = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    np.testing.assert_allclose(np.diff(crossings) * DT, 2.0, atol=DT)


def test_slow_limits_the_motion_and_delayed_adds_exactly_its_delay():
    step = lambda k: (TRIM[0] + (0.2 if k >= 50 else 0.0), TRIM[1], 0.4)
    x, _, _, _ = fly([Fault("elevon_left", "slow", 0.0, value=0.5)], step)
    np.testing.assert_allclose(np.diff(x[55:85, 0]), 0.5 * DT)
    late, _, _, _ = fly([Fault("elevon_left", "delayed", 0.0, value=0.2)], step)
    np.testing.assert_allclose(late[20:, 0], fly([], step)[0][:-20, 0], atol=1e-15)


def test_floating_trails_with_the_airflow_and_recovers():
    x, _, _, _ = fly([Fault("elevon_left", "floating", 0.5, 1.5, value=-0.4)], wave, alpha=0.1)
    assert x[140, 0] == pytest.approx(-0.04, abs=1e-6)
    x, _, _, _ = fly(
        [Fault("elevon_left", "floating", 0.5, 1.5, value=-0.4, rudder=True)], wave, alpha=9.0, beta=0.2
    )
    assert x[140, 0] == pytest.approx(-0.08, abs=1e-6)
    assert x[199, 0] == pytest.approx(fly([], wave)[0][199, 0], abs=1e-6)


def test_throttle_is_a_servo_and_thrust_a_separate_loss():
    x, felt, effects, _ = fly(
        [
            Fault("throttle", "loss_of_effectiveness", 0.5, value=0.3),
            Fault("throttle", "thrust_loss", 1.0, value=0.25),
        ],
        lambda k: (*TRIM[:2], 0.5),
    )
    assert felt[-1, 2] == pytest.approx(0.7 * 0.5) and x[-1, 2] == 0.5
    assert (effects[:100, 5] == 1).all() and (effects[100:, 5] == 0.75).all()


def test_wing_and_airframe_damage_grows_along_its_profile():
    profile = ((0.0, 0.0), (0.5, 0.2), (1.0, 1.0))
    _, _, e, size = fly(
        [
            Fault("wing_right", "lift_loss", 0.2, value=0.1, profile=profile),
            Fault("wing_left", "drag_increase", 0.2, value=0.5, ramp_s=1.0),
            Fault("airframe", "icing", 0.2, 1.7, value=0.2, ramp_s=1.0),
        ],
        lambda k: TRIM,
    )
    t = DT * np.arange(200)
    share = np.interp(t - 0.2, [0, 0.5, 1.0], [0, 0.2, 1.0], left=0.0)
    np.testing.assert_allclose(e[:, 1], 1 - 0.1 * share, atol=1e-9)
    ramp = np.clip(t - 0.2, 0, 1)
    np.testing.assert_allclose(e[:, 2], 1 + 0.5 * ramp, atol=1e-9)
    np.testing.assert_allclose(e[:170, 4], 0.2 * ramp[:170], atol=1e-9)
    assert (e[170:, 4] == 0).all() and (e[:, [0, 3, 5]] == 1).all()
    np.testing.assert_allclose(size[:, 0], 0.1 * share, atol=1e-9)


def test_a_ramp_takes_a_stuck_surface_from_where_it_was():
    x, _, _, _ = fly([Fault("elevon_right", "stuck", 0.5, value=0.1, ramp_s=1.0)], lambda k: TRIM)
    t = DT * np.arange(201)
    goal = TRIM[1] + (0.1 - TRIM[1]) * np.clip(t - 0.5, 0, 1)
    np.testing.assert_allclose(x[100:150, 1], goal[100:150] - 0.15 / 50, atol=2e-3)
    assert x[-1, 1] == pytest.approx(0.1, abs=1e-6)


def test_a_sequence_of_faults_on_one_surface():
    x, _, _, size = fly(
        [
            Fault("elevon_left", "stuck", 0.3, 0.8, value=0.1),
            Fault("elevon_left", "stuck", 1.0, 1.5, value=-0.1),
        ],
        lambda k: TRIM,
    )
    assert x[80, 0] == pytest.approx(0.1, abs=1e-6) and x[99, 0] == pytest.approx(TRIM[0], abs=1e-2)
    assert x[150, 0] == pytest.approx(-0.1, abs=1e-6) and x[-1, 0] == pytest.approx(TRIM[0], abs=1e-6)
    assert (size[30:80, 0] == 0.1).all() and (size[80:, 0] == 0).all() and (size[:30, 0] == 0).all()


@settings(max_examples=40, deadline=None)
@given(
    mode=st.sampled_from(sorted(m for m, s in MODES.items() if "surface" in s.targets)),
    value=st.floats(-0.3, 0.3),
    start=st.integers(0, 80),
    length=st.integers(1, 60),
)
def test_every_fault_of_a_surface_keeps_within_stops_and_rate_and_ends(mode, value, start, length):
    if mode in ("loss_of_effectiveness", "slow", "delayed"):
        value = abs(value)
    f = Fault("elevon_right", mode, start * DT, (start + length) * DT, value, frequency_hz=2.0)
    x, felt, _, size = fly([f], wave, n=260, alpha=0.1, beta=0.1)
    healthy = fly([], wave, n=260)[0]
    assert (x[:, 1] >= -0.5).all() and (x[:, 1] <= 0.35).all()
    if mode != "floating":
        assert (np.abs(np.diff(x[:, 1])) <= 6.0 * DT * (1 + 1e-9)).all()
    np.testing.assert_array_equal(x[: start + 1], healthy[: start + 1])
    np.testing.assert_allclose(x[start + length + 60 :, 1], healthy[start + length + 60 :, 1], atol=2e-5)
    np.testing.assert_array_equal(felt[start + length + 1 :, 1], x[start + length + 1 :, 1])
    assert (size[start + length :] == 0).all()


@pytest.mark.parametrize(
    ("fault", "word"),
    [
        (Fault("canard", "stuck", 1.0), "canard"),
        (Fault("elevon_left", "melted", 1.0), "melted"),
        (Fault("elevon_left", "lift_loss", 1.0, value=0.1), "wing"),
        (Fault("elevon_left", "stuck", 5.0, 4.0), "start < end"),
        (Fault("elevon_left", "stuck", 0.0, value=0.6), "stops"),
        (Fault("elevon_left", "stuck", 0.0, value=0.34, about="trim", ramp_s=-1), "ramp"),
        (Fault("elevon_left", "offset", 0.0), "finite"),
        (Fault("elevon_left", "oscillating", 0.0, value=0.1), "frequency"),
        (Fault("wing_left", "lift_loss", 0.0, value=0.1, profile=((0.0, 1.0), (1.0, 0.5))), "heals"),
        (Fault("throttle", "thrust_loss", 0.0, value=1.5), "within"),
        (Fault("sensor.q", "offset", 0.0, value=0.1), "no such sensor"),
        (Fault("sensor.p", "stuck", 0.0, value=0.1), "repeats"),
        (Fault("elevon_left", "slow", 0.0, value=0.1, ramp_s=2.0), "at once"),
    ],
)
def test_impossible_faults_are_refused_by_name(fault, word):
    with pytest.raises(WrongUse, match=word):
        fault_table([fault], SURFACES, LIMITS, TRIM, ("p",), DT)
