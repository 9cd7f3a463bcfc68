"""Equation error: least squares on the low-passed angular acceleration, scanned over command delay.

    s F(s) w = F(s) [ V (a w + sum_j c_j w_j) + V^2 (sum_s b_s delta_s + air + m) ] + error,   F = W^2 / (s + W)^2

It needs no start values and gives the first guess of the delay. In closed loop, gusts reach the commands
through the autopilot and pull b_s towards zero; the filter-error stage removes that.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.types import Array
from .data import Segment, Training, shift, smooth

BANDWIDTH = 10.0
DELAYS_S = tuple(np.round(np.arange(0.0, 0.201, 0.02), 3))
SETTLE = 5.0


def bandwidth(dt_s: float) -> float:
    """W in rad/s: 10, or half the Nyquist frequency where sampling is slow."""
    return min(BANDWIDTH, 0.5 * math.pi / dt_s)


def low_passed(x: Array, dt_s: float, derivative: bool = False) -> Array:
    """F(s) x, or s F(s) x, along the first axis; bilinear transform, started at the first value."""
    from scipy.signal import bilinear, lfilter

    w = bandwidth(dt_s)
    b, a = bilinear([w * w, 0.0] if derivative else [w * w], [1.0, 2.0 * w, w * w], 1.0 / dt_s)
    y = lfilter(b, a, x - x[:1], axis=0)
    return np.asarray(y if derivative else y + x[:1])


def regressors(training: Training, segment: Segment, axis: int, delay_s: float, lag_s: float) -> Array:
    """Columns (n, m) in the order of `names`: own and other rates, groups, air angles, trim."""
    v = segment.speed[:, None]
    moved = [shift(smooth(c, training.dt_s, lag_s), training.dt_s, delay_s) for c in segment.commands.T]
    others = np.delete(segment.rates, axis, axis=1)
    own = segment.rates[:, axis : axis + 1]
    return np.hstack((v * own, v * others, v**2 * np.column_stack(moved), v**2 * segment.air, v**2))


def names(training: Training, axis: int) -> tuple[str, ...]:
    """Names of the columns of `regressors`."""
    others = tuple(r for i, r in enumerate(training.rates) if i != axis)
    groups = tuple(f"command.{g.name}" for g in training.groups)
    return (training.rates[axis], *others, *groups, *training.air, "trim")


def stacked(training: Training, axis: int, delay_s: float, lag_s: float) -> tuple[Array, Array]:
    """Low-passed acceleration and regressors over all segments, without the first 5/W of each."""
    skip = math.ceil(SETTLE / bandwidth(training.dt_s) / training.dt_s)
    y, x = [], []
    for segment in training.segments:
        y.append(low_passed(segment.rates[:, axis], training.dt_s, derivative=True)[skip:])
        x.append(low_passed(regressors(training, segment, axis, delay_s, lag_s), training.dt_s)[skip:])
    return np.concatenate(y), np.concatenate(x)


def explained(y: Array, x: Array, theta: Array) -> float:
    """R2 = 1 - var(y - x theta) / var(y)."""
    return float(1.0 - np.var(y - x @ theta) / np.var(y))


def scan(training: Training) -> tuple[float, list[Array]]:
    """(delay_s, theta per axis) with the largest joint likelihood over all axes, without actuator lag."""
    best: tuple[float, float, list[Array]] = (math.inf, 0.0, [])
    for delay in DELAYS_S:
        cost, thetas = 0.0, []
        for axis in range(len(training.rates)):
            y, x = stacked(training, axis, delay, 0.0)
            theta = np.linalg.lstsq(x, y, rcond=None)[0]
            cost += 0.5 * len(y) * math.log(max(1.0 - explained(y, x, theta), 1e-9))
            thetas.append(theta)
        if cost < best[0]:
            best = (cost, float(delay), thetas)
    return best[1:]
