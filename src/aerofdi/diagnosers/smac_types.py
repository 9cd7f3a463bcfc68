"""The records of SMAC-FDI: the numbers fixed at design time and the memory that goes from step to step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from .smac_ekf import RateModel

Ints = NDArray[np.int64]

# Actuator health evaluators.
RECTIFIED, SYNCHRONOUS, FUSED = 0, 1, 2
# Rules of the fault detector: the paper's sum over the axes (5), or the largest axis against its own threshold.
SUM, AXES = 0, 1

# Channels of z before the commands.
P, Q, R, AIRSPEED, ALPHA, BETA, PHI, THETA, PSI, ALTITUDE = range(10)
SIGNALS = ("p", "q", "r", "airspeed", "alpha", "beta", "phi", "theta", "psi", "altitude")
SIGNAL_UNITS = ("rad/s", "rad/s", "rad/s", "m/s", "rad", "rad", "rad", "rad", "rad", "m")


class Detector(NamedTuple):
    """Fault detector, section 3.2.

    rule: SUM (5) or AXES. a1, a2: shares 1 - exp(-2 pi f Ts) of LP1 and LP2. threshold: Gamma2_thresh, rad/s (AXES: 1).
    release: the flag falls below release x threshold. axis (3,): p, q, r thresholds, rad/s: they choose the group, and
    with AXES they detect too. wind_gain: growth of all
    thresholds with wind activity, sqrt(1 + (wind_gain activity)^2), 1/rad (0: fixed, as in the paper). wind_floor: activity of the vanes' own noise, rad^2.
    a_fast, a_slow, a_wind: shares of the filters of the wind measure. a_estimate: of the stuck angle's filter.
    sensitivity (3, nu): residual in rad/s that 1 rad of unexplained deflection leaves in steady flight. estimate_std
    (nu,): of the stuck angle, rad.
    """

    rule: int
    a1: float
    a2: float
    threshold: float
    release: float
    axis: Array
    wind_gain: float
    wind_floor: float
    a_fast: float
    a_slow: float
    a_wind: float
    a_estimate: float
    sensitivity: Array
    estimate_std: Array


class Probe(NamedTuple):
    """Excitation (14) and actuator health evaluators (17).

    amplitude (nu,): A, rad. phase (nu,): omega Ts, rad a sample. slots (ns, nu): 1 where a surface is excited in that
    test. axis (nu,): group (0 roll, 1 pitch, 2 yaw). twins (nu,): other surfaces of the group. method: RECTIFIED,
    SYNCHRONOUS or FUSED. lag (nu,): lambda, samples. reply (nu,): the share of A with which a sound surface's command answers.
    a_mean, a_noise, a_lambda: shares of the filters f_i1 (mean), f_i2 (noise), f_i3; a_track: of the
    answer while tracking. loop (nu, 2): real and imaginary
    part of the loop gain through this surface alone at its frequency. healthy (nu, 2): complex ratio R0 of command to
    excitation with every surface sound. dead (nu, 2): complex ratio Q0 of the residual of its axis to the excitation of
    a surface that does not move, s. window: N, samples of the synchronous evaluator. cosine, sine (N, nu).
    threshold (nu,): Lambda_thresh, rad. stuck_below: remaining effectiveness below which the label is "stuck".
    """

    amplitude: Array
    phase: Array
    slots: Ints
    axis: Ints
    twins: Ints
    method: int
    lag: Ints
    reply: Array
    a_mean: float
    a_noise: float
    a_lambda: float
    a_track: float
    loop: Array
    healthy: Array
    dead: Array
    window: int
    cosine: Array
    sine: Array
    threshold: Array
    stuck_below: float


class Timing(NamedTuple):
    """Timeouts of the isolator in samples, see the table in `smac_isolator`; margin: standard deviations of caution."""

    settle: int
    test_min: int
    test_max: int
    confirm: int
    recover: int
    rest: int
    retest: int
    sweep_every: int
    margin: float


class Budget(NamedTuple):
    """What the excitation may never exceed. amplitude (nu,): rad. seconds: of excitation between two resets. bank,
    pitch (rad), altitude, track (m): deviations from straight and level flight at which it stops at once."""

    amplitude: Array
    seconds: float
    bank: float
    pitch: float
    altitude: float
    track: float


class Params(NamedTuple):
    """Everything SMAC knows of one aircraft. max_age (nz,): s, inf for optional inputs."""

    model: RateModel
    detector: Detector
    probe: Probe
    timing: Timing
    budget: Budget
    max_age: Array


# Slots of State.clock.
READY, GAP, INDEX, MODE, SINCE, SLOT, FLAG, EFFORT, SWEEP_AGE, SWEEP, FOREIGN, CALM = range(12)
# Slots of State.home.
HOME_THETA, HOME_ALTITUDE, HOME_PSI, DRIFT = range(4)
# Slots of State.wind.
WIND_AF, WIND_AS, WIND_BF, WIND_BS, WIND_POWER = range(5)


class State(NamedTuple):
    """Memory between steps; sizes for nu surfaces and a window of N samples.

    x (3,), P (6,): filter. low, axis, slow (3,): residuals through LP1, through LP1 and LP2, and through the estimate's
    filter. gamma (1,):
    Gamma2. wind (5,). residual, accel (3,): this sample's. mean, noise, trim (nu,): filtered commands. delta (nu,): stuck angle
    minus command, rad. ring_c, ring_s
    (nu, N), ring_r (3, N): commands without mean, excitations, residuals. sums (nu, 6): demodulated rings: command cos,
    sin, excitation cos, sin, residual of the axis cos, sin. ambient (nu, 2): mean square of the amplitudes that command
    and residual have by themselves at the test frequency, rad2, (rad/s)2. lam (nu,): Lambda, rad. answer, witness
    (nu, 2): averaged complex R and Q. count (nu,): samples in it. excited (nu,): samples since this surface's
    excitation began. label (nu,): 1 stuck, 2 partly effective. verdict (nu,): 0 untested, 1 sound, 2 undecided, of this round. hold
    (nu,): samples the answer has been on one side (negative: sound side). excitation (nu,). home (4,). clock (12,).
    """

    x: Array
    P: Array
    low: Array
    axis: Array
    slow: Array
    gamma: Array
    wind: Array
    residual: Array
    accel: Array
    mean: Array
    noise: Array
    trim: Array
    delta: Array
    ring_c: Array
    ring_s: Array
    ring_r: Array
    sums: Array
    ambient: Array
    lam: Array
    answer: Array
    witness: Array
    count: Ints
    excited: Ints
    label: Ints
    verdict: Ints
    hold: Ints
    excitation: Array
    home: Array
    clock: Ints


def init(params: Params) -> State:
    """Nothing seen yet: x(0|-1) = 0, Sigma(0|-1) = I, every filter at zero, no label."""
    n, window = len(params.probe.amplitude), params.probe.window
    f, i = np.zeros, lambda *shape: np.zeros(shape, dtype=np.int64)
    return State(
        f(3), np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0]), f(3), f(3), f(3), f(1), f(5), f(3), f(3), f(n), f(n), f(n),
        f(n), f((n, window)), f((n, window)), f((3, window)), f((n, 6)), f((n, 2)), f(n), f((n, 2)), f((n, 2)), i(n), i(n), i(n), i(n), i(n), f(n), f(4),
        i(12),
    )  # fmt: skip
