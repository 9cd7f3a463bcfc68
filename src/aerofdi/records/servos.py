"""Actuator outputs -> normalised surface commands, by what the autopilot's own parameters say."""

from __future__ import annotations

import numpy as np

from ..core import Array, Flight, Series
from .log import Log
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


def _functions(log: Log, count: int) -> dict[int, int]:
    """Output number -> surface function, from the log's parameters; empty where it has none."""
    found = {}
    for n in range(1, count + 1):
        value = log.parameters.get(f"SERVO{n}_FUNCTION")
        if value is not None and np.isfinite(value) and int(value) in ARDUPILOT_FUNCTIONS:
            found[n] = int(value)
    return found


def _travel(log: Log, n: int, assumed: list[str]) -> tuple[float, float, float, bool]:
    keys = [f"SERVO{n}_{key}" for key in ("MIN", "TRIM", "MAX")]
    if all(key in log.parameters for key in keys):
        low, trim, high = (float(log.parameters[key]) for key in keys)
        if low <= trim <= high and low < high:
            return low, trim, high, bool(log.parameters.get(f"SERVO{n}_REVERSED", 0.0))
        assumed.append(
            f"output {n}: MIN, TRIM, MAX in the log are not in order; 1100, 1500, 1900 us are used"
        )
    return *DEFAULT_US, False


def ardupilot_surfaces(log: Log, profile: Profile, flight: Flight) -> None:
    """Add `command.<surface>` and `throttle` from servo pulses (profile [outputs] topics 'TOPIC.FIELD{n}').

    By SERVOn_FUNCTION, _MIN, _TRIM, _MAX, _REVERSED; without them by ArduPlane's default outputs, marked in
    meta['assumed']. Several outputs with one function carry one command: they are named <surface>_servoN and
    grouped under <surface>. [outputs.names] of the profile may name outputs otherwise.
    """
    pattern = next((p for p in profile.outputs.get("topics", ()) if p.partition(".")[0] in log.tables), None)
    if pattern is None:
        return
    topic, _, form = pattern.partition(".")
    table = log.tables[topic]
    columns = {n: form.replace("{n}", str(n)).replace("{n0}", str(n - 1)) for n in range(1, 33)}
    columns = {n: name for n, name in columns.items() if name in table.columns}
    assumed: list[str] = flight.meta["assumed"]
    functions = _functions(log, 32)
    if not functions:
        functions = dict(DEFAULT_FUNCTIONS)
        assumed.append(
            "the log holds no SERVOn parameters: outputs 1 aileron, 2 elevator, 3 throttle, 4 rudder "
            "with 1100, 1500, 1900 us are assumed (ArduPlane's defaults)"
        )
    names = {int(n): name for n, name in profile.outputs.get("names", {}).items()}
    used = {n: f for n, f in functions.items() if n in columns}
    for n, function in used.items():
        surface, signs = ARDUPILOT_FUNCTIONS[function]
        low, trim, high, reverse = _travel(log, n, assumed)
        if function in RANGE_FUNCTIONS and not log.parameters.get(f"SERVO{n}_MIN"):
            trim = low
        pwm = np.asarray(table.columns[columns[n]], dtype=float)
        value = pwm_to_command(pwm, low, trim, high, reverse, function in RANGE_FUNCTIONS)
        if not np.isfinite(value).any():
            flight.meta["notes"].append(f"output {n} ({surface}) is left out: its pulse is 0 throughout")
            continue
        twins = [m for m, other in used.items() if other == function]
        name = names.get(n, surface if len(twins) == 1 else f"{surface}_servo{n}")
        series = Series(np.asarray(table.t_s, float), value, "1")
        if surface == "throttle":
            flight.measured.setdefault("throttle", series._replace(value=np.clip(value, 0.0, 1.0)))
            continue
        flight.measured[f"command.{name}"] = series
        _describe_surface(flight, name, surface, signs, n, (low, trim, high, reverse))


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
