"""Units of aircraft files: for every SI unit the spellings accepted for it and their factors."""

from __future__ import annotations

from math import pi

DEG = pi / 180.0

# SI unit of the house -> unit in the file -> factor.
ACCEPTED: dict[str, dict[str, float]] = {
    "1": {"1": 1.0, "%": 0.01},
    "rad": {"rad": 1.0, "deg": DEG},
    "rad/s": {"rad/s": 1.0, "deg/s": DEG, "rpm": 2.0 * pi / 60.0, "rev/s": 2.0 * pi, "Hz": 2.0 * pi},
    "1/rad": {"1/rad": 1.0, "1/deg": 1.0 / DEG},
    "1/rad^2": {"1/rad^2": 1.0, "1/deg^2": 1.0 / (DEG * DEG)},
    "m": {"m": 1.0, "mm": 1e-3, "in": 0.0254, "ft": 0.3048},
    "m^2": {"m^2": 1.0, "ft^2": 0.3048**2},
    "m/s": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kt": 1852.0 / 3600.0, "ft/s": 0.3048},
    "m/s^2": {"m/s^2": 1.0, "ft/s^2": 0.3048},
    "kg": {"kg": 1.0, "g": 1e-3, "lb": 0.45359237},
    "kg m^2": {"kg m^2": 1.0, "slug ft^2": 1.3558179483314004},
    "kg/m^3": {"kg/m^3": 1.0},
    "kg/s": {"kg/s": 1.0, "g/h": 1e-3 / 3600.0, "kg/h": 1.0 / 3600.0},
    "N": {"N": 1.0, "lbf": 4.4482216152605},
    "W": {"W": 1.0, "kW": 1e3, "hp": 745.69987158227022},
    "Pa": {"Pa": 1.0, "hPa": 100.0, "kPa": 1e3},
    "s": {"s": 1.0, "ms": 1e-3},
    "Hz": {"Hz": 1.0},
}
