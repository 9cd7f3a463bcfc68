"""An identified aircraft -> the numbers of the `effectiveness` diagnoser."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..aircraft.identified import AxisModel, IdentifiedModel
from ..core.types import HEALTHY, Array, Channels, Diagnoser, Hypothesis
from ..parts.rate_filter import Disturbance, rate_filter
from .effectiveness import Params, init, run_into, step_into
from .effectiveness_types import LOSS, STUCK

# Standard deviations of what a healthy aircraft may differ by: surface gain (the fit's own uncertainty is added);
# airspeed, where measured and where not.
GAIN_TOLERANCE = 0.08
SPEED_TOLERANCE = (0.03, 0.05)
# How far outside its range in training a speed may be before the model is not trusted.
ENVELOPE = {"airspeed": 0.2, "groundspeed": 0.1}
ALARM = 12.0
MARGIN = 3.0
DOF = 5.0
SETTLE_S = 2.0
EVIDENCE_S = 15.0
FRESH_S = 8.0
# How far the trim moment may wander although training did not show it, as a share of the moment of full command:
# little where its cause is measured (pitch: angle of attack, yaw: sideslip), more where it is not.
TRIM_FLOOR = {"p": (0.02, 0.02), "q": (0.02, 0.10), "r": (0.02, 0.05)}
TRIM_CAUSE = {"p": "beta", "q": "alpha", "r": "beta"}


def from_identified(
    model: IdentifiedModel, max_age_s: dict[str, float], alarm: float = ALARM, behind_s: float = 0.0
) -> Diagnoser:
    """The diagnoser of an identified aircraft.

    max_age_s: for each channel of the model, how old a value may be. alarm: log-likelihood score that raises an alarm.
    behind_s: how far behind the channels are read, so that slowly logged commands are known between their stamps.
    Hypotheses: for every identifiable group loss of effectiveness (estimate: gain that is left, 1 = all) and stuck
    (estimate: position in the unit of its commands); for groups of n surfaces also one of n stuck.
    """
    channels = model.channels
    names = tuple(channels)
    hypotheses, table = _hypotheses(model)
    params = _params(model, names, table, np.array([max_age_s[n] for n in names]), alarm)
    return Diagnoser(
        name="effectiveness",
        inputs=Channels(
            names, tuple(channels.values()), tuple(max_age_s[n] for n in names), behind_s=behind_s
        ),
        outputs=Channels((), ()),
        hypotheses=(HEALTHY, *hypotheses),
        dt_s=model.dt_s,
        active=False,
        params=params,
        init=init,
        step_into=step_into,
        run_into=run_into,
        residuals=tuple(f"innovation.{a.rate}" for a in model.axes),
        settle_s=SETTLE_S,
    )


def _hypotheses(model: IdentifiedModel) -> tuple[list[Hypothesis], list[tuple[float, ...]]]:
    """Hypotheses and for each: kind, group, share, prior mean, prior std, memory s, low, high."""
    out: list[Hypothesis] = []
    rows: list[tuple[float, ...]] = []
    for j, g in enumerate(model.groups):
        if not g.identifiable:
            continue
        out.append(Hypothesis(g.name, "loss_of_effectiveness", "1", g.name))
        rows.append((LOSS, j, 1.0, 0.5, 0.25, 40.0, 0.25, 0.75))
        reach = 0.5 * (g.upper - g.lower)
        stuck = (g.mean, max(3.0 * g.deviation, 0.25 * reach), 5.0, g.lower, g.upper)
        out.append(Hypothesis(g.name, "stuck", g.unit, g.name))
        rows.append((STUCK, j, 1.0, *stuck))
        n = len(g.channels)
        if n > 1:
            out.append(Hypothesis(g.name, "stuck", g.unit, f"{g.name}:1of{n}"))
            rows.append((STUCK, j, 1.0 / n, *stuck))
    return out, rows


def trimmed_noise(axis: AxisModel) -> Disturbance:
    """The axis's noise with the trim wander raised to its floor."""
    strongest = max((abs(axis.coefficient(n)) for n in axis.names if n.startswith("command.")), default=0.0)
    known = TRIM_CAUSE[axis.rate] in axis.names
    floor = TRIM_FLOOR[axis.rate][0 if known else 1]
    return axis.noise._replace(s_c=max(axis.noise.s_c, floor * strongest))


def gain_tolerance(model: IdentifiedModel, group: str) -> float:
    """How far the gain of a group may be off while healthy: modelling plus the relative error of its best-known fit."""
    name = f"command.{group}"
    relative = [
        a.deviation(name) / abs(a.coefficient(name)) for a in model.axes if a.coefficient(name) != 0.0
    ]
    return math.hypot(GAIN_TOLERANCE, min(relative, default=1.0))


def _params(
    model: IdentifiedModel,
    names: tuple[str, ...],
    rows: list[tuple[float, ...]],
    max_age: Array,
    alarm: float,
) -> Params:
    axes, groups = model.axes, model.groups
    filters = [rate_filter(a.coefficient(a.rate), trimmed_noise(a), model.dt_s) for a in axes]
    commands = [c for g in groups for c in g.channels]
    rates = [n for n in names if n in ("p", "q", "r")]
    air = [n for n in names if n in ("alpha", "beta")]
    b = np.array([[a.coefficient(f"command.{g.name}") for g in groups] for a in axes])
    speed = "airspeed" in names
    nuisance = [0.0, *(gain_tolerance(model, g.name) for g in groups), SPEED_TOLERANCE[0 if speed else 1]]
    place = np.array([[0.0 if n == a.rate else a.coefficient(n) for n in rates] for a in axes])
    return Params(
        ad=np.array([f.ad for f in filters]),
        bd=np.array([f.bd for f in filters]),
        k=np.array([f.k for f in filters]),
        s=np.array([max(a.innovation_std**2, f.s) for a, f in zip(axes, filters, strict=True)]),
        a=np.array([a.coefficient(a.rate) for a in axes]),
        couple=place,
        b=b,
        air=np.array([[a.coefficient(n) for n in air] for a in axes]).reshape(len(axes), len(air)),
        m=np.array([a.coefficient("trim") for a in axes]),
        rate_at=np.array([names.index(a.rate) for a in axes]),
        couple_at=np.array([names.index(n) for n in rates]),
        command_at=np.array([names.index(c) for c in commands]),
        air_at=np.array([names.index(n) for n in air], dtype=np.int64),
        speed_at=names.index("airspeed") if speed else -1,
        weights=_weights(model, commands),
        lower=np.array([g.lower for g in groups]),
        upper=np.array([g.upper for g in groups]),
        v0=model.airspeed if speed else 1.0,
        speed_pole=math.exp(-model.dt_s / 1.0),
        lag_pole=math.exp(-model.dt_s / model.lag_s) if model.lag_s > 0 else 0.0,
        delay=model.delay_s / model.dt_s,
        max_age=max_age,
        **_hypothesis_columns(rows),
        nuisance_spread=np.array(nuisance),
        nuisance_memory=30.0,
        alarm=alarm,
        cap=2.0 * alarm,
        clear=0.2 * alarm,
        margin=MARGIN,
        temper=0.9,
        dof=DOF,
        dt=model.dt_s,
        settle=SETTLE_S,
        fresh_s=FRESH_S,
        evidence_memory=EVIDENCE_S,
        **_envelope(model, names),
    )


def _weights(model: IdentifiedModel, commands: list[str]) -> Array:
    """(groups, commands): how much each command counts in the mean of its group."""
    out = np.zeros((len(model.groups), len(commands)))
    for j, g in enumerate(model.groups):
        for c, w in zip(g.channels, g.weights, strict=True):
            out[j, commands.index(c)] = w
    return out


def _hypothesis_columns(rows: list[tuple[float, ...]]) -> dict[str, Any]:
    """The table of hypotheses, a row each, as the columns of Params."""
    table = np.array(rows, float).reshape(-1, 8)
    names = ("share", "mean", "spread", "memory", "low", "high")
    numbers = {name: table[:, 2 + k].copy() for k, name in enumerate(names)}
    kind, group = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
    return numbers | {"kind": kind, "group": group, "gain_std": np.full(len(table), 0.1)}


def _envelope(model: IdentifiedModel, names: tuple[str, ...]) -> dict[str, Any]:
    """The speeds outside which the model was never learnt."""
    limits = [n for n in ENVELOPE if n in names]
    return {
        "limit_at": np.array([names.index(n) for n in limits], dtype=np.int64),
        "limit_low": np.array([(1.0 - ENVELOPE[n]) * model.envelope[n][0] for n in limits]),
        "limit_high": np.array([(1.0 + ENVELOPE[n]) * model.envelope[n][1] for n in limits]),
    }
