"""What happened when, as rows of a timeline: modes, what was learnt from and judged, what each diagnoser said."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.types import Flight, Status
from ..pipeline.spans import without
from ..pipeline.types import FlightDiagnosis, Run, Span
from .words import hypothesis_text, ordered

Stretch = list[Any]  # t0, t1, state, text


def timeline(d: FlightDiagnosis) -> list[dict[str, Any]]:
    """Rows {"name", "stretches": [[t0, t1, state, text], ...]} from top to bottom."""
    rows = [{"name": "mode", "stretches": modes(d.flight)}, {"name": "use", "stretches": use(d)}]
    for r in ordered(d):
        if r.run is not None:
            rows.append({"name": r.diagnoser, "stretches": states(r.run)})
    return [row for row in rows if row["stretches"]]


def modes(flight: Flight) -> list[Stretch]:
    """Autopilot modes; those under autopilot apart from the rest."""
    series = flight.measured.get("mode")
    if series is None or not len(series.t_s):
        return []
    codes, auto = series.codes or {}, set(flight.meta.get("autopilot_modes", ()))
    value = np.asarray(series.value)
    at = np.flatnonzero(np.concatenate(([True], np.diff(value) != 0)))
    ends = [*series.t_s[at[1:]].tolist(), flight.span_s[1]]
    out = []
    for k, end in zip(at, ends, strict=True):
        if np.isfinite(value[k]):
            name = codes.get(int(value[k]), f"mode {value[k]:g}")
            out.append(
                [float(series.t_s[k]), float(end), "auto" if name in auto or not auto else "manual", name]
            )
    return out


def use(d: FlightDiagnosis) -> list[Stretch]:
    """Trained, judged, and what neither was, with why."""
    out = [[a, b, "trained", "learnt from, never counted as healthy"] for a, b in d.trained]
    out += [[a, b, "judged", "judged"] for a, b in d.judged]
    out += [[a, b, "unjudged", why] for a, b, why in unjudged(d)]
    return sorted(out)


def unjudged(d: FlightDiagnosis) -> list[tuple[float, float, str]]:
    """(t0, t1, why) of all time neither learnt from nor judged."""
    rest = without([d.flight.span_s], [*d.trained, *d.judged])
    grounded = without(rest, d.flown)
    out = [(a, b, "not flown under autopilot with moving commands") for a, b in grounded]
    out += [(a, b, "outside what was asked to be judged") for a, b in without(rest, grounded)]
    return sorted(out)


def marks(d: FlightDiagnosis) -> list[dict[str, Any]]:
    """Instants {"t", "text", "kind"}; kind: alarm, or truth where the log or a simulation tells when a fault began."""
    out = []
    for r in d.results:
        first = next((e for e in r.events if e["event"] == "detected"), None)
        if first:
            out.append({"t": first["t_s"], "text": f"{r.diagnoser}: alarm", "kind": "alarm"})
    out += [
        {"t": e.t_s, "text": f"truth: {e.text}", "kind": "truth"}
        for e in d.flight.events
        if e.kind == "fault"
    ]
    for name, s in d.flight.truth.items():
        if name.startswith("failure.") and (np.asarray(s.value) != 0).any():
            t = float(s.t_s[int(np.argmax(np.asarray(s.value) != 0))])
            out.append({"t": t, "text": f"truth: {name}", "kind": "truth"})
    return sorted(out, key=lambda m: m["t"])


def windows(d: FlightDiagnosis, half_s: float) -> list[Span]:
    """Spans around the first alarm of each diagnoser, to be kept sample by sample."""
    return [(m["t"] - half_s, m["t"] + half_s) for m in marks(d) if m["kind"] == "alarm"]


def states(r: Run) -> list[list[Any]]:
    """[t0, t1, state, text] of each stretch of a run: silent, alarm, named, or a status."""
    v = r.verdict
    named = v.active[:, 1:]
    which = (
        (named.argmax(axis=1) + 1) * named.any(axis=1) if named.shape[1] else np.zeros(len(named), dtype=int)
    )
    code = np.where(v.status != Status.OK, -v.status, np.where(v.detected, 1 + which, 0)).astype(int)
    cut = np.zeros(len(code), dtype=bool)
    cut[[b for b in r.breaks if b < len(code)]] = True
    cut[1:] |= np.diff(code) != 0
    at = np.flatnonzero(cut)
    ends = np.append(at[1:], len(code)) - 1
    return [
        [float(r.t_s[i]), float(r.t_s[j] + r.diagnoser.dt_s), *_state(r, int(code[i]))]
        for i, j in zip(at, ends)
    ]


def _state(r: Run, code: int) -> tuple[str, str]:
    if code < 0:
        return "waiting", f"{Status(-code).name}: {Status(-code).text}"
    if code == 0:
        return "silent", "judged: no alarm"
    if code == 1:
        return "alarm", "alarm, not isolated"
    return "named", hypothesis_text(r.diagnoser.hypotheses[code - 1])
