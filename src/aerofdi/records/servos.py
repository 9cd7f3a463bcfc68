"""Actuator outputs -> normalised surface commands, by what the autopilot's own parameters say."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core import Array, Flight, Series
from .log import Log, Table
from .profile import Profile

# SERVOn_FUNCTION -> surface, and the moment a positive normalised command asks for.
ARDUPILOT_FUNCTIONS: dict[int, tuple[str, dict[str, int]]] = {
    2: ("flap", {}),
    3: ("flap", {}),
    4: ("aileron", {"roll": 1}),
    19: ("elevator", {"pitch": 1}),
    21: ("rudder", {"yaw": 1}),
    24: ("flaperon_left", {"roll": 1}),
    25: ("flaperon_right", {"roll": 1}),
    70: ("throttle", {}),
    77: ("elevon_left", {"pitch": 1, "roll": -1}),
    78: ("elevon_right", {"pitch": 1, "roll": 1}),
    79: ("vtail_left", {"pitch": 1, "yaw": -1}),
    80: ("vtail_right", {"pitch": 1, "yaw": 1}),
}
# Outputs that run from MIN to MAX (0 to 1) instead of about TRIM (-1 to 1).
RANGE_FUNCTIONS = {2, 3, 70}
DEFAULT_FUNCTIONS = {1: 4, 2: 19, 3: 70, 4: 21}
DEFAULT_US = (1100.0, 1500.0, 1900.0)
MAX_OUTPUTS = 32
# MAV_TYPE of fixed wings and VTOLs.
WINGED_TYPES = frozenset((1, 19, 20, 21, 22, 23, 24, 25))


def pwm_to_command(pwm: Array, low: float, trim: float, high: float, reverse: bool, ranged: bool) -> Array:
    """The normalised command behind a servo pulse, the inverse of what ArduPilot's output stage does.

    About trim, separately on each side: (pwm - trim) / (high - trim) or / (trim - low); ranged: (pwm - low) /
    (high - low). A pulse of 0 means the output is off: NaN.
    """
    pwm = np.where(pwm > 0, pwm, np.nan)
    if ranged:
        value = (pwm - low) / max(high - low, 1.0)
        return 1.0 - value if reverse else value
    up, down = max(high - trim, 1.0), max(trim - low, 1.0)
    value = np.where(pwm >= trim, (pwm - trim) / up, (pwm - trim) / down)
    return -value if reverse else value


def _is_plane(log: Log) -> bool:
    """Whether the autopilot flies a fixed wing or a VTOL, as far as the log says; True where it does not say."""
    firmware = str(log.info.get("firmware", "ArduPlane"))
    heartbeat = log.tables.get("HEARTBEAT")
    kinds = (
        set()
        if heartbeat is None
        else set(np.asarray(heartbeat.columns.get("type", [])).astype(int).tolist())
    )
    return firmware.startswith("ArduPlane") and (not kinds or bool(kinds & WINGED_TYPES))


def _functions(log: Log, meta: dict[str, Any]) -> dict[int, int]:
    """Output number -> surface function: by the log's parameters, else ArduPlane's defaults, said in meta."""
    given = {n: log.parameters.get(f"SERVO{n}_FUNCTION") for n in range(1, MAX_OUTPUTS + 1)}
    known = {n: int(value) for n, value in given.items() if value is not None and np.isfinite(value)}
    if known:
        return {n: function for n, function in known.items() if function in ARDUPILOT_FUNCTIONS}
    meta["assumed"].append(
        "the log holds no SERVOn parameters: outputs 1 aileron, 2 elevator, 3 throttle, 4 rudder "
        "with 1100, 1500, 1900 us are assumed (ArduPlane's defaults)"
    )
    return dict(DEFAULT_FUNCTIONS)


def _travel(log: Log, n: int, assumed: list[str]) -> tuple[float, float, float, bool]:
    keys = [f"SERVO{n}_{key}" for key in ("MIN", "TRIM", "MAX")]
    if all(key in log.parameters for key in keys):
        low, trim, high = (float(log.parameters[key]) for key in keys)
        if low <= trim <= high and low < high:
            return low, trim, high, bool(log.parameters.get(f"SERVO{n}_REVERSED", 0.0))
        assumed.append(f"output {n}: its MIN, TRIM, MAX are not in order; 1100, 1500, 1900 us are assumed")
    elif f"SERVO{n}_FUNCTION" in log.parameters:
        assumed.append(f"output {n}: its MIN, TRIM, MAX are not in the log; 1100, 1500, 1900 us are assumed")
    return *DEFAULT_US, False


def _pulses(log: Log, profile: Profile) -> tuple[Table, dict[int, str]] | None:
    """The topic that holds the pulses, and output number -> field, by the first pattern whose topic is there."""
    for pattern in profile.outputs.get("topics", ()):
        topic, _, form = pattern.partition(".")
        if topic in log.tables:
            table = log.tables[topic]
            fields = {
                n: form.replace("{n}", str(n)).replace("{n0}", str(n - 1)) for n in range(1, MAX_OUTPUTS + 1)
            }
            return table, {n: name for n, name in fields.items() if name in table.columns}
    return None


def ardupilot_surfaces(log: Log, profile: Profile, flight: Flight) -> None:
    """Add `command.<surface>` and `throttle` from servo pulses (profile [outputs] topics 'TOPIC.FIELD{n}').

    By SERVOn_FUNCTION, _MIN, _TRIM, _MAX, _REVERSED; without them by ArduPlane's default outputs, marked in
    meta['assumed']. Several outputs with one function carry one command: they are named <surface>_servoN and
    grouped under <surface>. [outputs.names] of the profile may name outputs otherwise.
    """
    found = _pulses(log, profile)
    if not _is_plane(log):
        flight.meta["notes"].append(
            "the vehicle is no ArduPlane fixed wing or VTOL: its outputs are no control surfaces, its modes unnamed"
        )
        if "mode" in flight.measured:
            flight.measured["mode"] = flight.measured["mode"]._replace(codes=None)
        return
    if found is None:
        return
    table, columns = found
    functions = _functions(log, flight.meta)
    names = {int(n): name for n, name in profile.outputs.get("names", {}).items()}
    used = {n: f for n, f in functions.items() if n in columns}
    if not used:
        flight.meta["notes"].append("no surface commands: no SERVOn_FUNCTION names a control surface")
    for n, function in used.items():
        surface, signs = ARDUPILOT_FUNCTIONS[function]
        travel = _travel(log, n, flight.meta["assumed"])
        pwm = np.asarray(table.columns[columns[n]], dtype=float)
        value = pwm_to_command(pwm, *travel, ranged=function in RANGE_FUNCTIONS)
        if not np.isfinite(value).any():
            flight.meta["notes"].append(f"output {n} ({surface}) is left out: its pulse is 0 throughout")
            continue
        series = Series(np.asarray(table.t_s, float), value, "1")
        if surface == "throttle":
            flight.measured.setdefault("throttle", series._replace(value=np.clip(value, 0.0, 1.0)))
            continue
        alone = list(used.values()).count(function) == 1
        name = names.get(n, surface if alone else f"{surface}_servo{n}")
        flight.measured[f"command.{name}"] = series
        _describe_surface(flight, name, surface, signs, n, travel)


def _describe_surface(
    flight: Flight,
    name: str,
    surface: str,
    signs: dict[str, int],
    n: int,
    travel: tuple[float, float, float, bool],
) -> None:
    low, trim, high, reverse = travel
    meta = flight.meta
    if signs:
        meta["surface_signs"][name] = dict(signs)
    direction = -1.0 if reverse else 1.0
    meta["servos"][name] = {
        "output": n,
        "neutral_us": trim,
        "us_per_unit": direction * ((trim - low) if reverse else (high - trim)),
        "us_per_unit_negative": direction * ((high - trim) if reverse else (trim - low)),
    }
    if name != surface:
        meta["groups"].setdefault(surface, []).append(name)
