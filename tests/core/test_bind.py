"""Binding is causal, knows what is fresh, and refuses with both sides named."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerofdi.core import Channels, Flight, MissingChannel, Series, WrongUse, bind, fresh

P = Channels(("p",), ("rad/s",), (1.0,))


def flight(t, v, **more):
    return Flight({"p": Series(np.asarray(t, float), np.asarray(v, float), "rad/s", **more)})


@given(
    st.lists(st.floats(0.0, 10.0), min_size=1, max_size=40),
    st.floats(0.02, 1.0),
    st.floats(0.5, 9.5),
)
def test_nothing_after_an_instant_changes_what_was_known_at_it(stamps, dt, cut):
    t = np.sort(np.array(stamps))
    v = np.arange(len(t), dtype=float)
    whole = bind(flight(t, v), P, dt, 0.0, 10.0)
    until = t <= cut
    if not until.any():
        return
    early = bind(flight(t[until], v[until]), P, dt, 0.0, 10.0)
    same = whole.t_s <= cut
    averaged = (whole.delay_s[0] > 0) or (early.delay_s[0] > 0)
    if not averaged:
        np.testing.assert_array_equal(whole.z[same], early.z[same])
        np.testing.assert_array_equal(whole.age[same], early.age[same])


@given(
    st.lists(st.floats(0.0, 10.0), min_size=1, max_size=40),
    st.floats(0.02, 1.0),
    st.integers(1, 4),
    st.floats(0.5, 9.5),
)
def test_reading_behind_is_causal_too(stamps, dt, steps, cut):
    t = np.sort(np.array(stamps))
    v = np.arange(len(t), dtype=float) ** 2
    behind = P._replace(behind_s=steps * dt)
    until = t <= cut
    if not until.any():
        return
    flights = [flight(t[k], v[k]) for k in (slice(None), until)]
    whole, early = (bind(f, behind, dt, 0.0, 10.0) for f in flights)
    if not any(dt > 1.5 * fresh(f.measured["p"]).period_s for f in flights):
        same = whole.t_s <= cut
        np.testing.assert_array_equal(whole.z[same], early.z[same])
        np.testing.assert_array_equal(whole.age[same], early.age[same])


@pytest.mark.parametrize("start", [0.0, 0.004, 0.008, 0.012, 0.016])
def test_what_is_read_behind_does_not_depend_on_where_the_grid_falls(start):
    """Commands logged at 25 Hz on a grid of 50 Hz: held, they are late by 0 to 40 ms, as the grid falls."""
    clock, slow = 0.003 + 0.02 * np.arange(200), 0.009 + 0.04 * np.arange(100)
    f = flight(clock, np.cos(clock)).with_measured(
        u=Series(slow, np.sin(2 * np.pi * slow), "rad"),
        fast=Series(0.0025 * np.arange(1600), 2.0 * np.arange(1600), "m"),
    )
    inputs = Channels(("p", "u", "fast"), ("rad/s", "rad", "m"), (1.0, 1.0, 1.0), behind_s=0.04)
    s = bind(f, inputs, 0.02, 0.5 + start, 3.5)
    assert 0.0 <= s.t_s[0] - 0.5 - start < 0.02
    then = s.t_s - 0.04
    np.testing.assert_allclose(s.z[:, 0], np.cos(then), atol=1e-7)
    np.testing.assert_allclose(s.z[:, 1], np.interp(then, slow, np.sin(2 * np.pi * slow)), atol=1e-7)
    np.testing.assert_allclose(s.z[:, 2], 2.0 * (then / 0.0025), atol=1.1)
    assert (s.age[:, 0] < 1e-8).all() and (s.age[:, 1] < 0.04 + 1e-8).all()
    np.testing.assert_allclose(s.delay_s[:2], 0.04)
    held = bind(f, inputs._replace(behind_s=0.0), 0.02, 0.5 + start, 3.5)
    assert np.abs(held.z[:, 1] - np.sin(2 * np.pi * held.t_s)).max() > 0.1, "held, it is another signal"


def test_reading_ahead_is_refused():
    with pytest.raises(WrongUse, match=r"-0\.1 s behind"):
        bind(flight([0.0, 0.1], [0.0, 1.0]), P._replace(behind_s=-0.1), 0.1, who="parity")


def test_beyond_the_last_value_known_the_line_goes_on_level():
    s = bind(flight([0.0, 0.1, 0.2, 0.9], [0.0, 1.0, 2.0, 9.0]), P._replace(behind_s=0.1), 0.1, 0.2, 1.15)
    np.testing.assert_allclose(s.z[:, 0], [1, 2, 2, 2, 2, 2, 2, 2 + 7 * 6 / 7, 9, 9], atol=1e-6)
    assert s.age[-3, 0] == pytest.approx(0.6), "and how old it is is still said"


def test_last_value_and_its_age():
    s = bind(flight([0.0, 0.1, 0.3], [1.0, 2.0, 3.0]), P, 0.1, 0.0, 0.55)
    np.testing.assert_array_equal(s.z[:, 0], [1, 2, 2, 3, 3, 3])
    np.testing.assert_allclose(s.age[:, 0], [0, 0, 0.1, 0, 0.1, 0.2], atol=1e-8)


def test_before_the_first_value_nothing_is_known():
    s = bind(flight([0.5, 0.6], [1.0, 2.0]), P, 0.1, 0.2, 0.7)
    assert np.isnan(s.z[:3, 0]).all() and np.isinf(s.age[:3, 0]).all()


def test_nan_repeated_stamps_and_known_repeats_are_not_fresh():
    s = fresh(Series(np.array([0, 1, 1, 2, 3.0]), np.array([1, 2, 9, np.nan, 2.0]), "1", repeats=True))
    np.testing.assert_array_equal(s.t_s, [0, 1])
    s = fresh(Series(np.array([0, 1, 2.0]), np.array([1, 1, 1.0]), "1"))
    assert len(s.t_s) == 3, "an unchanged value is news unless the log is known to repeat"


def test_a_faster_channel_is_averaged_over_the_last_period_and_says_so():
    t = np.arange(0, 2, 0.01)
    s = bind(flight(t, np.sin(2 * np.pi * 10.0 * t)), P, 0.1, 0.5, 1.5)
    assert np.abs(s.z).max() < 1e-9, "ten samples of a 10 Hz sine average to nothing instead of aliasing"
    assert s.delay_s[0] == pytest.approx(0.045)


def test_coded_channels_are_never_averaged():
    t = np.arange(0, 2, 0.01)
    f = Flight({"mode": Series(t, (t > 1).astype(float) * 4, "1", codes={0: "manual", 4: "auto"})})
    s = bind(f, Channels(("mode",), ("1",)), 0.1, 0.0, 2.0)
    assert set(np.unique(s.z)) == {0.0, 4.0}


def test_a_missing_channel_names_both_sides():
    with pytest.raises(MissingChannel, match=r"'q' is needed by parity.*log\.bin has p"):
        bind(Flight(flight([0, 1], [0, 0]).measured, meta={"source": "log.bin"}), Channels(("q",), ("rad/s",)), 0.1,
             who="parity")  # fmt: skip


def test_truth_and_output_are_never_bindable():
    f = Flight({}, truth={"p": Series(np.zeros(2), np.zeros(2), "rad/s")})
    with pytest.raises(MissingChannel, match="only as truth"):
        bind(f, P, 0.1)


def test_a_wrong_unit_names_both_units():
    f = Flight({"p": Series(np.arange(3.0), np.zeros(3), "deg/s")})
    with pytest.raises(WrongUse, match=r"'rad/s'.*'deg/s'"):
        bind(f, P, 0.1)


def test_an_absent_optional_channel_is_nan_with_infinite_age():
    s = bind(flight([0, 1], [0, 1]), Channels(("p", "q"), ("rad/s", "rad/s"), (1.0, 1.0), ("q",)), 0.5)
    assert np.isnan(s.z[:, 1]).all() and np.isinf(s.age[:, 1]).all()


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf])
def test_a_senseless_period_is_refused(dt):
    with pytest.raises(WrongUse, match="sample period"):
        bind(flight([0, 1], [0, 1]), P, dt)
