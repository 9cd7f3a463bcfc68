"""What the README says of real flights, measured again: needs AEROFDI_DATA. Peers are the truth or the goal."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from aerofdi.pipeline import FlightDiagnosis, diagnose


def run() -> dict:
    """One entry a number."""
    root = os.environ.get("AEROFDI_DATA")
    if not root:
        print("real_flights needs AEROFDI_DATA; skipped", file=sys.stderr)
        return {}
    flights = Path(root) / "flights"
    parts = (_elevon, _thor, _wing, _alfa, _sitl)
    return {f"real_flights {k}": v for part in parts for k, v in part(flights).items()}


def _entry(ours: float, unit: str, goal: float | None = None, note: str = "") -> dict:
    peers = (
        {}
        if goal is None
        else {"truth or goal": {"value": goal, "ratio": ours / goal if goal else float("nan")}}
    )
    return {"ours": float(ours), "unit": unit, "peers": peers, "conditions": note}


def _events(d: FlightDiagnosis, kind: str, name: str = "effectiveness") -> list[dict]:
    return [e for r in d.results if r.diagnoser == name for e in r.events if e["event"] == kind]


def _run(d: FlightDiagnosis):
    return next(r.run for r in d.results if r.diagnoser == "effectiveness")


def _us(d: FlightDiagnosis, t0: float, t1: float) -> float:
    r, servo = _run(d), d.flight.meta["servos"]["elevon_right"]
    names = [(h.fault, h.mode) for h in r.diagnoser.hypotheses]
    now = (r.t_s > t0) & (r.t_s < t1)
    estimate = np.nanmedian(r.verdict.estimate[now, names.index(("elevon_right", "stuck"))])
    return servo["neutral_us"] + servo["us_per_unit"] * float(estimate)


def _elevon(flights: Path) -> dict:
    log = next((flights / "enac_elevon_2017").glob("*.data"))
    d = diagnose([log], healthy="2739:2790", judge_span="2790:2820")[0]
    first, named = _events(d, "detected")[0], _events(d, "isolated")[0]
    return {
        "elevon delay": _entry(first["t_s"] - 2813.1, "s", 2.0, f"named {named['fault']} {named['mode']}"),
        "elevon first position": _entry(_us(d, 2813.5, 2815.1), "us", 1416.0),
        "elevon second position": _entry(
            _us(d, 2815.3, 2815.9), "us", 1492.0, "airspeed not measured, diving"
        ),
    }


def _thor(flights: Path) -> dict:
    log = next((flights / "umn_thor_flt75").glob("*.mat"))
    d = diagnose([log], healthy="234.6:384", judge_span="384:533")[0]
    fit = {a.rate: a for a in d.model.axes}
    return {
        "thor roll R2": _entry(fit["p"].r2, "1", 0.5, f"held out {fit['p'].r2_held_out:.2f}"),
        "thor pitch R2": _entry(fit["q"].r2, "1", 0.35, f"held out {fit['q'].r2_held_out:.2f}"),
        "thor delay and lag": _entry(1e3 * (d.model.delay_s + d.model.lag_s), "ms"),
        "thor alarms": _entry(len(_events(d, "detected")), "alarms", None, "149 s of healthy flight"),
    }


def _wing(flights: Path) -> dict:
    d = diagnose([next((flights / "enac_daredevil_2020").glob("*.csv.gz"))], healthy="180:350")[0]
    r = _run(d)
    gain = {s: d.flight.truth[f"gain.{s}"] for s in ("elevon_left", "elevon_right")}
    left = np.array([h.fault == "elevon_left" for h in r.diagnoser.hypotheses])
    delays, errors, wrong = [], [], 0.0
    for side, s in gain.items():
        edges = np.flatnonzero(np.diff(s.value) != 0) + 1
        for i, j in zip(edges, [*edges[1:], len(s.t_s) - 1], strict=True):
            a, b, g = s.t_s[i], s.t_s[j], s.value[i]
            now = (r.t_s >= a) & (r.t_s < b)
            called = r.verdict.active[now][:, left].any(axis=1)
            if side == "elevon_right" and g < 1:
                wrong += float(called.sum()) * r.diagnoser.dt_s
            elif g == 0.3 and a < 1400:
                delays.append(r.t_s[now][called.argmax()] - a if called.any() else np.inf)
            elif side == "elevon_left" and a > 1400 and 0.25 < g < 0.75:
                late = (r.t_s > a + 15) & (r.t_s < b - 1)
                if np.isfinite(r.verdict.estimate[late, 1]).any():
                    errors.append(abs(np.nanmean(r.verdict.estimate[late, 1]) - g))
    healthy = [
        e for e in _events(d, "detected")
        if e["t_s"] < 2440 and all(np.interp(e["t_s"] + np.array([-0.5, 0.5]), s.t_s, s.value).min() == 1.0
                                   for s in gain.values())
    ]  # fmt: skip
    return {
        "wing slowest strong left loss": _entry(max(delays), "s", 5.0, f"{len(delays)} episodes"),
        "wing right losses called left": _entry(wrong, "s"),
        "wing staircase error": _entry(
            float(np.mean(errors)), "1", 0.15, f"mean absolute, {len(errors)} steps"
        ),
        "wing new alarms in healthy spans": _entry(len(healthy), "alarms", 1.0),
    }


def _top(d: FlightDiagnosis) -> float:
    """Highest effectiveness score of the judged flight."""
    score = _run(d).verdict.score
    return float(np.nanmax(score)) if np.isfinite(score).any() else 0.0


def _alfa(flights: Path) -> dict:
    out, weakest = {}, np.inf
    for name in ("2018-10-05-14-37-22_2", "2018-10-05-14-37-22_3"):
        d = diagnose([next((flights / "alfa").glob(f"*{name}*"))])[0]
        weakest = min(weakest, _top(d))
        s = d.flight.truth["failure.aileron"]
        start = s.t_s[(s.value != 0).argmax()]
        named = _events(d, "isolated")[0]
        note = (
            f"{named['fault']} {named['mode']}, {named['estimate']:.2f} +- {named['estimate_std']:.2f} left"
        )
        out[f"alfa {name[-4:]} delay"] = _entry(_events(d, "detected")[0]["t_s"] - start, "s", 15.0, note)
    quiet = diagnose(sorted((flights / "alfa").glob("*no_failure")))
    out["alfa no failure called fault"] = _entry(sum(d.verdict == "fault" for d in quiet), "flights", None,
                                                 f"{len(quiet)} flights, effectiveness judged "
                                                 f"{sum(_result(d) == 'healthy' for d in quiet)}")  # fmt: skip
    liveliest = max(_top(d) for d in quiet)
    out["alfa score of the weaker fault"] = _entry(
        weakest, "1", None, f"alarm at 12; liveliest healthy flight {liveliest:.1f}"
    )
    engines = diagnose(sorted((flights / "alfa").glob("*engine_failure*")))
    surface = sum(any(e["fault"] for r in d.results for e in r.events) for d in engines)
    alarms = sum(any(r.diagnoser == "parity" and r.verdict == "fault" for r in d.results) for d in engines)
    note = f"{len(engines)} flights; parity alarms in {alarms}"
    out["alfa engine failures called a surface"] = _entry(surface, "flights", None, note)
    return out


def _result(d: FlightDiagnosis) -> str:
    return next(r.verdict for r in d.results if r.diagnoser == "effectiveness")


def _sitl(flights: Path) -> dict:
    folder = flights / "arduplane_sitl"
    stuck = diagnose([folder / "aerosonde_stuck_left_aileron.BIN"])[0]
    named = next(e for e in _events(stuck, "isolated") if e["mode"] == "stuck")
    quiet = diagnose([folder / "healthy.tlog"])[0]
    both = diagnose([folder / f"right_aileron_gain03.{x}" for x in ("BIN", "tlog")])
    t = [_events(d, "isolated")[0] for d in both]
    note = "; ".join(f"{e['fault']} {e['mode']} {e['estimate']:.2f} at {e['t_s']:.1f} s" for e in t)
    return {
        "sitl stuck aileron delay": _entry(_events(stuck, "detected")[0]["t_s"] - 86.84, "s", 10.0),
        "sitl stuck aileron named stuck after": _entry(named["t_s"] - 86.84, "s", 10.0, named["fault"]),
        "sitl healthy alarms": _entry(len(_events(quiet, "detected")), "alarms"),
        "sitl two logs differ by": _entry(abs(t[0]["t_s"] - t[1]["t_s"]), "s", 1.0, note),
    }
