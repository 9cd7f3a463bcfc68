"""`identify`: healthy flight in, an identified aircraft out."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..aircraft.identified import AxisModel, IdentifiedModel, SurfaceGroup
from ..core.errors import CannotJudge
from ..core.types import Array
from . import equation_error as ee
from . import filter_error as fe
from .data import Spans, Training, prepare

LAGS_S = (0.0, 0.04, 0.08)
LONGEST_S = 0.2001
HELD_OUT = 0.3
SIGNIFICANT = 3.0


def identify(
    spans: Spans, name: str = "aircraft", progress: Callable[[str], None] | None = None
) -> IdentifiedModel:
    """Fit the rate dynamics of every measured axis from healthy flight.

    spans: (flight, t0_s, t1_s), at least 10 s in all. Stages: equation error over a delay scan; filter error
    (maximum likelihood with gusts) started there; delay and lag scanned again by its likelihood; solved once more.
    Returns the model with covariance, R2, held-out R2 and notes on what the data cannot tell.

    Raises MissingChannel (no rates or commands) and CannotJudge (no moving command, too little data).
    """
    say = progress or (lambda text: None)
    training = prepare(spans)
    if not training.groups:
        raise CannotJudge(
            f"{spans[0][0].name}: no surface command moves in the healthy span; "
            f"give a span flown by the autopilot with --healthy T0:T1"
        )
    say("equation error: delay scan")
    delay, _ = ee.scan(training)
    axes = range(len(training.rates))
    say("filter error: gusts and damping")
    search = [_search(training, i, delay, 0.0) for i in axes]
    delay, lag = _scan(training, search)
    say("filter error: final fit")
    fits = [_refit(training, i, delay, lag) for i in axes]
    models = tuple(_axis(training, i, fits[i], delay, lag) for i in axes)
    groups, notes = _judge_groups(training, models)
    notes += contradictions(groups, models, spans[0][0].meta.get("surface_signs", {}))
    return IdentifiedModel(
        name=name,
        dt_s=training.dt_s,
        delay_s=delay,
        lag_s=lag,
        airspeed=training.airspeed,
        groups=groups,
        axes=models,
        trained_s=training.duration_s,
        envelope=_envelope(training, spans),
        notes=notes,
    )


def _refit(training: Training, axis: int, delay: float, lag: float) -> fe.AxisFit:
    search = _search(training, axis, delay, lag)
    return fe.solve_axis(search, fe.columns(training, axis, delay, lag), training.dt_s)


def _search(training: Training, axis: int, delay: float, lag: float) -> Array:
    c = fe.columns(training, axis, delay, lag)
    return fe.search_axis(c, training.dt_s, training.rates[axis], training.command_period_s)


def _scan(training: Training, search: list[Array]) -> tuple[float, float]:
    """Delay and lag of largest joint likelihood, the noise of each axis held."""
    best = (math.inf, 0.0, 0.0)
    step = max(training.dt_s / 2, 0.01)
    for lag in LAGS_S:
        for delay in np.arange(0.0, LONGEST_S - lag, step):
            cost = sum(_cost(training, i, float(delay), lag, s) for i, s in enumerate(search))
            if cost < best[0]:
                best = (cost, float(delay), lag)
    return best[1], best[2]


def _cost(training: Training, axis: int, delay: float, lag: float, search: Array) -> float:
    try:
        return fe.solve_axis(search, fe.columns(training, axis, delay, lag), training.dt_s).cost
    except np.linalg.LinAlgError:
        return math.inf


def _axis(training: Training, axis: int, fit: fe.AxisFit, delay: float, lag: float) -> AxisModel:
    names = ee.names(training, axis)
    value = np.concatenate(([fit.a], fit.theta))
    covariance = np.zeros((len(value), len(value)))
    covariance[1:, 1:] = fit.covariance
    # Damping comes from the search, which gives no covariance: 10 % is assumed.
    covariance[0, 0] = (0.1 * fit.a) ** 2
    y, x = ee.stacked(training, axis, delay, lag)
    least = np.linalg.lstsq(x, y, rcond=None)[0]
    c = fe.columns(training, axis, delay, lag)
    return AxisModel(
        rate=training.rates[axis],
        names=names,
        value=value,
        covariance=covariance,
        noise=fit.noise,
        innovation_std=fit.innovation_std,
        r2=fe.simulation_r2(fit, c, training.dt_s),
        r2_acceleration=ee.explained(y, x, least),
        r2_held_out=_held_out(training, axis, fit, c),
    )


def _held_out(training: Training, axis: int, fit: fe.AxisFit, c: fe.Columns) -> float:
    """Simulation R2 on the last 30 % of the training with coefficients from the first 70 %.

    Delay, lag, damping and noise stay those of the whole.
    """
    cut = int((1.0 - HELD_OUT) * len(c.rate))
    early = fe.solve_axis(fit.search, fe.Columns(*(v[:cut] for v in c)), training.dt_s)
    late = fe.Columns(*(v[cut:].copy() for v in c))
    late.starts[0] = True
    late.use[: math.ceil(fe.SETTLE_S / training.dt_s)] = False
    return fe.simulation_r2(early, late, training.dt_s)


def _judge_groups(
    training: Training, axes: tuple[AxisModel, ...]
) -> tuple[tuple[SurfaceGroup, ...], tuple[str, ...]]:
    """Mark groups no axis answers, and say in words what could not be told apart."""
    groups, notes = [], list(training.notes)
    for g in training.groups:
        t = max(
            abs(a.coefficient(f"command.{g.name}")) / max(a.deviation(f"command.{g.name}"), 1e-12)
            for a in axes
        )
        groups.append(g._replace(identifiable=t > SIGNIFICANT))
        if t <= SIGNIFICANT:
            notes.append(
                f"{g.name}: its commands moved too little to identify it (t = {t:.1f}); it cannot be judged"
            )
        if len(g.channels) > 1:
            notes.append(f"{', '.join(g.channels)} always moved together: judged as one group, {g.name}")
    return tuple(groups), tuple(notes)


def contradictions(
    groups: tuple[SurfaceGroup, ...], axes: tuple[AxisModel, ...], signs: dict[str, dict[str, int]]
) -> tuple[str, ...]:
    """One sentence for every fitted sign that significantly contradicts what the profile says of the surface.

    signs: surface -> {"roll" | "pitch" | "yaw": +1 or -1}, the direction of the rate a positive command asks for.
    """
    axis_of = {"p": "roll", "q": "pitch", "r": "yaw"}
    out = []
    for g in groups:
        surface = g.channels[0].removeprefix("command.")
        for a in axes:
            stated = signs.get(surface, {}).get(axis_of[a.rate])
            name = f"command.{g.name}"
            fitted, std = a.coefficient(name), a.deviation(name)
            # The group moves along its first surface where that one's weight is positive.
            along = math.copysign(1.0, g.weights[0]) * fitted
            if stated and abs(fitted) > SIGNIFICANT * std and along * stated < 0:
                out.append(
                    f"sign contradicts the profile: a positive {surface} command should turn {axis_of[a.rate]} "
                    f"{'+' if stated > 0 else '-'}, the fit says {along:+.2f} +- {std:.2f}; check [surfaces] and "
                    f"signs of the profile, or whether a missing signal (angle of attack) takes part"
                )
    return tuple(out)


def _envelope(training: Training, spans: Spans) -> dict[str, tuple[float, float]]:
    """Lowest and highest command of every group, and speed, in training."""
    u = np.concatenate([s.commands for s in training.segments])
    v = np.concatenate([s.speed for s in training.segments])
    out = {
        f"command.{g.name}": (float(u[:, i].min()), float(u[:, i].max()))
        for i, g in enumerate(training.groups)
    }
    if math.isfinite(training.airspeed):
        out["airspeed"] = (float(v.min() * training.airspeed), float(v.max() * training.airspeed))
    if all("groundspeed" in f.measured for f, _, _ in spans):
        speed = np.concatenate([f.measured["groundspeed"].between(a, b).value for f, a, b in spans])
        if np.isfinite(speed).any() and np.nanmax(speed) > np.nanmin(speed):
            out["groundspeed"] = (float(np.nanmin(speed)), float(np.nanmax(speed)))
    return out
