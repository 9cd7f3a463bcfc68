"""What an aircraft file may and must hold: one schema for every aircraft, as data.

Section -> key -> Item (a number and its SI unit) or Choice (a word). Sections of aerodynamics and propulsion depend on
their `kind`. docs/add_an_aircraft.md explains every section with an example.
"""

from __future__ import annotations

import math
from typing import NamedTuple

INF = math.inf


class Item(NamedTuple):
    """A number. unit: SI, see units.py. rank: 0 scalar, 1 list, 2 table. low, high: open bounds on every value;
    closed: the bounds belong to the range. size: length of a list, 0 for any."""

    unit: str
    required: bool = True
    rank: int = 0
    low: float = -INF
    high: float = INF
    closed: bool = False
    size: int = 0


class Choice(NamedTuple):
    """A word. choices: those accepted, empty for any text."""

    choices: tuple[str, ...] = ()
    required: bool = True


Section = dict[str, Item | Choice]


def positive(unit: str, required: bool = True) -> Item:
    return Item(unit, required, low=0.0)


def not_negative(unit: str, required: bool = True) -> Item:
    return Item(unit, required, low=0.0, closed=True)


def free(unit: str, required: bool = True) -> Item:
    return Item(unit, required)


def optional(unit: str) -> Item:
    return Item(unit, required=False)


INERTIA: Section = {
    "Ixx": positive("kg m^2"),
    "Iyy": positive("kg m^2"),
    "Izz": positive("kg m^2"),
    "Ixz": free("kg m^2"),
}

# Positions are structural: x aft, y right, z up, from any common datum.
POSITION = Item("m", required=False, rank=1, size=3)

SECTIONS: dict[str, Section] = {
    "reference": {
        "airspeed": positive("m/s"),
        "altitude": free("m"),
        "wing_area": positive("m^2"),
        "chord": positive("m"),
        "span": positive("m"),
        "gravity": positive("m/s^2"),
    },
    "envelope": {
        "min_airspeed": positive("m/s"),
        "max_airspeed": positive("m/s"),
        "airspeed_rate": positive("m/s^2", required=False),
        "min_alpha": optional("rad"),
        "max_alpha": optional("rad"),
        "max_beta": positive("rad", required=False),
    },
    "atmosphere": {"model": Choice(("isa", "constant")), "density": positive("kg/m^3", required=False)},
    "mass": {"mass": positive("kg"), **INERTIA},
    "mass.full": {"mass": positive("kg"), **INERTIA, "center_of_gravity": POSITION},
    "geometry": {
        "wing_half_arm": positive("m"),
        "center_of_gravity": POSITION,
        "aerodynamic_reference": POSITION,
        "propeller": POSITION,
    },
}
OPTIONAL_SECTIONS = ("mass.full",)

_ANGLE, _RATE = free("1/rad"), optional("1/rad")
DERIVATIVES: Section = {
    "CL_0": free("1"),
    "CL_alpha": _ANGLE,
    "CL_q": _RATE,
    "CD_0": positive("1"),
    "CD_alpha": _RATE,
    "CD_alpha2": optional("1/rad^2"),
    "CD_beta2": optional("1/rad^2"),
    "CD_q": _RATE,
    "CD_induced": not_negative("1", required=False),
    "CL_min_drag": optional("1"),
    "CY_0": optional("1"),
    "CY_beta": _ANGLE,
    "CY_p": _RATE,
    "CY_r": _RATE,
    "Cl_0": optional("1"),
    "Cl_beta": _ANGLE,
    "Cl_p": _ANGLE,
    "Cl_r": _RATE,
    "Cm_0": free("1"),
    "Cm_alpha": _ANGLE,
    "Cm_q": _ANGLE,
    "Cn_0": optional("1"),
    "Cn_beta": _ANGLE,
    "Cn_p": _RATE,
    "Cn_r": _ANGLE,
    "CL_alpha_dot": _RATE,
    "Cm_alpha_dot": _RATE,
}
CONTROL: Section = {name: _RATE for name in ("CD", "CY", "CL", "Cl", "Cm", "Cn")}
ICING: Section = {
    k: optional("1")
    for k in DERIVATIVES
    if k not in ("CD_induced", "CL_min_drag", "CL_alpha_dot", "Cm_alpha_dot")
}
ICING_CONTROL: Section = {name: optional("1") for name in CONTROL}
TABLE_INPUTS = ("elevator", "aileron_left", "aileron_right", "rudder_top", "rudder_bottom", "flap")

_AXES = Choice(("body", "wind"))
AERO: dict[str, dict[str, Section]] = {
    "derivatives": {
        "aero": {"kind": Choice(("derivatives",)), "axes": _AXES},
        "aero.derivatives": DERIVATIVES,
        "aero.stall": {"rate": positive("1/rad"), "alpha": positive("rad")},
        "aero.icing": ICING,
    },
    "tables": {
        "aero": {
            "kind": Choice(("tables",)),
            "axes": _AXES,
            "file": Choice(),
            "advance_ratio": not_negative("1"),
            "Cm_q": _ANGLE,
            "CL_q": _RATE,
            "CL_alpha_dot": _RATE,
            "Cm_alpha_dot": _RATE,
        },
        "aero.rudder": {
            "share_top": not_negative("1"),
            "share_bottom": not_negative("1"),
            "arm_top": free("m"),
            "arm_bottom": free("m"),
        },
    },
}
OPTIONAL_AERO = ("aero.stall", "aero.icing")

_ROTATION = Item("1", low=-1.0, high=1.0, closed=True)
PROPULSION: dict[str, Section] = {
    "thrust_law": {
        "max_thrust": positive("N"),
        "airspeed": positive("m/s"),
        "exponent": free("1"),
        "min_airspeed": positive("m/s"),
        "time_constant": positive("s"),
    },
    "actuator_disc": {"area": positive("m^2"), "efficiency": positive("1"), "speed": positive("m/s")},
    "propeller_speed": {
        "diameter": positive("m"),
        "CT": Item("1", rank=1, size=3),
        "max_speed": positive("rad/s"),
        "time_constant": positive("s"),
    },
    "propeller_power": {
        "diameter": positive("m"),
        "CT": Item("1", rank=1, size=5),
        "CP": Item("1", rank=1, size=5),
        "max_advance_ratio": positive("1"),
        "power": Item("W", rank=1, size=3),
        "max_power": positive("W"),
        "max_speed": positive("rad/s"),
        "inertia": positive("kg m^2"),
        "rotation": _ROTATION,
    },
    "engine_map": {
        "diameter": positive("m"),
        "advance_ratio": Item("1", rank=1),
        "CT": Item("1", rank=1),
        "CP": Item("1", rank=1),
        "engine_speed": Item("rad/s", rank=1, low=0.0),
        "manifold_pressure": Item("Pa", rank=1, low=0.0),
        "power": Item("W", rank=2),
        "fuel_flow": Item("kg/s", rank=2, low=0.0, closed=True),
        "inertia": positive("kg m^2"),
        "rotation": _ROTATION,
    },
}

SURFACE_NAMES = (
    "aileron_left",
    "aileron_right",
    "elevator",
    "elevator_left",
    "elevator_right",
    "rudder",
    "rudder_top",
    "rudder_bottom",
    "elevon_left",
    "elevon_right",
    "flap",
    "flap_left",
    "flap_right",
)
COMMANDS = ("elevator", "aileron", "rudder", "flap")
SURFACE: Section = {
    "name": Choice(SURFACE_NAMES),
    "group": Choice(("aileron", "elevon", "elevator", "rudder", "flap")),
    "positive": Choice(),
    "min": free("rad"),
    "max": free("rad"),
    "rate_limit": positive("rad/s", required=False),
    "actuator": Choice(("none", "first_order", "second_order")),
    "bandwidth": positive("rad/s", required=False),
    "damping": positive("1", required=False),
    "delay": not_negative("s", required=False),
}

# Unit of each channel a sensor may have.
SENSOR_UNITS = {
    **dict.fromkeys(("p", "q", "r", "engine_speed"), "rad/s"),
    **dict.fromkeys(("phi", "theta", "psi", "alpha", "beta"), "rad"),
    **dict.fromkeys(("u", "v", "w", "airspeed", "groundspeed", "climb_rate"), "m/s"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
    **dict.fromkeys(("altitude", "north", "east"), "m"),
    "fuel_mass": "kg",
}

# Every array of a wind-tunnel file: table -> its axes in order, and the number of coefficients in the last place.
WIND_TUNNEL: dict[str, tuple[tuple[str, ...], int]] = {
    "base": (("alpha", "beta"), 6),
    "aileron": (("alpha", "beta", "deflection"), 0),
    "rudder": (("alpha", "beta", "deflection", "advance_ratio"), 2),
    "elevator": (("alpha", "deflection", "advance_ratio"), 3),
    "flap": (("alpha", "deflection", "advance_ratio"), 3),
    "roll_rate": (("alpha", "p_hat"), 3),
    "yaw_rate": (("alpha", "r_hat"), 3),
}
