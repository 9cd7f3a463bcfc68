"""A servo is exact between its limits, and its limits act where they act on a real one."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core.errors import WrongUse
from aerofdi.parts.servo import servo_coefficients, servo_step


def run(c, commands, x=0.0, v=0.0):
    out = []
    for u in commands:
        x, v = servo_step(c, x, v, u)
        out.append((x, v))
    return np.array(out)


def test_first_order_step_is_the_exact_solution():
    c = servo_coefficients(1, 50.27, dt_s=0.01)
    t = 0.01 * np.arange(1, 60)
    out = run(c, np.ones(59))
    np.testing.assert_allclose(out[:, 0], 1 - np.exp(-50.27 * t), rtol=1e-12)
    np.testing.assert_allclose(out[:, 1], 50.27 * np.exp(-50.27 * t), rtol=1e-9, atol=1e-12)


def test_second_order_step_is_the_exact_solution():
    w, z, dt = 62.8, 0.77, 1 / 92
    t = dt * np.arange(1, 40)
    wd, decay = w * math.sqrt(1 - z * z), np.exp(-z * w * t)
    x = 1 - decay * (np.cos(wd * t) + z * w / wd * np.sin(wd * t))
    v = decay * w * w / wd * np.sin(wd * t)
    out = run(servo_coefficients(2, w, z, dt_s=dt), np.ones(39))
    np.testing.assert_allclose(out[:, 0], x, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(out[:, 1], v, rtol=1e-9, atol=1e-10)


@settings(deadline=None)
@given(order=st.sampled_from([0, 1, 2]), u=st.floats(-2, 2), dt=st.sampled_from([0.001, 0.01, 0.05]))
def test_rest_stays_rest_to_the_bit(order, u, dt):
    c = servo_coefficients(order, 40.0, 0.7, dt_s=dt)
    assert tuple(servo_step(c, u, 0.0, u)) == (u, 0.0)


@settings(max_examples=60, deadline=None)
@given(
    order=st.sampled_from([0, 1, 2]),
    commands=st.lists(st.floats(-3, 3), min_size=5, max_size=60),
    rate=st.floats(0.5, 20.0),
)
def test_limits_always_hold(order, commands, rate):
    dt = 0.01
    out = run(servo_coefficients(order, 60.0, 0.6, -0.5, 0.35, rate, dt), commands)
    moves = np.diff(np.concatenate(([0.0], out[:, 0])))
    assert (np.abs(moves) <= rate * dt * (1 + 1e-12)).all()
    assert (out[:, 0] <= 0.35).all() and (out[:, 0] >= -0.5).all()
    if order:
        assert (np.abs(out[:, 1]) <= rate).all()
    at_stop = (out[:, 0] == 0.35) & (out[:, 1] > 0) | (out[:, 0] == -0.5) & (out[:, 1] < 0)
    assert not at_stop.any()


def test_rate_limit_acts_on_the_motion_not_on_the_command():
    """A command spike of one sample moves the servo for one step, not for a whole slewing time."""
    rate, dt = math.radians(150), 0.01
    c = servo_coefficients(1, 500.0, rate=rate, dt_s=dt)
    out = run(c, [1.0, 0.0, 0.0, 0.0, 0.0])[:, 0]
    assert out[0] == pytest.approx(rate * dt)
    assert abs(out[2]) < 1e-3


def test_a_slewing_servo_takes_the_time_its_rate_says():
    rate, dt = 2.0, 0.005
    out = run(servo_coefficients(2, 80.0, 0.8, rate=rate, dt_s=dt), np.ones(200))[:, 0]
    fast = np.flatnonzero(np.diff(out) >= rate * dt * (1 - 1e-9))
    assert len(fast) > 70  # the limit was felt
    assert 0.44 <= dt * (1 + np.argmax(out > 0.9)) <= 0.46  # 0.9 at 2 per second
    assert out[-1] == pytest.approx(1.0, abs=1e-9)


def test_second_order_saturated_follows_the_limited_equation():
    """x' = v, v' = w^2 (u - x) - 2 zeta w v with |v| held: never further off than one step of slewing."""
    w, z, rate, h, u = 40.0, 0.7, 1.5, 1e-5, 0.8
    x = v = 0.0
    truth = [x]
    for k in range(60_000):
        v = min(max(v + h * (w * w * (u - x) - 2 * z * w * v), -rate), rate)
        x += h * v
        if k % 250 == 249:
            truth.append(x)
    for every, dt in ((4, 0.01), (1, 0.0025)):
        out = run(servo_coefficients(2, w, z, rate=rate, dt_s=dt), np.full(240 // every, u))[:, 0]
        error = np.abs(out - np.array(truth)[every::every])
        assert error.max() < rate * dt
        assert error[-1] < 1e-4


@pytest.mark.parametrize("bad", [{"order": 3}, {"bandwidth": 0.0}, {"lower": 1, "upper": 1}, {"rate": 0.0}])
def test_impossible_servos_are_refused(bad):
    with pytest.raises(WrongUse, match="servo"):
        servo_coefficients(**{"order": 1, "bandwidth": 10.0, **bad})
