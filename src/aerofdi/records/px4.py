"""PX4 actuator topics -> surface commands, old and new firmware."""

from __future__ import annotations

import numpy as np

from ..core import Array, Flight, Series
from .log import Log, Table
from .profile import Profile

# CA_SV_CSn_TYPE -> surface.
SURFACE_TYPES = {
    1: "aileron_left",
    2: "aileron_right",
    3: "elevator",
    4: "rudder",
    5: "elevon_left",
    6: "elevon_right",
    7: "vtail_left",
    8: "vtail_right",
    9: "flap_left",
    10: "flap_right",
    11: "airbrake",
    13: "atail_left",
    14: "atail_right",
    15: "aileron",
    17: "spoiler_left",
    18: "spoiler_right",
}
TYPE_SIGNS: dict[str, dict[str, int]] = {
    "aileron_left": {"roll": -1},
    "aileron_right": {"roll": 1},
    "aileron": {"roll": 1},
    "elevator": {"pitch": 1},
    "rudder": {"yaw": 1},
    "elevon_left": {"roll": -1, "pitch": 1},
    "elevon_right": {"roll": 1, "pitch": 1},
}
AXIS_SURFACES = (("aileron", "roll"), ("elevator", "pitch"), ("rudder", "yaw"))
FIXED_WING = 2
ROTARY_WING = 1


def _any_equal(log: Log, field: str, value: float) -> bool:
    table = log.tables.get("vehicle_status")
    column = None if table is None else table.columns.get(field)
    return column is not None and bool(np.any(np.asarray(column) == value))


def has_wings(log: Log) -> bool:
    """Whether the vehicle ever flew, or may fly, on wings: fixed wing or VTOL, old and new status fields."""
    if _any_equal(log, "is_vtol", 1) or _any_equal(log, "vehicle_type", FIXED_WING):
        return True
    # Firmware before 1.9 says only whether it is rotary.
    return "vehicle_type" not in _columns(log, "vehicle_status") and _any_equal(log, "is_rotary_wing", 0)


def is_vtol(log: Log) -> bool:
    return _any_equal(log, "is_vtol", 1)


def _columns(log: Log, topic: str) -> dict[str, Array]:
    table = log.tables.get(topic)
    return {} if table is None else table.columns


def _series(table: Table, field: str) -> Series | None:
    value = np.asarray(table.columns[field], dtype=float) if field in table.columns else None
    if value is None or not np.isfinite(value).any():
        return None
    return Series(table.t_s, value, "1")


def _from_servos(log: Log, names: dict[int, str], flight: Flight) -> bool:
    """Commands of single surfaces: actuator_servos, named by CA_SV_CSn_TYPE, signed by CA_SV_CSn_TRQ_x."""
    table = log.tables.get("actuator_servos")
    if table is None or not len(table.t_s):
        return False
    count = log.parameters.get("CA_SV_CS_COUNT", 0.0)
    for k in range(8):
        kind = int(log.parameters.get(f"CA_SV_CS{k}_TYPE", 0)) if k < count else 0
        surface = names.get(k) or SURFACE_TYPES.get(kind)
        series = _series(table, f"control[{k}]")
        if surface is None or series is None:
            continue
        twin = f"command.{surface}" in flight.measured
        name = f"{surface}_servo{k + 1}" if twin else surface
        flight.measured[f"command.{name}"] = series
        signs = {}
        for axis, letter in (("roll", "R"), ("pitch", "P"), ("yaw", "Y")):
            torque = log.parameters.get(f"CA_SV_CS{k}_TRQ_{letter}", 0.0)
            if abs(torque) > 1e-3:
                signs[axis] = 1 if torque > 0 else -1
        signs = signs or dict(TYPE_SIGNS.get(surface, {}))
        if signs:
            flight.meta["surface_signs"][name] = signs
    if not count and not names:
        flight.meta["notes"].append(
            "actuator_servos is there but CA_SV_CS_COUNT is not: its outputs cannot be named; name them in "
            "[outputs.names] of a profile"
        )
    return any(name.startswith("command.") for name in flight.measured)


def _from_axes(log: Log, flight: Flight) -> None:
    """Roll, pitch and yaw demands before the mixer, named after the surface that acts on the axis."""
    vtol = is_vtol(log)
    sources = (
        ("actuator_controls_1" if vtol else "actuator_controls_0", "control[{}]"),
        ("vehicle_torque_setpoint:1" if vtol else "vehicle_torque_setpoint", "xyz[{}]"),
    )
    for topic, form in sources:
        table = log.tables.get(topic)
        if table is None or not len(table.t_s):
            continue
        for k, (surface, axis) in enumerate(AXIS_SURFACES):
            series = _series(table, form.format(k))
            if series is not None:
                flight.measured[f"command.{surface}"] = series
                flight.meta["surface_signs"][surface] = {axis: 1}
        flight.meta["assumed"].append(
            f"{topic} holds roll, pitch and yaw demands before the mixer; they are named aileron, elevator "
            f"and rudder after the axis they act on, whatever the surfaces are"
        )
        return
    flight.meta["notes"].append(
        "no surface commands: none of actuator_servos, actuator_controls_0 or _1, vehicle_torque_setpoint is "
        "in the log; pulses of actuator_outputs can be mapped in [channels] of a profile"
    )


def px4_surfaces(log: Log, profile: Profile, flight: Flight) -> None:
    """Add `command.<surface>` and `throttle` of a PX4 flight; a multicopter has none, and a note says so."""
    if not has_wings(log):
        flight.meta["notes"].append(
            "the vehicle is no fixed wing or VTOL (vehicle_status), so it has no control surfaces to judge"
        )
        return
    names = {int(k): str(v) for k, v in profile.outputs.get("names", {}).items()}
    if not _from_servos(log, names, flight):
        _from_axes(log, flight)
    for topic, field in (("actuator_motors", "control[0]"), ("actuator_controls_0", "control[3]")):
        table = log.tables.get(topic)
        series = None if table is None else _series(table, field)
        if series is not None and "throttle" not in flight.measured and not is_vtol(log):
            flight.measured["throttle"] = series
