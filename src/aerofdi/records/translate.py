"""Log + Profile -> Flight: the one place where names, units and signs are translated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Flight, Series, WrongUse
from .log import Log, Table, ordered, printable, unreadable
from .profile import ChannelSpec, Profile
from .px4 import px4_surfaces
from .servos import ardupilot_surfaces
from .units import to_si

_SCHEMES: dict[str, Callable[[Log, Profile, Flight], None]] = {
    "ardupilot": ardupilot_surfaces,
    "px4": px4_surfaces,
}
ABSOLUTE_S = 6e8
STRAY_S = 6 * 3600.0
_TIME_FACTOR = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def matches(profile: Profile, log: Log) -> int:
    """How many conditions of the profile's [match] the log meets; 0 where any fails or none is asked."""
    want = profile.match
    topics, fields, info = want.get("topics", []), want.get("fields", []), want.get("info", {})
    if not all(topic in log.tables and len(log.tables[topic].t_s) for topic in topics):
        return 0
    if not all(log.has(reference) for reference in fields):
        return 0
    if not all(str(log.info.get(key)) == str(value) for key, value in info.items()):
        return 0
    return len(topics) + len(fields) + len(info)


def _with_time(log: Log, profile: Profile, path: Path) -> Log:
    """A table format given the clock its profile names in [time]."""
    if "field" not in profile.time:
        return log
    reference = profile.time["field"]
    topic, _, name = reference.partition(".")
    if not log.has(reference):
        raise unreadable(
            path, f"has no time field {reference!r}, which profile {profile.name!r} names in [time]"
        )
    raw = np.asarray(log.tables[topic].columns[name])
    if raw.dtype.kind not in "fiub":
        raise unreadable(path, f"the time field {reference!r} holds text")
    t, absolute = seconds(raw, profile.time.get("unit", "s"))
    log.tables[topic] = ordered(t, log.tables[topic].columns)
    log.clock = "0 at the earliest stamp" if absolute else f"the log's own clock, {reference}"
    return log


def seconds(raw: NDArray[Any], unit: str) -> tuple[Array, bool]:
    """Stamps in s. Those that count from 1970 (beyond 1989) start at 0 instead; True where so."""
    factor = _TIME_FACTOR[unit]
    finite = raw[np.isfinite(raw)] if raw.dtype.kind == "f" else raw
    first = finite.min() if len(finite) else 0
    if float(first) * factor <= ABSOLUTE_S:
        return raw.astype(float) * factor, False
    return (raw - first).astype(float) * factor, True


def without_strays(log: Log) -> Log:
    """The log without stamps far from all others, such as a flipped bit leaves; a note says how many.

    Stamps are counted by the hour; stretches apart by more than an hour that hold less than 1 % of all
    samples go.
    """
    ends = [(table.t_s[0], table.t_s[-1]) for table in log.tables.values() if len(table.t_s)]
    if not ends or max(b for _, b in ends) - min(a for a, _ in ends) < STRAY_S:
        return log
    stamps = np.concatenate([table.t_s for table in log.tables.values()])
    hours, counts = np.unique(np.floor(stamps / 3600.0), return_counts=True)
    stretch = np.concatenate(([0], np.cumsum(np.diff(hours) > 2.0)))
    heavy = np.bincount(stretch, weights=counts) >= 0.01 * len(stamps)
    kept = hours[heavy[stretch]]
    dropped = 0
    for name, table in log.tables.items():
        keep = np.isin(np.floor(table.t_s / 3600.0), kept)
        if not keep.all():
            dropped += int((~keep).sum())
            log.tables[name] = Table(table.t_s[keep], {k: v[keep] for k, v in table.columns.items()})
    low, high = (kept[0] * 3600.0, (kept[-1] + 1.0) * 3600.0) if len(kept) else (0.0, 0.0)
    log.events = [event for event in log.events if low <= event.t_s <= high]
    if dropped:
        log.notes.append(f"{dropped} samples with stamps far from all others were left out")
    return log


def _where(table: Table, conditions: dict[str, float]) -> Table:
    keep = np.ones(len(table.t_s), dtype=bool)
    for name, value in conditions.items():
        if name in table.columns:
            keep &= np.asarray(table.columns[name]) == value
    if keep.all():
        return table
    return Table(table.t_s[keep], {k: v[keep] for k, v in table.columns.items()})


def _coded(text: NDArray[Any]) -> tuple[Array, dict[int, str]]:
    names, values = np.unique(text, return_inverse=True)
    return values.astype(float), {k: str(name) for k, name in enumerate(names)}


def _raw(spec: ChannelSpec, log: Log) -> tuple[Array, NDArray[Any]] | None:
    """Stamps and raw values of a channel before scaling; None where the log does not have it."""
    if spec.mix:
        if not all(log.has(name) for name in spec.mix):
            return None
        topic = next(iter(spec.mix)).partition(".")[0]
        table = _where(log.tables[topic], spec.where)
        total = np.zeros(len(table.t_s))
        for name, weight in spec.mix.items():
            total += weight * np.asarray(table.columns[name.partition(".")[2]], dtype=float)
        return table.t_s, total
    present = [name for name in spec.source if log.has(name)]
    if not present:
        return None
    topic = present[0].partition(".")[0]
    table = _where(log.tables[topic], spec.where)
    if not len(table.t_s):
        return None
    if spec.farthest_from is None:
        return table.t_s, table.columns[present[0].partition(".")[2]]
    stack = np.stack([np.asarray(table.columns[n.partition(".")[2]], dtype=float) for n in present])
    pick = np.nanargmax(np.nan_to_num(np.abs(stack - spec.farthest_from), nan=-1.0), axis=0)
    return table.t_s, stack[pick, np.arange(stack.shape[1])]


def _bits(raw: NDArray[Any], bit: int) -> Array:
    """One bit of an integer field; NaN where the field does not hold an integer."""
    number = np.asarray(raw, dtype=float)
    whole = np.isfinite(number) & (np.abs(number) < 2.0**62)
    integers = np.where(whole, number, 0.0).astype(np.int64)
    return np.where(whole, ((integers >> bit) & 1).astype(float), np.nan)


def channel(spec: ChannelSpec, log: Log) -> Series | None:
    """One channel of the log in house units; None where the log does not have it."""
    found = _raw(spec, log)
    if found is None:
        return None
    t, raw = found
    if raw.dtype.kind in "USO":
        value, codes = _coded(raw.astype(str))
        return Series(t, value, "1", codes, spec.repeats)
    value = _bits(raw, spec.bit) if spec.bit is not None else np.asarray(raw, dtype=float)
    if spec.equals is not None:
        value = np.where(np.isfinite(value), (value == spec.equals).astype(float), np.nan)
    unit, factor = to_si(spec.unit, "this profile")
    plain = spec.offset == 0.0 and spec.sign * spec.scale * factor == 1.0
    if not plain:
        value = (value - spec.offset) * (spec.sign * spec.scale * factor)
    if spec.limits is not None:
        value = np.clip(value, *spec.limits)
    if spec.negative_scale != 1.0:
        value = np.where(value < 0.0, value * spec.negative_scale, value)
    return Series(np.asarray(t, float), np.array(value, dtype=float), unit, spec.codes, spec.repeats)


def _table(specs: dict[str, ChannelSpec], log: Log, notes: list[str]) -> dict[str, Series]:
    found: dict[str, Series] = {}
    for name, spec in specs.items():
        series = channel(spec, log)
        if series is None:
            continue
        if spec.absent_if_zero and not np.any(series.value[np.isfinite(series.value)]):
            notes.append(f"{name} is left out: {spec.source[0]} is 0 throughout, so the sensor gave nothing")
            continue
        found[name] = series
    return found


def _meta(log: Log, profile: Profile, path: Path) -> dict[str, Any]:
    return {
        "source": path.name,
        "format": log.format,
        "profile": profile.name,
        "aircraft": profile.aircraft,
        "clock": log.clock,
        "signs": profile.signs,
        "surface_signs": {name: dict(signs) for name, signs in profile.surfaces.items()},
        "groups": {name: list(members) for name, members in profile.groups.items()},
        "aliases": dict(profile.aliases),
        "servos": {name: dict(servo) for name, servo in profile.servos.items()},
        "autopilot_modes": list(profile.autopilot_modes),
        "assumed": list(profile.assumed),
        "notes": list(log.notes),
        "info": dict(log.info),
    }


@np.errstate(all="ignore")
def translate(log: Log, profile: Profile, path: Path) -> Flight:
    """The flight a log holds, in the house's names, units and signs.

    Raises UnreadableFile where not one channel of the profile is in the log.
    """
    if not set(profile.reader) & {log.format}:
        raise WrongUse(
            f"profile {profile.name!r} reads {', '.join(profile.reader)}, but {path.name} is {log.format}; "
            f"choose another profile or leave it out"
        )
    log = without_strays(_with_time(log, profile, path))
    meta = _meta(log, profile, path)
    notes: list[str] = meta["notes"]
    flight = Flight(
        measured=_table(profile.channels, log, notes),
        output=_table(profile.output, log, notes),
        truth=_table(profile.truth, log, notes),
        events=sorted(log.events, key=lambda event: event.t_s),
        parameters=dict(log.parameters),
        meta=meta,
    )
    if "scheme" in profile.outputs:
        _SCHEMES[profile.outputs["scheme"]](log, profile, flight)
    if not any(len(s.t_s) for t in (flight.measured, flight.output, flight.truth) for s in t.values()):
        have = ", ".join(printable(name) for name in sorted(log.seen)[:12]) or "nothing"
        raise unreadable(path, f"holds none of the channels of profile {profile.name!r}; it has {have}")
    _prune(flight)
    return flight


def _prune(flight: Flight) -> None:
    """Signs, aliases and servos only of surfaces the flight commands; groups of bindable commands only."""
    have = {
        n.partition(".")[2] for t in (flight.measured, flight.output) for n in t if n.startswith("command.")
    }
    for key in ("surface_signs", "aliases", "servos"):
        flight.meta[key] = {k: v for k, v in flight.meta[key].items() if k in have}
    bindable = {name.partition(".")[2] for name in flight.measured if name.startswith("command.")}
    groups = {k: [m for m in members if m in bindable] for k, members in flight.meta["groups"].items()}
    flight.meta["groups"] = {k: members for k, members in groups.items() if members}
