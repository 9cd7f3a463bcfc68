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

from ..core.types import Array, Verdict
from ..parts.ops import lean, maximum, merged, sqrt
from .effectiveness_evidence import correlation, evidence, fresh
from .effectiveness_filters import advance, input_status, outside, rates_are_new, restart
from .effectiveness_types import (
    ACTIVE,
    CLOCK,
    DETECTED,
    FRESH_AGE,
    GAP,
    LOSS,
    NOT_READY,
    OK,
    OUTSIDE,
    SLIGHT,
    STUCK,
    Params,
    State,
    init,
)

__all__ = ["Params", "State", "init", "run_into", "step_into"]


@merged
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


@merged
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
        if correlation(state, best, n) > 0.9 and state.evidence[n] > 0.9 * state.evidence[best]:
            return False
    return True


@merged
def _slight(params: Params, state: State, best: int) -> bool:
    """Whether the leading hypothesis is a loss too small to be told from model error."""
    small = params.nuisance_spread[1 + params.group[best]] + sqrt(state.var[best])
    return params.kind[best] == LOSS and state.theta[best] < small


@merged
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


@merged
def _recover(params: Params, state: State) -> None:
    """Take the fresh filter over, forget the fault: signatures at rest, hypotheses at their priors."""
    state.scalars[DETECTED] = 0.0
    na, ng = params.b.shape
    for i in range(na):
        state.rough[i] = 1.0
        for c in range(3):
            state.x[i, c] = state.y[i, c]
            state.xm[i, c] = 0.0
            for j in range(ng):
                state.xl[j, i, c] = 0.0
                state.xp[j, i, c] = 0.0
    for n in range(len(params.kind)):
        state.score[n] = 0.0
        state.evidence[n] = 0.0
        state.theta[n] = params.mean[n]
        state.var[n] = params.spread[n] * params.spread[n]
    for n in range(len(params.nuisance_spread)):
        state.ntheta[n] = 0.0
    state.scalars[SLIGHT] = 0.0
    state.scalars[FRESH_AGE] = params.fresh_s


@merged
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


@lean
def step_into(params: Params, state: State, z: Array, age: Array, out: Verdict, k: int) -> None:
    """One sample: innovations, hypotheses, decision, prediction. Bad data freeze everything and give a status."""
    status = input_status(params, z, age)
    if status != OK:
        state.scalars[GAP] += 1.0
        _write(params, state, out, k, status)
        return
    if state.scalars[GAP] > 0.0:
        restart(params, state, z)
    for i in range(params.b.shape[0]):
        state.innovation[i] = z[params.rate_at[i]] - state.x[i, 0]
    state.scalars[CLOCK] += params.dt
    seen = rates_are_new(params, age)
    if state.scalars[CLOCK] < params.settle:
        status = NOT_READY
    elif outside(params, state, z):
        status = OUTSIDE
    elif seen:
        lead = evidence(params, state)
        _decide(params, state, fresh(params, state, z, lead))
    _write(params, state, out, k, status)
    advance(params, state, z, seen)


@lean
def run_into(params: Params, state: State, z: Array, age: Array, out: Verdict) -> None:
    """Every row in order."""
    for k in range(z.shape[0]):
        step_into(params, state, z[k], age[k], out, k)
