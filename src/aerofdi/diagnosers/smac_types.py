"""The records of SMAC-FDI: the numbers fixed at design time and the memory that goes from step to step.

Numbers that exist once a surface share one table each (few, wide arrays are passed between compiled
functions at no cost, many small ones are not); the columns have names below.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Array, WrongUse
from .smac_ekf import RateModel

Ints = NDArray[np.int64]

# Actuator health evaluators.
RECTIFIED, SYNCHRONOUS, FUSED = 0, 1, 2
# Rules of the fault detector: the paper's sum over the axes (5), or the largest axis against its own
# threshold.
SUM, AXES = 0, 1

# Channels of z before the commands.
P, Q, R, AIRSPEED, ALPHA, BETA, PHI, THETA, PSI, ALTITUDE = range(10)
SIGNALS = ("p", "q", "r", "airspeed", "alpha", "beta", "phi", "theta", "psi", "altitude")
SIGNAL_UNITS = ("rad/s", "rad/s", "rad/s", "m/s", "rad", "rad", "rad", "rad", "rad", "m")
FIRST = len(SIGNALS)


class Detector(NamedTuple):
    """Fault detector, section 3.2.

    rule: SUM (5) or AXES. a1, a2: shares 1 - exp(-2 pi f Ts) of LP1 and LP2. threshold: Gamma2_thresh,
    rad/s (AXES: 1). release: the flag falls below release x threshold. wind_floor: vane activity of their
    own noise, rad2; suspect: share of a threshold raised by the wind that starts a test, never below the
    threshold of still air. a_fast, a_slow, a_wind: shares of the filters of the wind measure. a_estimate:
    of the stuck angle's filter. a_level: of the mean square of each filtered residual while nothing is
    excited. axis (3,): p, q, r thresholds, rad/s: they choose the group, and with AXES they detect too.
    wind_gain (3,): growth of each with vane activity, sqrt(1 + wind_gain^2 (activity - floor)), 1/rad.
    quiet (3,): standard deviation of the filtered residuals in still air, rad/s; each threshold also grows
    with their own over it (gain 0 and quiet inf: fixed, as in the paper). sensitivity (3, nu): residual in
    rad/s that 1 rad of unexplained deflection leaves in steady flight.
    """

    rule: int
    a1: float
    a2: float
    threshold: float
    release: float
    wind_floor: float
    suspect: float
    a_fast: float
    a_slow: float
    a_wind: float
    a_estimate: float
    a_level: float
    axis: Array
    wind_gain: Array
    quiet: Array
    sensitivity: Array


# Columns of Probe.surface.
(
    AMPLITUDE,  # A of (14), rad
    PHASE,  # omega Ts, rad a sample
    BUDGET,  # what the excitation may never exceed, rad
    THRESHOLD,  # Lambda_thresh, rad
    REPLY,  # kappa: the share of A with which a sound surface's command answers
    LOOP_RE,  # loop gain through this surface alone at its frequency
    LOOP_IM,
    HEALTHY_RE,  # R0: command over excitation with every surface sound
    HEALTHY_IM,
    DEAD_RE,  # Q0: residual of its axis over excitation of a surface that does not move, rad/s per rad
    DEAD_IM,
    ANGLE_STD,  # standard deviation of the estimated stuck angle, rad
) = range(12)
# Columns of Probe.place.
AXIS, LAG = range(2)


class Probe(NamedTuple):
    """Excitation (14) and actuator health evaluators (17).

    method: RECTIFIED, SYNCHRONOUS or FUSED. a_mean, a_noise, a_lambda: shares of the filters f_i1 (mean),
    f_i2 (noise), f_i3; a_track: of the answer while tracking. window: N, samples of the synchronous
    evaluator. stuck_below: remaining effectiveness below which the label is "stuck". surface (nu, 12),
    place (nu, 2): columns named above; AXIS is the group (0 roll, 1 pitch, 2 yaw), LAG is lambda in
    samples. slots (ns, nu): 1 where a surface is excited in that test. waves (N, 2 nu): cosine, then sine
    of every surface's frequency over the window.
    """

    method: int
    a_mean: float
    a_noise: float
    a_lambda: float
    a_track: float
    window: int
    stuck_below: float
    surface: Array
    place: Ints
    slots: Ints
    waves: Array


class Timing(NamedTuple):
    """Timeouts of the isolator in samples, see the table in `smac_isolator`; odds: log-likelihood ratio that
    decides a test.
    """

    settle: int
    test_min: int
    test_max: int
    confirm: int
    recover: int
    rest: int
    retest: int
    sweep_every: int
    odds: float


class Budget(NamedTuple):
    """What the excitation may never exceed besides its amplitude. seconds: of excitation between two
    resets. bank, pitch (rad), altitude, track (m): deviations from straight and level flight at which it
    stops at once."""

    seconds: float
    bank: float
    pitch: float
    altitude: float
    track: float


class Params(NamedTuple):
    """Everything SMAC knows of one aircraft. vanes: 1 where alpha and beta are measured; else the filter
    takes alpha = theta and beta = 0, as in straight and level flight. max_age (nz,): s, inf for optional
    inputs."""

    vanes: int
    model: RateModel
    detector: Detector
    probe: Probe
    timing: Timing
    budget: Budget
    max_age: Array


_PARTS = {"model": RateModel, "detector": Detector, "probe": Probe, "timing": Timing, "budget": Budget}


def flatten(params: Params) -> dict[str, NDArray[Any]]:
    """Params as the arrays a Design holds: "probe.surface" -> array."""
    out: dict[str, NDArray[Any]] = {"vanes": np.asarray(params.vanes), "max_age": params.max_age}
    for part in _PARTS:
        record = getattr(params, part)
        out |= {f"{part}.{name}": np.asarray(getattr(record, name)) for name in record._fields}
    return out


def unflatten(arrays: Mapping[str, Any]) -> Params:
    """The Params of `flatten`; a missing array is refused by name."""
    names = ["vanes", "max_age", *(f"{part}.{f}" for part, kind in _PARTS.items() for f in kind._fields)]  # type: ignore[attr-defined]
    missing = [name for name in names if name not in arrays]
    if missing:
        raise WrongUse(
            f"this is no SMAC design: it lacks {', '.join(missing)}; make it with `aerofdi design smac`"
        )

    def value(x: Any) -> Any:
        a = np.asarray(x)
        whole = a.dtype.kind in "iub"
        if a.ndim == 0:
            return int(a) if whole else float(a)
        return np.ascontiguousarray(a, dtype=np.int64 if whole else float)

    parts: dict[str, Any] = {
        part: kind(**{f: value(arrays[f"{part}.{f}"]) for f in kind._fields})  # type: ignore[attr-defined]
        for part, kind in _PARTS.items()
    }
    return Params(vanes=value(arrays["vanes"]), max_age=value(arrays["max_age"]), **parts)


# Columns of State.axes.
RESIDUAL, LOW, LEVEL, SLOW, POWER, BIAS = range(6)
# Columns of State.surface.
(
    MEAN,  # of the command, rad
    NOISE,  # the command without mean and fast noise, rad
    TRIM,  # the command through the estimate's filter, rad
    DELTA,  # stuck angle less command, rad
    LAMBDA,  # rad
    ANSWER_RE,  # averaged R
    ANSWER_IM,
    WITNESS_RE,  # averaged Q
    WITNESS_IM,
    EXCITATION,  # for the next sample, rad
    C_COS,  # the windows, demodulated: command, excitation, residual of the axis
    C_SIN,
    E_COS,
    E_SIN,
    R_COS,
    R_SIN,
    C_POWER,  # mean square amplitude of command and residual at the test frequency without excitation
    R_POWER,
    CROSS_RE,  # mean of command times conjugate residual there
    CROSS_IM,
    EVIDENCE,  # log-likelihood ratio of dead against sound (testing), of sound against dead (tracking)
    C_SUM,  # of the command without mean over the window: not zero while it is on its way elsewhere
) = range(22)
# Columns of State.count.
HEARD, EXCITED, LABEL, ROUND = range(4)
# Slots of State.clock.
READY, GAP, INDEX, MODE, SINCE, SLOT, FLAG, SUSPECT = range(8)
EFFORT, SWEEP_AGE, SWEEP, FOREIGN, CALM, LISTENED, HEEDED = range(8, 15)
# Slots of State.misc.
GAMMA2, WIND_AF, WIND_AS, WIND_BF, WIND_BS, WIND_POWER, HOME_THETA, HOME_ALTITUDE, HOME_PSI, DRIFT = range(10)
SCALE = 10  # and 11, 12: how far wind raises the threshold of each axis
TEST_SCALE = 13  # and 14, 15: the same for what starts a test


class State(NamedTuple):
    """Memory between steps, for nu surfaces and a window of N samples; the columns are named above.

    kalman (9,): x and the lower triangle of Sigma. axes (3, 6): residual; through LP1; through LP1 and LP2;
    through the estimate's filter; variance and mean of the third. surface (nu, 22). count (nu, 4): samples averaged
    into the answer; samples excited; label (0 sound, 1 stuck, 2 partly effective); verdict of this round (0
    untested, 1 sound, 2 undecided). ring (2 nu + 3, N): commands without mean, excitations, residuals. misc
    (16,). clock (15,).
    """

    kalman: Array
    axes: Array
    surface: Array
    count: Ints  # type: ignore[assignment]
    ring: Array
    misc: Array
    clock: Ints


def init(params: Params) -> State:
    """Nothing seen yet: x(0|-1) = 0, Sigma(0|-1) = I, every filter at zero, no label."""
    n, window = len(params.probe.surface), params.probe.window
    kalman = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    return State(
        kalman, np.zeros((3, 6)), np.zeros((n, 22)), np.zeros((n, 4), dtype=np.int64), np.zeros((2 * n + 3, window)),
        np.zeros(16), np.zeros(15, dtype=np.int64),
    )  # fmt: skip
