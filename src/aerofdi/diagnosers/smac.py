"""SMAC-FDI: one three-state filter notices a fault, an excitation of one surface at a time finds it.

    residual   y - x(k|k-1) of the turn rates                                              `smac_ekf`, section 3.1
    Gamma1     |LP1(p~)| + |LP1(q~)| + |LP1(r~)|                                           (5)
    Gamma2     LP2(Gamma1);  ThereIsaFault: Gamma2 > Gamma2_thresh                         section 3.2
    delta_s    A sin(omega t) on the surface under test, added to its command              (14)
    Lambda_i   does the controller answer delta_s,i with delta_c,i?                        (17), `smac_health`
    isolator   which surface next, and what the answer means                               Figure 6, `smac_isolator`

The diagnoser is active: its excitation rides in `Verdict.excitation`, is added to the commands one sample later and is
never beyond its budget; while it tests or tracks it asks for HOLD_LEVEL. It reads the commands before excitation
(`command.<surface>`) and what was added (`excitation.<surface>`); a flight without the latter cannot be replayed and is
refused by name. Replay uses the recorded excitation; `excitation_difference` says where its own would have differed.

detected is ThereIsaFault or any declared surface. A declared surface is "stuck" (it does not answer: locked or
floating; estimate = its angle, rad) or "loss_of_effectiveness" (it answers too little; estimate = lost share).
Several surfaces can be declared at once. event.reset above one half clears everything declared and the used seconds.

Guarantees: |excitation| <= budget at every sample; none after `seconds` of it in total, outside the attitude, altitude
and track limits, or while an input is stale or not finite (a bad sample changes no state but a counter; afterwards the
filter starts again). Loss of effectiveness of a surface that need not move leaves no residual in straight flight; only
a sweep (`sweep_every_s`) finds it. Not modelled: sensor faults, which look like faults of surfaces to the detector.

Source: paper "smac". Beyond it: the synchronous evaluator, tests of several surfaces at once, thresholds that follow
the wind, estimates, budgets.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core import HEALTHY, Array, Channels, Diagnoser, Hypothesis, Request, Sample, Status, Verdict
from ..parts.ops import jit, sqrt
from .smac_ekf import ekf_step, input_acceleration
from .smac_health import evaluate_health, listen, loss_std, remaining, watch_commands
from .smac_isolator import HALT, TEST, TRACK, isolate, reset
from .smac_types import (
    AIRSPEED,
    ALPHA,
    AXES,
    BETA,
    CALM,
    FLAG,
    GAP,
    INDEX,
    MODE,
    READY,
    SIGNAL_UNITS,
    SIGNALS,
    WIND_AF,
    WIND_AS,
    WIND_BF,
    WIND_BS,
    WIND_POWER,
    Params,
    State,
    init,
)

NONFINITE, STALE, NOT_READY, OUTSIDE = (
    int(s) for s in (Status.NONFINITE, Status.STALE_INPUT, Status.NOT_READY, Status.OUT_OF_ENVELOPE)
)
HOLD_LEVEL = int(Request.HOLD_LEVEL)
RESIDUALS = ("roll rate", "pitch rate", "yaw rate", "gamma2")
FIRST = len(SIGNALS)


@jit
def _input_status(p: Params, z: Array, age: Array) -> int:
    """NONFINITE before STALE_INPUT before OK, over everything but the optional reset."""
    status = 0
    for j in range(len(z) - 1):
        if not math.isfinite(z[j]):
            return NONFINITE
        if age[j] > p.max_age[j]:
            status = STALE
    return status


@jit
def _start(p: Params, s: State, z: Array) -> None:
    """After a start or a gap: the filter begins at the measured rates, command filters at the commands."""
    for i in range(3):
        s.x[i] = z[i]
    s.P[:] = 0.0
    s.P[0], s.P[2], s.P[5] = 1.0, 1.0, 1.0
    for i in range(len(s.mean)):
        s.mean[i] = z[FIRST + i]
        s.trim[i] = z[FIRST + i]
        s.noise[i] = 0.0
    s.ring_c[:] = 0.0
    s.ring_s[:] = 0.0
    s.sums[:] = 0.0
    s.wind[WIND_AF], s.wind[WIND_AS] = z[ALPHA], z[ALPHA]
    s.wind[WIND_BF], s.wind[WIND_BS] = z[BETA], z[BETA]
    s.clock[READY] = 0
    s.clock[CALM] = 0


@jit
def _bad_sample(s: State) -> None:
    """Stop exciting; whatever is declared stays, a test begins anew."""
    s.clock[GAP] += 1
    for i in range(len(s.excitation)):
        s.excitation[i] = 0.0
        s.excited[i] = 0


@jit
def _wind_activity(p: Params, s: State, z: Array) -> float:
    """Mean square of the band-passed vanes beyond their own noise, rad2."""
    d = p.detector
    s.wind[WIND_AF] += d.a_fast * (z[ALPHA] - s.wind[WIND_AF])
    s.wind[WIND_AS] += d.a_slow * (z[ALPHA] - s.wind[WIND_AS])
    s.wind[WIND_BF] += d.a_fast * (z[BETA] - s.wind[WIND_BF])
    s.wind[WIND_BS] += d.a_slow * (z[BETA] - s.wind[WIND_BS])
    a = float(s.wind[WIND_AF] - s.wind[WIND_AS])
    b = float(s.wind[WIND_BF] - s.wind[WIND_BS])
    s.wind[WIND_POWER] += d.a_wind * (a * a + b * b - s.wind[WIND_POWER])
    return max(float(s.wind[WIND_POWER]) - d.wind_floor, 0.0)


@jit
def residuals(p: Params, s: State, z: Array, u: Array) -> None:
    """The residual generator: one step of the filter with the sum of command and excitation."""
    V = float(z[AIRSPEED])
    V = max(V, p.model.v_min)
    input_acceleration(p.model, 0.5 * p.model.rho * V * V, float(z[ALPHA]), float(z[BETA]), u, s.accel)
    ekf_step(p.model, s.x, s.P, z, V, s.accel, s.residual)


@jit
def detect(p: Params, s: State, gamma_thresh: float) -> None:
    """Section 3.2: LP1, (5), LP2, threshold with release; or each axis through LP1 and LP2 against its own threshold."""
    d = p.detector
    total, worst = 0.0, 0.0
    for i in range(3):
        low, axis = float(s.low[i]), float(s.axis[i])
        low += d.a1 * (float(s.residual[i]) - low)
        axis += d.a2 * (low - axis)
        s.low[i], s.axis[i] = low, axis
        total += abs(low)
        worst = max(worst, abs(axis) / float(d.axis[i]))
    g = float(s.gamma[0])
    g = worst if d.rule == AXES else g + d.a2 * (total - g)
    s.gamma[0] = g
    if s.clock[FLAG] > 0:
        s.clock[FLAG] = 1 if g > d.release * gamma_thresh else 0
    else:
        s.clock[FLAG] = 1 if g > gamma_thresh else 0


@jit
def _estimate(p: Params, s: State, z: Array) -> None:
    """delta - delta_c of the declared surfaces from (11), each from the residual of its own axis less the others'."""
    d = p.detector
    n = len(s.label)
    for i in range(3):
        s.slow[i] += d.a_estimate * (s.residual[i] - s.slow[i])
    for i in range(n):
        s.trim[i] += d.a_estimate * (z[FIRST + i] - s.trim[i])
        if s.label[i] == 0:
            s.delta[i] = 0.0
    for i in range(n):
        if s.label[i] > 0:
            axis = int(p.probe.axis[i])
            rest = s.slow[axis]
            for j in range(n):
                if j != i:
                    rest -= d.sensitivity[axis, j] * s.delta[j]
            s.delta[i] = rest / d.sensitivity[axis, i]


@jit
def _alone(p: Params, s: State, i: int) -> bool:
    """Whether no other declared surface shares the axis: two stuck twins leave one residual for two unknowns."""
    for j in range(len(s.label)):
        if j != i and s.label[j] > 0 and p.probe.axis[j] == p.probe.axis[i]:
            return False
    return True


@jit
def _say_surface(p: Params, s: State, i: int, ok: bool, out: Verdict, k: int) -> None:
    """The two hypotheses of surface i."""
    a, b = 1 + 2 * i, 2 + 2 * i
    label = s.label[i]
    out.active[k, a] = ok and label == 1
    out.active[k, b] = ok and label == 2
    heard = s.excited[i] > 0 and s.count[i] > 0
    left = remaining(p.probe, s, i) if heard else math.nan
    out.score[k, a] = s.lam[i] if heard else math.nan
    out.score[k, b] = 1.0 - left
    told = ok and label == 1 and _alone(p, s, i)
    out.estimate[k, a] = s.trim[i] + s.delta[i] if told else math.nan
    out.estimate_std[k, a] = p.detector.estimate_std[i] if told else math.nan
    told = ok and label == 2 and heard
    out.estimate[k, b] = 1.0 - left if told else math.nan
    out.estimate_std[k, b] = loss_std(p.probe, s, i) if told else math.nan


@jit
def _say(p: Params, s: State, status: int, gamma_thresh: float, scale: float, out: Verdict, k: int) -> None:
    """Row k of the verdict."""
    judging = status == 0 or status == OUTSIDE
    n = len(s.label)
    fault = s.clock[FLAG] > 0 and judging
    for i in range(n):
        _say_surface(p, s, i, judging, out, k)
        out.excitation[k, i] = s.excitation[i]
        fault = fault or (judging and s.label[i] > 0)
    out.detected[k] = fault
    out.active[k, 0] = status == 0 and not fault
    out.score[k, 0] = math.nan
    out.estimate[k, 0] = math.nan
    out.estimate_std[k, 0] = math.nan
    bad = status == NONFINITE or status == STALE
    for i in range(3):
        out.residual[k, i] = math.nan if bad else s.axis[i]
        out.threshold[k, i] = p.detector.axis[i] * scale
    out.residual[k, 3] = math.nan if bad else s.gamma[0]
    out.threshold[k, 3] = gamma_thresh
    mode = s.clock[MODE]
    out.request[k] = HOLD_LEVEL if judging and (mode == TEST or mode == TRACK) else 0
    out.status[k] = status


@jit
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: z = signals, commands (nu), excitations (nu), reset; row k of out."""
    p, s, d = params, state, params.detector
    n = len(s.label)
    if z[len(z) - 1] > 0.5:
        reset(s)
    status = _input_status(p, z, age)
    if status > 0:
        _bad_sample(s)
        _say(p, s, status, d.threshold, 1.0, out, k)
        return
    if s.clock[GAP] > 0 or s.clock[INDEX] == 0:
        _start(p, s, z)
        s.clock[GAP] = 0
    activity = _wind_activity(p, s, z)
    scale = sqrt(1.0 + d.wind_gain * d.wind_gain * activity)
    residuals(p, s, z, z[FIRST : FIRST + n] + z[FIRST + n : FIRST + 2 * n])
    watch_commands(p.probe, s, z, FIRST, n)
    s.clock[READY] += 1
    # The filter needs a moment after a start; the detector's filters begin behind it.
    ready = s.clock[READY] > p.timing.settle
    if 2 * s.clock[READY] > p.timing.settle:
        detect(p, s, d.threshold * scale)
        _estimate(p, s, z)
    if ready:
        if s.clock[CALM] > p.probe.window and s.clock[FLAG] == 0:
            listen(p.probe, s, d.a_wind)
        s.clock[CALM] += 1
        evaluate_health(p.probe, s, s.clock[MODE] == TRACK)
        isolate(p, s, z, scale)
    else:
        s.clock[FLAG] = 0
    s.clock[INDEX] += 1
    status = OUTSIDE if s.clock[MODE] == HALT else (0 if ready else NOT_READY)
    _say(p, s, status, d.threshold * scale, scale, out, k)


@jit
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row of z (n, nz)."""
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


def smac(params: Params, surfaces: tuple[str, ...], groups: tuple[str, ...], name: str = "smac") -> Diagnoser:
    """The diagnoser of these numbers; `design.smac.design_smac` makes them and `from_design` calls this.

    surfaces (nu,): in the order of every (nu,) array of params. groups (nu,): the group each belongs to ("aileron").
    """
    commands = tuple(f"command.{s}" for s in surfaces)
    excitations = tuple(f"excitation.{s}" for s in surfaces)
    rad = ("rad",) * len(surfaces)
    inputs = Channels(
        (*SIGNALS, *commands, *excitations, "event.reset"), (*SIGNAL_UNITS, *rad, *rad, "1"),
        tuple(float(a) for a in params.max_age), ("event.reset",),
    )  # fmt: skip
    hypotheses = [HEALTHY]
    for s, g in zip(surfaces, groups, strict=True):
        hypotheses += [Hypothesis(s, "stuck", "rad", g), Hypothesis(s, "loss_of_effectiveness", "1", g)]
    return Diagnoser(
        name, inputs, Channels(excitations, rad), tuple(hypotheses), params.model.dt, True, params, init, step_into,
        run_into, RESIDUALS, tuple(float(a) for a in params.budget.amplitude), params.timing.settle * params.model.dt,
    )  # fmt: skip


class Difference(NamedTuple):
    """Where a replay's own excitation differs from the recorded one: samples that differ, the first time, the largest
    difference in rad (NaN time and 0 where none does)."""

    samples: int
    first_s: float
    largest: float


def excitation_difference(d: Diagnoser, sample: Sample, verdict: Verdict) -> Difference:
    """Compare what a replay would have excited with what the flight really had, one sample later.

    A replay reads the recorded excitation, so its verdict stays meaningful; where the two differ, the isolator would
    have gone another way in flight.
    """
    nu = len(d.outputs.names)
    flown = sample.z[1:, FIRST + nu : FIRST + 2 * nu]
    gap = np.abs(flown - verdict.excitation[:-1]).max(axis=1, initial=0.0)
    at = np.flatnonzero(~(gap <= 1e-12))
    if not len(at):
        return Difference(0, math.nan, 0.0)
    return Difference(len(at), float(sample.t_s[1 + at[0]]), float(np.nanmax(gap)))
