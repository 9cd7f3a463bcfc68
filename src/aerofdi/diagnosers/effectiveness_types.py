"""Numbers and memory of the `effectiveness` diagnoser."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..core.types import Array, Status

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
    """Memory of the diagnoser.

    x, y: filters of the rates and their fresh copies of the recovery test; xl, xp, xm: of the signatures. held:
    delayed commands. theta, var: hypotheses; ntheta, nvar, nweight: healthy family. score, evidence, cross, pattern:
    decision. rough, inflation: noise of rougher air. information: of each group. scalars: see the indices below.
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
