"""From an aircraft file to the parameters of its plant."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..aircraft import Aircraft
from ..aircraft.schema import TABLE_INPUTS
from ..core.errors import WrongUse
from ..core.types import Array
from .aero import ControlDerivatives, DerivativeAero, Derivatives
from .atmosphere import ISA_DENSITY, ISA_DENSITY_EXPONENT, ISA_LAPSE, Air
from .plant import Body, MassProperties, PlantParams, Wing
from .propulsion import (
    ActuatorDisc,
    EngineMap,
    PropellerPower,
    PropellerSpeed,
    ThrustLaw,
)
from .rigid_body import Inertia
from .tables import TableAero, TableControl
from .types import N_SURFACES, Surfaces

_ROWS = ("CD", "CY", "CL", "Cl", "Cm", "Cn")


def plant_params(aircraft: Aircraft) -> PlantParams:
    """Everything `plant` needs of an aircraft of kind "full"; WrongUse for an identified one.

    >>> from aerofdi.aircraft import load_aircraft
    >>> plant_params(load_aircraft("vireo")).body.mass.mass
    1.28
    """
    if aircraft.kind != "full":
        raise WrongUse(
            f"aircraft {aircraft.name!r} was identified from flights and has no equations of motion; "
            f"give an aircraft file of kind 'full'"
        )
    tables = aircraft.settings["aero.kind"] == "tables"
    return PlantParams(
        control=_table_control(aircraft) if tables else _control_derivatives(aircraft),
        body=Body(
            _air(aircraft),
            _mass(aircraft),
            _wing(aircraft),
            _table_aero(aircraft) if tables else _derivative_aero(aircraft),
            _propulsion(aircraft),
        ),
    )


def fuel_capacity(aircraft: Aircraft) -> float:
    """Mass of a full tank, kg; 0 without one."""
    return aircraft.number("mass.full.mass", aircraft.number("mass.mass")) - aircraft.number("mass.mass")


def surfaces_tuple(values: Any) -> Surfaces:
    """Deflections in rad in the order of `aircraft.surfaces`, filled up with zeros."""
    flat = [float(v) for v in values]
    return tuple(flat + [0.0] * (N_SURFACES - len(flat)))  # type: ignore[return-value]


def _air(a: Aircraft) -> Air:
    gravity = a.number("reference.gravity")
    if a.settings["atmosphere.model"] == "constant":
        return Air(a.number("atmosphere.density"), 0.0, 0.0, gravity)
    return Air(a.number("atmosphere.density", ISA_DENSITY), ISA_LAPSE, ISA_DENSITY_EXPONENT, gravity)


def _vector(a: Aircraft, path: str, default: str = "") -> Array:
    for key in (path, default):
        if key in a.numbers:
            return np.asarray(a.numbers[key].value, float)
    return np.zeros(3)


def _mass(a: Aircraft) -> MassProperties:
    names = ("Ixx", "Iyy", "Izz", "Ixz")
    empty = np.array([a.number(f"mass.{k}") for k in names])
    fuel = fuel_capacity(a)
    cg = _vector(a, "geometry.center_of_gravity")
    slope, cg_slope = np.zeros(4), np.zeros(3)
    if fuel > 0.0:
        slope = (np.array([a.number(f"mass.full.{k}") for k in names]) - empty) / fuel
        cg_slope = (_vector(a, "mass.full.center_of_gravity", "geometry.center_of_gravity") - cg) / fuel
    return MassProperties(
        a.number("mass.mass"),
        Inertia(*empty.tolist()),
        Inertia(*slope.tolist()),
        float(cg[0]),
        float(cg[2]),
        float(cg_slope[0]),
        float(cg_slope[2]),
    )


def _wing(a: Aircraft) -> Wing:
    section = "aero" if a.settings["aero.kind"] == "tables" else "aero.derivatives"
    # A missing position is that of the centre of gravity, so that it makes no moment.
    reference = _vector(a, "geometry.aerodynamic_reference", "geometry.center_of_gravity")
    hub = _vector(a, "geometry.propeller", "geometry.center_of_gravity")
    return Wing(
        a.number("reference.wing_area"),
        a.number("reference.chord"),
        a.number("reference.span"),
        float(reference[0]),
        float(reference[2]),
        a.number("geometry.wing_half_arm"),
        1.0 if a.settings["aero.axes"] == "wind" else 0.0,
        a.number(f"{section}.CL_alpha_dot", 0.0),
        a.number(f"{section}.Cm_alpha_dot", 0.0),
        float(hub[0]),
        float(hub[2]),
    )


def _rows(matrix: Array) -> Any:
    return tuple(surfaces_tuple(row) for row in matrix)


def _control_derivatives(a: Aircraft) -> ControlDerivatives:
    """Column per surface: sum over the inputs it feeds of weight times derivative (|weight| for drag)."""
    clean = np.zeros((6, len(a.surfaces)))
    ice = np.zeros_like(clean)
    for j, surface in enumerate(a.surfaces):
        for name, weight in surface.feeds.items():
            for i, row in enumerate(_ROWS):
                c = a.number(f"aero.control.{name}.{row}", 0.0) * (abs(weight) if row == "CD" else weight)
                clean[i, j] += c
                ice[i, j] += c * a.number(f"aero.icing.control.{name}.{row}", 0.0)
    return ControlDerivatives(_rows(clean), _rows(ice))


def _derivative_aero(a: Aircraft) -> DerivativeAero:
    names = Derivatives._fields
    return DerivativeAero(
        Derivatives(*(a.number(f"aero.derivatives.{k}", 0.0) for k in names)),
        Derivatives(*(a.number(f"aero.icing.{k}", 0.0) for k in names)),
        a.number("aero.derivatives.CD_induced", 0.0),
        a.number("aero.derivatives.CL_min_drag", 0.0),
        a.number("aero.stall.rate", 0.0),
        a.number("aero.stall.alpha", 0.0),
    )


def _table_control(a: Aircraft) -> TableControl:
    weights = np.array([[s.feeds.get(name, 0.0) for s in a.surfaces] for name in TABLE_INPUTS])
    return TableControl(_rows(weights))


def _table_aero(a: Aircraft) -> TableAero:
    t = a.tables
    J = a.number("aero.advance_ratio")
    span = a.number("reference.span")
    if not (
        np.array_equal(t["base.alpha"], t["aileron.alpha"])
        and np.array_equal(t["base.alpha"], t["rudder.alpha"])
    ):
        raise WrongUse(
            f"{a.path}: the tables base, aileron, rudder, elevator, flap must have the same alpha axis"
        )

    def at_ratio(name: str, axis: int) -> Array:
        """The table at the advance ratio, its axis gone, edges held."""
        x, data = t[f"{name}.advance_ratio"], t[f"{name}.data"]
        j = int(np.clip(np.searchsorted(x, J) - 1, 0, len(x) - 2))
        f = float(np.clip((J - x[j]) / (x[j + 1] - x[j]), 0.0, 1.0))
        return np.ascontiguousarray((1.0 - f) * data.take(j, axis) + f * data.take(j + 1, axis))

    def half(side: str) -> tuple[float, float]:
        share = a.number(f"aero.rudder.share_{side}")
        return share, share * a.number(f"aero.rudder.arm_{side}") / span

    return TableAero(
        t["base.alpha"], t["base.beta"], t["base.data"],
        t["aileron.deflection"], t["aileron.data"],
        t["rudder.deflection"], at_ratio("rudder", 3),
        t["elevator.deflection"], at_ratio("elevator", 2),
        t["flap.deflection"], at_ratio("flap", 2),
        t["roll_rate.alpha"], t["roll_rate.p_hat"], t["roll_rate.data"],
        t["yaw_rate.alpha"], t["yaw_rate.r_hat"], t["yaw_rate.data"],
        half("top"), half("bottom"),
        a.number("aero.Cm_q"), a.number("aero.CL_q", 0.0),
    )  # fmt: skip


def _propulsion(a: Aircraft) -> Any:
    kind = a.settings["propulsion.kind"]

    def n(key: str) -> float:
        return a.number(f"propulsion.{key}")

    def array(key: str) -> Array:
        return np.ascontiguousarray(a.numbers[f"propulsion.{key}"].value)

    def coefficients(key: str) -> Any:
        return tuple(array(key).tolist())

    if kind == "thrust_law":
        return ThrustLaw(n("max_thrust"), n("airspeed"), n("exponent"), n("min_airspeed"), n("time_constant"))
    if kind == "actuator_disc":
        return ActuatorDisc(n("area"), n("efficiency"), n("speed"))
    if kind == "propeller_speed":
        CT_0, CT_1, CT_2 = coefficients("CT")
        return PropellerSpeed(n("diameter"), CT_0, CT_1, CT_2, n("max_speed"), n("time_constant"))
    if kind == "propeller_power":
        return PropellerPower(
            n("diameter"), coefficients("CT"), coefficients("CP"), n("max_advance_ratio"), coefficients("power"),
            n("max_power"), n("max_speed"), n("inertia"), n("rotation"),
        )  # fmt: skip
    return EngineMap(
        n("diameter"), array("advance_ratio"), array("CT"), array("CP"), array("engine_speed"),
        array("manifold_pressure"), array("power"), array("fuel_flow"), n("inertia"), n("rotation"),
    )  # fmt: skip
