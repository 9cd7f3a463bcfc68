"""How far off a surface may be stuck before steady flight is lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ..aircraft import Aircraft
from .build import plant_params
from .trim import NoTrim, mixing, trim


class StuckRange(NamedTuple):
    """Angles of one stuck surface at which steady straight level flight exists, rad; nominal is its healthy trim.

    released: what had to be given up, "airspeed" or "" (the airspeed asked for is held).
    """

    surface: str
    low: float
    high: float
    nominal: float
    released: str


def trimmable_range(
    aircraft: Aircraft, surface: str, airspeed: float | None = None, altitude: float | None = None
) -> StuckRange:
    """Angles at which `surface` may be stuck and the aircraft still has steady, straight, level flight.

    Held at `airspeed` where the other surfaces can; where they cannot, at any airspeed of the aircraft's envelope,
    which `released` then says. The ends are found to 1e-4 rad by bisection outwards from the healthy trim.
    """
    params = plant_params(aircraft)
    index = aircraft.surface_index(surface)
    healthy = trim(aircraft, airspeed, altitude, params=params)
    nominal = healthy.surfaces[index]
    _, _, commands = mixing(aircraft, {surface: nominal})
    _, _, before = mixing(aircraft, {})
    free = ("airspeed",) if len(commands) < 2 or ("elevator" in before and "elevator" not in commands) else ()

    def flies(angle: float) -> bool:
        try:
            trim(aircraft, airspeed, altitude, stuck={surface: angle}, free=free, params=params)
        except NoTrim:
            return False
        return True

    limits = aircraft.surfaces[index]
    low, high = (_last(flies, nominal, end) for end in (limits.lower, limits.upper))
    return StuckRange(surface, low, high, nominal, free[0] if free else "")


def _last(flies: Callable[[float], bool], inside: float, outside: float) -> float:
    """The last angle from inside towards outside at which it flies."""
    if flies(outside):
        return outside
    while abs(outside - inside) > 1e-4:
        middle = 0.5 * (inside + outside)
        if flies(middle):
            inside = middle
        else:
            outside = middle
    return inside
