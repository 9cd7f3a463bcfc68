"""Read a scenario file: every key known, every number with its unit, every refusal with its line."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from ..aircraft import Aircraft, load_aircraft
from ..aircraft.lines import read_toml
from ..core.errors import WrongUse
from ..dynamics.faults import MODES, Fault, family
from ..dynamics.sensors import TRUE
from ..dynamics.wind import LIGHT, MODERATE, SEVERE
from .reader import Table
from .types import (
    LATERAL,
    Guidance,
    Gust,
    Point,
    Rates,
    Scenario,
    Start,
    Track,
    Turbulence,
    WindSpec,
)

HOME = Path(__file__).parent
LEVELS = {"light": LIGHT, "moderate": MODERATE, "severe": SEVERE}
NAN = float("nan")


def scenario_names() -> tuple[str, ...]:
    """The scenarios that come with the package."""
    return tuple(sorted(p.stem for p in HOME.glob("*.toml")))


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """The scenario of that name, or in that file.

    Raises UnreadableFile (missing, not TOML) or WrongUse (unknown key, wrong unit, impossible value), with
    file and line.

    >>> load_scenario("demo").aircraft
    'vireo'
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        if str(name_or_path) not in scenario_names():
            raise WrongUse(
                f"scenario {str(name_or_path)!r} is not known; known are {', '.join(scenario_names())}; "
                f"or give the path of a .toml file"
            )
        path = HOME / f"{name_or_path}.toml"
    document, lines = read_toml(path)
    return _scenario(Table(path, lines, document))


def _scenario(t: Table) -> Scenario:
    name = t.word("aircraft")
    try:
        aircraft = load_aircraft(name if not name.endswith(".toml") else t.path.parent / name)
    except WrongUse as error:
        raise t.refuse("aircraft", str(error)) from None
    if aircraft.kind != "full":
        raise t.refuse("aircraft", f"{name!r} is an identified model; only a full model can be flown")
    start = _start(t.table("start"), aircraft)
    pilot = t.table("autopilot")
    variant = pilot.word("variant", default="")
    sensors, noise_factor = _sensors(t.table("sensors"))
    scenario = Scenario(
        name=t.path.stem,
        title=t.word("title", default=t.path.stem),
        aircraft=name if not name.endswith(".toml") else str(t.path.parent / name),
        duration_s=t.number("duration", "s", low=1e-3),
        seed=t.integer("seed", 0),
        start=start,
        guidance=_guidance(t.table("guidance"), start),
        wind=_wind(t.table("wind")),
        sensors=sensors,
        noise_factor=noise_factor,
        autopilot=_autopilot(pilot, aircraft, variant),
        variant=variant,
        faults=tuple(_fault(f, aircraft) for f in t.rows("fault")),
        parameters=_parameters(t.table("parameters"), aircraft),
        rates=_rates(t.table("rates")),
        path=t.path,
    )
    t.end()
    return scenario


def _autopilot(t: Table, aircraft: Aircraft, variant: str) -> dict[str, Any]:
    """The [autopilot] changes as written, checked against the controller's gains."""
    from ..autopilot import autopilot_of

    try:
        autopilot_of(
            aircraft.autopilot, t.values, variant, who=f"aircraft {aircraft.name!r} with this scenario"
        )
    except WrongUse as error:
        raise t.refuse("", str(error)) from None
    return t.values


def _start(t: Table, aircraft: Aircraft) -> Start:
    start = Start(
        t.number("airspeed", "m/s", aircraft.number("reference.airspeed"), low=1.0),
        t.number("altitude", "m", aircraft.number("reference.altitude")),
        t.number("heading", "rad", 0.0),
        t.number("north", "m", 0.0),
        t.number("east", "m", 0.0),
        t.number("climb_angle", "rad", 0.0, low=-1.0, high=1.0),
    )
    t.end()
    return start


def _guidance(t: Table, start: Start) -> Guidance:
    lateral = t.word("lateral", LATERAL, "heading")
    angle = "bank" if lateral == "bank" else "course" if lateral == "course" else "heading"
    last = Point(0.0, start.airspeed, start.altitude, 0.0 if lateral == "bank" else start.heading)
    points = []
    for row in t.rows("point"):
        last = Point(
            row.number("t", "s", low=last.t_s),
            row.number("airspeed", "m/s", last.airspeed, low=1.0),
            row.number("altitude", "m", last.altitude),
            row.number(angle, "rad", last.angle) if lateral != "track" else 0.0,
        )
        row.end()
        points.append(last)
    track = _track(t.table("track"), start) if lateral == "track" else None
    t.end()
    return Guidance(lateral, tuple(points) or (last,), track)


def _track(t: Table, start: Start) -> Track:
    """A rectangle from the start along its heading, or waypoints."""
    if t.has("north") or t.has("east"):
        north, east = t.numbers("north", "m"), t.numbers("east", "m")
        if len(north) != len(east):
            raise t.refuse("east", f"north and east need as many numbers, got {len(north)} and {len(east)}")
    else:
        from ..autopilot.guidance import rectangle

        length, width = t.number("length", "m", low=1.0), t.number("width", "m", low=1.0)
        right = t.word("turn", ("right", "left"), "right") == "right"
        north, east = rectangle(length, width, start.heading, start.north, start.east, right)
    t.end()
    return Track(tuple(map(float, north)), tuple(map(float, east)))


def _wind(t: Table) -> WindSpec:
    spec = WindSpec(
        speed=t.number("speed", "m/s", 0.0, low=0.0),
        direction=t.number("from", "rad", 0.0),
        up=t.number("up", "m/s", 0.0),
        reference_height=t.number("reference_height", "m", WindSpec().reference_height, low=0.1),
        roughness=t.number("roughness", "m", 0.0, low=0.0),
        turbulence=_turbulence(t.table("turbulence")) if t.has("turbulence") else None,
        gusts=tuple(_gust(row) for row in t.rows("gust")),
    )
    t.known.append("turbulence")
    t.end()
    return spec


def _turbulence(t: Table) -> Turbulence:
    model = t.word("model", ("dryden", "von_karman"))
    if t.has("sigma") or t.has("length"):
        sigma, length = t.numbers("sigma", "m/s", size=3), t.numbers("length", "m", size=3)
        found = Turbulence(model, 0.0, _triple(sigma), _triple(length))
    elif t.has("level"):
        found = Turbulence(model, LEVELS[t.word("level", tuple(LEVELS))])
    else:
        found = Turbulence(model, t.number("wind_20ft", "m/s", low=0.0))
    t.known += ["level", "wind_20ft", "sigma", "length"]
    t.end()
    return found


def _triple(values: Any) -> tuple[float, float, float]:
    u, v, w = (float(x) for x in values)
    return u, v, w


def _gust(t: Table) -> Gust:
    gust = Gust(
        t.number("start", "s", low=0.0),
        _triple(t.numbers("velocity", "m/s", size=3)),
        _triple(t.numbers("length", "m", size=3)),
        t.flag("stays", True),
    )
    if min(gust.length) <= 0:
        raise t.refuse("length", f"the lengths of a gust must be above 0 m, got {gust.length}")
    t.end()
    return gust


def _sensors(t: Table) -> tuple[dict[str, dict[str, float]], float]:
    noise_factor = t.number("noise_factor", "1", 1.0, low=0.0)
    out: dict[str, dict[str, float]] = {}
    for channel in t.names():
        if channel not in TRUE:
            raise t.refuse(channel, f"{channel!r} is not a sensor channel; channels are {', '.join(TRUE)}")
        unit, row = TRUE[channel], t.table(channel)
        forms = {
            "noise": ("sigma", unit),
            "rate": ("rate_hz", "Hz"),
            "bias": ("bias", unit),
            "bias_sigma": ("bias_sigma", unit),
            "drift": ("drift", f"{unit}/s"),
            "walk": ("walk", f"{unit}/sqrt(s)"),
            "delay": ("delay_s", "s"),
        }
        out[channel] = {ours: row.number(key, u) for key, (ours, u) in forms.items() if row.has(key)}
        row.known += list(forms)
        row.end()
    return out, noise_factor


def _parameters(t: Table, aircraft: Aircraft) -> dict[str, tuple[float, float]]:
    """Numbers of the aircraft to change: a value with unit, or { factor = 1.1 }."""
    out = {}
    for path in t.names():
        if path not in aircraft.numbers or np.ndim(aircraft.numbers[path].value) != 0:
            raise t.refuse(
                path, f"aircraft {aircraft.name!r} has no scalar number {path!r}; see `aerofdi info`"
            )
        entry = t.values[path]
        if isinstance(entry, dict) and set(entry) == {"factor"}:
            row = t.table(path)
            out[path] = (NAN, row.number("factor", "1"))
        else:
            out[path] = (t.number(path, aircraft.numbers[path].si_unit), 1.0)
    return out


def _rates(t: Table) -> Rates:
    rates = Rates(*(t.number(k, "Hz", NAN) for k in ("dynamics", "control", "record")))
    for key, value in zip(Rates._fields, rates, strict=True):
        if not (math.isnan(value) or value > 0):
            raise t.refuse(key, f"{key!r} must be above 0 Hz, got {value:g}")
    t.end()
    return rates


def _value_unit(mode: str, kind: str, target: str) -> str:
    unit = MODES[mode].unit
    own = (
        TRUE.get(target.removeprefix("sensor."), "1")
        if kind == "sensor"
        else "1"
        if kind == "throttle"
        else "rad"
    )
    return unit.replace("position", own).replace("signal", own).replace("rad/rad", "1")


def _fault(t: Table, aircraft: Aircraft) -> Fault:
    target = t.word("target")
    surfaces = [s.name for s in aircraft.surfaces]
    try:
        kind = family(target, surfaces)
    except WrongUse as error:
        raise t.refuse("target", str(error)) from None
    mode = t.word("mode", tuple(m for m, spec in MODES.items() if kind in spec.targets))
    rudder = kind == "surface" and aircraft.surface(target).group == "rudder"
    value = NAN
    if mode == "hardover":
        value = 1.0 if t.word("stop", ("upper", "lower")) == "upper" else -1.0
    elif mode == "floating":
        value = t.number("value", "1", 0.0)
    elif mode != "off" and (mode != "stuck" or t.has("value")):
        value = t.number("value", _value_unit(mode, kind, target))
    angular = mode in ("stuck", "loss_of_effectiveness") and kind in ("surface", "throttle")
    about = t.word("about", ("trim", "neutral")) if angular and not math.isnan(value) else "neutral"
    fault = Fault(
        target,
        mode,
        t.number("start", "s", low=0.0),
        t.number("end", "s", math.inf, low=0.0),
        value,
        about,
        t.number("ramp", "s", 0.0, low=0.0),
        _profile(t) if t.has("profile") else (),
        t.number("frequency", "Hz", low=0.0) if mode == "oscillating" else NAN,
        rudder,
    )
    t.known += ["value", "about", "profile", "frequency", "stop"]
    t.end()
    return fault


def _profile(t: Table) -> tuple[tuple[float, float], ...]:
    row = t.table("profile")
    times, shares = row.numbers("t", "s"), row.numbers("share", "1")
    if len(times) != len(shares) or not len(times):
        raise row.refuse("share", f"t and share need as many numbers, got {len(times)} and {len(shares)}")
    row.end()
    return tuple((float(a), float(b)) for a, b in zip(times, shares, strict=True))
