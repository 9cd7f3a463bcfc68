"""Healthy flight -> model, diagnosers and calibrated thresholds; and the test that the healthy part is one piece."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..aircraft import Aircraft
from ..aircraft.identified import IdentifiedModel
from ..core.bind import bind, default_max_age
from ..core.errors import CannotJudge, WrongUse
from ..core.run import run
from ..core.types import Array, Diagnoser, Flight, Status
from ..design.parity import calibrate_threshold
from ..diagnosers import effectiveness_setup, parity_setup
from ..identify import from_aircraft, identify
from ..identify.data import RATES, behind
from .spans import split
from .types import Span

FALSE_ALARMS_PER_HOUR = 0.1
MOST_FALSE_ALARMS_PER_HOUR = 60.0
UNEQUAL = 2.5
# High enough that no alarm, cap or recovery of the diagnoser cuts a score short while it is being measured.
UNCUT = 1e4
WHOLE_S = 60.0


class Trained(NamedTuple):
    """A model and its diagnosers, ready to judge."""

    model: IdentifiedModel
    diagnosers: tuple[Diagnoser, ...]
    notes: tuple[str, ...]


class Timing(NamedTuple):
    """How a model's channels are bound in one flight: how old each may be, and how far behind they are read, s."""

    max_age_s: dict[str, float]
    behind_s: float


def timing(model: IdentifiedModel, flight: Flight) -> Timing:
    """Ages: five median periods of the channel in this flight, at least five model periods. Behind: see `behind`."""
    ages = {
        n: max(default_max_age(flight, n) if n in flight.measured else 0.0, 5.0 * model.dt_s)
        for n in model.channels
    }
    names = tuple(n for n in model.channels if n in RATES or n.startswith("command."))
    return Timing(ages, behind(flight, names, model.dt_s))


def checked_rate(false_alarms_per_hour: float | None) -> float:
    """The rate of false alarms asked for, in 1/h, 0.1 where none was; WrongUse outside (0, 60]."""
    rate = FALSE_ALARMS_PER_HOUR if false_alarms_per_hour is None else float(false_alarms_per_hour)
    if not 0.0 < rate <= MOST_FALSE_ALARMS_PER_HOUR:
        raise WrongUse(
            f"--false-alarms-per-hour {rate:g} is no rate to aim at; give a number above 0 and at most "
            f"{MOST_FALSE_ALARMS_PER_HOUR:g} per hour (default {FALSE_ALARMS_PER_HOUR:g})"
        )
    return rate


def train(
    flight: Flight,
    spans: list[Span],
    progress: Callable[[str], None] | None = None,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    published: Aircraft | None = None,
) -> Trained:
    """Identify the aircraft from healthy spans of one flight, calibrate both diagnosers on them.

    published: a full aircraft file whose derivatives are taken instead of fitted ones.

    Raises CannotJudge where the spans disagree among themselves (part of the training may be faulty).
    """
    pieces = [(flight, a, b) for a, b in spans]
    if published is not None:
        return calibrate(flight, spans, from_aircraft(published, pieces), false_alarms_per_hour)
    name = str(flight.meta.get("aircraft") or "aircraft")
    model = identify(pieces, name=name, progress=progress)
    if progress:
        progress("is the training of one piece?")
    _homogeneous(flight, spans, model)
    return calibrate(flight, spans, model, false_alarms_per_hour)


def calibrate(
    flight: Flight,
    spans: list[Span],
    model: IdentifiedModel,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
) -> Trained:
    """Diagnosers of a model with thresholds from healthy spans of a flight.

    Parity: the threshold its residuals pass false_alarms_per_hour times an hour (`calibrate_threshold`).
    Effectiveness: the mean time between false alarms of a cumulative log-likelihood ratio grows as e^alarm (Lorden's
    bound), so the alarm of the default rate moves by ln(default / asked); never below 1.5 times the highest score of
    training.

    Raises CannotJudge where these spans look faulty to the model: a threshold above them would hide the fault.
    """
    highest = max(scores(flight, spans, model), default=0.0)
    _refuse(flight, spans, highest)
    rate = math.log(FALSE_ALARMS_PER_HOUR / checked_rate(false_alarms_per_hour))
    alarm = max(effectiveness_setup.ALARM + rate, 1.5 * highest)
    residuals = parity_residuals(flight, spans, model)
    threshold = tuple(
        calibrate_threshold(residuals[:, i], model.dt_s, false_alarms_per_hour)
        for i in range(residuals.shape[1])
    )
    model = model._replace(calibration={"effectiveness_alarm": (alarm,), "parity_threshold": threshold})
    return Trained(model, diagnosers(model, timing(model, flight)), model.notes)


def diagnosers(model: IdentifiedModel, when: Timing) -> tuple[Diagnoser, ...]:
    """The diagnosers of a calibrated model."""
    if not model.calibration:
        raise CannotJudge(
            f"the model of {model.name} has no thresholds yet; give healthy flight with --healthy or --healthy-flight"
        )
    parity = parity_setup.from_identified(
        model, when.max_age_s, tuple(model.calibration["parity_threshold"]), behind_s=when.behind_s
    )
    found = [parity]
    if any(g.identifiable for g in model.groups):
        alarm = model.calibration["effectiveness_alarm"][0]
        found.append(effectiveness_setup.from_identified(model, when.max_age_s, alarm, when.behind_s))
    return tuple(found)


def scores(flight: Flight, spans: list[Span], model: IdentifiedModel) -> list[float]:
    """Highest effectiveness score in each span, not cut short by any alarm."""
    if not any(g.identifiable for g in model.groups):
        return []
    when = timing(model, flight)
    d = effectiveness_setup.from_identified(model, when.max_age_s, UNCUT, when.behind_s)
    out = []
    for a, b in spans:
        _, verdict = run(d, bind(flight, d.inputs, d.dt_s, a, b, who=d.name))
        out.append(float(np.max(verdict.score, initial=0.0)))
    return out


def parity_residuals(flight: Flight, spans: list[Span], model: IdentifiedModel) -> Array:
    """Residuals (n, axes) where the parity diagnoser was judging."""
    when = timing(model, flight)
    d = parity_setup.from_identified(model, when.max_age_s, behind_s=when.behind_s)
    rows = []
    for a, b in spans:
        _, verdict = run(d, bind(flight, d.inputs, d.dt_s, a, b, who=d.name))
        rows.append(verdict.residual[verdict.status == Status.OK])
    return np.concatenate(rows)


def _homogeneous(flight: Flight, spans: list[Span], model: IdentifiedModel) -> None:
    """Each half judged by a model of the other: a fault inside the training raises an alarm in both directions."""
    _refuse(flight, spans, max(scores(flight, spans, model), default=0.0))
    if sum(b - a for a, b in spans) >= WHOLE_S:
        first, second = split(spans, 0.5)
        _refuse(flight, spans, min(_cross(flight, first, second), _cross(flight, second, first)))


def _refuse(flight: Flight, spans: list[Span], worst: float) -> None:
    limit = UNEQUAL * effectiveness_setup.ALARM
    if worst >= limit:
        raise CannotJudge(
            f"{flight.name}: the training span {_text(spans)} is not of one piece (score {worst:.0f}, "
            f"limit {limit:.0f}): part of it may already be faulty; give a healthy span with --healthy T0:T1"
        )


def _cross(flight: Flight, learn: list[Span], judge: list[Span]) -> float:
    try:
        model = identify([(flight, a, b) for a, b in learn])
        return max(scores(flight, judge, model), default=0.0)
    except CannotJudge:
        return 0.0


def _text(spans: list[Span]) -> str:
    return (
        ", ".join(f"{a:.0f}-{b:.0f} s" for a, b in spans) if math.isfinite(sum(b for _, b in spans)) else "?"
    )
