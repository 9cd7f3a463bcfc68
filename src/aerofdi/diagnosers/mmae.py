"""Multiple-model adaptive estimation: one Kalman filter per "this surface is stuck", the best filter names
the fault.

Symbols (paper "vireo_comparison", section 3.3): x^_i state estimate of model i, x-_i its prediction, L_i
steady-state gain, r_i innovation, P^_i innovation covariance, p_i probability, RES_i = e_i' W e_i with e_i
the residuals after a low pass. Model 0 is healthy; model i holds the position of one surface as a slowly
wandering state.

    x-_i(k) = A_i x^_i(k-1) + B_i u(k-1),   r_i = y(k) - C_i x-_i(k),   x^_i = x-_i + L_i r_i          (12)
    rule PAPER     log p_i -= gain RES_i, only where at least `quorum` of the RES exceed `threshold`   (13),
    (14) rule TEXTBOOK  log p_i += -1/2 r_i' P^_i^-1 r_i - 1/2 log det P^_i, at every sample
    (4)-(7)

u is the output of the discrete actuator models, y the measured signals, delayed in the model by a chain of
states. (5) is printed without the 1/2 its Gaussian density needs; it stands here.

Probabilities live as logarithms and never fall below `floor`, so that any model can always come back: from
the floor to one half takes a bounded sum of evidence, however long the healthy flight before the fault was.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core import HEALTHY, Array, Channels, Design, Diagnoser, Hypothesis, Verdict
from ..parts.bessel import sections_step
from ..parts.delay_line import delay_fill, delay_line, delay_step
from ..parts.ops import exp, jit, log
from ..parts.servo import servo_step

PAPER, TEXTBOOK = 0, 1
LOW_PASS_ORDER = 5
SEEN, GAP, PLACE = range(3)


class Params(NamedTuple):
    """N models of n states (shorter ones padded with zeros), ns signals, nu commands, nl low-pass states.

    A (N, n, n), B (N, n, nu), H (N, ns, n): signals predicted from the states. L (N, n, ns): Kalman gain,
    zero in columns of signals that are compared but not measured. measured (ns,): 1 or 0. weight (ns,):
    diagonal of W. S_inv (N, ns, ns), log_beta (N,): inverse and -1/2 log det of the innovation covariance.
    start (n, ns): states from the first sample. stuck (N,): index of the stuck command, -1 for healthy. std
    (N,): of the stuck position, rad. trim (nu,): deflections the model is about, rad. servo (nu, 8): see
    `parts.servo`. low (nl, 5): sections of the low pass of the residuals, see `parts.bessel`. prior (N,):
    log. settings: by the indices GAIN ... below. max_age (nz,) s.
    """

    A: Array
    B: Array
    H: Array
    L: Array
    measured: Array
    weight: Array
    S_inv: Array
    log_beta: Array
    start: Array
    stuck: Array
    std: Array
    trim: Array
    servo: Array
    low: Array
    prior: Array
    settings: Array
    max_age: Array


GAIN, THRESHOLD, QUORUM, FLOOR, RULE, COMPARE_DELAY, SETTLE, MAX_GAP, VALID, COMMAND_DELAY = range(10)


class State(NamedTuple):
    """x (N, n). servo (nu, 2): position, speed. line (nu, w): delayed commands. ring (N, D + 1, ns):
    predictions of the last samples. low (N, ns, nl, 2). log_p (N,). clock (3,): samples since the last start,
    bad samples in a row, place in the ring.
    """

    x: Array
    servo: Array
    line: Array
    ring: Array
    low: Array
    log_p: Array
    clock: Array


def init(params: Params) -> State:
    """Nothing seen yet, probabilities at their prior."""
    models, n, nu = params.B.shape
    ns, nl = len(params.weight), len(params.low)
    ring = np.zeros((models, int(params.settings[COMPARE_DELAY]) + 1, ns))
    line = np.stack([delay_line(float(params.settings[COMMAND_DELAY])) for _ in range(nu)])
    return State(
        np.zeros((models, n)), np.zeros((nu, 2)), line, ring, np.zeros((models, ns, nl, 2)), params.prior.copy(),
        np.zeros(3, dtype=np.int64),
    )  # fmt: skip


@jit
def _input_status(params: Params, z: Array, age: Array) -> int:
    """NONFINITE before STALE_INPUT before OK, over the signals and commands (not the optional reset)."""
    status = 0
    for j in range(len(z) - 1):
        if not np.isfinite(z[j]):
            return 3
        if age[j] > params.max_age[j]:
            status = 2
    return status


@jit
def _start(params: Params, state: State, z: Array) -> None:
    """Place states, actuators and delayed predictions where the first sample says they are."""
    models, n, nu = params.B.shape
    ns = len(params.weight)
    for a in range(nu):
        delay_fill(state.line[a], z[ns + a])
        state.servo[a, 0] = z[ns + a]
        state.servo[a, 1] = 0.0
    for i in range(models):
        for s in range(n):
            x = 0.0
            for j in range(ns):
                x += params.start[s, j] * z[j]
            state.x[i, s] = x
        if params.stuck[i] >= 0:
            a = int(params.stuck[i])
            state.x[i, n - 1] = z[ns + a] - params.trim[a]
        for j in range(ns):
            for d in range(state.ring.shape[1]):
                state.ring[i, d, j] = z[j]
            state.low[i, j, :, :] = 0.0
    state.clock[SEEN] = 0
    state.clock[PLACE] = 0


@jit
def _predict(params: Params, state: State, i: int, x: Array) -> None:
    """x <- A_i x^_i + B_i u with u the actuator positions of the last sample."""
    n, nu = params.B.shape[1], params.B.shape[2]
    for s in range(n):
        total = 0.0
        for j in range(n):
            total += params.A[i, s, j] * state.x[i, j]
        for a in range(nu):
            total += params.B[i, s, a] * (state.servo[a, 0] - params.trim[a])
        x[s] = total


@jit
def _residuals(params: Params, state: State, i: int, z: Array, x: Array, e: Array) -> None:
    """e <- signals minus predictions; a signal that is only compared uses the prediction of D samples ago."""
    n, ns = len(x), len(e)
    depth = state.ring.shape[1]
    now = state.clock[PLACE] % depth
    then = (state.clock[PLACE] + 1) % depth
    for j in range(ns):
        prediction = 0.0
        for s in range(n):
            prediction += params.H[i, j, s] * x[s]
        state.ring[i, now, j] = prediction
        e[j] = z[j] - (prediction if params.measured[j] > 0.5 else state.ring[i, then, j])


@jit
def _weighed(params: Params, state: State, i: int, e: Array) -> float:
    """RES_i = e' W e of the low-passed residuals (13)."""
    total = 0.0
    for j in range(len(e)):
        if params.weight[j] > 0.0:
            y = sections_step(params.low, state.low[i, j], e[j])
            total += params.weight[j] * y * y
    return total


@jit
def _mahalanobis(params: Params, i: int, e: Array) -> float:
    """1/2 r' P^_i^-1 r over the measured signals (5)."""
    total = 0.0
    for j in range(len(e)):
        for s in range(len(e)):
            total += 0.5 * e[j] * params.S_inv[i, j, s] * e[s]
    return total


@jit
def _normalise(log_p: Array, floor: float) -> None:
    """Sum to one, then none below the floor."""
    top = np.max(log_p)
    total = 0.0
    for i in range(len(log_p)):
        total += exp(log_p[i] - top)
    shift = top + log(total)
    for i in range(len(log_p)):
        log_p[i] = max(log_p[i] - shift, floor)


@jit
def _update(params: Params, state: State, evidence: Array) -> None:
    """Probabilities from this sample's evidence: (14) or (4)."""
    c = params.settings
    if int(c[RULE]) == TEXTBOOK:
        for i in range(len(evidence)):
            state.log_p[i] += params.log_beta[i] - evidence[i]
        _normalise(state.log_p, c[FLOOR])
        return
    above = 0
    for i in range(len(evidence)):
        above += 1 if abs(evidence[i]) > c[THRESHOLD] else 0
    if above >= int(c[QUORUM]):
        for i in range(len(evidence)):
            state.log_p[i] -= c[GAIN] * evidence[i]
        _normalise(state.log_p, c[FLOOR])


@jit
def _say(params: Params, state: State, status: int, evidence: Array, out: Verdict, k: int) -> None:
    """Row k of the verdict. Model i is valid where p_i > 1/2; detected where the healthy one is not."""
    n = params.B.shape[1]
    top = np.max(state.log_p)
    total = 0.0
    for i in range(len(evidence)):
        total += exp(state.log_p[i] - top)
    out.status[k] = status
    out.detected[k] = status == 0 and exp(state.log_p[0] - top) / total < params.settings[VALID]
    for i in range(len(evidence)):
        p = exp(state.log_p[i] - top) / total
        out.score[k, i] = p
        out.active[k, i] = status == 0 and p > params.settings[VALID]
        out.residual[k, i] = evidence[i] if status == 0 or status == 1 else np.nan
        out.threshold[k, i] = params.settings[THRESHOLD] if int(params.settings[RULE]) == PAPER else np.nan
        if params.stuck[i] >= 0 and status == 0:
            out.estimate[k, i] = state.x[i, n - 1] + params.trim[int(params.stuck[i])]
            out.estimate_std[k, i] = params.std[i]
        else:
            out.estimate[k, i] = np.nan
            out.estimate_std[k, i] = np.nan
    out.request[k] = 0


@jit
def _advance(params: Params, state: State, z: Array, evidence: Array) -> None:
    """One good sample through all filters; evidence <- RES_i or 1/2 r' P^-1 r."""
    models, n, nu = params.B.shape
    ns = len(params.weight)
    x, e = np.empty(n), np.empty(ns)
    textbook = int(params.settings[RULE]) == TEXTBOOK
    for i in range(models):
        _predict(params, state, i, x)
        _residuals(params, state, i, z, x, e)
        evidence[i] = _mahalanobis(params, i, e) if textbook else _weighed(params, state, i, e)
        for s in range(n):
            for j in range(ns):
                x[s] += params.L[i, s, j] * e[j] * params.measured[j]
            state.x[i, s] = x[s]
    state.clock[PLACE] += 1
    for a in range(nu):
        u = delay_step(state.line[a], z[ns + a], params.settings[COMMAND_DELAY])
        state.servo[a, 0], state.servo[a, 1] = servo_step(
            params.servo[a], state.servo[a, 0], state.servo[a, 1], u
        )


@jit
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: z = signals (ns), commands (nu), then the optional reset.

    A bad sample changes nothing but the Status. After more than MAX_GAP bad ones the filters start again from
    the next good sample, are NOT_READY for SETTLE samples, and the probabilities stay as they were.
    """
    models = len(params.prior)
    evidence = np.full(models, np.nan)
    if z[len(z) - 1] > 0.5:
        state.log_p[:] = params.prior
    status = _input_status(params, z, age)
    if status > 0:
        state.clock[GAP] += 1
        _say(params, state, status, evidence, out, k)
        return
    if state.clock[SEEN] == 0 or state.clock[GAP] > params.settings[MAX_GAP]:
        _start(params, state, z)
    state.clock[GAP] = 0
    _advance(params, state, z, evidence)
    state.clock[SEEN] += 1
    ready = state.clock[SEEN] > params.settings[SETTLE]
    if ready:
        _update(params, state, evidence)
    _say(params, state, 0 if ready else 1, evidence, out, k)


@jit
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row of z (n, nz)."""
    for k in range(len(z)):
        step_into(params, state, z[k], age[k], out, k)


def from_design(design: Design, name: str = "mmae") -> Diagnoser:
    """The online estimator of a Design made by `design.mmae.design_mmae`.

    Inputs: the signals (rad or rad/s), `command.<surface>` (rad) and, optional, `event.reset` (above one
    half: back to the prior probabilities). Hypotheses: healthy, then one surface stuck each, estimate in rad
    about neutral. Residuals: RES_i of (13), or 1/2 r' P^-1 r for the textbook rule.

    Guarantee: any model at the floor returns to one half after at most log(1/floor) more evidence than the
    others have, whatever happened before. Not modelled: two faults at once, partly effective surfaces, other
    modes.

    Source: paper "vireo_comparison", section 3.3.
    """
    spec, p = design.spec, design.params
    surfaces, suspects, dt_s = spec["surfaces"], spec["suspects"], float(spec["dt_s"])
    age = np.array([spec["max_age_s"]] * (len(spec["signals"]) + len(surfaces)) + [math.inf])
    arrays = {k: np.ascontiguousarray(p[k], dtype=float) for k in Params._fields if k != "max_age"}
    params = Params(**arrays, max_age=age)
    commands = tuple(f"command.{s}" for s in surfaces)
    reset = "event.reset"
    units = tuple(spec["units"]) + ("rad",) * len(commands) + ("1",)
    channels = Channels((*spec["signals"], *commands, reset), units, tuple(float(a) for a in age), (reset,))
    stuck = tuple(Hypothesis(s, "stuck", "rad", spec["group"]) for s in suspects)
    hypotheses = (HEALTHY, *stuck)
    settle = float(p["settings"][SETTLE]) * dt_s
    names = tuple(f"RES {h.fault}" if h.mode == "stuck" else "RES healthy" for h in hypotheses)
    return Diagnoser(
        name,
        channels,
        Channels((), ()),
        hypotheses,
        dt_s,
        False,
        params,
        init,
        step_into,
        run_into,
        names,
        (),
        settle,
    )


def state_count(design: Design) -> dict[str, int]:
    """States that must be carried from sample to sample: of each filter, of the actuator models, of the low
    passes.
    """
    p = design.params
    n, stuck = p["B"].shape[1], p["stuck"]
    filters = int(np.sum(np.where(stuck >= 0, n, n - 1)))
    servos = 2 * p["B"].shape[2]
    low = len(stuck) * int(np.sum(p["weight"] > 0)) * LOW_PASS_ORDER
    return {"filters": filters, "actuators": servos, "low_passes": low, "total": filters + servos}
