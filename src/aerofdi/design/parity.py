"""Threshold of a residual for a requested false-alarm rate, from healthy flight."""

from __future__ import annotations

import math

import numpy as np

from ..core.errors import CannotJudge
from ..core.types import Array

CLUSTER_S = 2.0
QUANTILE = 0.9
CONFIDENCE = 0.9


def calibrate_threshold(residual: Array, dt_s: float, false_alarms_per_hour: float) -> float:
    """T such that |residual| is expected to exceed it `false_alarms_per_hour` times an hour in such flight.

    Peaks over threshold: peaks of |residual| above its 90 % quantile u, one for each cluster of 2 s, have excesses
    taken as exponential with mean m (its upper 90 % confidence limit, since healthy flight is short):

        T = u + m ln(peaks per hour / requested per hour),   at least 1.3 times the largest value seen

    The extrapolation holds for flight as rough as the training; it says nothing about rougher air.

    >>> import numpy as np
    >>> r = np.random.default_rng(0).normal(size=100_000)
    >>> 4.0 < calibrate_threshold(r, 0.02, 0.1) < 12.0
    True
    """
    e = np.abs(residual[np.isfinite(residual)])
    if len(e) * dt_s < 5.0:
        raise CannotJudge(
            f"{len(e) * dt_s:.1f} s of healthy residual are too few to set a threshold; give at least 5 s"
        )
    u = float(np.quantile(e, QUANTILE))
    width = max(1, round(CLUSTER_S / dt_s))
    blocks = [float(e[i : i + width].max()) for i in range(0, len(e), width)]
    peaks = np.array([b for b in blocks if b > u])
    largest = float(e.max())
    if len(peaks) < 2 or u == 0.0:
        return max(1.3 * largest, 1e-9)
    from scipy.stats import chi2

    k = len(peaks)
    mean = float(np.mean(peaks - u)) * 2 * k / float(chi2.ppf(1.0 - CONFIDENCE, 2 * k))
    per_hour = k / (len(e) * dt_s / 3600.0)
    return max(u + mean * math.log(max(per_hour / false_alarms_per_hour, 1.0)), 1.3 * largest)
