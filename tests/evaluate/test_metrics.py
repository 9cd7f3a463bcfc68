"""Intervals keep their promise of coverage, re-derived from their definitions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, poisson

from aerofdi.core import WrongUse
from aerofdi.evaluate import bootstrap, clopper_pearson, garwood, median_interval


@given(st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_clopper_pearson_ends_are_where_the_tail_is_half_the_risk(kn):
    k, n = kn
    i = clopper_pearson(k, n, 0.95)
    assert 0 <= i.low <= i.value <= i.high <= 1
    if k > 0:
        assert binom.sf(k - 1, n, i.low) == pytest.approx(0.025, rel=1e-6)
    if k < n:
        assert binom.cdf(k, n, i.high) == pytest.approx(0.025, rel=1e-6)


@given(st.integers(0, 300), st.floats(0.01, 1e4))
def test_garwood_ends_are_where_the_tail_is_half_the_risk(k, hours):
    i = garwood(k, hours, 0.9)
    assert 0 <= i.low <= i.value <= i.high
    assert poisson.cdf(k, i.high * hours) == pytest.approx(0.05, rel=1e-6)
    if k > 0:
        assert poisson.sf(k - 1, i.low * hours) == pytest.approx(0.05, rel=1e-6)


def test_garwood_covers_at_least_as_often_as_it_says():
    for rate in (0.3, 1.0, 4.0, 12.0):
        k = np.arange(60)
        covered = [garwood(int(x), 1.0).low <= rate <= garwood(int(x), 1.0).high for x in k]
        assert 0.95 <= poisson.pmf(k, rate)[covered].sum() <= 1.0


def test_nothing_seen_says_nothing():
    assert math.isnan(clopper_pearson(0, 0).value) and clopper_pearson(0, 0)[1:] == (0.0, 1.0)
    assert garwood(0, 0.0).high == math.inf
    assert math.isnan(bootstrap(np.array([])).value)
    assert math.isnan(median_interval(np.array([])).value)


@pytest.mark.parametrize(
    "call", [lambda: clopper_pearson(3, 2), lambda: garwood(-1, 1.0), lambda: garwood(1, 1.0, 2)]
)
def test_impossible_counts_are_refused(call):
    with pytest.raises(WrongUse):
        call()


def test_bootstrap_repeats_and_covers():
    random = np.random.default_rng(3)
    hits = 0
    for _ in range(120):
        x = random.normal(2.0, 1.0, 60)
        i = bootstrap(x, np.mean, resamples=400)
        hits += i.low <= 2.0 <= i.high
    assert bootstrap(x, np.mean, resamples=400) == i
    assert 0.88 <= hits / 120 <= 1.0


def test_median_interval_counts_a_missed_fault_as_infinitely_late():
    x = np.array([1.0, 2.0, 3.0, 4.0, math.inf, math.inf, math.inf])
    i = median_interval(x)
    assert i.value == 4.0 and i.low == 1.0 and i.high == math.inf
    assert median_interval(np.array([1.0, 1.0, math.inf, math.inf])).value == math.inf
    # Coverage of (x_(l), x_(n+1-l)) is 1 - 2 P(B < l).
    n = 41
    i = median_interval(np.arange(1.0, n + 1))
    assert 1 - 2 * binom.cdf(i.low - 1, n, 0.5) >= 0.95 > 1 - 2 * binom.cdf(i.low, n, 0.5)
    assert i.low + i.high == n + 1
