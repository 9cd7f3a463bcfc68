"""Filters of the `effectiveness` diagnoser: innovations of the rates and signatures of what each fault would add."""

from __future__ import annotations

import numpy as np

from ..core.types import Array
from ..parts.delay_line import delay_fill, delay_step
from ..parts.ops import clip, merged
from ..parts.rate_filter import rate_filter_step
from .effectiveness_types import CLOCK, GAP, NONFINITE, OK, SPEED, STALE, Params, State


@merged
def input_status(params: Params, z: Array, age: Array) -> int:
    """NONFINITE, STALE or OK for one sample."""
    status = OK
    for j in range(len(params.max_age)):
        if not np.isfinite(z[j]):
            return NONFINITE
        if not age[j] <= params.max_age[j]:
            status = STALE
    return status


@merged
def _deflection(params: Params, z: Array, j: int) -> float:
    """The command of group j: its channels with their weights, held within the stops."""
    delta = 0.0
    for c in range(params.weights.shape[1]):
        delta += params.weights[j, c] * z[params.command_at[c]]
    return clip(delta, params.lower[j], params.upper[j])


@merged
def restart(params: Params, state: State, z: Array) -> None:
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


@merged
def advance(params: Params, state: State, z: Array, seen: bool) -> None:
    """Move every filter one step with this sample; the innovations were used before.

    seen: whether the rates are new. A held rate is no measurement: the filters then predict without correction.
    """
    weight = 1.0 if seen else 0.0
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
            rate_filter_step(ad, bd, k, state.xl[j, i], -push * state.held[j], -weight * state.xl[j, i, 0])
            rate_filter_step(ad, bd, k, state.xp[j, i], push, -weight * state.xp[j, i, 0])
        # What one per cent more airspeed than measured or assumed would add, in per cent.
        faster = 2.0 * v * v * moment + v * damping
        rate_filter_step(ad, bd, k, state.xm[i], faster, -weight * state.xm[i, 0])
        known = v * damping - params.a[i] * w + v * v * moment
        rate_filter_step(ad, bd, k, state.x[i], known, weight * (w - state.x[i, 0]))
        rate_filter_step(ad, bd, k, state.y[i], known, weight * (w - state.y[i, 0]))


@merged
def outside(params: Params, state: State, z: Array) -> bool:
    """Whether a condition the model depends on (its speed) has left, over the last second, what training held."""
    outside = False
    for j in range(len(params.limit_at)):
        now = z[params.limit_at[j]]
        state.slow[j] += (1.0 - params.speed_pole) * (now - state.slow[j])
        if not params.limit_low[j] <= state.slow[j] <= params.limit_high[j]:
            outside = True
    return outside


@merged
def rates_are_new(params: Params, age: Array) -> bool:
    """Whether every rate was measured within the last one and a half samples."""
    new = True
    for i in range(len(params.rate_at)):
        new = new and age[params.rate_at[i]] <= 1.5 * params.dt
    return new
