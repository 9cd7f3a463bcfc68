"""Faults are physics: one catalogue of what can go wrong, when, how fast and how far.

A fault has an onset, an end (recovery), and a share s(t) that grows from 0 to 1: at once, over `ramp_s`, or
along a `profile`. Several faults may follow or overlap each other; those of one surface add up where that
has a meaning, else the later in the list wins. With u the delayed command, x the servo's position, d what
the air feels:

    stuck                   servo driven to `value` and held; without a value held where it is (x frozen)
    hardover                servo driven to its upper (value > 0) or lower (value < 0) stop
    floating                free in the air: x trails to value * alpha (rudders: beta) with 0.05 s
    loss_of_effectiveness   d = a + (1 - value s)(x - a), a = 0 about neutral or the trim angle about trim
    offset                  u + value s: the servo's zero has moved; stops and rate limit still hold
    oscillating             u + value s sin(2 pi f (t - onset))
    slow                    rate limit lowered to `value` (per s)
    delayed                 transport delay longer by value s (in s)
    thrust_loss             thrust * (1 - value s)
    lift_loss               lift of one wing half * (1 - value s), the share never falling
    drag_increase           drag of one wing half * (1 + value s), the share never falling
    icing                   severity eta = value s of the whole airframe
    drift                   sensor + value (t - onset) s
    noise                   sensor + value s times a standard normal number per sample
    off                     sensor gives nothing: a gap

`stuck`, `offset` and `delayed` apply to sensors too (stuck: the last reading is repeated). Throttle faults
are those of a surface with limits 0 and 1. A servo meets a fault after the transport delay, so onsets are
not delayed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.ops import merged, minimum, sin

FLOAT_TIME_S = 0.05


class Mode(NamedTuple):
    """What a fault mode applies to, the unit of its value, and its FAILURE_TYPE in MAVLink's common dialect.

    targets: any of "surface", "throttle", "wing", "airframe", "sensor". unit: "position" is rad for a
    surface and 1 for the throttle, "signal" the sensor's own unit. mavlink: "" where MAVLink has no such
    type.
    """

    targets: tuple[str, ...]
    unit: str
    mavlink: str
    kind: int


_SERVO = ("surface", "throttle")
MODES = {
    "stuck": Mode((*_SERVO, "sensor"), "position", "FAILURE_TYPE_STUCK", 0),
    "hardover": Mode(_SERVO, "1", "FAILURE_TYPE_WRONG", 1),
    "floating": Mode(("surface",), "rad/rad", "FAILURE_TYPE_OFF", 2),
    "loss_of_effectiveness": Mode(_SERVO, "1", "", 3),
    "offset": Mode((*_SERVO, "sensor"), "position", "FAILURE_TYPE_WRONG", 4),
    "oscillating": Mode(_SERVO, "position", "", 5),
    "slow": Mode(_SERVO, "position/s", "FAILURE_TYPE_SLOW", 6),
    "delayed": Mode((*_SERVO, "sensor"), "s", "FAILURE_TYPE_DELAYED", 7),
    "thrust_loss": Mode(("throttle",), "1", "", 8),
    "lift_loss": Mode(("wing",), "1", "", 9),
    "drag_increase": Mode(("wing",), "1", "", 10),
    "icing": Mode(("airframe",), "1", "", 11),
    "drift": Mode(("sensor",), "signal/s", "FAILURE_TYPE_WRONG", 12),
    "noise": Mode(("sensor",), "signal", "FAILURE_TYPE_GARBAGE", 13),
    "off": Mode(("sensor",), "1", "FAILURE_TYPE_OFF", 14),
}
"""The catalogue. Servo and sensor types follow MAV_CMD_INJECT_FAILURE: units SYSTEM_SERVO, SYSTEM_MOTOR,
SENSOR_*.
"""

(
    STUCK, HARDOVER, FLOATING, LOSS, OFFSET, OSCILLATING, SLOW, DELAYED,
    THRUST, LIFT, DRAG, ICING, DRIFT, NOISE, OFF,
) = range(15)  # fmt: skip
WINGS = ("wing_left", "wing_right")
AIRFRAME = "airframe"
THROTTLE = "throttle"


class Fault(NamedTuple):
    """One fault in SI units and rad.

    target: a surface, "throttle", "wing_left", "wing_right", "airframe" or "sensor.<channel>". mode: of
    MODES. start_s <= t < end_s: when. value: size, see the top of this file; NaN for a surface stuck where
    it is. about: "neutral" or "trim", what a stuck angle or an effectiveness counts from. ramp_s: time over
    which the share grows from 0 to 1. profile: instead of ramp_s, ((time since onset in s, share), ...),
    linear between, last one held. frequency_hz: of `oscillating`. rudder: True where `floating` trails with
    sideslip.
    """

    target: str
    mode: str
    start_s: float
    end_s: float = math.inf
    value: float = math.nan
    about: str = "neutral"
    ramp_s: float = 0.0
    profile: tuple[tuple[float, float], ...] = ()
    frequency_hz: float = math.nan
    rudder: bool = False


class FaultTable(NamedTuple):
    """Faults as numbers: rows (m, 9), profile points (k, 2), time of the first onset."""

    rows: Array
    points: Array
    first_s: float


class FaultState(NamedTuple):
    """on: (m,) 1 while active. latch: (m,) position of the servo at the onset. size: (m,) value times
    share, now.
    """

    on: Array
    latch: Array
    size: Array


class Modified(NamedTuple):
    """What the faults do to the servos (n, 7), the sensors (s, 5) and the airframe (6,) at this instant."""

    servo: Array
    sensor: Array
    effects: Array


KIND, TARGET, START, END, VALUE, EXTRA, FIRST, COUNT, FAMILY = range(9)
HOLD, GOAL, ADD, SCALE, ABOUT, RATE, LATER = range(7)
FREE, DRIVEN, FROZEN, TRAILING = 0.0, 1.0, 2.0, 3.0
S_FROZEN, S_ADD, S_SIGMA, S_OFF, S_LATER = range(5)
_SERVO_CLEAN = np.array([FREE, 0.0, 0.0, 1.0, 0.0, math.inf, 0.0])
_EFFECTS_CLEAN = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 1.0])


def family(target: str, surfaces: Sequence[str]) -> str:
    """Which family a target belongs to: "surface", "throttle", "wing", "airframe" or "sensor"."""
    if target.startswith("sensor."):
        return "sensor"
    table = {THROTTLE: "throttle", AIRFRAME: "airframe", **dict.fromkeys(WINGS, "wing")}
    found = "surface" if target in surfaces else table.get(target)
    if found is None:
        raise WrongUse(
            f"fault target {target!r} is not known; known are {', '.join(surfaces)}, {THROTTLE}, "
            f"{', '.join(WINGS)}, {AIRFRAME} and sensor.<channel>"
        )
    return found


def _check(f: Fault, kind: str) -> None:
    if f.mode not in MODES:
        raise WrongUse(f"fault mode {f.mode!r} is not known; known are {', '.join(MODES)}")
    who, mode = f"fault {f.target}/{f.mode}", MODES[f.mode]
    if kind not in mode.targets:
        raise WrongUse(f"{who}: this mode applies to {', '.join(mode.targets)}, not to a {kind}")
    if not (f.start_s >= 0 and f.end_s > f.start_s and f.ramp_s >= 0):
        raise WrongUse(
            f"{who}: needs 0 <= start < end and ramp >= 0, got {f.start_s}, {f.end_s}, {f.ramp_s} s"
        )
    valueless = f.mode == "off" or (f.mode == "stuck")
    if not math.isfinite(f.value) and not (valueless and math.isnan(f.value)):
        raise WrongUse(f"{who}: needs a finite value in {mode.unit!r}, got {f.value}")
    if f.mode == "stuck" and kind == "sensor" and not math.isnan(f.value):
        raise WrongUse(f"{who}: a stuck sensor repeats its last reading and takes no value, got {f.value}")
    low, high = _RANGE.get(f.mode, (-math.inf, math.inf))
    if math.isfinite(f.value) and not low <= f.value <= high:
        raise WrongUse(f"{who}: the value must lie within [{low}, {high}], got {f.value}")
    if f.mode == "oscillating" and not f.frequency_hz > 0:
        raise WrongUse(f"{who}: needs a frequency above 0 Hz, got {f.frequency_hz}")
    if f.about not in ("trim", "neutral"):
        raise WrongUse(f"{who}: about is 'trim' or 'neutral', not {f.about!r}")
    _check_profile(f, who)


_RANGE = {
    "loss_of_effectiveness": (0.0, 1.0),
    "thrust_loss": (0.0, 1.0),
    "lift_loss": (0.0, 1.0),
    "drag_increase": (0.0, math.inf),
    "icing": (0.0, 1.0),
    "slow": (0.0, math.inf),
    "delayed": (0.0, 10.0),
    "noise": (0.0, math.inf),
}
_ABRUPT = ("slow", "hardover", "floating", "off")


def _check_profile(f: Fault, who: str) -> None:
    if f.mode in _ABRUPT and (f.profile or f.ramp_s):
        raise WrongUse(f"{who}: comes at once; it takes no ramp and no profile")
    if not f.profile:
        return
    points = np.asarray(f.profile, float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise WrongUse(f"{who}: a profile is a list of (time since onset, share) pairs, got {f.profile}")
    if f.ramp_s:
        raise WrongUse(f"{who}: give a ramp or a profile, not both")
    if points[0, 0] < 0 or (np.diff(points[:, 0]) < 0).any():
        raise WrongUse(f"{who}: the times of a profile start at 0 or later and never decrease")
    if f.mode in ("lift_loss", "drag_increase") and (np.diff(points[:, 1]) < 0).any():
        raise WrongUse(f"{who}: damage never heals; the shares of its profile must not decrease")


def _points(f: Fault) -> list[tuple[float, float]]:
    if f.profile:
        return [(float(t), float(s)) for t, s in f.profile]
    return [(0.0, 0.0), (f.ramp_s, 1.0)] if f.ramp_s > 0 else [(0.0, 1.0)]


def _row(f: Fault, kind: str, index: int, trim: float, limits: Any, dt_s: float, first: int) -> list[float]:
    value, extra = f.value, 0.0
    if f.mode == "stuck" and f.about == "trim":
        value += trim
    if f.mode == "hardover":
        value = limits[1] if f.value > 0 else limits[0]
    if f.mode == "loss_of_effectiveness" and f.about == "trim":
        extra = trim
    if f.mode == "oscillating":
        extra = 2.0 * math.pi * f.frequency_hz
    if f.mode == "delayed":
        extra = 1.0 / dt_s
    if f.mode == "floating":
        extra = float(f.rudder)
    families = {"surface": 0.0, "throttle": 0.0, "wing": 1.0, "airframe": 1.0, "sensor": 2.0}
    return [
        MODES[f.mode].kind, index, f.start_s, f.end_s, value, extra, first, len(_points(f)), families[kind],
    ]  # fmt: skip


def fault_table(
    faults: Sequence[Fault],
    surfaces: Sequence[str],
    limits: Any,
    trim: Any,
    sensors: Sequence[str],
    dt_s: float,
) -> FaultTable:
    """Check the faults and turn them into numbers.

    surfaces: names in the order of the servos; the throttle is one more servo after them. limits: (n + 1,
    2), trim: (n + 1,), of the servos including the throttle, rad. sensors: channel names. dt_s: step of the
    loop, s. Raises WrongUse naming the fault.
    """
    rows: list[list[float]] = []
    points: list[tuple[float, float]] = []
    for f in faults:
        kind = family(f.target, surfaces)
        _check(f, kind)
        index = _index(f, kind, surfaces, sensors)
        servo = index if kind in _SERVO else 0
        if f.mode == "stuck" and kind in _SERVO and math.isfinite(f.value):
            _within(f, f.value + (trim[servo] if f.about == "trim" else 0.0), limits[servo])
        rows.append(_row(f, kind, index, trim[servo], limits[servo], dt_s, len(points)))
        points.extend(_points(f))
    first = min((f.start_s for f in faults), default=math.inf)
    return FaultTable(np.array(rows).reshape(-1, 9), np.array(points).reshape(-1, 2), float(first))


def _within(f: Fault, value: float, limits: Any) -> None:
    if not limits[0] - 1e-9 <= value <= limits[1] + 1e-9:
        raise WrongUse(
            f"fault {f.target}/{f.mode}: {value:.4f} is beyond the stops {limits[0]:.4f} to {limits[1]:.4f}"
        )


def _index(f: Fault, kind: str, surfaces: Sequence[str], sensors: Sequence[str]) -> int:
    if kind == "surface":
        return list(surfaces).index(f.target)
    if kind == "throttle":
        return len(surfaces)
    if kind == "wing":
        return WINGS.index(f.target)
    if kind == "sensor":
        channel = f.target.removeprefix("sensor.")
        if channel not in sensors:
            raise WrongUse(
                f"fault {f.target}/{f.mode}: there is no such sensor; there are {', '.join(sensors)}"
            )
        return list(sensors).index(channel)
    return 0


def fault_state(table: FaultTable, servos: int, sensors: int) -> tuple[FaultState, Modified]:
    """Before any onset."""
    m = len(table.rows)
    state = FaultState(np.zeros(m), np.zeros(m), np.zeros(m))
    return state, Modified(np.tile(_SERVO_CLEAN, (servos, 1)), np.zeros((sensors, 5)), _EFFECTS_CLEAN.copy())


@merged
def _share(points: Array, first: int, count: int, since: float) -> float:
    """Linear between the points of a profile, held before the first and after the last; a step counts as
    taken.
    """
    if since < points[first, 0]:
        return points[first, 1] if points[first, 0] <= 0.0 else 0.0
    for i in range(first + count - 1, first - 1, -1):
        if since >= points[i, 0]:
            if i == first + count - 1:
                return points[i, 1]
            width = points[i + 1, 0] - points[i, 0]
            return points[i, 1] + (points[i + 1, 1] - points[i, 1]) * (since - points[i, 0]) / width
    return 0.0


@merged
def _clean(modified: Modified) -> None:
    servo = modified.servo
    for i in range(servo.shape[0]):
        servo[i, HOLD], servo[i, GOAL], servo[i, ADD], servo[i, SCALE] = FREE, 0.0, 0.0, 1.0
        servo[i, ABOUT], servo[i, RATE], servo[i, LATER] = 0.0, 1e300, 0.0
    modified.sensor[:] = 0.0
    e = modified.effects
    e[0] = e[1] = e[2] = e[3] = e[5] = 1.0
    e[4] = 0.0


@merged
def _on_servo(s: Array, r: Array, t: float, share: float, latch: float, alpha: float, beta: float) -> None:
    """Enter one active fault into the servo's row s."""
    kind, value, extra = int(r[KIND]), r[VALUE], r[EXTRA]
    if kind == STUCK and value != value:  # no value: where it is
        s[HOLD], s[GOAL] = FROZEN, latch
    elif kind in (STUCK, HARDOVER):
        s[HOLD], s[GOAL] = DRIVEN, latch + share * (value - latch) if share < 1.0 else value
    elif kind == FLOATING:
        s[HOLD], s[GOAL] = TRAILING, value * (beta if extra > 0.0 else alpha)
    elif kind == LOSS:
        s[SCALE] *= 1.0 - value * share
        s[ABOUT] = extra
    elif kind == OFFSET:
        s[ADD] += value * share
    elif kind == OSCILLATING:
        s[ADD] += value * share * sin(extra * (t - r[START]))
    elif kind == SLOW:
        s[RATE] = minimum(s[RATE], value)
    elif kind == DELAYED:
        s[LATER] += value * share * extra


@merged
def _on_airframe(e: Array, kind: int, target: int, size: float) -> None:
    """Enter one active fault into the effects: lift left, right, drag left, right, icing, thrust."""
    if kind == LIFT:
        e[target] *= 1.0 - size
    elif kind == DRAG:
        e[2 + target] *= 1.0 + size
    elif kind == ICING:
        e[4] += size


@merged
def _on_sensor(s: Array, r: Array, t: float, share: float) -> None:
    """Enter one active fault into the sensor's row s."""
    kind, size = int(r[KIND]), r[VALUE] * share
    if kind == STUCK:
        s[S_FROZEN] = 1.0
    elif kind == OFFSET:
        s[S_ADD] += size
    elif kind == DRIFT:
        s[S_ADD] += size * (t - r[START])
    elif kind == NOISE:
        s[S_SIGMA] += size
    elif kind == OFF:
        s[S_OFF] = 1.0
    elif kind == DELAYED:
        s[S_LATER] += size * r[EXTRA]


@merged
def faults_now(
    table: FaultTable,
    state: FaultState,
    modified: Modified,
    position: Array,
    t: float,
    alpha: float,
    beta: float,
) -> None:
    """Write into `modified` what all faults do at time t; position (n,) of the servos is latched at onsets.

    Before table.first_s there is nothing to do, and a loop need not call it.
    """
    _clean(modified)
    for i in range(table.rows.shape[0]):
        r = table.rows[i]
        if t < r[START] - 1e-9 or t >= r[END] - 1e-9:
            state.on[i], state.size[i] = 0.0, 0.0
            continue
        target, kind = int(r[TARGET]), int(r[KIND])
        if state.on[i] == 0.0:
            state.on[i] = 1.0
            state.latch[i] = position[target] if r[FAMILY] == 0.0 else 0.0
        share = _share(table.points, int(r[FIRST]), int(r[COUNT]), t - r[START])
        state.size[i] = r[VALUE] * share if kind != STUCK and kind != HARDOVER else r[VALUE]
        if kind == THRUST:
            modified.effects[5] *= 1.0 - r[VALUE] * share
        elif r[FAMILY] == 0.0:
            _on_servo(modified.servo[target], r, t, share, state.latch[i], alpha, beta)
        elif r[FAMILY] == 1.0:
            _on_airframe(modified.effects, kind, target, state.size[i])
        else:
            _on_sensor(modified.sensor[target], r, t, share)
