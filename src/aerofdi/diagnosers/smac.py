"""SMAC-FDI: one three-state filter notices a fault, an excitation of one surface at a time finds it.

    residual   y - x(k|k-1) of the turn rates                                 `smac_ekf`, section 3.1
    Gamma1     |LP1(p~)| + |LP1(q~)| + |LP1(r~)|                              (5)
    Gamma2     LP2(Gamma1);  ThereIsaFault: Gamma2 > Gamma2_thresh            section 3.2
    delta_s    A sin(omega t) on the surface under test, added to its command (14)
    Lambda_i   does the controller answer delta_s,i with delta_c,i?           (17), `smac_health`
    isolator   which surface next, and what the answer means                  Figure 6, `smac_isolator`

The diagnoser is active: its excitation rides in `Verdict.excitation`, is added to the commands one sample
later and is never beyond its budget; while it tests or tracks it asks for HOLD_LEVEL. It reads the commands
before excitation (`command.<surface>`) and what was added (`excitation.<surface>`); a flight without the
latter cannot be replayed and is refused by name. Replay uses the recorded excitation;
`excitation_difference` says where its own would have differed.

detected is ThereIsaFault or any declared surface. A declared surface is "stuck" (it does not answer: locked
or floating; estimate = its angle, rad) or "loss_of_effectiveness" (it answers too little; estimate = lost
share). Several surfaces can be declared at once. event.reset above one half clears everything declared and
the used seconds.

Guarantees: |excitation| <= budget at every sample; none after `seconds` of it in total, outside the
attitude, altitude and track limits, or while an input is stale or not finite (a bad sample ends the test
under way and changes nothing else; afterwards the filter begins at the measured rates). Loss of
effectiveness of a surface that need not move leaves no residual in straight flight; only a sweep
(`sweep_every_s`) finds it. Not modelled: sensor faults, which look like faults of surfaces to the detector.

Source: paper "smac". Beyond it: the synchronous evaluator, tests of several surfaces at once, thresholds
that follow the wind (with a suspicion below the alarm that starts tests), estimates, budgets.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core import (
    HEALTHY,
    Array,
    Channels,
    Design,
    Diagnoser,
    Hypothesis,
    Request,
    Sample,
    Status,
    Verdict,
    WrongUse,
)
from ..parts.ops import inline, lean, maximum, minimum, sqrt
from .smac_ekf import ekf_step, input_acceleration
from .smac_health import evaluate_health, listen, silence, watch_commands
from .smac_isolator import HALT, REST, isolate, reset
from .smac_types import (
    AIRSPEED,
    ALPHA,
    AXES,
    AXIS,
    BETA,
    BIAS,
    BUDGET,
    C_COS,
    C_SUM,
    CALM,
    DELTA,
    FIRST,
    FLAG,
    GAMMA2,
    GAP,
    HEEDED,
    INDEX,
    LABEL,
    LEVEL,
    LOW,
    MEAN,
    MODE,
    NOISE,
    POWER,
    R_SIN,
    READY,
    RESIDUAL,
    SCALE,
    SIGNAL_UNITS,
    SIGNALS,
    SLOW,
    SUSPECT,
    TEST_SCALE,
    THETA,
    TRIM,
    WIND_AF,
    WIND_AS,
    WIND_BF,
    WIND_BS,
    WIND_POWER,
    Detector,
    Params,
    State,
    init,
    unflatten,
)
from .smac_verdict import gamma_threshold, say

NONFINITE, STALE, NOT_READY, OUTSIDE = (
    int(s) for s in (Status.NONFINITE, Status.STALE_INPUT, Status.NOT_READY, Status.OUT_OF_ENVELOPE)
)
HOLD_LEVEL = int(Request.HOLD_LEVEL)
# Of the mean square of a residual in gusts: it is taken in their quieter moments, and scatters.
MARGIN = 1.6
RESIDUALS = ("roll rate", "pitch rate", "yaw rate", "gamma2")


@inline
def _input_status(p: Params, z: Array, age: Array) -> int:
    """NONFINITE before STALE_INPUT before OK, over everything but the optional inputs."""
    status, max_age, vanes = 0, p.max_age, p.vanes
    for j in range(len(z) - 1):
        if vanes > 0 or j not in (ALPHA, BETA):
            if not math.isfinite(z[j]):
                return NONFINITE
            if age[j] > max_age[j]:
                status = STALE
    return status


@inline
def _start(p: Params, s: State, z: Array) -> None:
    """At the start and after a long gap: the filter begins at the measured rates, command filters at the
    commands.
    """
    n = len(s.surface)
    s.kalman[:] = 0.0
    for i in range(3):
        s.kalman[i] = z[i]
    s.kalman[3], s.kalman[5], s.kalman[8] = 1.0, 1.0, 1.0
    s.ring[:] = 0.0
    s.surface[:, C_COS : R_SIN + 1] = 0.0
    s.surface[:, C_SUM] = 0.0
    for i in range(n):
        s.surface[i, MEAN], s.surface[i, TRIM], s.surface[i, NOISE] = z[FIRST + i], z[FIRST + i], 0.0
    if p.vanes > 0:
        s.misc[WIND_AF], s.misc[WIND_AS] = z[ALPHA], z[ALPHA]
        s.misc[WIND_BF], s.misc[WIND_BS] = z[BETA], z[BETA]
    s.clock[READY], s.clock[CALM], s.clock[GAP] = 0, 0, 0


@inline
def _resume(s: State, z: Array) -> None:
    """After a gap shorter than the window: only the rates are old."""
    for i in range(3):
        s.kalman[i] = z[i]
    s.clock[GAP], s.clock[CALM] = 0, 0


@inline
def _bad_sample(s: State) -> None:
    """Stop exciting; whatever is declared stays, a test begins anew."""
    s.clock[GAP] += 1
    for i in range(len(s.surface)):
        silence(s, i)


@inline
def follow_wind(p: Params, s: State, z: Array) -> None:
    """How far the wind raises the threshold of each axis: 1 in still air.

    The larger of what the vanes and what the residuals of the last while say. The vanes hear a gust as it
    begins; the residuals tell more exactly, later, and where there are no vanes.
    """
    d, axes, misc = p.detector, s.axes, s.misc
    more = _vane_activity(d, s, z) if p.vanes > 0 else 0.0
    # 1.25 relative standard deviations, 2 / sqrt(heard a2), of a variance from so many samples: LP1 and LP2
    # tie 2 / a2 of them together.
    heard = maximum(1.0, minimum(float(s.clock[HEEDED]), 1.0 / d.a_level))
    scatter = 2.5 / sqrt(heard * d.a2)
    for i in range(3):
        excess = float(axes[i, POWER]) / float(d.quiet[i]) ** 2 - 1.0 - scatter
        own = sqrt(1.0 + MARGIN * maximum(excess, 0.0))
        vanes = sqrt(1.0 + d.wind_gain[i] * d.wind_gain[i] * more)
        misc[SCALE + i] = maximum(own, vanes)
        misc[TEST_SCALE + i] = maximum(1.0, d.suspect * misc[SCALE + i])


@inline
def _vane_activity(d: Detector, s: State, z: Array) -> float:
    """Mean square of both vanes between f_slow and f_fast, less that of their own noise, rad2."""
    misc = s.misc
    alpha, beta = float(z[ALPHA]), float(z[BETA])
    fast_a, slow_a = float(misc[WIND_AF]), float(misc[WIND_AS])
    fast_b, slow_b = float(misc[WIND_BF]), float(misc[WIND_BS])
    # After a start the filters average what they have, and the measure waits for the slow one.
    seen = 1.0 / (1.0 + int(s.clock[READY]))
    fast, slow = maximum(d.a_fast, seen), maximum(d.a_slow, seen)
    fast_a, slow_a = fast_a + fast * (alpha - fast_a), slow_a + slow * (alpha - slow_a)
    fast_b, slow_b = fast_b + fast * (beta - fast_b), slow_b + slow * (beta - slow_b)
    power = float(misc[WIND_POWER])
    late = int(s.clock[READY]) - 1.0 / d.a_slow
    if late > 0.0:
        now = (fast_a - slow_a) ** 2 + (fast_b - slow_b) ** 2
        power += maximum(d.a_wind, minimum(1.0, 1.0 / late)) * (now - power)
    misc[WIND_AF], misc[WIND_AS], misc[WIND_BF], misc[WIND_BS] = fast_a, slow_a, fast_b, slow_b
    misc[WIND_POWER] = power
    return maximum(power - d.wind_floor, 0.0)


@inline
def _heed(d: Detector, s: State) -> None:
    """The variance of each filtered residual: of all that was heard, later of the last while.

    About its own mean, so that a fault that stays, or was there from the start, does not pass for gusts. Heard
    without excitation or suspicion, and at rest after a round of tests that found nothing: what no test
    explains is taken for gusts in the end.
    """
    share = maximum(d.a_level, 1.0 / (1.0 + int(s.clock[HEEDED])))
    s.clock[HEEDED] += 1
    for i in range(3):
        away = float(s.axes[i, LEVEL]) - float(s.axes[i, BIAS])
        s.axes[i, BIAS] += share * away
        s.axes[i, POWER] += share * ((1.0 - share) * away * away - float(s.axes[i, POWER]))


@inline
def residuals(p: Params, s: State, z: Array) -> None:
    """The residual generator: one step of the filter under the sum of command and excitation."""
    m, n = p.model, len(s.surface)
    V = maximum(float(z[AIRSPEED]), m.v_min)
    alpha = float(z[ALPHA]) if p.vanes > 0 else float(z[THETA])
    beta = float(z[BETA]) if p.vanes > 0 else 0.0
    a0 = input_acceleration(m, V, alpha, beta, z, FIRST, n, 0)
    a1 = input_acceleration(m, V, alpha, beta, z, FIRST, n, 1)
    a2 = input_acceleration(m, V, alpha, beta, z, FIRST, n, 2)
    ekf_step(m, s.kalman, z, V, a0, a1, a2, s.axes)


@inline
def detect(d: Detector, s: State) -> None:
    """Section 3.2: LP1, (5), LP2, threshold with release; or each axis through LP1 and LP2 against its own
    threshold.

    Twice: ThereIsaFault, and in gusts already below its threshold the suspicion that starts a test, which
    finds what the residual cannot show.
    """
    axes, threshold, misc = s.axes, d.axis, s.misc
    total, worst, suspect = 0.0, 0.0, 0.0
    for i in range(3):
        low, level = float(axes[i, LOW]), float(axes[i, LEVEL])
        low += d.a1 * (float(axes[i, RESIDUAL]) - low)
        level += d.a2 * (low - level)
        axes[i, LOW], axes[i, LEVEL] = low, level
        total += abs(low)
        worst = maximum(worst, abs(level) / (float(threshold[i]) * float(misc[SCALE + i])))
        suspect = maximum(suspect, abs(level) / (float(threshold[i]) * float(misc[TEST_SCALE + i])))
    g = float(misc[GAMMA2])
    g = worst if d.rule == AXES else g + d.a2 * (total - g)
    misc[GAMMA2] = g
    if d.rule != AXES:
        worst, suspect = g / gamma_threshold(d, s, SCALE), g / gamma_threshold(d, s, TEST_SCALE)
    s.clock[FLAG] = 1 if worst > (d.release if s.clock[FLAG] > 0 else 1.0) else 0
    s.clock[SUSPECT] = 1 if suspect > (d.release if s.clock[SUSPECT] > 0 else 1.0) else 0


@inline
def _estimate(p: Params, s: State, z: Array) -> None:
    """delta - delta_c of the declared surfaces from (11), each from the residual of its own axis less the
    others'.
    """
    a, axes, surface, count, place = p.detector.a_estimate, s.axes, s.surface, s.count, p.probe.place
    sensitivity = p.detector.sensitivity
    n = len(surface)
    for i in range(3):
        axes[i, SLOW] += a * (axes[i, RESIDUAL] - axes[i, SLOW])
    for i in range(n):
        surface[i, TRIM] += a * (z[FIRST + i] - surface[i, TRIM])
        if count[i, LABEL] == 0:
            surface[i, DELTA] = 0.0
    for i in range(n):
        if count[i, LABEL] > 0:
            axis = int(place[i, AXIS])
            rest = float(axes[axis, SLOW])
            for j in range(n):
                if j != i:
                    rest -= float(sensitivity[axis, j]) * float(surface[j, DELTA])
            surface[i, DELTA] = rest / float(sensitivity[axis, i])


@lean
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: z = signals, commands (nu), excitations (nu), reset; row k of out."""
    p, s, clock = params, state, state.clock
    if z[len(z) - 1] > 0.5:
        reset(s)
    status = _input_status(p, z, age)
    if status > 0:
        _bad_sample(s)
        say(p, s, status, out, k)
        return
    if clock[INDEX] == 0 or clock[GAP] > p.probe.window:
        _start(p, s, z)
    elif clock[GAP] > 0:
        _resume(s, z)
    follow_wind(p, s, z)
    residuals(p, s, z)
    watch_commands(p.probe, s, z, FIRST, len(s.surface))
    clock[READY] += 1
    # The filter needs a moment after a start; the detector's filters begin behind it.
    ready = clock[READY] > p.timing.settle
    if 2 * clock[READY] > p.timing.settle:
        detect(p.detector, s)
        _estimate(p, s, z)
    if ready:
        evaluate_health(p, s)
        isolate(p, s, z)
    else:
        clock[FLAG], clock[SUSPECT] = 0, 0
    if clock[CALM] > p.probe.window and (clock[SUSPECT] == 0 or clock[MODE] == REST):
        listen(p.probe, s, p.detector.a_wind)
        # The detector's filters have settled by now: their rise is no gust.
        if 4 * clock[READY] > 3 * p.timing.settle:
            _heed(p.detector, s)
    clock[CALM] += 1
    clock[INDEX] += 1
    say(p, s, OUTSIDE if clock[MODE] == HALT else (0 if ready else NOT_READY), out, k)


@lean
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row of z (n, nz)."""
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


def from_design(design: Design, name: str = "smac") -> Diagnoser:
    """The online diagnoser of a Design made by `design.smac.design_smac`.

    Inputs: p, q, r (rad/s), airspeed, alpha, beta (optional where the aircraft has no vanes), phi, theta,
    psi, altitude, `command.<surface>` and `excitation.<surface>` (rad), and, optional, `event.reset`.
    Outputs: `excitation.<surface>`. Hypotheses: healthy, then two a surface. Residuals: the three rates'
    (rad/s) and Gamma2.
    """
    params = unflatten(design.params)
    surfaces, groups = tuple(design.spec["surfaces"]), tuple(design.spec["groups"])
    if len(params.max_age) != FIRST + 2 * len(surfaces) + 1 or len(groups) != len(surfaces):
        raise WrongUse(
            f"this design names {len(surfaces)} surfaces and {len(groups)} groups but holds {len(params.max_age)} inputs; "
            f"make it again with `aerofdi design smac`"
        )
    commands = tuple(f"command.{s}" for s in surfaces)
    excitations = tuple(f"excitation.{s}" for s in surfaces)
    rad = ("rad",) * len(surfaces)
    optional = ("event.reset",) if params.vanes else ("alpha", "beta", "event.reset")
    inputs = Channels(
        (*SIGNALS, *commands, *excitations, "event.reset"), (*SIGNAL_UNITS, *rad, *rad, "1"),
        tuple(float(a) for a in params.max_age), optional,
    )  # fmt: skip
    hypotheses = [HEALTHY]
    for s, g in zip(surfaces, groups, strict=True):
        hypotheses += [Hypothesis(s, "stuck", "rad", g), Hypothesis(s, "loss_of_effectiveness", "1", g)]
    return Diagnoser(
        name, inputs, Channels(excitations, rad), tuple(hypotheses), params.model.dt, True, params, init, step_into,
        run_into, RESIDUALS, tuple(float(a) for a in params.probe.surface[:, BUDGET]), params.timing.settle * params.model.dt,
    )  # fmt: skip


class Difference(NamedTuple):
    """Where a replay's own excitation differs from the recorded one: samples that differ, the first time,
    the largest difference in rad (NaN time and 0 where none does)."""

    samples: int
    first_s: float
    largest: float


def excitation_difference(d: Diagnoser, sample: Sample, verdict: Verdict) -> Difference:
    """Compare what a replay would have excited with what the flight really had, one sample later.

    A replay reads the recorded excitation, so its verdict stays meaningful; where the two differ, the
    isolator would have gone another way in flight.
    """
    nu = len(d.outputs.names)
    flown = sample.z[1:, FIRST + nu : FIRST + 2 * nu]
    gap = np.abs(flown - verdict.excitation[:-1]).max(axis=1, initial=0.0)
    at = np.flatnonzero(~(gap <= 1e-12))
    if not len(at):
        return Difference(0, math.nan, 0.0)
    return Difference(len(at), float(sample.t_s[1 + at[0]]), float(np.nanmax(gap)))
