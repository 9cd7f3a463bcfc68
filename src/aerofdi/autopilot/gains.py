"""Which controllers there are, and gains from the `[autopilot]` table of an aircraft or scenario file."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from math import isfinite, pi
from types import ModuleType
from typing import Any

from ..core.errors import WrongUse

CONTROLLERS = ("vireo", "ultrastick", "aerosonde", "aerosim_mpc", "ducard")
_DEGREE = pi / 180.0


def controller(name: str) -> ModuleType:
    """The module of one controller: Gains, UNITS, RATE_HZ, State, Command, init, step.

    >>> from aerofdi.autopilot import controller
    >>> controller("vireo").Command._fields
    ('elevon_left', 'elevon_right', 'throttle')
    """
    if name not in CONTROLLERS:
        raise WrongUse(f"autopilot {name!r} is not known; known are {', '.join(CONTROLLERS)}")
    return importlib.import_module(f"{__package__}.{name}")


def _number(who: str, name: str, unit: str, entry: Any) -> float:
    """The value of one entry in the unit the controller uses; deg and deg/s are turned into radians."""
    if not isinstance(entry, Mapping) or "v" not in entry or "unit" not in entry or "src" not in entry:
        raise WrongUse(
            f"{who}: gain {name!r} needs {{ v = number, unit = {unit!r}, src = source }}; got {entry!r}"
        )
    value, given = entry["v"], entry["unit"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise WrongUse(f"{who}: gain {name!r} must be a finite number, got {value!r}")
    scale = {(unit, unit): 1.0, ("rad", "deg"): _DEGREE, ("rad/s", "deg/s"): _DEGREE}.get((unit, given))
    if scale is None:
        raise WrongUse(
            f"{who}: gain {name!r} is in {given!r}; accepted: {unit!r}{' or deg' if 'rad' in unit else ''}"
        )
    return float(value) * scale


def load_gains(name: str, table: Mapping[str, Any], who: str = "this file") -> Any:
    """The Gains of controller `name` (or "guidance") from { v, unit, src[, assumed, note] } entries.

    Raises WrongUse, naming `who` and the gain, for a missing or unknown gain, a wrong unit, or no source.
    """
    module = importlib.import_module(f"{__package__}.guidance") if name == "guidance" else controller(name)
    missing = [k for k in module.Gains._fields if k not in table]
    unknown = [k for k in table if k not in module.Gains._fields]
    if missing or unknown:
        parts = [f"misses {', '.join(missing)}"] if missing else []
        parts += [f"has unknown {', '.join(unknown)}"] if unknown else []
        raise WrongUse(f"{who}: the gains of autopilot {name!r} {' and '.join(parts)}")
    return module.Gains(*(_number(who, k, module.UNITS[k], table[k]) for k in module.Gains._fields))
