"""Random variations of a scenario, one per seed: faults, wind. Counter-based, so a seed always means the same
flight.

[[draw.fault]]                                          # any number of faults
targets = ["elevon_left", "elevon_right"]               # one of these
mode = "stuck"
about = "trim"                                          # as in scenarios
value = { v = [-7.0, 5.0], unit = "deg" }               # uniform between; left out for modes without a size
start = { v = [60.0, 90.0], unit = "s" }
length = { v = [30.0, 30.0], unit = "s" }               # left out: to the end
[draw.wind]
speed = { v = [0.0, 5.0], unit = "m/s" }                # from any direction
turbulence = "dryden"                                   # of the strength of that wind; left out: steady wind
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ..dynamics.faults import Fault
from ..parts.random import uniform4
from ..scenarios.reader import Table
from ..scenarios.types import Scenario, Turbulence

# Channels of the random numbers; far from those of the simulator, which count from 0.
WIND_CHANNEL, FAULT_CHANNEL = 1_000_000, 1_000_001
RANGE = tuple[float, float]


class FaultDraw(NamedTuple):
    """One fault: uniform between the ends of value (SI), start (s) and length (s; None: to the end of the
    flight).
    """

    targets: tuple[str, ...]
    mode: str
    about: str
    value: RANGE | None
    start: RANGE
    length: RANGE | None


class WindDraw(NamedTuple):
    """Wind speed uniform between the ends, m/s, from any direction; turbulence model or "" for none."""

    speed: RANGE
    turbulence: str


class Draw(NamedTuple):
    """What varies from seed to seed."""

    faults: tuple[FaultDraw, ...] = ()
    wind: WindDraw | None = None


def _range(t: Table, key: str, unit: str) -> RANGE:
    low, high = (float(x) for x in t.numbers(key, unit, size=2))
    if not low <= high:
        raise t.refuse(key, f"{key!r} must be [low, high], got {[low, high]}")
    return low, high


def read_draw(path: Path, lines: dict, values: dict[str, Any]) -> Draw:
    """The [draw] table of a campaign; units in SI or as they say, every refusal with its line."""
    t = Table(path, lines, values, ("draw",))
    faults = []
    for row in t.rows("fault"):
        targets = tuple(str(x) for x in row.values.pop("targets", ()))
        if not targets:
            raise row.refuse("targets", "targets must be a list of surfaces")
        unit = row.word("unit", default="rad")
        faults.append(
            FaultDraw(
                targets, row.word("mode"), row.word("about", ("trim", "neutral"), "neutral"),
                _range(row, "value", unit) if row.has("value") else None, _range(row, "start", "s"),
                _range(row, "length", "s") if row.has("length") else None,
            )
        )  # fmt: skip
        row.known += ["targets", "value", "length"]
        row.end()
    wind = None
    if t.has("wind"):
        w = t.table("wind")
        wind = WindDraw(_range(w, "speed", "m/s"), w.word("turbulence", ("", "dryden", "von_karman"), ""))
        w.end()
    t.known += ["wind"]
    t.end()
    return Draw(tuple(faults), wind)


def _between(r: RANGE, u: float) -> float:
    return r[0] + (r[1] - r[0]) * u


def apply(draw: Draw, scenario: Scenario, seed: int) -> Scenario:
    """The scenario of this seed: its own faults plus the drawn ones, wind drawn where the draw says so."""
    faults = list(scenario.faults)
    for i, f in enumerate(draw.faults):
        which, size, when, long = uniform4(seed, 0, FAULT_CHANNEL, i)
        start = _between(f.start, when)
        faults.append(
            Fault(
                f.targets[min(int(which * len(f.targets)), len(f.targets) - 1)], f.mode, start,
                start + _between(f.length, long) if f.length else math.inf,
                _between(f.value, size) if f.value else math.nan, f.about,
            )
        )  # fmt: skip
    wind = scenario.wind
    if draw.wind:
        strength, way, _, _ = uniform4(seed, 0, WIND_CHANNEL, 0)
        speed = _between(draw.wind.speed, strength)
        turbulence = Turbulence(draw.wind.turbulence, speed) if draw.wind.turbulence and speed > 0 else None
        wind = wind._replace(speed=speed, direction=2.0 * math.pi * way, turbulence=turbulence)
    return replace(scenario, faults=tuple(faults), wind=wind)
