"""Units of logs -> the units of the house, once, at the door."""

from __future__ import annotations

import math

from ..core import WrongUse

DEG = math.pi / 180.0
G = 9.80665

# Log unit -> (house unit, factor).
CONVERSIONS: dict[str, tuple[str, float]] = {
    "1": ("1", 1.0),
    "%": ("1", 0.01),
    "rad": ("rad", 1.0),
    "deg": ("rad", DEG),
    "cdeg": ("rad", DEG / 100.0),
    "mrad": ("rad", 1e-3),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", DEG),
    "cdeg/s": ("rad/s", DEG / 100.0),
    "mrad/s": ("rad/s", 1e-3),
    "rpm": ("rad/s", 2.0 * math.pi / 60.0),
    "m": ("m", 1.0),
    "dm": ("m", 0.1),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "km": ("m", 1e3),
    "ft": ("m", 0.3048),
    "m/s": ("m/s", 1.0),
    "cm/s": ("m/s", 1e-2),
    "mm/s": ("m/s", 1e-3),
    "km/h": ("m/s", 1.0 / 3.6),
    "kt": ("m/s", 1852.0 / 3600.0),
    "ft/s": ("m/s", 0.3048),
    "m/s2": ("m/s2", 1.0),
    "cm/s2": ("m/s2", 1e-2),
    "ft/s2": ("m/s2", 0.3048),
    "g": ("m/s2", G),
    "mg": ("m/s2", G * 1e-3),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "kg": ("kg", 1.0),
    "N": ("N", 1.0),
    "N m": ("N m", 1.0),
    "Pa": ("Pa", 1.0),
    "hPa": ("Pa", 100.0),
    "V": ("V", 1.0),
    "A": ("A", 1.0),
    "K": ("K", 1.0),
}

_RATE, _ANGLE, _SPEED, _ACC, _LENGTH, _NONE = ("rad/s",), ("rad",), ("m/s",), ("m/s2",), ("m",), ("1",)

# Channel -> the units it may have inside the house.
CHANNELS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("p", "q", "r", "engine_speed"), _RATE),
    **dict.fromkeys(("phi", "theta", "psi", "alpha", "beta"), _ANGLE),
    **dict.fromkeys(("u", "v", "w", "airspeed", "groundspeed", "climb_rate"), _SPEED),
    **dict.fromkeys(("wind_north", "wind_east", "wind_down"), _SPEED),
    **dict.fromkeys(("ax", "ay", "az"), _ACC),
    **dict.fromkeys(("altitude", "north", "east"), _LENGTH),
    **dict.fromkeys(("throttle", "mode", "armed", "airborne"), _NONE),
    "fuel_mass": ("kg",),
}

PREFIXED = ("command", "reference", "excitation", "event")


def channel_units(name: str) -> tuple[str, ...] | None:
    """The units a channel may have; None where the name is not one of the house's."""
    prefix, _, rest = name.partition(".")
    if rest and prefix in ("command", "excitation"):
        return ("rad", "1")
    if rest and prefix == "reference":
        return CHANNELS.get(rest)
    if rest and prefix == "event":
        return _NONE
    return CHANNELS.get(name)


def to_si(unit: str, who: str) -> tuple[str, float]:
    """(house unit, factor) of a log's unit.

    >>> to_si("km/h", "profile 'x'")[0]
    'm/s'
    """
    if unit not in CONVERSIONS:
        raise WrongUse(f"{who} gives the unit {unit!r}; accepted are {', '.join(CONVERSIONS)}")
    return CONVERSIONS[unit]
