"""Density and pressure of the standard troposphere, or a constant density where a paper uses one."""

from __future__ import annotations

from typing import NamedTuple

from ..parts.ops import exp, inline, log, maximum

# ISO 2533 sea level and troposphere: T0 288.15 K, 6.5 K/km, p0 101325 Pa, R 287.05287, g0 9.80665.
ISA_DENSITY = 1.225
ISA_PRESSURE = 101325.0
ISA_LAPSE = 0.0065 / 288.15
ISA_DENSITY_EXPONENT = 9.80665 / (0.0065 * 287.05287) - 1.0
ISA_PRESSURE_EXPONENT = 9.80665 / (0.0065 * 287.05287)


class Air(NamedTuple):
    """rho = density0 (1 - lapse h)^exponent; lapse = 0 is a constant density. gravity in m/s2."""

    density0: float
    lapse: float
    exponent: float
    gravity: float


@inline
def density(air: Air, altitude: float) -> float:
    """Air density at an altitude in m, kg/m3. Valid in the troposphere (below 11 km).

    >>> round(density(Air(1.225, ISA_LAPSE, ISA_DENSITY_EXPONENT, 9.80665), 1000.0), 4)
    1.1116
    """
    if air.lapse == 0.0:
        return air.density0
    return air.density0 * exp(air.exponent * log(maximum(1.0 - air.lapse * altitude, 0.05)))


@inline
def pressure(altitude: float) -> float:
    """Standard static pressure at an altitude in m, Pa. Valid in the troposphere.

    >>> round(pressure(1000.0))
    89875
    """
    return ISA_PRESSURE * exp(ISA_PRESSURE_EXPONENT * log(maximum(1.0 - ISA_LAPSE * altitude, 0.05)))
