"""A small diagnosed flight made by hand: known arrays in, known words and pictures out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aerofdi.aircraft.identified import AxisModel, IdentifiedModel, SurfaceGroup
from aerofdi.core import (
    HEALTHY,
    Channels,
    Diagnoser,
    Event,
    Flight,
    Hypothesis,
    Series,
    Status,
    empty_verdict,
)
from aerofdi.parts.rate_filter import Disturbance
from aerofdi.pipeline import FlightDiagnosis, Result, Run

DT = 0.02
LOSS = Hypothesis("elevon_right", "loss_of_effectiveness", "1", "elevon_right")
STUCK = Hypothesis("elevon_right", "stuck", "1", "elevon_right")


def never(*_: Any) -> None:
    """Stands where a kernel would be: a report must not run what it shows."""
    raise AssertionError("the report ran a diagnoser it was only to show")


def flight(source: str = "a flight.csv", **meta: Any) -> Flight:
    """60 s at 50 Hz: rates, attitude, two elevon commands, a mode that ends at 50 s, a position."""
    t = DT * np.arange(3000)
    wave = np.sin(0.7 * t)
    measured = {
        "p": Series(t, 0.3 * wave, "rad/s"),
        "q": Series(t, 0.1 * np.cos(t), "rad/s"),
        "phi": Series(t, 0.2 * wave, "rad"),
        "command.elevon_left": Series(t, -0.2 * wave, "1"),
        "command.elevon_right": Series(t, 0.2 * wave + 0.05 * np.sin(3 * t), "1"),
        "north": Series(t, 10 * t, "m"),
        "east": Series(t, 50 * np.sin(0.1 * t), "m"),
        "mode": Series(np.array([0.0, 50.0]), np.array([2.0, 0.0]), "1", {2: "AUTO", 0: "MANUAL"}),
    }
    about = {
        "source": source,
        "autopilot_modes": ["AUTO"],
        "aliases": {"elevon_right": "elevon B"},
        "servos": {"elevon_right": {"neutral_us": 1416.0, "us_per_unit": 484.0}},
    }
    return Flight(measured, events=[Event(40.0, "fault", "elevon_right: stuck begins")], meta=about | meta)


def model() -> IdentifiedModel:
    """Roll and pitch, two elevons, round numbers."""
    names = ("p", "command.elevon_left", "command.elevon_right", "trim")
    axes = tuple(
        AxisModel(
            rate,
            (rate, *names[1:]),
            np.array([-5.0, left, 20.0, 0.1]),
            np.diag([0.01, 0.04, 0.04, 0.01]),
            Disturbance(0.5, 0.1, 60.0, 0.1, 0.01),
            0.01,
            0.8,
            0.85,
            0.7,
        )
        for rate, left in (("p", -20.0), ("q", 20.0))
    )
    groups = tuple(
        SurfaceGroup(n, (f"command.{n}",), (1.0,), "1", -1.0, 1.0, 0.0, 0.2, True)
        for n in ("elevon_left", "elevon_right")
    )
    return IdentifiedModel("wing", DT, 0.04, 0.04, float("nan"), groups, axes, 20.0, {}, ())


def made_run(name: str, hypotheses: tuple[Hypothesis, ...], alarm_s: float | None) -> Run:
    """Judged 20-48 s with a gap of stale input at 30-31 s; an alarm from alarm_s on, naming the last hypothesis."""
    t = 20.0 + DT * np.arange(1400)
    residuals = ("p", "q")
    inputs = Channels(residuals, ("rad/s", "rad/s"))
    kernels = (never, never, never)
    d = Diagnoser(name, inputs, Channels((), ()), hypotheses, DT, False, None, *kernels, residuals)
    v = empty_verdict(d, len(t))
    v.status[:] = Status.OK
    v.status[(t >= 30.0) & (t < 31.0)] = Status.STALE_INPUT
    v.residual[:], v.threshold[:] = 0.01, 0.1
    v.score[:] = 0.5
    v.active[:, 0] = True
    if alarm_s is not None:
        loud = t >= alarm_s - 1e-9
        v.detected[loud] = True
        v.active[loud, 0] = False
        v.residual[loud, 0] = 0.2
        if len(hypotheses) > 1:
            v.active[loud, -1] = True
            v.score[loud, -1] = 20.0
            v.estimate[loud, -1], v.estimate_std[loud, -1] = 0.01, 0.02
    return Run(d, t, np.zeros((len(t), 2)), v, (0,))


def event(t: float, kind: str, h: Hypothesis | None, **more: Any) -> dict[str, Any]:
    """An event of the pipeline."""
    named = {"fault": h.fault, "mode": h.mode, "group": h.group, "unit": h.unit} if h else {}
    empty = dict.fromkeys(("fault", "mode", "estimate", "estimate_std", "unit"))
    return {"t_s": t, "event": kind, **empty, **named, **more}


def diagnosis(
    verdict: str = "fault", source: str = "a flight.csv", notes: tuple[str, ...] = ()
) -> FlightDiagnosis:
    """fault: elevon stuck, alarm at 40.5 s; healthy: silent; cannot_judge: no model."""
    f = flight(source)
    if verdict == "cannot_judge":
        results = [Result(n, verdict, "no surface command is logged") for n in ("parity", "effectiveness")]
        return FlightDiagnosis(source, f, [(0.0, 50.0)], [], [], None, results, list(notes))
    alarm = 40.5 if verdict == "fault" else None
    found = [event(40.5, "detected", None), event(40.5, "isolated", STUCK, estimate=0.01, estimate_std=0.17)]
    results = [
        Result(
            "parity", "healthy", "rates follow", {"elevon_right offset": 0.3}, [], made_run("parity", (HEALTHY,), None)
        ),
        Result(
            "effectiveness", verdict, "told elsewhere", {"elevon_right loss_of_effectiveness": 0.35},
            found if alarm else [], made_run("effectiveness", (HEALTHY, LOSS, STUCK), alarm),
        ),
    ]  # fmt: skip
    return FlightDiagnosis(
        source, f, [(0.0, 50.0)], [(0.0, 20.0)], [(20.0, 48.0)], model(), results, list(notes)
    )


@pytest.fixture
def faulty() -> FlightDiagnosis:
    return diagnosis("fault")


@pytest.fixture
def healthy() -> FlightDiagnosis:
    return diagnosis("healthy")


@pytest.fixture
def unjudged() -> FlightDiagnosis:
    return diagnosis("cannot_judge")


@pytest.fixture
def make():
    """The maker itself, for a test that wants other names or notes."""
    return diagnosis
