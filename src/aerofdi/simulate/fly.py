"""One flight: run the prepared loop and turn its records into a Flight."""

from __future__ import annotations

import math
import os
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..aircraft import hash as aircraft_hash
from ..autopilot import guidance
from ..core.types import Array, Event, Flight, Series
from ..dynamics.actuators import actuator_state
from ..dynamics.faults import MODES, THROTTLE, fault_state
from ..dynamics.sensors import TRUE, sensor_offsets, sensor_state
from ..dynamics.wind import wind_state
from ..scenarios import Scenario, load_scenario
from .loop import AIR, Memory, Motion, Params, Record, advance
from .prepare import Prepared, prepare

WIND_UNITS = {
    "wind_north": "m/s", "wind_east": "m/s", "wind_down": "m/s",
    "wind_p": "rad/s", "wind_q": "rad/s", "wind_r": "rad/s",
}  # fmt: skip
MODE_CODES = {0: "auto", 1: "hold_level"}


class Run(NamedTuple):
    """One flight under way: its numbers, arrays and records. counts: samples each sensor takes."""

    prepared: Prepared
    params: Params
    memory: Memory
    record: Record
    counts: list[int]
    seed: int
    run: int


def as_scenario(scenario: str | os.PathLike[str] | Scenario) -> Scenario:
    """A Scenario from its name, its path, or itself."""
    return scenario if isinstance(scenario, Scenario) else load_scenario(scenario)


def start(prepared: Prepared, seed: int, run: int, truth: bool = True) -> tuple[Run, Motion]:
    """Fresh arrays for one flight; the motion before step 0."""
    p = prepared.params if truth else prepared.params._replace(record_every=0)
    sensors, counts = sensor_offsets(p.sensors, prepared.steps)
    p = p._replace(sensors=sensors)
    n = len(prepared.servos)
    faults, modified = fault_state(p.faults, n, len(counts))
    memory = Memory(
        wind_state(p.wind),
        actuator_state(p.actuators, p.trim, prepared.extra_delay),
        sensor_state(sensors, prepared.extra_delay),
        faults,
        modified,
        p.trim.copy(),
        np.zeros(n),
        np.zeros(n),
        np.zeros(len(TRUE)),
    )
    instants = -(-prepared.steps // p.control_every)
    rows = -(-prepared.steps // p.record_every) if p.record_every else 0
    columns = len(TRUE) + AIR + n + len(p.faults.rows)
    record = Record(
        np.full(sum(counts), np.nan),
        np.full((instants, n), np.nan),
        np.full((instants, 4), np.nan),
        np.full((rows, columns), np.nan),
    )
    return Run(prepared, p, memory, record, counts, seed, run), Motion(
        0, prepared.plant, prepared.pilot, guidance.init(p.plan)
    )


def fly(scenario: str | os.PathLike[str] | Scenario, seed: int | None = None, run: int = 0) -> Flight:
    """Fly a scenario (name, path or Scenario) once.

    seed: the scenario's unless given; run: number of the flight in a series of one seed. The same scenario,
    seed and run give the same flight, bit for bit. Where the motion diverges (beyond 10 km/s: a loss of
    control that no longer means anything) the flight ends there and an event says so.

    >>> flight = fly("demo", seed=7)
    >>> flight.measured["p"].unit
    'rad/s'
    """
    s = as_scenario(scenario)
    r, motion = start(prepare(s), s.seed if seed is None else seed, run)
    motion = advance(r.params, r.memory, r.record, motion, r.seed, r.run, r.prepared.steps, 0)
    return assemble(r, motion.k)


def stamps(steps: int, every: int, dt: float) -> Array:
    """Times of the instants 0, every, 2 every, ... below `steps`, s; exactly k * dt."""
    return np.asarray(np.arange(0, steps, every) * dt, np.float64)


def assemble(r: Run, flown: int, requests: Any = None) -> Flight:
    """The Flight of the first `flown` steps of a run. requests: (control instants,) HOLD_LEVEL or 0."""
    p, dt = r.params, r.params.dt
    clocks: dict[int, Array] = {}

    def clock(every: int) -> Array:
        if every not in clocks:
            clocks[every] = stamps(flown, every, dt)
        return clocks[every]

    measured = _readings(r, clock)
    t = clock(p.control_every)
    mode = np.zeros(len(t)) if requests is None else np.asarray(requests, float)[: len(t)]
    measured |= _commands(r, t)
    measured["mode"] = Series(t, mode, "1", MODE_CODES)
    truth = _truth(r, clock(p.record_every)) if p.record_every else {}
    return Flight(measured, {}, truth, _events(r, flown, t, mode), {}, _meta(r, flown))


def _readings(r: Run, clock: Any) -> dict[str, Series]:
    out = {}
    p = r.params.sensors
    for first, last, every in p.groups:
        t = clock(int(every))
        for i in range(first, last):
            channel = r.prepared.sensors[i].channel
            value = r.record.measured[p.offset[i] : p.offset[i] + len(t)]
            there = np.isfinite(value)
            series = (
                Series(t, value, TRUE[channel])
                if there.all()
                else Series(t[there], value[there], TRUE[channel])
            )
            out[channel] = series
    return out


def _commands(r: Run, t: Array) -> dict[str, Series]:
    out = {}
    for i, name in enumerate(r.prepared.servos):
        value = r.record.command[: len(t), i]
        out[name if name == THROTTLE else f"command.{name}"] = Series(
            t, value, "1" if name == THROTTLE else "rad"
        )
    names = {"phi": "rad", "theta": "rad", "airspeed": "m/s", "altitude": "m"}
    for i, (name, unit) in enumerate(names.items()):
        out[f"reference.{name}"] = Series(t, r.record.reference[: len(t), i], unit)
    return out


def _truth(r: Run, t: Array) -> dict[str, Series]:
    units = {**TRUE, **WIND_UNITS}
    units |= {
        n if n == THROTTLE else f"surface.{n}": "1" if n == THROTTLE else "rad" for n in r.prepared.servos
    }
    table = r.record.truth[: len(t)]
    out = {name: Series(t, table[:, i], unit) for i, (name, unit) in enumerate(units.items())}
    for i, fault in enumerate(fault_list(r.prepared)):
        active = (t >= fault["start_s"] - 1e-9) & (t < fault["end_s"] - 1e-9)
        size = np.where(active, table[:, len(units) + i], np.nan)
        name = f"fault.{fault['target']}.{fault['mode']}"
        before = out[name].value if name in out else np.full(len(t), np.nan)
        out[name] = Series(t, np.where(active, size, before), fault["unit"])
    return out


def fault_list(prepared: Prepared) -> list[dict[str, Any]]:
    """What was injected, for `meta` and for scoring: SI, angles absolute (about neutral)."""
    out = []
    for f, row in zip(prepared.scenario.faults, prepared.params.faults.rows, strict=True):
        servo = f.target in prepared.servos
        own = (
            "1"
            if f.target == THROTTLE
            else "rad"
            if servo
            else TRUE.get(f.target.removeprefix("sensor."), "1")
        )
        unit = MODES[f.mode].unit.replace("position", own).replace("signal", own)
        value = float(row[4])
        about_trim = (
            value - float(prepared.params.trim[prepared.servos.index(f.target)]) if servo else math.nan
        )
        about_trim = about_trim if f.mode in ("stuck", "hardover") else math.nan
        unit = own if f.mode == "hardover" else unit
        what = {"target": f.target, "mode": f.mode, "start_s": f.start_s, "end_s": f.end_s}
        out.append({**what, "value": value, "about_trim": about_trim, "unit": unit})
    return out


def _events(r: Run, flown: int, t: Array, mode: Array) -> list[Event]:
    end = flown * r.params.dt
    found = []
    for f in r.prepared.scenario.faults:
        found.append(Event(f.start_s, "fault", f"{f.target}: {f.mode} begins"))
        if math.isfinite(f.end_s):
            found.append(Event(f.end_s, "fault", f"{f.target}: {f.mode} ends"))
    for k in np.flatnonzero(np.diff(mode)):
        found.append(Event(float(t[k + 1]), "mode", MODE_CODES[int(mode[k + 1])]))
    found = sorted(e for e in found if e.t_s < end)
    if flown < r.prepared.steps:
        found.append(Event(end, "diverged", "control was lost and the motion diverged; the flight ends here"))
    return found


def _meta(r: Run, flown: int) -> dict[str, Any]:
    s, a = r.prepared.scenario, r.prepared.aircraft
    groups = {g: list(names) for g, names in a.groups.items() if len(names) > 1}
    return {
        "source": s.name,
        "aircraft": s.aircraft,
        "aircraft_hash": aircraft_hash(a),
        "scenario": s.name,
        "title": s.title,
        "autopilot": r.prepared.autopilot.name,
        "seed": r.seed,
        "run": r.run,
        "version": __version__,
        "simulated": True,
        "dt_s": r.params.dt,
        "diverged": flown < r.prepared.steps,
        "faults": fault_list(r.prepared),
        "trim": {n: float(v) for n, v in zip(r.prepared.servos, r.params.trim, strict=True)},
        "autopilot_modes": list(MODE_CODES.values()),
        "groups": groups,
        "ideal_sensors": list(r.prepared.ideal),
        "clock": "seconds since the start of the simulation",
    }
