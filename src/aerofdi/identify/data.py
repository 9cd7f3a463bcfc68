"""Flights -> the arrays a fit needs: rates, group commands, airspeed ratio, each training span on its own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..aircraft.identified import SurfaceGroup
from ..core.bind import bind, default_max_age, fresh
from ..core.errors import CannotJudge, MissingChannel, WrongUse
from ..core.types import Array, Channels, Flight

RATES = ("p", "q", "r")
AIR = ("alpha", "beta")
FASTEST_DT_S = 0.02
COLLINEAR = 0.99
AIRSPEED_LAG_S = 1.0
KINDS = ("aileron", "elevon", "flaperon", "elevator", "vtail", "rudder", "other")


class Segment(NamedTuple):
    """One unbroken stretch of training: t (n,), rates (n, 3), commands (n, ng), air (n, na), speed (n,) = V/V0."""

    t: Array
    rates: Array
    commands: Array
    air: Array
    speed: Array


class Training(NamedTuple):
    """dt_s, the groups, which rates and air angles are there, mean airspeed (NaN if none), the segments, notes, slowest
    command period."""

    dt_s: float
    groups: tuple[SurfaceGroup, ...]
    rates: tuple[str, ...]
    air: tuple[str, ...]
    airspeed: float
    segments: tuple[Segment, ...]
    notes: tuple[str, ...] = ()
    command_period_s: float = 0.0

    @property
    def duration_s(self) -> float:
        return sum(len(s.t) for s in self.segments) * self.dt_s


Spans = list[tuple[Flight, float, float]]


def command_channels(flight: Flight) -> tuple[str, ...]:
    """The surface commands of a flight, sorted; throttle and flap are not judged."""
    skip = ("command.throttle", "command.flap", "command.flap_left", "command.flap_right")
    return tuple(sorted(n for n in flight.measured if n.startswith("command.") and n not in skip))


def sample_period(flight: Flight) -> float:
    """The period at which rates bring news, not below 0.02 s."""
    periods = [fresh(flight.measured[r]).period_s for r in RATES if r in flight.measured]
    periods = [x for x in periods if math.isfinite(x)]
    if not periods:
        raise MissingChannel(
            f"angular rates (p, q, r) are needed to identify an aircraft, but {flight.name} has "
            f"{', '.join(sorted(flight.measured)) or 'no channels'}; map them in [channels] of the profile"
        )
    return max(FASTEST_DT_S, round(max(periods), 4))


def behind(flight: Flight, names: tuple[str, ...], dt_s: float) -> float:
    """How far behind to read a flight, s: so many whole samples that nine steps in ten of each channel are over by then."""
    steps = [np.diff(fresh(flight.measured[n]).t_s) for n in names if n in flight.measured]
    long = max((float(np.quantile(x, 0.9)) for x in steps if len(x)), default=0.0)
    return dt_s * math.ceil(long / dt_s - 0.01)


def prepare(spans: Spans) -> Training:
    """Bind every span, group collinear commands, drop stale and non-finite rows, cut at gaps.

    spans: (flight, t0_s, t1_s) of healthy flight. Flights may differ: what all of them hold is used, at the period of
    the slowest, and notes name what is left out. Raises MissingChannel where rates or surface commands are absent,
    WrongUse where a channel has two units, CannotJudge where no command moves or the spans are too short.
    """
    flights = list({id(f): f for f, _, _ in spans}.values())
    dt = max(sample_period(f) for f in flights)
    rates, left = _shared(
        "angular rates", flights, [tuple(r for r in RATES if r in f.measured) for f in flights]
    )
    commands, more = _shared(
        "surface commands (command.<surface>)", flights, [command_channels(f) for f in flights]
    )
    air = tuple(a for a in AIR if _everywhere(flights, a) and _varies(spans, a))
    speed = tuple(v for v in ("airspeed",) if _everywhere(flights, v) and _varies(spans, v))
    names = rates + commands + air + speed
    units = tuple(_unit(flights, n) for n in names)
    pieces = [
        piece for f, t0, t1 in spans for piece in _pieces(f, names, units, rates + commands, dt, t0, t1)
    ]
    pieces = [(t, z) for t, z in pieces if len(t) * dt >= 3.0]
    if sum(len(t) for t, _ in pieces) * dt < 10.0:
        raise CannotJudge(
            f"{_listed(flights)}: less than 10 s of unbroken healthy data with {', '.join(names)}; "
            f"give a longer span with --healthy T0:T1"
        )
    every = np.concatenate([z for _, z in pieces])
    first, last = len(rates), len(rates) + len(commands)
    groups, notes = group_commands(commands, units[first:last], every[:, first:last])
    v0 = float(np.mean(every[:, -1])) if speed else math.nan
    segments = tuple(_segment(t, z, len(rates), commands, groups, len(air), v0, dt) for t, z in pieces)
    period = max(fresh(f.measured[c]).period_s for f in flights for c in commands)
    return Training(dt, groups, rates, air, v0, segments, (*left, *more, *notes), period)


def _listed(flights: list[Flight]) -> str:
    return ", ".join(f.name for f in flights)


def _everywhere(flights: list[Flight], name: str) -> bool:
    return all(name in f.measured for f in flights)


def _shared(
    what: str, flights: list[Flight], have: list[tuple[str, ...]]
) -> tuple[tuple[str, ...], list[str]]:
    """The channels every flight has, and a note for each that only some have."""
    for flight, channels in zip(flights, have, strict=True):
        if not channels:
            raise MissingChannel(
                f"{what} are needed to identify an aircraft, but {flight.name} has "
                f"{', '.join(sorted(flight.measured))}; map them in [channels] of the profile"
            )
    every = [n for n in dict.fromkeys(n for channels in have for n in channels)]
    shared = tuple(n for n in every if all(n in channels for channels in have))
    if not shared:
        told = "; ".join(f"{f.name} has {', '.join(c)}" for f, c in zip(flights, have, strict=True))
        raise MissingChannel(
            f"the flights to identify one aircraft from share no {what}: {told}; "
            f"give flights of one aircraft, or map their channels to the same names in [channels] of the profile"
        )
    notes = []
    for n in every:
        without = [f for f, channels in zip(flights, have, strict=True) if n not in channels]
        if without:
            notes.append(f"{n} is left out: {_listed(without)} does not have it")
    return shared, notes


def _unit(flights: list[Flight], name: str) -> str:
    """The unit of a channel, which must be one in all flights: a full command cannot be told in rad."""
    first = flights[0]
    for f in flights[1:]:
        if f.measured[name].unit != first.measured[name].unit:
            raise WrongUse(
                f"one model needs one unit of {name!r}, but {first.name} has it in {first.measured[name].unit!r} and "
                f"{f.name} in {f.measured[name].unit!r}; map both alike in [channels] of the profile"
            )
    return first.measured[name].unit


def _varies(spans: Spans, name: str) -> bool:
    """Whether a channel is alive: finite values that are not all one number."""
    values = np.concatenate([f.measured[name].between(a, b).value for f, a, b in spans if name in f.measured])
    values = values[np.isfinite(values)]
    return len(values) > 10 and float(np.ptp(values)) > 1e-6


def _pieces(
    flight: Flight,
    names: tuple[str, ...],
    units: tuple[str, ...],
    timed: tuple[str, ...],
    dt: float,
    t0: float,
    t1: float,
) -> list[tuple[Array, Array]]:
    """Unbroken stretches (t, z) of one span; `timed` are the channels that say how far behind it is read."""
    ages = tuple(default_max_age(flight, n) for n in names)
    inputs = Channels(names, units, ages, behind_s=behind(flight, timed, dt))
    sample = bind(flight, inputs, dt, t0, t1, who="identify")
    good = np.isfinite(sample.z).all(axis=1) & (sample.age <= np.asarray(ages)).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], good.astype(int), [0]))))
    return [(sample.t_s[i:j], sample.z[i:j]) for i, j in zip(edges[::2], edges[1::2], strict=True)]


def _segment(
    t: Array,
    z: Array,
    nr: int,
    commands: tuple[str, ...],
    groups: tuple[SurfaceGroup, ...],
    na: int,
    v0: float,
    dt: float,
) -> Segment:
    u = z[:, nr : nr + len(commands)]
    delta = np.column_stack(
        [sum(w * u[:, commands.index(c)] for c, w in zip(g.channels, g.weights, strict=True)) for g in groups]
    )
    air = z[:, nr + len(commands) : nr + len(commands) + na]
    speed = smooth(z[:, -1], dt, AIRSPEED_LAG_S) / v0 if math.isfinite(v0) else np.ones(len(t))
    return Segment(t, z[:, :nr], delta, air, speed)


def smooth(x: Array, dt: float, lag_s: float) -> Array:
    """First-order lag, exact for held inputs, started at its first value; lag 0 returns x."""
    if lag_s <= 0 or not len(x):
        return x
    from scipy.signal import lfilter

    pole = math.exp(-dt / lag_s)
    y, _ = lfilter([1.0 - pole], [1.0, -pole], x, zi=[pole * x[0]])
    return np.asarray(y)


def shift(x: Array, dt: float, delay_s: float) -> Array:
    """Delayed by delay_s, linear between samples, the first value before the start (as `parts.delay_line`)."""
    n = delay_s / dt
    whole = math.floor(n)
    part = n - whole
    padded = np.concatenate((np.full(whole + 1, x[0]), x))
    newer, older = padded[1 : len(x) + 1], padded[: len(x)]
    return newer + part * (older - newer)


def group_commands(
    names: tuple[str, ...], units: tuple[str, ...], u: Array
) -> tuple[tuple[SurfaceGroup, ...], tuple[str, ...]]:
    """Groups of commands whose correlation in training exceeds 0.99 in size, and notes; constant ones are left out.

    Surfaces of one kind and unit (both ailerons) form a group. Another surface that moves in proportion to it (a rudder
    mixed to the ailerons) cannot be told apart: its effect stays inside the group of the kind that comes
    first in KINDS, and a note says so.
    """
    deviation = u.std(axis=0)
    scale = float(deviation.max(initial=0.0))
    moving = [j for j in range(len(names)) if deviation[j] > 1e-3 * scale and deviation[j] > 1e-9]
    moving.sort(key=lambda j: KINDS.index(kind(names[j])))
    groups: list[list[int]] = []
    notes: list[str] = []
    for j in moving:
        alike = [g for g in groups if abs(np.corrcoef(u[:, g[0]], u[:, j])[0, 1]) > COLLINEAR]
        if not alike:
            groups.append([j])
        elif (kind(names[alike[0][0]]), units[alike[0][0]]) == (kind(names[j]), units[j]):
            alike[0].append(j)
        else:
            notes.append(
                f"{names[j]} moved in proportion to {names[alike[0][0]]}: the two cannot be told apart, "
                f"and its effect is counted with {kind(names[alike[0][0]])}"
            )
    members = [[names[j] for j in g] for g in groups]
    made = tuple(
        _make_group(name, channels, units[g[0]], u[:, g])
        for name, channels, g in zip(group_names(members), members, groups, strict=True)
    )
    return made, tuple(notes)


def kind(channel: str) -> str:
    """aileron, elevon, elevator, rudder or another word: the part of the surface's name before the side.

    >>> kind("command.aileron_left")
    'aileron'
    """
    word = channel.removeprefix("command.").split("_")[0]
    return word if word in KINDS else KINDS[-1]


def _make_group(name: str, channels: list[str], unit: str, u: Array) -> SurfaceGroup:
    signs = [1.0 if np.corrcoef(u[:, 0], u[:, i])[0, 1] >= 0 else -1.0 for i in range(u.shape[1])]
    weights = tuple(s / len(channels) for s in signs)
    delta = u @ np.array(weights)
    reach = 1.0 if unit == "1" else max(math.radians(25.0), 1.2 * float(np.abs(u).max()))
    return SurfaceGroup(
        name=name,
        channels=tuple(channels),
        weights=weights,
        unit=unit,
        lower=-reach,
        upper=reach,
        mean=float(delta.mean()),
        deviation=float(delta.std()),
        identifiable=True,
    )


def group_names(members: list[list[str]]) -> list[str]:
    """A name for each group of command channels, all different: where two share a word, every surface is listed.

    >>> group_names([["command.aileron_1", "command.aileron_2"], ["command.aileron_3", "command.aileron_4"]])
    ['aileron_1+aileron_2', 'aileron_3+aileron_4']
    """
    surfaces = [[c.removeprefix("command.") for c in channels] for channels in members]
    short = [group_name(s) for s in surfaces]
    return [n if short.count(n) == 1 else "+".join(s) for n, s in zip(short, surfaces, strict=True)]


def group_name(surfaces: list[str]) -> str:
    """The surface itself, the word its sides share ('aileron' of aileron_left and aileron_right), or 'a+b'."""
    if len(surfaces) == 1:
        return surfaces[0]
    stems = {s.split("_")[0] for s in surfaces}
    return stems.pop() if len(stems) == 1 else "+".join(sorted(surfaces))
