"""What no single number shows: a body that cannot exist, an envelope without inside, a map that does not fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .lines import Path_
from .types import Number

Fault = tuple[Path_, str]


def physical_fault(numbers: Mapping[str, Number], settings: Mapping[str, str]) -> Fault | None:
    """The first thing that cannot be: the key to blame and the message; None where all is well."""
    value = {k: n.value for k, n in numbers.items()}
    for section in ("mass", "mass.full"):
        if f"{section}.Ixx" in value:
            fault = _inertia(section, *(value[f"{section}.{k}"] for k in ("Ixx", "Iyy", "Izz", "Ixz")))
            if fault:
                return fault
    if "mass.full.mass" in value and value["mass.full.mass"] <= value["mass.mass"]:
        return ("mass", "full", "mass"), "the full mass must be above the empty mass in [mass]"
    if not value["envelope.min_airspeed"] < value["envelope.max_airspeed"]:
        return ("envelope", "min_airspeed"), "min_airspeed must be below max_airspeed"
    if settings["atmosphere.model"] == "constant" and "atmosphere.density" not in value:
        return ("atmosphere",), "[atmosphere] with a constant density misses 'density' (kg/m^3)"
    if settings["propulsion.kind"] == "engine_map":
        return _engine_map({k.split(".")[1]: v for k, v in value.items() if k.startswith("propulsion.")})
    return None


def _inertia(section: str, xx: float, yy: float, zz: float, xz: float) -> Fault | None:
    tensor = np.array([[xx, 0.0, -xz], [0.0, yy, 0.0], [-xz, 0.0, zz]])
    a, b, c = np.linalg.eigvalsh(tensor)
    if a > 0.0 and a + b >= c * (1.0 - 1e-9):
        return None
    return (
        (*section.split("."), "Ixx"),
        f"the inertia of [{section}] is not that of any body: principal moments {a:.4g}, {b:.4g}, {c:.4g} "
        f"kg m^2 must be positive and none above the sum of the other two",
    )


def _engine_map(value: dict[str, Any]) -> Fault | None:
    ratios, speeds, pressures = (
        len(value[k]) for k in ("advance_ratio", "engine_speed", "manifold_pressure")
    )
    sizes = {
        "CT": (ratios,),
        "CP": (ratios,),
        "power": (speeds, pressures),
        "fuel_flow": (speeds, pressures),
    }
    for key, size in sizes.items():
        if value[key].shape != size:
            return ("propulsion", key), f"propulsion.{key} has shape {value[key].shape}, expected {size}"
    for key in ("advance_ratio", "engine_speed", "manifold_pressure"):
        if len(value[key]) < 2 or (np.diff(value[key]) <= 0.0).any():
            return ("propulsion", key), f"propulsion.{key} must increase strictly"
    return None
