"""Which controllers there are, and gains from the `[autopilot]` table of an aircraft or scenario file.

    [autopilot]
    controller = "vireo"
    [autopilot.gains]                    every gain of the controller, { v, unit, src[, assumed, note] }
    bank_kp = { v = -0.34, unit = "rad/rad", src = "..." }
    [autopilot.guidance]                 the gains of the track law, same form
    [autopilot.variants.NAME]            gains that differ in a variant (optional)

A scenario may hold the same tables; what it gives replaces what the aircraft file gives.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from math import isfinite
from types import ModuleType
from typing import Any, NamedTuple

from ..aircraft.units import ACCEPTED
from ..core.errors import WrongUse
from . import guidance

CONTROLLERS = ("vireo", "ultrastick", "aerosonde", "aerosim_mpc", "ducard")
TABLES = ("controller", "gains", "guidance", "variants")


class Autopilot(NamedTuple):
    """A controller with its numbers.

    module: Gains, UNITS, RATE_HZ, State, Command, init, step. gains: its Gains. guidance: for
    `guidance.plan`.
    """

    name: str
    module: ModuleType
    gains: Any
    guidance: guidance.Gains


def controller(name: str) -> ModuleType:
    """The module of one controller.

    >>> from aerofdi.autopilot import controller
    >>> controller("vireo").Command._fields
    ('elevon_left', 'elevon_right', 'throttle')
    """
    if name not in CONTROLLERS:
        raise WrongUse(f"autopilot {name!r} is not known; known are {', '.join(CONTROLLERS)}")
    return importlib.import_module(f"{__package__}.{name}")


def _number(who: str, name: str, unit: str, entry: Any) -> float:
    """The value of one entry in the unit the controller uses."""
    if not isinstance(entry, Mapping) or not {"v", "unit", "src"} <= set(entry):
        raise WrongUse(
            f"{who}: gain {name!r} needs {{ v = number, unit = {unit!r}, src = source }}; got {entry!r}"
        )
    value, given = entry["v"], entry["unit"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise WrongUse(f"{who}: gain {name!r} must be a finite number, got {value!r}")
    accepted = ACCEPTED.get(unit, {unit: 1.0})
    if given not in accepted:
        raise WrongUse(f"{who}: gain {name!r} is in {given!r}; accepted: {', '.join(accepted)}")
    return float(value) * accepted[given]


def load_gains(name: str, table: Mapping[str, Any], who: str = "this file") -> Any:
    """The Gains of controller `name` (or of "guidance") from { v, unit, src[, assumed, note] } entries.

    Raises WrongUse, naming `who` and the gain, for a missing or unknown gain, a wrong unit, or no source.
    """
    module = guidance if name == "guidance" else controller(name)
    missing = [k for k in module.Gains._fields if k not in table]
    unknown = [k for k in table if k not in module.Gains._fields]
    if missing or unknown:
        parts = [f"lack {', '.join(missing)}"] if missing else []
        parts += [f"have the unknown {', '.join(unknown)}"] if unknown else []
        raise WrongUse(
            f"{who}: the gains of {name!r} {' and '.join(parts)}; known are {', '.join(module.Gains._fields)}"
        )
    return module.Gains(*(_number(who, k, module.UNITS[k], table[k]) for k in module.Gains._fields))


def autopilot_of(
    table: Mapping[str, Any],
    changes: Mapping[str, Any] | None = None,
    variant: str = "",
    who: str = "this file",
) -> Autopilot:
    """The autopilot an aircraft file's `[autopilot]` table describes, with a scenario's changes on top.

    table: `Aircraft.autopilot`. changes: the same tables, where some entries may be missing; another
    controller must bring all its gains. variant: name in `[autopilot.variants]`.
    """
    changes = changes or {}
    for source in (table, changes):
        unknown = [k for k in source if k not in TABLES]
        if unknown:
            raise WrongUse(
                f"{who}: [autopilot] has the unknown {', '.join(unknown)}; known are {', '.join(TABLES)}"
            )
    name = changes.get("controller", table.get("controller"))
    if not name:
        raise WrongUse(f"{who}: [autopilot] names no controller; accepted: {', '.join(CONTROLLERS)}")
    variants = table.get("variants", {})
    if variant and variant not in variants:
        raise WrongUse(
            f"{who}: autopilot variant {variant!r} is not known; known are {', '.join(variants) or 'none'}"
        )
    own = table.get("gains", {}) if name == table.get("controller") else {}
    gains = {**own, **variants.get(variant, {}), **changes.get("gains", {})}
    track = {**table.get("guidance", {}), **changes.get("guidance", {})}
    return Autopilot(name, controller(name), load_gains(name, gains, who), load_gains("guidance", track, who))
