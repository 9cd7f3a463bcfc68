"""Which curves a page shows of a diagnosed flight."""

from __future__ import annotations

import math

import numpy as np

from ..core.bind import bind
from ..core.run import run
from ..core.types import Array, Flight, Series, Status
from ..diagnosers import parity_setup
from ..identify.data import command_channels
from ..pipeline.train import timing
from ..pipeline.types import FlightDiagnosis, Result, Run, Span
from .traces import Panel, Trace, line
from .words import AXES, LOSS, STUCK, alarm_level, hypothesis_text, ordered, spoken

DEG = 180.0 / math.pi
UNFILTERED = np.array([[1.0, 0.0, 0.0, 0.0, 0.0]])
BAND = 1.96


def panels(d: FlightDiagnosis) -> list[Panel]:
    """From what happened (attitude, commands) over what was expected (rates) to what was concluded."""
    return [p for p in (attitude(d.flight), commands(d.flight), *rates(d), *concluded(d)) if p.traces]


def attitude(flight: Flight) -> Panel:
    """Roll and pitch, and what was asked for."""
    m = flight.measured
    names = (("phi", "roll", "1"), ("theta", "pitch", "2"))
    asked = [
        _series(f"{text} asked", m[f"reference.{n}"], DEG, "reference")
        for n, text, _ in names
        if f"reference.{n}" in m
    ]
    felt = [_series(text, m[n], DEG, role) for n, text, role in names if n in m]
    return Panel("Attitude", "deg", (*asked, *felt))


def commands(flight: Flight) -> Panel:
    """What the autopilot asked of every surface."""
    names = command_channels(flight)
    unit = flight.measured[names[0]].unit if names else "1"
    aliases = flight.meta.get("aliases")
    traces = tuple(
        _series(
            spoken(n.removeprefix("command."), aliases),
            flight.measured[n],
            _factor(unit),
            str(i + 1),
            step=True,
        )
        for i, n in enumerate(names)
    )
    return Panel("Surface commands", _readable(unit), traces)


def rates(d: FlightDiagnosis) -> list[Panel]:
    """Each measured rate with what the commands explain of it; without a model, the rates alone."""
    m = d.flight.measured
    found = explained(d)
    if found is None:
        traces = tuple(_series(AXES[n], m[n], DEG, str(i + 1)) for i, n in enumerate(AXES) if n in m)
        return [Panel("Angular rates", "deg/s", traces)]
    t, names, measured, expected = found
    return [
        Panel(
            f"{AXES.get(n, n).capitalize()} rate {n}: measured, and explained by commands",
            "deg/s",
            (
                line("measured", t, DEG * measured[:, i], "measured"),
                line("explained", t, DEG * expected[:, i], "explained"),
            ),
        )
        for i, n in enumerate(names)
    ]  # fmt: skip


def explained(d: FlightDiagnosis) -> tuple[Array, tuple[str, ...], Array, Array] | None:
    """(t, rates, measured (n, na), explained (n, na)) over all that was trained on or judged; None without a model.

    Explained is the prediction inside the parity residual, without its low-pass: the model driven by commands, the
    other rates and the air, never by the rate itself.
    """
    if d.model is None:
        return None
    when = timing(d.model, d.flight)
    parity = parity_setup.from_identified(d.model, when.max_age_s, behind_s=when.behind_s)
    parity = parity._replace(params=parity.params._replace(sections=UNFILTERED))
    at = [parity.inputs.names.index(n) for n in parity.residuals]
    parts: list[tuple[Array, Array, Array]] = []
    for a, b in joined([*d.trained, *d.judged]):
        sample = bind(d.flight, parity.inputs, parity.dt_s, a, b, who=parity.name)
        if len(sample.t_s):
            _, verdict = run(parity, sample)
            measured = sample.z[:, at]
            parts.append(
                (
                    sample.t_s - when.behind_s,
                    measured,
                    np.where(np.isfinite(verdict.residual), verdict.residual + measured, np.nan),
                )
            )
    if not parts:
        return None
    t, measured, expected = (np.concatenate(x) for x in zip(*parts, strict=True))
    return t, parity.residuals, measured, expected


def joined(spans: list[Span]) -> list[Span]:
    """Spans in order, those that touch made one.

    >>> joined([(5.0, 9.0), (0.0, 5.0)])
    [(0.0, 9.0)]
    """
    out: list[Span] = []
    for a, b in sorted(spans):
        if out and a <= out[-1][1] + 1e-6:
            out[-1] = (out[-1][0], max(out[-1][1], b))
        else:
            out.append((a, b))
    return out


def concluded(d: FlightDiagnosis) -> list[Panel]:
    """Scores, residuals and estimates of every diagnoser that ran."""
    out: list[Panel] = []
    for r in ordered(d):
        if r.run is None or not len(r.run.t_s):
            continue
        if len(r.run.diagnoser.hypotheses) > 1:
            out += [scores(r.run), *estimates(d, r, r.run)]
        else:
            out.append(residuals(r.run))
    return out


def scores(r: Run) -> Panel:
    """How well each fault explains the flight, against the alarm."""
    level = alarm_level(r)
    traces = tuple(
        line(hypothesis_text(h), *_with_breaks(r, r.verdict.score[:, i + 1]), str(i + 1))
        for i, h in enumerate(r.diagnoser.hypotheses[1:])
    )
    levels = ((level, "alarm"),) if level else ()
    return Panel(f"{r.diagnoser.name}: score of each explanation", "", traces, levels, 0.0, 1.1 * (level or 1.0),
                 "log likelihood of a fault over that of the healthy aircraft, summed up")  # fmt: skip


def residuals(r: Run) -> Panel:
    """Residuals as shares of their thresholds."""
    with np.errstate(invalid="ignore", divide="ignore"):
        share = r.verdict.residual / r.verdict.threshold
    traces = tuple(
        line(AXES.get(n, n), *_with_breaks(r, share[:, i]), str(i + 1))
        for i, n in enumerate(r.diagnoser.residuals)
    )
    note = "explained minus measured rate, low-passed; 1 is the threshold calibrated on healthy flight"
    levels = ((1.0, "alarm"), (-1.0, ""))
    return Panel(f"{r.diagnoser.name}: residual over threshold", "", traces, levels, -1.1, 1.1, note)


def estimates(d: FlightDiagnosis, result: Result, r: Run) -> list[Panel]:
    """The size of every fault that an event names, with its 95 % interval, and the truth where the log holds it."""
    named = {(e["fault"], e["mode"], e.get("group")) for e in result.events if e["event"] == "isolated"}
    out = []
    for i, h in enumerate(r.diagnoser.hypotheses):
        if (h.fault, h.mode, h.group) not in named:
            continue
        factor = _factor(h.unit if h.mode != LOSS else "1")
        t, value = _with_breaks(r, factor * r.verdict.estimate[:, i])
        _, spread = _with_breaks(r, factor * BAND * r.verdict.estimate_std[:, i])
        band = Trace("95 % interval", t, value - spread, value + spread, "band")
        curves = (band, line("estimate", t, value, "1"), *_beside(d, h.fault, h.mode, factor))
        if h.mode == LOSS:
            out.append(
                Panel(
                    f"{hypothesis_text(h)}: effect left",
                    "%",
                    curves,
                    ((100.0, "healthy"), (0.0, "")),
                    0.0,
                    105.0,
                )
            )
        else:
            out.append(Panel(f"{hypothesis_text(h)}: position", _readable(h.unit), curves))
    return out


def _beside(d: FlightDiagnosis, surface: str, mode: str, factor: float) -> list[Trace]:
    """What the surface was asked, and what it really did where a log or a simulation knows."""
    out = []
    flight = d.flight
    channel, sign = _command(d, surface)
    if mode == STUCK and channel in flight.measured:
        out.append(_series("asked", flight.measured[channel], sign * factor, "reference", step=True))
    true = (
        flight.output.get(channel, flight.truth.get(f"surface.{surface}"))
        if mode == STUCK
        else flight.truth.get(f"gain.{surface}")
    )
    if true is not None:
        out.append(_series("truth (no diagnoser sees it)", true, sign * factor, "truth", step=True))
    return out


def _command(d: FlightDiagnosis, surface: str) -> tuple[str, float]:
    """(channel, sign) of a surface's command; for a group that of its first member, which all others follow."""
    for g in d.model.groups if d.model else ():
        if g.name == surface:
            return g.channels[0], math.copysign(1.0, g.weights[0])
    return f"command.{surface}", 1.0


def _with_breaks(r: Run, value: Array) -> tuple[Array, Array]:
    """(t, value) with NaN where nothing was judged and at the start of every span."""
    shown = np.where(r.verdict.status == Status.OK, value, np.nan)
    at = [b for b in r.breaks if 0 < b < len(r.t_s)]
    return np.insert(r.t_s, at, r.t_s[at]), np.insert(shown, at, np.nan)


def _series(name: str, s: Series, factor: float, role: str, step: bool = False) -> Trace:
    return line(name, np.asarray(s.t_s, float), factor * np.asarray(s.value, float), role, step)


def _factor(unit: str) -> float:
    return DEG if unit == "rad" else 100.0


def _readable(unit: str) -> str:
    return "deg" if unit == "rad" else "%"
