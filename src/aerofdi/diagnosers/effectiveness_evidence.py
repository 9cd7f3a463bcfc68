"""Evidence of the `effectiveness` diagnoser: every hypothesis against the healthy family, sample by sample."""

from __future__ import annotations

import numpy as np

from ..core.types import Array
from ..parts.ops import clip, lean, log, maximum, merged, minimum, sqrt
from .effectiveness_types import (
    FRESH_AGE,
    FRESH_LEAD,
    INFO_TIME,
    LOSS,
    REACH,
    Params,
    State,
)


@merged
def _log_t(ratio: float, variance: float, dof: float) -> float:
    """Student-t log density of a normalised square `ratio`, without the constants all hypotheses share."""
    return -0.5 * log(variance) - 0.5 * (dof + 1.0) * log(1.0 + ratio / dof)


@merged
def _update(theta: float, var: float, h: float, e: float, r: float, dof: float) -> tuple[float, float]:
    """One robust scalar Kalman update: measurement e = h theta + noise of variance r, Student-t."""
    nu = e - h * theta
    s = h * h * var + r
    weight = (dof + 1.0) / (dof + nu * nu / s)
    gain = var * h / (h * h * var + r / minimum(weight, 1.0))
    return theta + gain * nu, maximum(var - gain * h * var, 1e-12)


@merged
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


@merged
def _mix(state: State, lls: Array, best: float, nn: int) -> float:
    total = 0.0
    for n in range(nn):
        total += state.nweight[n] * np.exp(lls[n] - best)
    for n in range(nn):
        w = state.nweight[n] * np.exp(lls[n] - best) / maximum(total, 1e-300)
        # A floor lets a member that was wrong for long come back at once.
        state.nweight[n] = 0.99 * w + 0.01 / nn
    return best + log(maximum(total, 1e-300))


@lean
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


@merged
def evidence(params: Params, state: State) -> float:
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
        # Never below zero, so that what spoke against a fault before it happened does not count after.
        state.evidence[n] = maximum((1.0 - leak) * state.evidence[n] + gain, 0.0)
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


@merged
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


@merged
def correlation(state: State, n: int, k: int) -> float:
    """Correlation of the signatures two hypotheses predict; near one they cannot be told apart."""
    size = state.cross[n, n] * state.cross[k, k]
    return state.cross[n, k] / sqrt(size) if size > 1e-12 else 0.0


@merged
def fresh(params: Params, state: State, z: Array, base: float) -> bool:
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
