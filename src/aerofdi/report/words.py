"""Verdicts in words and in the units people read; the terminal and the page both speak through here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..aircraft.identified import IdentifiedModel
from ..core.types import Flight, Hypothesis, Status
from ..pipeline.types import FlightDiagnosis, Result, Run, Span

SIDES = ("left", "right", "top", "bottom", "inner", "outer")
VERDICTS = {"fault": "FAULT", "healthy": "healthy", "cannot_judge": "cannot judge"}
AXES = {"p": "roll", "q": "pitch", "r": "yaw"}
# A surface named for less than this share of the longest time does not make the headline.
SLIGHT = 0.1
LOSS, STUCK = "loss_of_effectiveness", "stuck"


class Headline(NamedTuple):
    """verdict: fault, healthy or cannot_judge. title: a few words. detail: one or two sentences."""

    verdict: str
    title: str
    detail: str


def spoken(name: str, aliases: Mapping[str, str] | None = None) -> str:
    """A surface or group as a person says it, with the name its own aircraft uses where that differs.

    >>> spoken("elevon_right", {"elevon_right": "elevon B"})
    'right elevon (elevon B)'
    >>> spoken("aileron_servo1")
    'aileron (servo 1)'
    """
    kind, _, rest = name.partition("_")
    if rest in SIDES:
        text = f"{rest} {kind}"
    elif rest.startswith("servo") and rest[5:].isdigit():
        text = f"{kind} (servo {rest[5:]})"
    else:
        text = name.replace("_", " ")
    alias = (aliases or {}).get(name)
    return f"{text} ({alias})" if alias else text


def capital(text: str) -> str:
    """The text with its first letter large, the rest as it is; names of channels and options stay untouched.

    >>> capital("roll"), capital("command.rudder moved")
    ('Roll', 'command.rudder moved')
    """
    first = text.partition(" ")[0].rstrip(",.:;")
    return text if any(c in first for c in "._-/") else text[:1].upper() + text[1:]


def spans_text(spans: Iterable[Span]) -> str:
    """'2739.0-2790.0 s, 2795.0-2820.0 s', or 'none'."""
    return ", ".join(f"{a:.1f}-{b:.1f} s" for a, b in spans) or "none"


def length(spans: Iterable[Span]) -> float:
    """Total length of spans, s."""
    return float(sum(b - a for a, b in spans))


def number(x: float, digits: int = 3) -> str:
    """A number with `digits` significant digits, no exponent between 0.001 and 100000.

    >>> number(1234.5678), number(0.0123456)
    ('1235', '0.0123')
    """
    if x == 0 or not math.isfinite(x):
        return f"{x:g}"
    if not 1e-3 <= abs(x) < 1e5:
        return f"{x:.{digits - 1}e}"
    places = max(digits - 1 - math.floor(math.log10(abs(x))), 0)
    return f"{x:.{places}f}"


def plus_minus(value: float, std: float, unit: str, factor: float = 1.0) -> str:
    """'12.30 ± 0.41 deg': both with the decimals that two digits of the deviation ask for."""
    v, s = factor * value, factor * std
    if not math.isfinite(s) or s <= 0:
        return f"{number(v, 2)} {unit}"
    places = min(max(1 - math.floor(math.log10(s)), 0), 6)
    return f"{v:.{places}f} ± {s:.{places}f} {unit}"


def pulse(
    surface: str, value: float, flight: Flight, model: IdentifiedModel | None
) -> tuple[float, float] | None:
    """(servo pulse in µs, µs per unit of command) at a command of a surface or group, where the log knows the servo.

    A group answers only where all its servos agree; they do not where sides are mirrored.
    """
    servos = flight.meta.get("servos") or {}
    members = [(surface, 1.0)]
    for g in model.groups if model else ():
        if g.name == surface:
            members = [
                (c.removeprefix("command."), math.copysign(1.0, w)) for c, w in zip(g.channels, g.weights)
            ]
    found = set()
    for name, sign in members:
        s = servos.get(name)
        if not s:
            return None
        side = "us_per_unit_negative" if sign * value < 0 and "us_per_unit_negative" in s else "us_per_unit"
        slope = sign * float(s[side])
        found.add((round(float(s["neutral_us"]) + slope * value, 1), abs(slope)))
    return found.pop() if len(found) == 1 else None


def deflection(
    surface: str, value: float, std: float | None, unit: str, flight: Flight, model: IdentifiedModel | None
) -> str:
    """A position of a surface: degrees, or per cent of full command and the servo pulse where it is known."""
    if unit == "rad":
        return _measure(value, std, "deg", 180.0 / math.pi)
    text = _measure(value, std, "% of full command", 100.0)
    at = pulse(surface, value, flight, model)
    if at is None:
        return text
    spread = f" ± {at[1] * std:.0f}" if std is not None and math.isfinite(std) else ""
    return f"{at[0]:.0f}{spread} µs ({text})"


def _measure(value: float, std: float | None, unit: str, factor: float) -> str:
    return plus_minus(value, math.nan if std is None else std, unit, factor)


def finding(event: Mapping[str, Any], d: FlightDiagnosis, brief: bool = False) -> str:
    """What an `isolated` event says: 'right elevon (elevon B) stuck at 1421 ± 84 µs (1 ± 17 % of full command)'.

    brief: without interval and second unit, 'right elevon (elevon B) stuck at 1421 µs'.
    """
    what = " ".join(_who_and_how(event, d))
    value, std = event.get("estimate"), None if brief else event.get("estimate_std")
    if value is None:
        return what
    if event["mode"] == LOSS:
        return f"{what}, {_measure(value, std, '%', 100.0)} of its effect left"
    at = deflection(event["fault"], value, std, event["unit"], d.flight, d.model)
    return f"{what} at {at.partition(' (')[0] if brief else at}"


def _who_and_how(event: Mapping[str, Any], d: FlightDiagnosis) -> tuple[str, str]:
    who = spoken(event["fault"], d.flight.meta.get("aliases"))
    group = str(event.get("group") or "")
    if ":" in group:
        who = f"{group.split(':')[1].replace('of', ' of ')} {who} surfaces"
    return who, event["mode"].replace("_", " ")


def event_text(event: Mapping[str, Any], d: FlightDiagnosis) -> str:
    """One event as a line of a table."""
    if event["event"] == "detected":
        return "alarm"
    if event["event"] == "isolated":
        return finding(event, d)
    return "alarm over"


def hypothesis_text(h: Hypothesis) -> str:
    """'aileron stuck', '1 of 2 aileron stuck'."""
    part = h.group.split(":")[1].replace("of", " of ") + " " if ":" in h.group else ""
    mode = "loss" if h.mode == LOSS else h.mode.replace("_", " ")
    return f"{part}{spoken(h.fault)} {mode}"


def headline(d: FlightDiagnosis) -> Headline:
    """The verdict on a flight: what, where, when, how much; or what was not seen; or why nothing can be said."""
    if d.verdict == "fault":
        return _fault(d)
    if d.verdict == "healthy":
        judged = length(d.judged)
        return Headline("healthy", "No surface fault found", f"{judged:.0f} s judged. {unseen(d)}")
    said = dict.fromkeys(reason(r, d) for r in d.results)
    return Headline("cannot_judge", "Could not be judged", " ".join(capital(text) + "." for text in said))


def reason(r: Result, d: FlightDiagnosis) -> str:
    """What a result says in one sentence, in readable units, without the name of the flight before it."""
    if r.verdict == "healthy" and r.run is not None:
        seconds = r.run.diagnoser.dt_s * float(np.sum(r.run.verdict.status == Status.OK))
        smallest = "; ".join(text for _, text, _ in detectable(r, d)) or "not known"
        return f"no alarm in {seconds:.0f} s judged; would have been seen: {smallest}"
    if r.verdict != "fault":
        text = r.reason
        for name in (d.file, d.flight.name):
            text = text.removeprefix(f"{name}: ")
        return text
    onset = next(e["t_s"] for e in r.events if e["event"] == "detected")
    said = "; ".join(finding(n.event, d) for n in named([r]))
    return f"alarm at {onset:.1f} s{': ' + said if said else '; which surface is the cause cannot be told'}"


class Named(NamedTuple):
    """A surface an alarm named: the event that first named its standing explanation, and for how long that held, s."""

    event: Mapping[str, Any]
    held_s: float


def named(results: Iterable[Result]) -> list[Named]:
    """Every surface that was named, with the explanation that held longest; in order of time, slight ones left out."""
    best: dict[str, Named] = {}
    for r in results:
        for e in r.events:
            if e["event"] != "isolated":
                continue
            seconds = held(r, e)
            if e["fault"] not in best or seconds > best[e["fault"]].held_s:
                best[e["fault"]] = Named(e, seconds)
    longest = max((n.held_s for n in best.values()), default=0.0)
    out = [n for n in best.values() if n.held_s >= SLIGHT * longest]
    return sorted(out, key=lambda n: n.event["t_s"])


def held(r: Result, event: Mapping[str, Any]) -> float:
    """For how long in all a run named what an event names, s."""
    if r.run is None:
        return 0.0
    same = [
        i for i, h in enumerate(r.run.diagnoser.hypotheses)
        if (h.fault, h.mode, h.group) == (event["fault"], event["mode"], event.get("group"))
    ]  # fmt: skip
    return r.run.diagnoser.dt_s * float(np.sum(r.run.verdict.active[:, same]))


def _fault(d: FlightDiagnosis) -> Headline:
    found = [r for r in d.results if r.verdict == "fault"]
    onset = min(e["t_s"] for r in found for e in r.events if e["event"] == "detected")
    surfaces = named(found)
    if not surfaces:
        who = ", ".join(r.diagnoser for r in found)
        return Headline(
            "fault",
            f"Alarm at {onset:.1f} s, surface not isolable",
            f"The aircraft stopped answering its commands as it did in training ({who}); "
            f"which surface is the cause cannot be told from these data.",
        )
    if len(surfaces) == 1:
        e = surfaces[0].event
        detail = f"Alarm at {onset:.1f} s, isolated at {e['t_s']:.1f} s: {finding(e, d)}."
        return Headline("fault", capital(finding(e, d, brief=True)), detail)
    title = "; ".join(f"{who} {mode}" for who, mode in (_who_and_how(n.event, d) for n in surfaces))
    said = [
        f"{finding(n.event, d)} (from {n.event['t_s']:.1f} s, for {n.held_s:.0f} s in all)" for n in surfaces
    ]
    return Headline("fault", capital(title), f"First alarm at {onset:.1f} s. {capital('; '.join(said))}.")


def unseen(d: FlightDiagnosis) -> str:
    """The smallest faults that would have been seen, as one sentence; empty where none is known."""
    said = [text for r in ordered(d) if r.verdict != "cannot_judge" for _, text, _ in detectable(r, d)]
    return "Would have been seen: " + "; ".join(said) + "." if said else ""


def detectable(r: Result, d: FlightDiagnosis) -> list[tuple[str, str, float]]:
    """(surface, text, share) of each smallest visible fault; share: 0 the best, 1 or more is blind."""
    out = []
    for key, value in r.minimum_detectable.items():
        name, _, mode = key.rpartition(" ")
        who = spoken(name)
        if mode == LOSS:
            text = (
                f"{who}: loss of {100 * value:.0f} % or more"
                if value <= 1
                else f"{who}: not even a total loss"
            )
            out.append((who, text, value))
            continue
        g = next((g for g in d.model.groups if g.name == name), None) if d.model else None
        unit = g.unit if g else "1"
        size = f"{math.degrees(value):.1f} deg" if unit == "rad" else f"{100 * value:.0f} % of full command"
        reach = 0.5 * (g.upper - g.lower) if g and g.upper > g.lower else 1.0
        text = (
            f"lasting offset of {size} or more" if value <= 2 * reach else "no lasting offset it could reach"
        )
        out.append((who, f"{who}: {text}", value / (2 * reach)))
    return out


def ordered(d: FlightDiagnosis) -> list[Result]:
    """Results, those that can name a surface first."""
    return sorted(d.results, key=lambda r: -len(r.run.diagnoser.hypotheses) if r.run else 0)


def evidence(r: Result, d: FlightDiagnosis) -> list[str]:
    """Why one diagnoser says what it says: silence before, what rose, how far, against what, what was not judged."""
    if r.run is None or not len(r.run.t_s):
        return [capital(reason(r, d)) + "."]
    run = r.run
    ok = run.verdict.status == Status.OK
    alarm = run.verdict.detected
    dt = run.diagnoser.dt_s
    first = int(np.argmax(alarm)) if alarm.any() else len(alarm)
    silent = dt * float(np.sum(ok[:first]))
    out = (
        [f"Silent through {silent:.1f} s of healthy-looking flight judged before the first alarm."]
        if alarm.any()
        else []
    )
    if len(run.diagnoser.hypotheses) > 1:
        out += _score_evidence(run, first)
    else:
        out += _residual_evidence(run, first)
    if r.verdict != "fault":
        out.append(capital(reason(r, d)) + ".")
    return out + not_judged(run)


def alarm_level(run: Run) -> float | None:
    """The score at which a diagnoser with scores raises its alarm."""
    level = getattr(run.diagnoser.params, "alarm", None)
    return None if level is None else float(level)


def _score_evidence(run: Run, first: int) -> list[str]:
    score = np.nan_to_num(run.verdict.score[:, 1:])
    if not score.size:
        return []
    names = [hypothesis_text(h) for h in run.diagnoser.hypotheses[1:]]
    level = alarm_level(run)
    limit = "" if level is None else f" {level:.1f}"
    if first >= len(score):
        best = int(score.max(axis=0).argmax())
        return [
            f"The highest score was {score.max():.1f} ({names[best]}, at {run.t_s[score[:, best].argmax()]:.1f} s); "
            f"the alarm level is{limit or ' not known'} (log likelihood against the healthy aircraft)."
        ]
    order = np.argsort(-score[first])
    others = ", ".join(f"{names[i]} {score[first, i]:.1f}" for i in order[1:4])
    out = [
        f"At {run.t_s[first]:.1f} s the score of '{names[order[0]]}' passed the alarm level{limit} "
        f"(log likelihood against the healthy aircraft)" + (f"; then stood: {others}." if others else ".")
    ]
    held = run.verdict.active[:, 1:].sum(axis=0) * run.diagnoser.dt_s
    if held.any():
        said = [f"{names[i]} {held[i]:.1f} s" for i in np.argsort(-held) if held[i] > 0]
        out.append("Named while the alarm stood: " + ", ".join(said) + ".")
    return out


def _residual_evidence(run: Run, first: int) -> list[str]:
    ratio = np.abs(run.verdict.residual) / run.verdict.threshold
    ratio[run.verdict.status != Status.OK] = np.nan
    if not np.isfinite(ratio).any():
        return []
    at, axis = np.unravel_index(int(np.nanargmax(ratio)), ratio.shape)
    name = AXES.get(run.diagnoser.residuals[axis], run.diagnoser.residuals[axis])
    limit = math.degrees(float(run.verdict.threshold[at, axis]))
    peak = (
        f"the {name} residual reached {ratio[at, axis]:.2f} times its threshold of {limit:.1f} deg/s "
        f"at {run.t_s[at]:.1f} s"
    )
    if first >= len(ratio):
        return [f"No residual passed its threshold: at most, {peak}."]
    crossing = int(np.nanargmax(ratio[first])) if np.isfinite(ratio[first]).any() else axis
    who = AXES.get(run.diagnoser.residuals[crossing], run.diagnoser.residuals[crossing])
    return [
        f"The {who} rate left what the commands explain at {run.t_s[first]:.1f} s; at most, {peak}. "
        f"A rate residual alone does not tell one surface from another."
    ]


def not_judged(run: Run) -> list[str]:
    """One sentence for each status other than OK that took at least a tenth of a second."""
    out = []
    status = run.verdict.status
    for s in Status:
        seconds = run.diagnoser.dt_s * float(np.sum(status == s))
        if s != Status.OK and seconds >= 0.1:
            out.append(f"{seconds:.1f} s were not judged ({s.name}): {s.text}.")
    return out
