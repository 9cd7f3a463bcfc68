"""A delay of D samples returns the input of exactly D samples ago: off by one is the classic mistake."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core.errors import WrongUse
from aerofdi.parts.delay_line import delay_fill, delay_line, delay_step

signals = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40)


@settings(deadline=None)
@given(u=signals, delay=st.integers(0, 12), before=st.floats(-5, 5))
def test_whole_delay_shifts_by_exactly_that_many_samples(u, delay, before):
    line = delay_line(delay, before)
    y = [delay_step(line, x, float(delay)) for x in u]
    assert y == ([before] * delay + u)[: len(u)]


@settings(deadline=None)
@given(u=signals, delay=st.floats(0.0, 9.0))
def test_fractional_delay_is_the_mean_of_the_delayed_held_signal(u, delay):
    line = delay_line(delay)
    y = np.array([delay_step(line, x, delay) for x in u])
    fine = 997
    held = np.concatenate([np.zeros(12 * fine), np.repeat(u, fine)])
    # Integral of the held input, then exact differences: mean over [k, k + 1) of u(t - delay).
    total = np.concatenate(([0.0], np.cumsum(held))) / fine
    grid = np.arange(len(total)) / fine - 12
    k = np.arange(len(u))
    mean = np.interp(k + 1 - delay, grid, total) - np.interp(k - delay, grid, total)
    np.testing.assert_allclose(y, mean, atol=1e-6 * (1 + np.abs(u).max()))


def test_lengthening_the_delay_holds_the_past():
    line = delay_line(5.0)
    seen = [delay_step(line, float(k), 2.0 if k < 20 else 5.0) for k in range(30)]
    assert seen[19] == 17.0 and seen[20] == 15.0 and seen[29] == 24.0


def test_a_delay_longer_than_the_line_is_held_at_its_length():
    line = delay_line(2.0)
    assert [delay_step(line, float(k), 50.0) for k in range(1, 7)] == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


def test_fill_forgets_the_past():
    line = delay_line(3.0)
    for k in range(5):
        delay_step(line, float(k), 3.0)
    delay_fill(line, 7.0)
    assert [delay_step(line, 1.0, 3.0) for _ in range(4)] == [7.0, 7.0, 7.0, 1.0]


@pytest.mark.parametrize("bad", [-1.0, float("nan"), float("inf")])
def test_impossible_delays_are_refused(bad):
    with pytest.raises(WrongUse, match="delay"):
        delay_line(bad)
