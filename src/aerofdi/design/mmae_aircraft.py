"""The bank of `design.mmae` for one redundant pair of an aircraft file: linear model, actuators and trim from the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..aircraft import hash as hash_of
from ..aircraft.types import ACTUATOR_ORDER, Aircraft, Surface
from ..core import Array, CannotJudge, Design, WrongUse
from ..dynamics.linearise import linearise
from ..dynamics.trim import trim
from ..parts.servo import servo_coefficients
from .mmae import Tuning, design_mmae

LATERAL = ("v", "p", "r", "phi")


def redundant_groups(aircraft: Aircraft) -> dict[str, tuple[str, ...]]:
    """Groups of two surfaces and more, which can stand in for each other.

    >>> from aerofdi.aircraft import load_aircraft
    >>> redundant_groups(load_aircraft("vireo"))
    {'elevon': ('elevon_left', 'elevon_right')}
    """
    return {name: surfaces for name, surfaces in aircraft.groups.items() if len(surfaces) > 1}


def _group(aircraft: Aircraft, group: str | None) -> str:
    """The group asked for, or the only one there is."""
    found = redundant_groups(aircraft)
    if not found:
        raise CannotJudge(
            f"mmae: aircraft {aircraft.name!r} has no group of two surfaces or more; a stuck surface can then not be "
            f"told from its neighbours; give two surfaces of the file the same group"
        )
    if group is None and len(found) == 1:
        return next(iter(found))
    if group not in found:
        given = f"group {group!r} was given" if group else "no group was given"
        raise WrongUse(f"mmae: {given}, but {aircraft.name!r} has {', '.join(found)}; name one of them")
    return group


def servo_of(surface: Surface, dt_s: float) -> Array:
    """The actuator model of a surface, (8,), limits included."""
    return servo_coefficients(
        ACTUATOR_ORDER[surface.actuator], surface.bandwidth, surface.damping, surface.lower, surface.upper,
        surface.rate_limit, dt_s,
    )  # fmt: skip


def design_for_aircraft(
    aircraft: Aircraft,
    tuning: Tuning,
    dt_s: float,
    *,
    group: str | None = None,
    airspeed: float | None = None,
    states: Sequence[str] = LATERAL,
) -> Design:
    """The filters of the healthy aircraft and of each surface of a redundant group stuck.

    The model is the aircraft linearised about level flight at `airspeed` (m/s; its reference airspeed if None) in
    `states`. group: whose surfaces may be stuck (the only redundant one if None). Inputs of the model: every surface
    that moves those states; flights need their commands. tuning: names states and signals, see `design.mmae.Tuning`;
    its delays are samples at dt_s, the transport delay of the file is not added.

    Raises CannotJudge where the file has no redundant group or the surfaces of the group act in nothing that is in
    `states`, WrongUse for names it does not have.
    """
    name = _group(aircraft, group)
    suspects = redundant_groups(aircraft)[name]
    condition = trim(aircraft, airspeed)
    model = linearise(aircraft, condition, states=states, inputs=[s.name for s in aircraft.surfaces])
    moves = np.abs(model.B).max(axis=0) > 1e-9
    surfaces = [s for s, on in zip(model.inputs, moves, strict=True) if on]
    still = [s for s in suspects if s not in surfaces]
    if still:
        raise CannotJudge(
            f"mmae: {', '.join(still)} of {aircraft.name!r} moves none of {', '.join(states)}; give states it moves"
        )
    return design_mmae(
        model.A, model.B[:, moves], states, surfaces, suspects,
        np.array([servo_of(aircraft.surface(s), dt_s) for s in surfaces]), dt_s, tuning,
        trim=[float(condition.surfaces[aircraft.surface_index(s)]) for s in surfaces],
        group=name, aircraft_hash=hash_of(aircraft),
    )  # fmt: skip
