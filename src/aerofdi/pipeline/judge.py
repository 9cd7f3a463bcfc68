"""Running a diagnoser over judged spans and saying in events and words what it found."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..aircraft.identified import IdentifiedModel
from ..core.bind import bind
from ..core.run import empty_verdict, run
from ..core.types import Diagnoser, Flight, Hypothesis, Status, Verdict
from .types import Result, Run, Span

JUDGED_SHARE = 0.5
STABLE_S = 1.0
WINDOW_S = 60.0


def judge(
    d: Diagnoser, flight: Flight, spans: list[Span], model: IdentifiedModel, warm_up: list[Span] | None = None
) -> Result:
    """One diagnoser over the judged spans of one flight.

    A span that follows on flown time is warmed up on the seconds before it, which are not judged.
    """
    joined, states = _run(d, flight, spans, warm_up or [])
    ok = joined.verdict.status == Status.OK
    share = float(np.mean(ok)) if len(ok) else 0.0
    smallest = minimum_detectable(d, states, model, float(np.sum(ok)) * d.dt_s)
    found = events(joined)
    if found:
        return Result(d.name, "fault", _fault_reason(d, found), smallest, found, joined)
    if share < JUDGED_SHARE:
        return Result(d.name, "cannot_judge", _silent_reason(d, joined.verdict, share), smallest, [], joined)
    if _blind(d, smallest, model):
        reason = (
            "too little excitation: the commands moved so little that even a loss of 100 % might stay unseen; "
            "judge a longer or livelier part of the flight"
            if d.name == "effectiveness"
            else "the model fits the training so loosely that not even a full deflection of a surface would pass a "
            "threshold; learn from a longer or livelier part of the flight"
        )
        return Result(d.name, "cannot_judge", reason, smallest, [], joined)
    return Result(d.name, "healthy", _healthy_reason(d, smallest, share), smallest, [], joined)


def _run(d: Diagnoser, flight: Flight, spans: list[Span], flown: list[Span]) -> tuple[Run, list[Any]]:
    """Every span run from a fresh start; the final state of each."""
    times, inputs, verdicts, breaks, states, n = [], [], [], [], [], 0
    for a, b in spans:
        before = max((x for x, y in flown if x <= a <= y), default=a)
        start = max(before, a - 2.0 * d.settle_s - 1.0)
        # Stay on the grid of the span so that the first judged sample is at its start.
        start = a - d.dt_s * math.floor((a - start) / d.dt_s)
        sample = bind(flight, d.inputs, d.dt_s, start, b, who=d.name)
        state, verdict = run(d, sample)
        states.append(state)
        use = sample.t_s >= a - 1e-9
        times.append(sample.t_s[use])
        inputs.append(sample.z[use])
        verdicts.append(Verdict(*(field[use] for field in verdict)))
        breaks.append(n)
        n += int(np.sum(use))
    if not times:
        return Run(d, np.zeros(0), np.zeros((0, len(d.inputs.names))), empty_verdict(d, 0), ()), states
    joined = Verdict(*(np.concatenate(f) for f in zip(*verdicts, strict=True)))
    return Run(d, np.concatenate(times), np.concatenate(inputs), joined, tuple(breaks)), states


def events(r: Run) -> list[dict[str, Any]]:
    """detected, isolated (each time another fault or mode has held for 1 s, stamped then), cleared.

    Where nothing is judged for a while (a gap) an alarm neither ends nor begins; one that stands at the end of a
    span is not called cleared.
    """
    out: list[dict[str, Any]] = []
    active, d = _active(r), r.diagnoser
    stable = max(1, round(STABLE_S / d.dt_s))
    named = -1
    for k in map(int, np.flatnonzero(np.diff(np.concatenate(([-1], active))) != 0)):
        was = active[k - 1] if k else -1
        now = int(active[k])
        if was < 0 and now >= 0:
            out.append(_event(r, k, "detected", None))
            named = 0
        if now > 0 and now != named and _lasts(active, k, stable):
            out.append(_event(r, k + stable - 1, "isolated", now))
            named = now
        if now < 0 <= was and k not in r.breaks:
            out.append(_event(r, k, "cleared", named if named > 0 else None))
    return out


def _active(r: Run) -> np.ndarray:
    """(n,) -1 without alarm, 0 alarm without a name, else the hypothesis; held while nothing is judged."""
    v = r.verdict
    said = np.where(v.detected, v.active.argmax(axis=1) * v.active.any(axis=1), -1)
    known = v.status == Status.OK
    known[[b for b in r.breaks if b < len(known)]] = True
    return said[np.maximum.accumulate(np.where(known, np.arange(len(said)), 0))]


def _lasts(active: np.ndarray, k: int, stable: int) -> bool:
    ahead = active[k : k + stable]
    return len(ahead) == stable and bool((ahead == active[k]).all())


def _event(r: Run, k: int, kind: str, hypothesis: int | None) -> dict[str, Any]:
    entry: dict[str, Any] = {"t_s": round(float(r.t_s[k]), 3), "event": kind}
    if hypothesis is None:
        return entry | {"fault": None, "mode": None, "estimate": None, "estimate_std": None, "unit": None}
    h = r.diagnoser.hypotheses[hypothesis]
    at = slice(k, _end(r, k, hypothesis)) if kind == "isolated" else slice(k - 1, k)
    estimate = _median(r.verdict.estimate[at, hypothesis])
    std = _median(r.verdict.estimate_std[at, hypothesis])
    return entry | {
        "fault": h.fault,
        "mode": h.mode,
        "group": h.group,
        "estimate": None if math.isnan(estimate) else round(float(estimate), 4),
        "estimate_std": None if math.isnan(std) else round(float(std), 4),
        "unit": h.unit,
    }


def _end(r: Run, k: int, hypothesis: int) -> int:
    """Where this isolation ends, at most 20 s on: the estimate of an event is its median until then."""
    active = r.verdict.active[k : k + round(20.0 / r.diagnoser.dt_s), hypothesis]
    return k + (len(active) if active.all() else max(int(np.argmin(active)), 1))


def _median(values: np.ndarray) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else math.nan


def minimum_detectable(
    d: Diagnoser, states: list[Any], model: IdentifiedModel, judged_s: float
) -> dict[str, float]:
    """The smallest fault these data would have shown; states: the final one of every judged span.

    effectiveness: the share of a group's effectiveness whose expected score reaches the alarm within a minute of
    the excitation seen, plus what model error may hide. parity: the lasting surface offset that drives the rate
    residual of any axis to its threshold, in the unit of the command.
    """
    if d.name == "effectiveness":
        from ..diagnosers.effectiveness_types import INFO_TIME, REACH

        seen = sum(float(s.scalars[INFO_TIME]) for s in states)
        if seen <= 0:
            return {}
        window = min(judged_s, WINDOW_S)
        out = {}
        for j, g in enumerate(model.groups):
            if not g.identifiable:
                continue
            information = sum(float(s.information[j]) for s in states) / seen * window
            blind = REACH * d.params.nuisance_spread[1 + j]
            loss = blind + math.sqrt(2.0 * d.params.alarm / max(information, 1e-9))
            out[f"{g.name} loss_of_effectiveness"] = round(float(loss), 3)
        return out
    out = {}
    for g in model.groups:
        sizes = [
            float(threshold) * abs(a.coefficient(a.rate)) / abs(a.coefficient(f"command.{g.name}"))
            for a, threshold in zip(model.axes, d.params.threshold, strict=True)
            if a.coefficient(f"command.{g.name}") != 0.0
        ]
        if g.identifiable and sizes:
            out[f"{g.name} offset"] = round(float(min(sizes)), 4)
    return out


def _blind(d: Diagnoser, smallest: dict[str, float], model: IdentifiedModel) -> bool:
    """Whether no fault of any size would have shown: a loss above one, an offset beyond the surface's range."""
    whole = {g.name: 1.0 if d.name == "effectiveness" else 0.5 * (g.upper - g.lower) for g in model.groups}
    return all(size > whole[key.rpartition(" ")[0]] for key, size in smallest.items())


def describe_estimate(h: Hypothesis, estimate: float | None, std: float | None) -> str:
    """An estimate in words, with its unit as people read it."""
    if estimate is None or std is None:
        return "size not known yet"
    if h.mode == "loss_of_effectiveness":
        return f"{100 * estimate:.0f} % +- {100 * std:.0f} % of its effect is left"
    if h.unit == "rad":
        return f"position {math.degrees(estimate):.1f} +- {math.degrees(std):.1f} deg"
    return f"position {100 * estimate:.0f} % +- {100 * std:.0f} % of full command"


def _fault_reason(d: Diagnoser, found: list[dict[str, Any]]) -> str:
    first = found[0]
    named = [e for e in found if e["event"] == "isolated"]
    if not named:
        return f"alarm at {first['t_s']:.1f} s; which surface is not isolable from these data"
    e = named[0]
    h = Hypothesis(e["fault"], e["mode"], e["unit"], e["group"])
    text = describe_estimate(h, e["estimate"], e["estimate_std"])
    part = f" ({h.group.split(':')[1].replace('of', ' of ')} surfaces)" if ":" in h.group else ""
    return f"{e['fault']}{part} {e['mode'].replace('_', ' ')} from {first['t_s']:.1f} s: {text}"


def _silent_reason(d: Diagnoser, v: Verdict, share: float) -> str:
    status = v.status[v.status != Status.OK]
    if not len(status):
        return "there is nothing left to judge; give a span with --judge T0:T1"
    common = Status(int(np.bincount(status).argmax()))
    return f"could judge only {100 * share:.0f} % of the span; mostly {common.name}: {common.text}"


def _healthy_reason(d: Diagnoser, smallest: dict[str, float], share: float) -> str:
    if d.name == "effectiveness":
        seen = ", ".join(f"{k.split()[0]} {100 * v:.0f} %" for k, v in smallest.items() if v <= 1.0)
        blind = ", ".join(k.split()[0] for k, v in smallest.items() if v > 1.0)
        return (
            f"no loss, no stuck surface; would have seen a loss of {seen} ({100 * share:.0f} % of the span judged)"
            + (f"; {blind} moved too little: not even a total loss would have shown" if blind else "")
        )
    seen = ", ".join(f"{k.split()[0]} {v:.3g}" for k, v in smallest.items())
    return (
        f"rates follow the commands; would have seen a lasting offset of {seen} ({100 * share:.0f} % judged)"
    )


Progress = Callable[[str], None]
