"""How soon a fault must be found: before the aircraft leaves what it can be flown back from.

    exit time(fault)       first time after the onset at which an envelope is left, with nobody knowing of the
    fault allowable time(size)   the smallest exit time over onsets along the flight

Envelopes are data (`envelopes.toml`: source and `assumed` per row). Source: paper "vireo_comparison",
sections 2.2 and 2.3; the envelopes are three of the five of Wilborn and Foster (2004).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Flight, MissingChannel, UnreadableFile, WrongUse
from ..dynamics.faults import Fault as PlantFault
from ..scenarios import Scenario

NO_LIMIT = (-math.inf, math.inf)
TRANSPORT_SPAN = 34.0
"""Span of the airliners the envelopes were drawn for, m (assumed: that of a Boeing 737)."""
NEEDED = ("phi", "theta", "p", "q", "r")


class Envelope(NamedTuple):
    """Limits on bank and pitch attitude, rad, as they will be in horizon_s at the present rates."""

    name: str
    text: str
    phi: tuple[float, float]
    theta: tuple[float, float]
    horizon_s: float
    source: str
    assumed: bool


class Allowable(NamedTuple):
    """Allowable detection time over the size of a fault: sizes (n,) increasing, seconds (n,)."""

    sizes: Array
    seconds: Array

    def at(self, size: float) -> float:
        """Seconds allowed for this size: the shorter of the two neighbours; the nearest end outside the
        range.
        """
        i = int(np.searchsorted(self.sizes, size))
        near = self.seconds[max(i - 1, 0) : i + 1]
        exact = np.isclose(self.sizes, size, rtol=0.0, atol=1e-12)
        return float(self.seconds[exact][0] if exact.any() else near.min())


def scaled(envelopes: Iterable[Envelope], span: float) -> tuple[Envelope, ...]:
    """Envelopes of a transport aircraft for one of another span (m), by dynamic (Froude) similarity.

    Angles stay, times go with the square root of length: horizon_s * sqrt(span / TRANSPORT_SPAN). A small aircraft at
    the same Froude number rolls and pitches that much faster, and one second ahead means nothing to it. Assumed.
    """
    if not span > 0:
        raise WrongUse(f"a span of {span} m was given; it must be positive")
    factor = math.sqrt(span / TRANSPORT_SPAN)
    return tuple(
        e._replace(horizon_s=e.horizon_s * factor, assumed=e.assumed or e.horizon_s > 0) for e in envelopes
    )


def _limits(row: Mapping, key: str) -> tuple[float, float]:
    low, high = row.get(f"{key}_deg", [-math.inf, math.inf])
    return math.radians(low), math.radians(high)


def _envelope(name: str, row: Mapping) -> Envelope:
    phi, theta = _limits(row, "phi"), _limits(row, "theta")
    return Envelope(
        name, row["text"], phi, theta, float(row["horizon_s"]), row["source"], bool(row["assumed"])
    )


def load_envelopes(path: Path | None = None) -> tuple[Envelope, ...]:
    """The envelopes of a TOML file (default: those of this room)."""
    path = path or Path(__file__).with_name("envelopes.toml")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        return tuple(_envelope(name, row) for name, row in table.items())
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UnreadableFile(
            f"{path}: {error!r}; an envelope needs text, horizon_s, source, assumed, and phi_deg or "
            f"theta_deg = [low, high]"
        ) from error


def attitude(flight: Flight) -> tuple[Array, dict[str, Array]]:
    """(t_s, channels of NEEDED) from the truth where it is known, else from the measured ones, on the clock
    of phi.
    """
    table = flight.truth if all(n in flight.truth for n in NEEDED) else flight.measured
    missing = [n for n in NEEDED if n not in table]
    if missing:
        raise MissingChannel(
            f"envelopes need {', '.join(NEEDED)}, but {flight.name} lacks {', '.join(missing)}; record them"
        )
    t = table["phi"].t_s
    return t, {n: np.interp(t, table[n].t_s, table[n].value) for n in NEEDED}


def ahead(x: Mapping[str, Array], horizon_s: float) -> tuple[Array, Array]:
    """(phi, theta) in horizon_s at the present Euler rates, rad."""
    sin, cos = np.sin(x["phi"]), np.cos(x["phi"])
    phi_dot = x["p"] + np.tan(x["theta"]) * (x["q"] * sin + x["r"] * cos)
    theta_dot = x["q"] * cos - x["r"] * sin
    return x["phi"] + horizon_s * phi_dot, x["theta"] + horizon_s * theta_dot


def outside(envelope: Envelope, x: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Where the envelope is left."""
    phi, theta = ahead(x, envelope.horizon_s)
    (a, b), (c, d) = envelope.phi, envelope.theta
    return (phi < a) | (phi > b) | (theta < c) | (theta > d)


def exit_time(flight: Flight, onset_s: float, envelopes: Iterable[Envelope]) -> tuple[float, str]:
    """(seconds from the onset to the first exit, name of that envelope); (inf, "none") where none is left."""
    t, x = attitude(flight)
    first = (math.inf, "none")
    for envelope in envelopes:
        at = np.flatnonzero(outside(envelope, x) & (t >= onset_s))
        if len(at):
            first = min(first, (float(t[at[0]]) - onset_s, envelope.name))
    return first


def widened(
    envelopes: Iterable[Envelope], healthy: Iterable[Flight], margin: float = 1.1
) -> tuple[Envelope, ...]:
    """Envelopes that hold every healthy flight: a limit it passes is moved to `margin` times what it reached.

    A limit the healthy aircraft passes in its own corners says nothing about a fault. Bank is moved alike on both
    sides: a track with right-hand corners only is healthy flown the other way too. Moved limits are marked assumed.
    """
    flights = [attitude(f)[1] for f in healthy]
    out = []
    for e in envelopes:
        phi, theta = e.phi, e.theta
        for x in flights:
            bank, pitch = ahead(x, e.horizon_s)
            far = margin * float(np.abs(bank).max())
            if far / margin > max(-e.phi[0], e.phi[1]) or outside(e._replace(theta=NO_LIMIT), x).any():
                phi = (min(phi[0], -far), max(phi[1], far))
            low, high = margin * float(pitch.min()), margin * float(pitch.max())
            theta = (min(theta[0], low) if low < margin * e.theta[0] else theta[0],
                     max(theta[1], high) if high > margin * e.theta[1] else theta[1])  # fmt: skip
        out.append(e._replace(phi=phi, theta=theta, assumed=e.assumed or (phi, theta) != (e.phi, e.theta)))
    return tuple(out)


def allowable(exits: Mapping[float, Iterable[float]]) -> Allowable:
    """From exit times (s) per fault size: the smallest per size, made shorter with growing size on either
    side.

    A larger fault of the same sign may not have more time than a smaller one, so scatter between sizes cannot
    hide a short time.
    """
    if not exits:
        raise WrongUse("an allowable detection time needs exit times of at least one fault size")
    sizes = np.array(sorted(exits))
    seconds = np.array([min(exits[s], default=math.inf) for s in sizes])
    for i in range(len(sizes)):
        inner = (np.sign(sizes) == np.sign(sizes[i])) & (np.abs(sizes) <= abs(sizes[i]))
        inner |= np.abs(sizes) < 1e-12
        seconds[i] = seconds[inner].min()
    return Allowable(sizes, seconds)


def fly_exits(
    scenario: Scenario,
    fault: PlantFault,
    sizes: Sequence[float],
    onsets_s: Sequence[float],
    envelopes: Sequence[Envelope],
    after_s: float = 40.0,
    progress: Callable[[str, float], None] | None = None,
) -> dict[float, list[float]]:
    """Exit times (s) of one kind of fault per size, from nonlinear flight with nobody knowing of the fault.

    scenario: healthy; fault: its target, mode and `about` are used; sizes: in SI; onsets_s: one flight each, after_s
    long after the onset. An exit that does not come within after_s is infinite.
    """
    from ..simulate import fly

    out: dict[float, list[float]] = {}
    for i, size in enumerate(sizes):
        for onset in onsets_s:
            now = fault._replace(value=size, start_s=onset, end_s=math.inf)
            flight = fly(replace(scenario, faults=(*scenario.faults, now), duration_s=onset + after_s))
            out.setdefault(size, []).append(exit_time(flight, onset, envelopes)[0])
        if progress:
            progress(f"allowable detection time: {i + 1} of {len(sizes)} sizes", (i + 1) / len(sizes))
    return out
