"""Causal binding: what a diagnoser would have known at each instant, no more."""

from __future__ import annotations

import math

import numpy as np

from .errors import MissingChannel, WrongUse
from .types import Array, Channels, Flight, Sample, Series

STALE_PERIODS = 5.0


def fresh(series: Series) -> Series:
    """The samples that brought news: finite, with a new stamp, and (where the log repeats) a new value."""
    t, v = np.asarray(series.t_s, float), np.asarray(series.value, float)
    keep = np.isfinite(v) & np.isfinite(t)
    t, v = t[keep], v[keep]
    if len(t) > 1:
        new = np.concatenate(([True], np.diff(t) > 0))
        t, v = t[new], v[new]
        if series.repeats:
            new = np.concatenate(([True], np.diff(v) != 0))
            t, v = t[new], v[new]
    return series._replace(t_s=t, value=v)


def default_max_age(flight: Flight, name: str) -> float:
    """Five median periods of the channel's fresh samples, s; infinite where it has fewer than two."""
    period = fresh(flight.measured[name]).period_s
    return STALE_PERIODS * period if math.isfinite(period) else math.inf


def _last_value(series: Series, t_s: Array) -> tuple[Array, Array]:
    """Last fresh value at or before each instant, and its age; NaN and inf before the first."""
    index = np.searchsorted(series.t_s, t_s, side="right") - 1
    known = index >= 0
    safe = np.where(known, index, 0)
    if not len(series.t_s):
        return np.full(len(t_s), np.nan), np.full(len(t_s), np.inf)
    value = np.where(known, series.value[safe], np.nan)
    return value, np.where(known, t_s - series.t_s[safe], np.inf)


def _line_value(series: Series, t_s: Array, known_s: Array) -> tuple[Array, Array]:
    """On the line between the fresh values around each instant, or the last one where the next is not known by then."""
    last, age = _last_value(series, t_s)
    if len(series.t_s) < 2:
        return last, age
    after = np.searchsorted(series.t_s, t_s, side="right")
    safe = np.clip(after, 1, len(series.t_s) - 1)
    t0, t1 = series.t_s[safe - 1], series.t_s[safe]
    v0, v1 = series.value[safe - 1], series.value[safe]
    between = (after == safe) & (t1 <= known_s)
    share = np.divide(t_s - t0, t1 - t0, out=np.zeros(len(t_s)), where=between)
    return np.where(between, v0 + (v1 - v0) * share, last), age


def _mean_value(series: Series, t_s: Array, window_s: float) -> tuple[Array, Array]:
    """Mean of the fresh values in (t - window, t]; the last value and its age where there are none."""
    last, age = _last_value(series, t_s)
    if not len(series.t_s):
        return last, age
    # Sums relative to the first value keep precision over long flights.
    total = np.concatenate(([0.0], np.cumsum(series.value - series.value[0])))
    hi = np.searchsorted(series.t_s, t_s, side="right")
    lo = np.searchsorted(series.t_s, t_s - window_s, side="right")
    count = hi - lo
    mean = (total[hi] - total[lo]) / np.maximum(count, 1) + series.value[0]
    return np.where(count > 0, mean, last), age


def _to_clock(flight: Flight, inputs: Channels, dt_s: float, t0_s: float) -> float:
    """Less than dt_s: by how much later to start, so that instants described fall on the stamps of the first channel."""
    series = flight.measured.get(inputs.names[0])
    stamps = fresh(series).t_s if series is not None else ()
    if not len(stamps):
        return 0.0
    stamp = float(stamps[max(int(np.searchsorted(stamps, t0_s + 1e-9, side="right")) - 1, 0)])
    later = (stamp + inputs.behind_s - t0_s) % dt_s
    return later if later < dt_s - 1e-9 else 0.0


def _check(flight: Flight, inputs: Channels, who: str) -> None:
    for name, unit in zip(inputs.names, inputs.units, strict=True):
        if name not in flight.measured:
            if name in inputs.optional:
                continue
            hidden = [k for k in ("output", "truth") if name in getattr(flight, k)]
            why = (
                f"it is there only as {hidden[0]}, which no diagnoser may read"
                if hidden
                else "map it in [channels] of the profile"
            )
            raise MissingChannel(
                f"channel {name!r} is needed by {who}, but {flight.name} has "
                f"{', '.join(sorted(flight.measured)) or 'no channels'}; {why}"
            )
        given = flight.measured[name].unit
        if given != unit:
            raise WrongUse(
                f"channel {name!r} is needed by {who} in {unit!r}, but {flight.name} has it in {given!r}; "
                f"correct the unit in [channels] of the profile"
            )


def bind(
    flight: Flight,
    inputs: Channels,
    dt_s: float,
    t0_s: float | None = None,
    t1_s: float | None = None,
    who: str = "this diagnoser",
) -> Sample:
    """What was known at t0, t0 + dt, ... < t1: for each channel the last fresh value and its age.

    A channel at least 1.5 times faster than dt is averaged over the last dt (the anti-alias filter; its delay of
    about dt/2 is in `delay_s`); coded channels never are. Repeated stamps, non-finite values and, where the series
    says `repeats`, repeated values are not fresh. Before the first value: NaN with infinite age.

    With behind_s the row of t describes t - behind_s from what was known at t: a slower channel lies on the line between its
    values around it (held where the later one was not known yet), a faster one is averaged around it, age is
    that of the earlier value there, and the grid starts up to dt later, where it meets the stamps of the first channel.
    So what is seen does not depend on where the grid falls against a slow log.

    Raises MissingChannel or WrongUse, naming both sides.

    >>> import numpy as np
    >>> from aerofdi.core import Channels, Flight, Series, bind
    >>> f = Flight({"p": Series(np.array([0.0, 0.1, 0.2]), np.array([1.0, 2.0, 3.0]), "rad/s")})
    >>> bind(f, Channels(("p",), ("rad/s",)), 0.1, 0.0, 0.35).z.ravel()
    array([1., 2., 3., 3.])
    """
    if not (dt_s > 0 and math.isfinite(dt_s)):
        raise WrongUse(f"{who} asks for a sample period of {dt_s} s; it must be positive and finite")
    if not (inputs.behind_s >= 0 and math.isfinite(inputs.behind_s)):
        raise WrongUse(
            f"{who} asks to read {inputs.behind_s} s behind; it must be 0 or more: nobody knows the future"
        )
    _check(flight, inputs, who)
    first, last = flight.span_s
    t0 = first if t0_s is None else t0_s
    if inputs.behind_s > 0.0:
        t0 += _to_clock(flight, inputs, dt_s, t0)
    t1 = last + dt_s if t1_s is None else t1_s
    n = max(0, math.ceil((t1 - t0) / dt_s - 1e-9))
    t = t0 + dt_s * np.arange(n)
    z = np.full((n, len(inputs.names)), np.nan)
    age = np.full_like(z, np.inf)
    delay = np.zeros(len(inputs.names))
    # Stamps are rounded in logs; a value stamped within a nanosecond of the instant counts as known.
    now = t + 1e-9
    then = now - inputs.behind_s
    ahead = min(inputs.behind_s, 0.5 * dt_s)
    for j, name in enumerate(inputs.names):
        if name not in flight.measured:
            continue
        series = fresh(flight.measured[name])
        period = series.period_s
        if series.codes is None and math.isfinite(period) and dt_s > 1.5 * period:
            z[:, j], age[:, j] = _mean_value(series, then + ahead, dt_s)
            delay[j] = inputs.behind_s - ahead + 0.5 * (dt_s - period)
        elif series.codes is None and inputs.behind_s > 0.0:
            z[:, j], age[:, j] = _line_value(series, then, now)
            delay[j] = inputs.behind_s
        else:
            z[:, j], age[:, j] = _last_value(series, then)
            delay[j] = inputs.behind_s
    return Sample(t, z, np.maximum(age, 0.0), delay)
