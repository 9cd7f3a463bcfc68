"""Diagnosers in the loop: each sees what `core.bind` would give it at that instant, and acts one sample
later.

A diagnoser of period T is stepped at t = 0, T, 2T, ... with everything stamped up to t. What its verdict
asks for, excitation (clipped to its budget) and HOLD_LEVEL, starts at its next instant and lasts until the
one after. With several, excitations of one surface add up, and one request is enough.
"""

from __future__ import annotations

import math
import os
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import MissingChannel, WrongUse
from ..core.run import empty_verdict
from ..core.types import Array, Channels, Diagnoser, Flight, Request, Series, Verdict
from ..dynamics.faults import THROTTLE
from ..dynamics.sensors import TRUE
from ..scenarios import Scenario
from .fly import Run, as_scenario, assemble, start
from .loop import Motion, advance
from .prepare import Prepared, prepare


class Watched(NamedTuple):
    """What one diagnoser said in a flight: its instants t_s (n,) and verdicts with a leading time axis."""

    name: str
    t_s: Array
    verdict: Verdict


class Flown(NamedTuple):
    """A flight with diagnosers on board; verdicts in the order the diagnosers were given."""

    flight: Flight
    verdicts: tuple[Watched, ...]


class _Source:
    """One measured channel while it is being recorded; `last` and `mean` as `core.bind` has them."""

    def __init__(self, unit: str, value: Array, every: int, dt: float, coded: bool = False):
        self.unit, self.value, self.every, self.dt, self.coded = unit, value, every, dt, coded
        self.t: list[float] = []
        self.fresh: list[float] = []
        self.total = [0.0]
        self.seen = 0

    @property
    def period_s(self) -> float:
        return self.every * self.dt

    def update(self, steps: int) -> None:
        """Take in what steps 0 .. steps - 1 recorded; gaps (NaN) bring no news."""
        have = -(-steps // self.every)
        for k in range(self.seen, have):
            v = float(self.value[k])
            if math.isfinite(v):
                self.t.append((k * self.every) * self.dt)
                self.fresh.append(v)
                self.total.append(self.total[-1] + (v - self.fresh[0]))
        self.seen = have

    def last(self, now: float) -> tuple[float, float]:
        """Last value stamped by `now` and its stamp."""
        i = len(self.t) - 1
        while i >= 0 and self.t[i] > now:
            i -= 1
        return (self.fresh[i], self.t[i]) if i >= 0 else (math.nan, -math.inf)

    def line(self, then: float, now: float) -> tuple[float, float]:
        """Between the values around `then` where the later one is stamped by `now`, else the earlier; and its stamp."""
        i = bisect_right(self.t, then) - 1
        if i < 0:
            return math.nan, -math.inf
        if i + 1 == len(self.t) or self.t[i + 1] > now:
            return self.fresh[i], self.t[i]
        t0, t1, v0, v1 = self.t[i], self.t[i + 1], self.fresh[i], self.fresh[i + 1]
        return v0 + (v1 - v0) * ((then - t0) / (t1 - t0)), t0

    def mean(self, now: float, window: float) -> float | None:
        """Mean of the values in (now - window, now], None where there are none."""
        hi = len(self.t)
        while hi > 0 and self.t[hi - 1] > now:
            hi -= 1
        lo = hi
        while lo > 0 and self.t[lo - 1] > now - window:
            lo -= 1
        if hi == lo:
            return None
        return (self.total[hi] - self.total[lo]) / (hi - lo) + self.fresh[0]


class _Passenger:
    """One diagnoser under way."""

    def __init__(self, d: Diagnoser, sources: dict[str, _Source], servos: Sequence[str], duration_s: float):
        self.d = d
        self.sources = [sources.get(n) for n in d.inputs.names]
        self.servos = [servos.index(_servo(n)) for n in d.outputs.names]
        n = max(0, math.ceil(duration_s / d.dt_s - 1e-9))
        self.t: Array = np.asarray(d.dt_s * np.arange(n), np.float64)
        self.state = d.init(d.params)
        self.out = empty_verdict(d, n)
        self.asked = np.zeros(len(self.servos))
        self.hold = 0
        self.next_look = self.next_act = 0

    def act(self) -> None:
        """Take up what the last verdict asked for."""
        j = self.next_act
        self.next_act += 1
        if j == 0:
            return
        budget = np.asarray(self.d.budget, float)
        wish = self.out.excitation[j - 1]
        self.asked = np.where(np.isfinite(wish), np.clip(wish, -budget, budget), 0.0)
        self.hold = int(self.out.request[j - 1] == Request.HOLD_LEVEL)

    def watched(self) -> Watched:
        """What it has said so far."""
        n = self.next_look
        fields: Any = tuple(field[:n] for field in self.out)
        return Watched(self.d.name, self.t[:n], Verdict(*fields))

    def look(self) -> None:
        """Bind this instant and step."""
        j, dt = self.next_look, self.d.dt_s
        self.next_look += 1
        t = float(self.t[j])
        now = t + 1e-9
        behind = self.d.inputs.behind_s
        then, ahead = now - behind, min(behind, 0.5 * dt)
        z, age = np.full(len(self.sources), np.nan), np.full(len(self.sources), np.inf)
        for i, source in enumerate(self.sources):
            if source is None:
                continue
            seen = then
            if not source.coded and dt > 1.5 * source.period_s:
                seen = then + ahead
                value, stamp = source.last(seen)
                mean = source.mean(seen, dt)
                value = value if mean is None else mean
            elif not source.coded and behind > 0.0:
                value, stamp = source.line(then, now)
            else:
                value, stamp = source.last(then)
            z[i], age[i] = value, max(seen - stamp, 0.0)
        self.d.step_into(self.d.params, self.state, z, age, self.out, j)


def _servo(channel: str) -> str:
    return channel.removeprefix("excitation.").removeprefix("command.")


class _Excitation:
    """The sum of all excitations, recorded at every change as a source that diagnosers may read."""

    def __init__(self, servos: Sequence[str], used: Iterable[int]):
        self.used = sorted(set(used))
        self.names = [f"excitation.{servos[i]}" for i in self.used]
        self.units = ["1" if servos[i] == THROTTLE else "rad" for i in self.used]
        self.t: list[float] = []
        self.rows: list[Array] = []

    def note(self, t: float, row: Array) -> None:
        if self.t and self.t[-1] == t:
            self.rows[-1] = row[self.used]
        else:
            self.t.append(t)
            self.rows.append(row[self.used])

    def series(self) -> dict[str, Series]:
        table, t = np.array(self.rows).reshape(len(self.t), len(self.used)), np.array(self.t)
        return {
            n: Series(t, table[:, i].copy(), u)
            for i, (n, u) in enumerate(zip(self.names, self.units, strict=True))
        }


class _ExcitationSource(_Source):
    """An excitation channel; its stamps are the instants at which any diagnoser acted."""

    def __init__(self, excitation: _Excitation, place: int, period_s: float):
        super().__init__(excitation.units[place], np.empty(0), 1, period_s)
        self.excitation, self.place = excitation, place

    def update(self, steps: int) -> None:
        for k in range(self.seen, len(self.excitation.t)):
            v = float(self.excitation.rows[k][self.place])
            self.t.append(self.excitation.t[k])
            self.fresh.append(v)
            self.total.append(self.total[-1] + (v - self.fresh[0]))
        self.seen = len(self.excitation.t)


def _sources(r: Run, mode: Array) -> dict[str, _Source]:
    p, dt, out = r.params, r.params.dt, {}
    for first, last, every in p.sensors.groups:
        for i in range(first, last):
            channel = r.prepared.sensors[i].channel
            samples = r.record.measured[p.sensors.offset[i] : p.sensors.offset[i] + r.counts[i]]
            out[channel] = _Source(TRUE[channel], samples, int(every), dt)
    for i, name in enumerate(r.prepared.servos):
        channel, unit = (name, "1") if name == THROTTLE else (f"command.{name}", "rad")
        out[channel] = _Source(unit, r.record.command[:, i], p.control_every, dt)
    for i, (name, unit) in enumerate(
        (("phi", "rad"), ("theta", "rad"), ("airspeed", "m/s"), ("altitude", "m"))
    ):
        out[f"reference.{name}"] = _Source(unit, r.record.reference[:, i], p.control_every, dt)
    out["mode"] = _Source("1", mode, p.control_every, dt, coded=True)
    return out


def _refuse(d: Diagnoser, sources: dict[str, _Source], servos: Sequence[str], scenario: str) -> None:
    for name in d.outputs.names:
        if _servo(name) not in servos:
            raise WrongUse(f"{d.name} excites {name!r}, but scenario {scenario!r} has {', '.join(servos)}")
    inputs: Channels = d.inputs
    for name, unit in zip(inputs.names, inputs.units, strict=True):
        if name not in sources:
            if name in inputs.optional:
                continue
            raise MissingChannel(
                f"channel {name!r} is needed by {d.name}, but scenario {scenario!r} has "
                f"{', '.join(sorted(sources))}; add it under [sensors]"
            )
        if sources[name].unit != unit:
            raise WrongUse(
                f"channel {name!r} is needed by {d.name} in {unit!r}, but scenario {scenario!r} has it in "
                f"{sources[name].unit!r}"
            )


def fly_with(
    scenario: str | os.PathLike[str] | Scenario,
    diagnosers: Sequence[Diagnoser],
    seed: int | None = None,
    run: int = 0,
) -> Flown:
    """Fly a scenario once with diagnosers in the loop.

    Each verdict equals that of `core.run` on `core.bind` of the returned flight, bit for bit (live =
    replay), as long as no channel it reads at a lower rate than its own has gaps. Raises MissingChannel or
    WrongUse naming both sides where a diagnoser does not fit the scenario. Much slower than `fly`: a
    passive diagnoser that asks for nothing is better run on the flight afterwards.
    """
    s = as_scenario(scenario)
    prepared = prepare(s)
    r, motion = start(prepared, s.seed if seed is None else seed, run)
    return _ride(prepared, r, motion, diagnosers)


def _ride(prepared: Prepared, r: Run, motion: Motion, diagnosers: Sequence[Diagnoser]) -> Flown:
    p, n = r.params, prepared.steps
    mode = np.zeros(len(r.record.command))
    sources, active = _channels(r, mode, diagnosers)
    for d in diagnosers:
        _refuse(d, sources, prepared.servos, prepared.scenario.name)
    riders = [_Passenger(d, sources, prepared.servos, n * p.dt) for d in diagnosers]
    stop = 0
    while motion.k < n and motion.k == stop:
        _act(riders, r, active, motion.k)
        hold = max((q.hold for q in riders), default=0)
        stop = min([n, *(_boundary(q, p.dt, motion.k) for q in riders)])
        mode[-(-motion.k // p.control_every) : -(-stop // p.control_every)] = hold
        motion = advance(p, r.memory, r.record, motion, r.seed, r.run, stop, hold)
        for source in sources.values():
            source.update(motion.k)
        for q in riders:
            while q.next_look < len(q.t) and math.floor((q.t[q.next_look] + 1e-9) / p.dt) < motion.k:
                q.look()
    flight = assemble(r, motion.k, mode)
    flight.measured.update(active.series())
    flight.meta["diagnosers"] = [d.name for d in diagnosers]
    return Flown(flight, tuple(q.watched() for q in riders))


def _channels(r: Run, mode: Array, diagnosers: Sequence[Diagnoser]) -> tuple[dict[str, _Source], _Excitation]:
    """Everything measured, as it is recorded, with the excitations the diagnosers may ask for."""
    servos, sources = r.prepared.servos, _sources(r, mode)
    names = [_servo(c) for d in diagnosers for c in d.outputs.names]
    active = _Excitation(servos, [servos.index(n) for n in names if n in servos])
    beat = min((d.dt_s for d in diagnosers if d.outputs.names), default=1.0)
    for place, name in enumerate(active.names):
        sources[name] = _ExcitationSource(active, place, beat)
    return sources, active


def _act(riders: list[_Passenger], r: Run, active: _Excitation, k: int) -> None:
    """Start what is due before step k."""
    changed = False
    for q in riders:
        while (
            q.next_act < len(q.t) and q.next_act <= q.next_look and _ceil(q.t[q.next_act], r.params.dt) <= k
        ):
            q.act()
            changed = True
    if not changed:
        return
    r.memory.excitation[:] = 0.0
    for q in riders:
        for servo, asked in zip(q.servos, q.asked, strict=True):
            r.memory.excitation[servo] += asked
    if active.names:
        active.note(k * r.params.dt, r.memory.excitation)


def _ceil(t: float, dt: float) -> int:
    return math.ceil(t / dt - 1e-9)


def _boundary(q: _Passenger, dt: float, k: int) -> int:
    """The next step count after k at which this diagnoser looks or acts."""
    found = [1 << 60]
    if q.next_look < len(q.t):
        found.append(math.floor((q.t[q.next_look] + 1e-9) / dt) + 1)
    if q.next_act < len(q.t):
        found.append(_ceil(q.t[q.next_act], dt))
    return min(b for b in found if b > k)
