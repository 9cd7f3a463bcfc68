"""Rates, counts and medians with confidence intervals; each says which interval it is.

Symbols: k events, n trials, T exposure, 1 - a the level of confidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..core import Array, WrongUse


class Interval(NamedTuple):
    """An estimate and its two-sided confidence interval, in the unit of the estimate; NaN where nothing was
    seen.
    """

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"


def _level(confidence: float) -> float:
    if not 0.0 < confidence < 1.0:
        raise WrongUse(
            f"a confidence of {confidence} was given; it must lie between 0 and 1, for example 0.95"
        )
    return 1.0 - confidence


def clopper_pearson(k: int, n: int, confidence: float = 0.95) -> Interval:
    """A probability from k events in n trials, with the exact binomial interval.

    low = B(a/2; k, n-k+1), high = B(1-a/2; k+1, n-k), B the beta quantile. Guarantee: covers the true
    probability at least 1 - a of the time for independent trials; conservative for few. n = 0 gives NaN and
    [0, 1]. Source: Clopper and Pearson, Biometrika 26 (1934).

    >>> from aerofdi.evaluate.metrics import clopper_pearson
    >>> clopper_pearson(0, 100).high < 0.037
    True
    """
    from scipy.special import betaincinv

    a = _level(confidence)
    if not 0 <= k <= n:
        raise WrongUse(f"{k} events in {n} trials were given; events lie between 0 and the number of trials")
    if n == 0:
        return Interval(math.nan, 0.0, 1.0)
    low = float(betaincinv(k, n - k + 1, a / 2)) if k > 0 else 0.0
    high = float(betaincinv(k + 1, n - k, 1 - a / 2)) if k < n else 1.0
    return Interval(k / n, low, high)


def garwood(k: int, exposure: float, confidence: float = 0.95) -> Interval:
    """A rate from k events in an exposure (flight hours), with the exact Poisson interval.

    low = chi2(a/2; 2k) / 2T, high = chi2(1-a/2; 2k+2) / 2T. Guarantee: covers at least 1 - a of the time for
    independent events of constant rate. Exposure 0 gives NaN and [0, inf]. Source: Garwood, Biometrika 28
    (1936).

    >>> from aerofdi.evaluate.metrics import garwood
    >>> round(garwood(0, 1.0).high, 3)
    3.689
    """
    from scipy.special import gammaincinv

    a = _level(confidence)
    if k < 0 or not exposure >= 0:
        raise WrongUse(f"{k} events in an exposure of {exposure} were given; neither may be negative")
    if exposure == 0:
        return Interval(math.nan, 0.0, math.inf)
    low = float(gammaincinv(k, a / 2)) / exposure if k > 0 else 0.0
    return Interval(k / exposure, low, float(gammaincinv(k + 1, 1 - a / 2)) / exposure)


def bootstrap(
    values: Array,
    statistic: Callable[..., Array] = np.median,
    confidence: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> Interval:
    """A statistic of independent values with its percentile bootstrap interval.

    values (n,), non-finite ones are left out; statistic takes (array, axis). Approximate: too narrow below
    about 20 values. Fewer than two finite values give a NaN interval. Same seed, same interval. Source: Efron
    and Tibshirani, An Introduction to the Bootstrap (1993), ch. 13.
    """
    a = _level(confidence)
    x = np.asarray(values, float).ravel()
    x = x[np.isfinite(x)]
    if not len(x):
        return Interval(math.nan, math.nan, math.nan)
    centre = float(statistic(x, axis=0))
    if len(x) < 2:
        return Interval(centre, math.nan, math.nan)
    random = np.random.Generator(np.random.Philox(seed))
    # Chunks keep memory small: at most about a million numbers at once.
    rows = max(1, 1_000_000 // len(x))
    draws = [
        statistic(x[random.integers(0, len(x), (min(rows, resamples - i), len(x)))], axis=1)
        for i in range(0, resamples, rows)
    ]
    low, high = np.quantile(np.concatenate(draws), [a / 2, 1 - a / 2])
    return Interval(centre, float(low), float(high))


def median_interval(values: Array, confidence: float = 0.95) -> Interval:
    """The median of values that may hold infinities (missed faults), with the exact order-statistic interval.

    (x_(l), x_(u)) with l, u from the binomial quantiles of 1/2: no assumption on the distribution, and a
    missed detection (inf) counts as late instead of being left out. NaN values are left out.
    """
    from scipy.stats import binom

    a = _level(confidence)
    x = np.sort(np.asarray(values, float).ravel())
    x = x[~np.isnan(x)]
    n = len(x)
    if not n:
        return Interval(math.nan, math.nan, math.nan)
    lower = int(binom.ppf(a / 2, n, 0.5))  # P(B < lower) < a/2, B the number of values below the median
    middle = x[(n - 1) // 2] if x[(n - 1) // 2] == x[n // 2] else 0.5 * (x[(n - 1) // 2] + x[n // 2])
    if lower < 1:
        return Interval(float(middle), -math.inf, math.inf)
    return Interval(float(middle), float(x[lower - 1]), float(x[n - lower]))
