"""The parts of the loops: angles, exact filters, integrators that do not wind up."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from aerofdi.aircraft import load_aircraft
from aerofdi.autopilot import autopilot_of
from aerofdi.autopilot.loops import GRAVITY, lag, lift_rise, pi_control, turn_pitch_rate, wrap

finite = st.floats(-50.0, 50.0)


@settings(deadline=None)
@given(st.floats(-100.0, 100.0))
def test_wrap_gives_the_same_angle_within_half_a_turn(angle: float) -> None:
    w = wrap(angle)
    assert -math.pi <= w < math.pi + 1e-12
    assert math.isclose(math.cos(w), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(w), math.sin(angle), abs_tol=1e-9)


@settings(deadline=None)
@given(finite, finite, st.floats(0.1, 40.0), st.floats(0.001, 0.2))
def test_lag_is_the_exact_solution_for_an_input_held_over_the_step(
    y0: float, u: float, pole: float, dt: float
) -> None:
    exact = solve_ivp(lambda _, y: pole * (u - y), (0.0, dt), [y0], rtol=1e-10, atol=1e-10).y[0, -1]
    assert math.isclose(lag(y0, u, pole, dt), exact, rel_tol=1e-7, abs_tol=1e-7)


def test_turn_terms_are_those_of_a_coordinated_level_turn() -> None:
    phi, speed = math.radians(40.0), 15.4
    turn_rate = GRAVITY * math.tan(phi) / speed
    assert math.isclose(turn_pitch_rate(phi, speed), turn_rate * math.sin(phi), rel_tol=1e-12)
    assert turn_pitch_rate(-phi, speed) == turn_pitch_rate(phi, speed) > 0.0
    # Lift goes with the coefficient and the square of the airspeed; its vertical part carries the weight.
    gains = autopilot_of(load_aircraft("vireo").autopilot).gains
    for airspeed in (12.0, 15.4, 19.0):
        lift = (1.0 + lift_rise(gains, airspeed, phi)) * (airspeed / 15.4) ** 2
        assert math.isclose(lift * math.cos(phi), 1.0, rel_tol=1e-12)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(finite, min_size=1, max_size=60),
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.floats(-1.0, 1.0),
    st.floats(0.05, 3.0),
)
def test_pi_stays_within_its_limits_and_its_integral_never_passes_them(
    errors: list[float], kp: float, ki: float, feed: float, limit: float
) -> None:
    integral = 0.0
    for e in errors:
        integral, out = pi_control(kp, ki, integral, e, feed, -limit, limit, 0.02)
        assert -limit <= out <= limit
        assert -limit <= integral <= limit


def test_pi_leaves_saturation_as_soon_as_the_error_turns_and_a_plain_one_does_not() -> None:
    kp, ki, dt, limit = 0.5, 0.5, 0.02, 0.4
    integral, plain = 0.0, 0.0
    for _ in range(1000):  # 20 s of an error no output can remove
        integral, out = pi_control(kp, ki, integral, 2.0, 0.0, -limit, limit, dt)
        plain += ki * 2.0 * dt
    assert out == limit
    _, after = pi_control(kp, ki, integral, -0.1, 0.0, -limit, limit, dt)
    assert after < limit
    assert np.clip(kp * -0.1 + plain, -limit, limit) == limit


def test_pi_integrates_like_its_transfer_function_between_limits() -> None:
    kp, ki, dt = -0.34, -0.086, 1.0 / 92.0
    w = 2.0
    t = dt * np.arange(20000)
    integral, out = 0.0, np.empty(len(t))
    for k, e in enumerate(np.sin(w * t)):
        integral, out[k] = pi_control(kp, ki, integral, e, 0.0, -10.0, 10.0, dt)
    tail = slice(10000, None)
    basis = np.column_stack([np.sin(w * t[tail]), np.cos(w * t[tail]), np.ones(10000)])
    a, b, _ = np.linalg.lstsq(basis, out[tail], rcond=None)[0]
    assert abs((a + 1j * b) - (kp + ki / (1j * w))) < 2.0 * abs(ki) * dt
