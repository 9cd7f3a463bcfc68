"""Effectiveness: which surface lost its grip or stands still, by competing hypotheses over an identified aircraft.

One Kalman filter per angular rate (`parts.rate_filter`) turns flight into white innovations e while the aircraft is
healthy. A fault adds a moment, and the same filter turns that moment into a known signature of the innovation:

    loss of group j, remaining gain 1 - theta:   e = theta  L_j          L_j : response to  -b_j delta_j V^2
    stuck group j at theta (share f of it):      e = f (L_j + theta P_j)  P_j : response to   b_j V^2
    healthy family (each with its own prior):    e = 0;  e = theta L_j, |theta| small (model gain error);
                                                 e = theta A, airspeed off by theta: moments 2 theta, damping theta

Each hypothesis holds one free number theta as a slowly varying Kalman state: never all free at once, neutral and trim
moment stay as identified. Its score is a cumulative sum of log-likelihood over the healthy family, restarted from
the prior whenever it falls to zero, so the number of samples before the fault does not matter. Likelihoods are
Student-t, because gusts are.

Not modelled: two faults at once, faults of throttle, a fault present throughout training.
Source: generalised likelihood ratio for jumps (Willsky and Jones) with a Bayesian prior on the jump.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..core.types import Array, Diagnoser, Status, Verdict
from ..parts.delay_line import delay_fill, delay_step
from ..parts.ops import clip, jit, log, maximum, minimum, sqrt
from ..parts.rate_filter import rate_filter_step

LOSS, STUCK = 0, 1
# A healthy aircraft differs from its model by at most this many of the stated standard deviations.
REACH = 1.5
OK, NOT_READY = int(Status.OK), int(Status.NOT_READY)
STALE, NONFINITE = int(Status.STALE_INPUT), int(Status.NONFINITE)
OUTSIDE = int(Status.OUT_OF_ENVELOPE)


class Params(NamedTuple):
    """na axes, ng groups, nc command channels, nh hypotheses without the healthy one, nn nuisances (healthy family).

    Filter: ad (na, 3, 3), bd (na, 3), k (na, 3), s (na,). Model: a (na,), couple (na, n_rates), b (na, ng),
    air (na, n_air), m (na,). Layout: rate, command, air_at: columns of z; speed_at: column or -1; weights (ng, nc).
    Hypotheses: kind, group, share, mean, spread, memory, low, high (nh,). Nuisance spreads (nn,).
    """

    ad: Array
    bd: Array
    k: Array
    s: Array
    a: Array
    couple: Array
    b: Array
    air: Array
    m: Array
    rate_at: Any
    couple_at: Any
    command_at: Any
    air_at: Any
    speed_at: int
    weights: Array
    lower: Array
    upper: Array
    v0: float
    speed_pole: float
    lag_pole: float
    delay: float
    max_age: Array
    kind: Any
    group: Any
    share: Array
    mean: Array
    spread: Array
    memory: Array
    low: Array
    high: Array
    gain_std: Array
    nuisance_spread: Array
    nuisance_memory: float
    alarm: float
    cap: float
    clear: float
    margin: float
    temper: float
    dof: float
    dt: float
    settle: float
    fresh_s: float
    evidence_memory: float
    limit_at: Any
    limit_low: Array
    limit_high: Array


class State(NamedTuple):
    """x: filters of the rates, y: the fresh ones of the recovery test; xl, xp, xm: of the signatures. theta, var: hypotheses; ntheta, nvar, nweight: healthy
    family. score, evidence, cross, pattern: decision. rough, inflation: noise of rougher air. information: per group.
    scalars: airspeed ratio, s since the last gap, detected, isolated hypothesis (0 none), s of information, gap samples.
    """

    x: Array
    y: Array
    xl: Array
    xp: Array
    xm: Array
    innovation: Array
    lag: Array
    held: Array
    line: Array
    theta: Array
    var: Array
    ntheta: Array
    nvar: Array
    nweight: Array
    score: Array
    evidence: Array
    cross: Array
    pattern: Array
    rough: Array
    inflation: Array
    lls: Array
    slow: Array
    scalars: Array
    information: Array


SPEED, CLOCK, DETECTED, ACTIVE, INFO_TIME, GAP, FRESH_AGE, FRESH_LEAD, SLIGHT = range(9)


def init(params: Params) -> State:
    """Everything at rest, every hypothesis at its prior."""
    na, ng = params.b.shape
    nh, nn = len(params.kind), len(params.nuisance_spread)
    return State(
        x=np.zeros((na, 3)),
        y=np.zeros((na, 3)),
        xl=np.zeros((ng, na, 3)),
        xp=np.zeros((ng, na, 3)),
        xm=np.zeros((na, 3)),
        innovation=np.zeros(na),
        held=np.zeros(ng),
        lag=np.zeros(ng),
        line=np.zeros((ng, int(params.delay) + 4)),
        theta=params.mean.copy(),
        var=params.spread**2,
        ntheta=np.zeros(nn),
        nvar=params.nuisance_spread**2,
        nweight=np.full(nn, 1.0 / nn),
        score=np.zeros(nh),
        evidence=np.zeros(nh),
        cross=np.zeros((nh, nh)),
        pattern=np.zeros((nh, na)),
        rough=np.ones(na),
        inflation=np.ones(na),
        lls=np.zeros(nn),
        slow=np.zeros(len(params.limit_at)),
        scalars=np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, params.fresh_s, 0.0, 0.0]),
        information=np.zeros(ng),
    )


@jit
def input_status(params: Params, z: Array, age: Array) -> int:
    """NONFINITE, STALE or OK for one sample."""
    status = OK
    for j in range(len(params.max_age)):
        if not np.isfinite(z[j]):
            return NONFINITE
        if not age[j] <= params.max_age[j]:
            status = STALE
    return status


@jit
def _deflection(params: Params, z: Array, j: int) -> float:
    """The command of group j: its channels with their weights, held within the stops."""
    delta = 0.0
    for c in range(params.weights.shape[1]):
        delta += params.weights[j, c] * z[params.command_at[c]]
    return clip(delta, params.lower[j], params.upper[j])


@jit
def _restart(params: Params, state: State, z: Array) -> None:
    """After a start or a gap: filters at the measured rates, signatures at rest, commands as if always so."""
    na, ng = params.b.shape
    for i in range(na):
        state.x[i, 0] = z[params.rate_at[i]]
        state.x[i, 1] = 0.0
        state.xm[i, 0] = 0.0
        for j in range(ng):
            state.xl[j, i, 0] = 0.0
            state.xp[j, i, 0] = 0.0
    for j in range(ng):
        delta = _deflection(params, z, j)
        state.lag[j] = delta
        delay_fill(state.line[j], delta)
    if params.speed_at >= 0:
        state.scalars[SPEED] = z[params.speed_at] / params.v0
    for j in range(len(params.limit_at)):
        state.slow[j] = z[params.limit_at[j]]
    state.scalars[GAP] = 0.0
    state.scalars[CLOCK] = 0.0


@jit
def _advance(params: Params, state: State, z: Array) -> None:
    """Move every filter one step with this sample; the innovations were used before."""
    na, ng = params.b.shape
    if params.speed_at >= 0:
        now = z[params.speed_at] / params.v0
        state.scalars[SPEED] += (1.0 - params.speed_pole) * (now - state.scalars[SPEED])
    v = state.scalars[SPEED]
    for j in range(ng):
        state.lag[j] += (1.0 - params.lag_pole) * (_deflection(params, z, j) - state.lag[j])
        state.held[j] = delay_step(state.line[j], state.lag[j], params.delay)
    for i in range(na):
        ad, bd, k = params.ad[i], params.bd[i], params.k[i]
        w = z[params.rate_at[i]]
        damping = params.a[i] * w
        for j in range(params.couple.shape[1]):
            damping += params.couple[i, j] * z[params.couple_at[j]]
        moment = params.m[i]
        for j in range(params.air.shape[1]):
            moment += params.air[i, j] * z[params.air_at[j]]
        for j in range(ng):
            push = v * v * params.b[i, j]
            moment += params.b[i, j] * state.held[j]
            rate_filter_step(ad, bd, k, state.xl[j, i], -push * state.held[j], -state.xl[j, i, 0])
            rate_filter_step(ad, bd, k, state.xp[j, i], push, -state.xp[j, i, 0])
        # What one per cent more airspeed than measured or assumed would add, in per cent.
        faster = 2.0 * v * v * moment + v * damping
        rate_filter_step(ad, bd, k, state.xm[i], faster, -state.xm[i, 0])
        known = v * damping - params.a[i] * w + v * v * moment
        rate_filter_step(ad, bd, k, state.x[i], known, w - state.x[i, 0])
        rate_filter_step(ad, bd, k, state.y[i], known, w - state.y[i, 0])


@jit
def _log_t(ratio: float, variance: float, dof: float) -> float:
    """Student-t log density of a normalised square `ratio`, without the constants all hypotheses share."""
    return -0.5 * log(variance) - 0.5 * (dof + 1.0) * log(1.0 + ratio / dof)


@jit
def _update(theta: float, var: float, h: float, e: float, r: float, dof: float) -> tuple[float, float]:
    """One robust scalar Kalman update: measurement e = h theta + noise of variance r, Student-t."""
    nu = e - h * theta
    s = h * h * var + r
    weight = (dof + 1.0) / (dof + nu * nu / s)
    gain = var * h / (h * h * var + r / minimum(weight, 1.0))
    return theta + gain * nu, maximum(var - gain * h * var, 1e-12)


@jit
def _healthy(params: Params, state: State) -> float:
    """Log likelihood of this sample under the healthy family; its members are updated and re-weighted."""
    na, ng = params.b.shape
    nn = len(params.nuisance_spread)
    pull = params.dt / params.nuisance_memory
    best = -1e300
    lls = state.lls
    for n in range(nn):
        spread = params.nuisance_spread[n]
        theta = state.ntheta[n] * (1.0 - pull)
        var = minimum(state.nvar[n] + 2.0 * pull * (spread * spread - state.nvar[n]), spread * spread)
        ll = 0.0
        for i in range(na):
            h = 0.0
            if 0 < n <= ng:
                h = state.xl[n - 1, i, 0]
            elif n > ng:
                h = state.xm[i, 0]
            e = state.innovation[i]
            r = params.s[i] * state.inflation[i]
            s = h * h * var + r
            nu = e - h * theta
            ll += _log_t(nu * nu / s, s, params.dof)
            theta, var = _update(theta, var, h, e, r, params.dof)
        state.ntheta[n] = clip(theta, -REACH * spread, REACH * spread)
        state.nvar[n] = var
        lls[n] = ll
        best = maximum(best, ll)
    return _mix(state, lls, best, nn)


@jit
def _mix(state: State, lls: Array, best: float, nn: int) -> float:
    total = 0.0
    for n in range(nn):
        total += state.nweight[n] * np.exp(lls[n] - best)
    for n in range(nn):
        w = state.nweight[n] * np.exp(lls[n] - best) / maximum(total, 1e-300)
        # A floor lets a member that was wrong for long come back at once.
        state.nweight[n] = 0.99 * w + 0.01 / nn
    return best + log(maximum(total, 1e-300))


@jit
def _hypothesis(params: Params, state: State, n: int) -> float:
    """Log likelihood of this sample under hypothesis n; theta and its variance are updated."""
    na = params.b.shape[0]
    j, f = params.group[n], params.share[n]
    pull = params.dt / params.memory[n]
    prior = params.spread[n] * params.spread[n]
    theta = state.theta[n] + pull * (params.mean[n] - state.theta[n])
    var = minimum(state.var[n] + 2.0 * pull * (prior - state.var[n]), prior)
    held = clip(theta, params.low[n], params.high[n])
    ll = 0.0
    for i in range(na):
        if params.kind[n] == LOSS:
            h, offset = state.xl[j, i, 0], 0.0
        else:
            h, offset = f * state.xp[j, i, 0], f * state.xl[j, i, 0]
        e = state.innovation[i] - offset
        r = params.s[i] * state.inflation[i]
        s = h * h * var + r
        nu = e - h * held
        ll += _log_t(nu * nu / s, s, params.dof)
        state.pattern[n, i] = (h * held + offset) / sqrt(r)
        theta, var = _update(theta, var, h, e, r, params.dof)
        held = clip(theta, params.low[n], params.high[n])
    state.theta[n] = theta
    state.var[n] = var
    return ll


@jit
def _evidence(params: Params, state: State) -> float:
    """Scores (cumulative, for detection), evidence (leaky, for isolation), pattern products, noise inflation.

    Returns the log likelihood of the hypothesis that leads.
    """
    na, nh = params.b.shape[0], len(params.kind)
    base = _healthy(params, state)
    leak = params.dt / params.evidence_memory
    lead, leader = base, -1.0
    for n in range(nh):
        ll = _hypothesis(params, state, n)
        if state.score[n] > leader:
            lead, leader = ll, state.score[n]
        gain = params.temper * (ll - base)
        state.score[n] = clip(state.score[n] + gain, 0.0, params.cap)
        state.evidence[n] += gain - leak * state.evidence[n]
        if state.score[n] <= 0.0:
            state.theta[n] = params.mean[n]
            state.var[n] = params.spread[n] * params.spread[n]
    for n in range(nh):
        for k in range(n + 1):
            product = 0.0
            for i in range(na):
                product += state.pattern[n, i] * state.pattern[k, i]
            state.cross[n, k] += leak * (product - state.cross[n, k])
            state.cross[k, n] = state.cross[n, k]
    _inflate(params, state)
    for j in range(params.b.shape[1]):
        for i in range(na):
            h = state.xl[j, i, 0]
            state.information[j] += params.temper * h * h / (params.s[i] * state.inflation[i])
    state.scalars[INFO_TIME] += params.dt
    return lead


@jit
def _inflate(params: Params, state: State) -> None:
    """Rougher air than in training raises the noise: the slow mean square of what the best explanation leaves."""
    best = 0
    for n in range(1, len(params.kind)):
        if state.evidence[n] > state.evidence[best]:
            best = n
    leak = params.dt / 10.0
    for i in range(params.b.shape[0]):
        healthy = state.innovation[i]
        faulty = healthy - state.pattern[best, i] * sqrt(params.s[i] * state.inflation[i])
        square = minimum(minimum(healthy * healthy, faulty * faulty) / params.s[i], 16.0)
        state.rough[i] += leak * (square - state.rough[i])
        state.inflation[i] = maximum(1.0, state.rough[i])


@jit
def _correlation(state: State, n: int, k: int) -> float:
    """Correlation of the signatures two hypotheses predict; near one they cannot be told apart."""
    size = state.cross[n, n] * state.cross[k, k]
    return state.cross[n, k] / sqrt(size) if size > 1e-12 else 0.0


@jit
def _fresh(params: Params, state: State, z: Array, base: float) -> bool:
    """Recovery test: does a healthy filter started anew explain flight better than the standing alarm?

    The filter in use has learnt the fault's moment as trim and would need a minute to unlearn it. Every `fresh_s` a
    copy without that memory starts; after its own settling it is compared with the best hypothesis.
    """
    age = state.scalars[FRESH_AGE]
    if age >= params.fresh_s:
        better = state.scalars[FRESH_LEAD] > params.margin
        state.scalars[FRESH_AGE] = 0.0
        state.scalars[FRESH_LEAD] = 0.0
        for i in range(params.b.shape[0]):
            state.y[i, 0] = z[params.rate_at[i]]
            state.y[i, 1] = 0.0
            state.y[i, 2] = 0.0
        return better
    if age >= params.settle:
        healthy = 0.0
        for i in range(params.b.shape[0]):
            r = params.s[i] * state.inflation[i]
            e = z[params.rate_at[i]] - state.y[i, 0]
            healthy += _log_t(e * e / r, r, params.dof)
        state.scalars[FRESH_LEAD] += params.temper * (healthy - base)
    state.scalars[FRESH_AGE] = age + params.dt
    return False


@jit
def _leader(params: Params, state: State) -> int:
    """The hypothesis with most evidence; the one in charge stays until another leads it by the margin."""
    best = int(state.scalars[ACTIVE]) - 1
    for n in range(len(params.kind)):
        lead = 2.0 * params.margin if best == int(state.scalars[ACTIVE]) - 1 and best >= 0 else 0.0
        if best < 0 or state.evidence[n] > state.evidence[best] + lead:
            best = n
    if params.kind[best] == LOSS and 1.0 - state.theta[best] < 1.5 * sqrt(state.var[best]):
        # Nothing is left of the gain: a surface that answers nothing is stuck, unless its evidence says otherwise.
        for n in range(len(params.kind)):
            near = state.evidence[n] > state.evidence[best] - params.margin
            if (
                near
                and params.group[n] == params.group[best]
                and params.kind[n] == STUCK
                and params.share[n] == 1.0
            ):
                return n
    return best


@jit
def _isolated(params: Params, state: State, best: int) -> bool:
    """Whether `best` stands alone against every other group: a clear lead, and a signature of its own."""
    if state.score[best] < 0.5 * params.alarm:
        return False
    mine = params.group[best]
    stands = state.scalars[ACTIVE] > 0.0 and params.group[int(state.scalars[ACTIVE]) - 1] == mine
    needed = 0.0 if stands else params.margin
    for n in range(len(params.kind)):
        if params.group[n] == mine:
            continue
        if state.evidence[best] - state.evidence[n] < needed:
            return False
        if _correlation(state, best, n) > 0.9 and state.evidence[n] > 0.9 * state.evidence[best]:
            return False
    return True


@jit
def _slight(params: Params, state: State, best: int) -> bool:
    """Whether the leading hypothesis is a loss too small to be told from model error."""
    small = params.nuisance_spread[1 + params.group[best]] + sqrt(state.var[best])
    return params.kind[best] == LOSS and state.theta[best] < small


@jit
def _decide(params: Params, state: State, recovered: bool) -> None:
    """Alarm at `alarm`; silence below `clear`, on recovery, or while only a slight loss is left."""
    top = 0.0
    for n in range(len(params.kind)):
        top = maximum(top, state.score[n])
    if top >= params.alarm:
        state.scalars[DETECTED] = 1.0
    elif top <= params.clear:
        state.scalars[DETECTED] = 0.0
    best = _leader(params, state)
    slight = _slight(params, state, best)
    state.scalars[SLIGHT] = state.scalars[SLIGHT] + params.dt if slight else 0.0
    if state.scalars[DETECTED] > 0.0 and (recovered or state.scalars[SLIGHT] > params.fresh_s):
        _recover(params, state)
    alone = state.scalars[DETECTED] > 0.0 and _isolated(params, state, best)
    state.scalars[ACTIVE] = float(best + 1) if alone else 0.0


@jit
def _recover(params: Params, state: State) -> None:
    """Take the fresh filter over, forget the fault: signatures at rest, hypotheses at their priors."""
    state.scalars[DETECTED] = 0.0
    state.x[:, :] = state.y
    state.xl[:, :, :] = 0.0
    state.xp[:, :, :] = 0.0
    state.xm[:, :] = 0.0
    state.score[:] = 0.0
    state.evidence[:] = 0.0
    state.theta[:] = params.mean
    state.var[:] = params.spread * params.spread
    state.ntheta[:] = 0.0
    state.rough[:] = 1.0
    state.scalars[SLIGHT] = 0.0
    state.scalars[FRESH_AGE] = params.fresh_s


@jit
def _write(params: Params, state: State, out: Verdict, k: int, status: int) -> None:
    na, nh = params.b.shape[0], len(params.kind)
    detected = state.scalars[DETECTED] > 0.0
    out.status[k] = status
    out.detected[k] = detected
    out.active[k, 0] = status == OK and not detected
    out.score[k, 0] = 0.0
    for n in range(nh):
        out.active[k, n + 1] = detected and state.scalars[ACTIVE] == n + 1
        out.score[k, n + 1] = state.score[n]
        if state.score[n] > params.clear:
            left = 1.0 - state.theta[n] if params.kind[n] == LOSS else state.theta[n]
            spread = params.gain_std[n] * (state.theta[n] if params.kind[n] == LOSS else params.spread[n])
            out.estimate[k, n + 1] = left
            out.estimate_std[k, n + 1] = sqrt(state.var[n] + spread * spread)
    for i in range(na):
        out.residual[k, i] = state.innovation[i] / sqrt(params.s[i])
        out.threshold[k, i] = 3.0 * sqrt(state.inflation[i])


@jit
def _outside(params: Params, state: State, z: Array) -> bool:
    """Whether a condition the model depends on (its speed) has left, over the last second, what training held."""
    outside = False
    for j in range(len(params.limit_at)):
        now = z[params.limit_at[j]]
        state.slow[j] += (1.0 - params.speed_pole) * (now - state.slow[j])
        if not params.limit_low[j] <= state.slow[j] <= params.limit_high[j]:
            outside = True
    return outside


@jit
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: innovations, hypotheses, decision, prediction. Bad data freeze everything and give a status."""
    status = input_status(params, z, age)
    if status != OK:
        state.scalars[GAP] += 1.0
        _write(params, state, out, k, status)
        return
    if state.scalars[GAP] > 0.0:
        _restart(params, state, z)
    for i in range(params.b.shape[0]):
        state.innovation[i] = z[params.rate_at[i]] - state.x[i, 0]
    state.scalars[CLOCK] += params.dt
    if state.scalars[CLOCK] < params.settle:
        status = NOT_READY
    elif _outside(params, state, z):
        status = OUTSIDE
    else:
        lead = _evidence(params, state)
        _decide(params, state, _fresh(params, state, z, lead))
    _write(params, state, out, k, status)
    _advance(params, state, z)


@jit
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row in order."""
    for k in range(z.shape[0]):
        step_into(params, state, z[k], age[k], out, k)
