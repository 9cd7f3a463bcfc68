"""A published aircraft -> the kind of model that `identify` fits: its derivatives, this flight's noise and trim."""

from __future__ import annotations

import math

import numpy as np

from ..aircraft import Aircraft
from ..aircraft.identified import AxisModel, IdentifiedModel, SurfaceGroup
from ..core.errors import WrongUse
from ..core.types import Array
from ..dynamics.linearise import LinearModel, linearise
from . import equation_error as ee
from . import filter_error as fe
from .data import Spans, Training, prepare
from .fit import _envelope, _held_out, _judge_groups

PUBLISHED_ERROR = 0.1


def from_aircraft(aircraft: Aircraft, spans: Spans) -> IdentifiedModel:
    """The rate dynamics of a full aircraft file at the airspeed of a healthy flight, with noise and trim from it.

    Damping, couplings and surface effects are those of the linearised aircraft (rows p, q, r of its A and B); only
    the trim moment and the gusts are fitted. Each published coefficient is given a standard deviation of 10 %
    (assumed). Commands must be recorded in rad. Angles of attack and sideslip are used where the flight has them.
    """
    training = prepare(spans)
    wrong = [g.name for g in training.groups if g.unit != "rad"]
    if wrong:
        raise WrongUse(
            f"{spans[0][0].name}: commands of {wrong[0]} are in '1', but the published aircraft {aircraft.name} needs "
            f'them in rad; map them with unit = "deg" or "rad" in the profile, or leave --aircraft out to identify'
        )
    unknown = [
        c
        for g in training.groups
        for c in g.channels
        if c.removeprefix("command.") not in _surfaces(aircraft)
    ]
    if unknown:
        raise WrongUse(
            f"{spans[0][0].name}: {unknown[0]!r} is not a surface of {aircraft.name}, which has "
            f"{', '.join(_surfaces(aircraft))}; correct the names in the profile"
        )
    speed = training.airspeed if math.isfinite(training.airspeed) else None
    linear = linearise(aircraft, speed)
    delay, lag = _timing(aircraft, training)
    axes = tuple(_axis(training, i, linear, delay, lag) for i in range(len(training.rates)))
    groups, notes = _judge_groups(training, axes)
    return IdentifiedModel(
        name=aircraft.name,
        dt_s=training.dt_s,
        delay_s=delay,
        lag_s=lag,
        airspeed=training.airspeed,
        groups=groups,
        axes=axes,
        trained_s=training.duration_s,
        envelope=_envelope(training, spans),
        notes=(f"derivatives of the published {aircraft.name}; noise and trim from this flight", *notes),
    )


def _surfaces(aircraft: Aircraft) -> tuple[str, ...]:
    return tuple(s.name for s in aircraft.surfaces)


def _timing(aircraft: Aircraft, training: Training) -> tuple[float, float]:
    """Delay and first-order lag of the slowest surface that was commanded."""
    used = {c.removeprefix("command.") for g in training.groups for c in g.channels}
    delays, lags = [0.0], [0.0]
    for s in aircraft.surfaces:
        if s.name in used:
            delays.append(s.delay)
            lags.append(
                {"none": 0.0, "first_order": 1.0, "second_order": 2.0 * s.damping}[s.actuator] / s.bandwidth
            )
    return max(delays), max(lags)


def _coefficients(training: Training, axis: int, linear: LinearModel) -> dict[str, float]:
    """Published value of every regressor of one axis but the trim moment."""
    rate = training.rates[axis]
    row = linear.states.index(rate)
    v0 = linear.trim.airspeed
    out = {r: float(linear.A[row, linear.states.index(r)]) for r in training.rates}
    for air, state in (("alpha", "w"), ("beta", "v")):
        if air in training.air:
            out[air] = float(linear.A[row, linear.states.index(state)]) * v0
    for g in training.groups:
        out[f"command.{g.name}"] = _group_effect(linear, row, g)
    return out


def _group_effect(linear: LinearModel, row: int, group: SurfaceGroup) -> float:
    total = 0.0
    for channel, weight in zip(group.channels, group.weights, strict=True):
        column = linear.inputs.index(channel.removeprefix("command."))
        total += math.copysign(1.0, weight) * float(linear.B[row, column])
    return total


def _axis(training: Training, axis: int, linear: LinearModel, delay: float, lag: float) -> AxisModel:
    names = ee.names(training, axis)
    known = _coefficients(training, axis, linear)
    given = np.array([known[n] for n in names[1:-1]])
    c = fe.columns(training, axis, delay, lag)
    c = c._replace(known=c.inputs[:, :-1] @ given, inputs=np.ascontiguousarray(c.inputs[:, -1:]))
    search = fe.search_axis(c, training.dt_s, names[0], training.command_period_s, max(-known[names[0]], 0.1))
    fit = fe.solve_axis(search, c, training.dt_s)
    value = np.concatenate(([fit.a], given, fit.theta))
    covariance: Array = np.diag((PUBLISHED_ERROR * value) ** 2)
    covariance[-1, -1] = fit.covariance[0, 0]
    y, x = ee.stacked(training, axis, delay, lag)
    return AxisModel(
        rate=names[0],
        names=names,
        value=value,
        covariance=covariance,
        noise=fit.noise,
        innovation_std=fit.innovation_std,
        r2=fe.simulation_r2(fit, c, training.dt_s),
        r2_acceleration=ee.explained(y, x, value),
        r2_held_out=_held_out(training, axis, fit, c),
    )
