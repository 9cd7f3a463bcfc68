"""From a plan to a Reference: references over time, a track of straight legs and banked corners, HOLD_LEVEL.

The track is flown by the L1 law (Park, Deyst and How 2004, in the form ArduPilot uses): with ground speed
V, look-ahead distance L1 = zeta T V / pi and eta the angle from the ground velocity to the point L1 ahead
on the leg,

    a = 4 zeta^2 V^2 / L1 sin(eta),   bank = atan(a / g), limited.

For small errors this is y'' + 2 zeta w y' + w^2 y = 0 with w = 2 pi / T for the cross-track error y. A
corner is begun so far before the waypoint that the limited bank rolls out on the next leg. HOLD_LEVEL
levels the wings, then holds the heading found and the altitude at the time of the request, until the
request ends.

Not modelled: climb along a leg (altitude follows the time table), wind estimation (ground velocity carries
it).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..core.errors import WrongUse
from ..core.types import Array
from ..parts.ops import atan2, clip, cos, maximum, merged, minimum, pi, sin, sqrt, tan
from .loops import GRAVITY, wrap
from .signals import BANK, COURSE, HEADING, TRACK, Measured, Reference

LEVEL_BANK = 0.0873  # 5 deg: below it the wings count as level and HOLD_LEVEL takes the heading
FREE, LEVELLING, HOLDING = 0, 1, 2


class Gains(NamedTuple):
    """l1_period, l1_damping:

    T and zeta of the track law. bank_max: its bank limit. turn_time: to roll in or out.
    """

    l1_period: float
    l1_damping: float
    bank_max: float
    turn_time: float


UNITS = {"l1_period": "s", "l1_damping": "1", "bank_max": "rad", "turn_time": "s"}
# Slow enough for every controller here: the track is four times slower than the slowest bank loop.
DEFAULT_GAINS = Gains(l1_period=12.0, l1_damping=0.75, bank_max=0.6, turn_time=0.6)


class Plan(NamedTuple):
    """What shall be flown; build it with `plan`.

    t_s, airspeed, altitude, angle: (n,) break points with linear ramps between them (a repeated stamp is a
    step; the last value holds). lateral: what `angle` is over time (BANK: bank, HEADING and COURSE:
    unwrapped angle), or TRACK. north, east: (m,) waypoints of the track in order, flown round and round; m
    = 0 without a track.
    """

    t_s: Array
    airspeed: Array
    altitude: Array
    angle: Array
    lateral: int
    north: Array
    east: Array
    gains: Gains


class State(NamedTuple):
    """row: last break point passed. leg: waypoint flown from. hold: FREE, LEVELLING or HOLDING."""

    row: int
    leg: int
    hold: int
    hold_altitude: float
    hold_heading: float


def plan(
    t_s: Any,
    airspeed: Any,
    altitude: Any,
    angle: Any = 0.0,
    lateral: int = HEADING,
    north: Any = (),
    east: Any = (),
    gains: Gains = DEFAULT_GAINS,
) -> Plan:
    """A checked Plan from lists or numbers; numbers are held over all of t_s. m/s, m, rad.

    Raises WrongUse naming the entry. A track needs at least three waypoints, no two in a row at one place.

    >>> from aerofdi.autopilot.guidance import plan, rectangle
    >>> from aerofdi.autopilot.signals import TRACK
    >>> north, east = rectangle(400.0, 200.0)
    >>> p = plan([0.0], 15.4, 100.0, lateral=TRACK, north=north, east=east)
    >>> len(p.north), p.airspeed.tolist()
    (4, [15.4])
    """
    t = np.ascontiguousarray(np.atleast_1d(np.asarray(t_s, float)))
    columns = {}
    for name, value in (("airspeed", airspeed), ("altitude", altitude), ("angle", angle)):
        # Contiguous, so that one compiled loop serves every plan.
        column = np.ascontiguousarray(np.atleast_1d(np.asarray(value, float)))
        column = np.full(len(t), column[0]) if len(column) == 1 else column
        if len(column) != len(t) or not np.isfinite(column).all():
            raise WrongUse(
                f"plan: {name} needs one finite number, or one for each of the {len(t)} times; got {value}"
            )
        columns[name] = column
    if not len(t) or not np.isfinite(t).all() or (np.diff(t) < 0).any():
        raise WrongUse(f"plan: times must be finite and never decrease, got {t_s}")
    if lateral not in (BANK, HEADING, COURSE, TRACK):
        raise WrongUse(f"plan: lateral is one of BANK, HEADING, COURSE, TRACK (0 to 3), got {lateral}")
    n, e = np.ravel(np.asarray(north, float)).copy(), np.ravel(np.asarray(east, float)).copy()
    if len(n) != len(e) or not (np.isfinite(n).all() and np.isfinite(e).all()):
        raise WrongUse(
            f"plan: north and east need the same number of finite waypoints, got {len(n)} and {len(e)}"
        )
    if lateral == TRACK:
        gaps = np.hypot(n - np.roll(n, 1), e - np.roll(e, 1)) if len(n) else np.zeros(1)
        if len(n) < 3 or gaps.min() <= 0.0:
            raise WrongUse(f"plan: a track needs at least three different waypoints, got {len(n)}")
    if not (0.0 < gains.bank_max < 1.4 and min(gains.l1_period, gains.l1_damping) > 0.0 <= gains.turn_time):
        raise WrongUse(
            f"plan: bank_max must be in (0, 1.4) rad, l1_period and l1_damping positive; got {gains}"
        )
    return Plan(t, columns["airspeed"], columns["altitude"], columns["angle"], int(lateral), n, e, gains)


def rectangle(
    length: float,
    width: float,
    course: float = 0.0,
    north: float = 0.0,
    east: float = 0.0,
    right: bool = True,
) -> tuple[Array, Array]:
    """Waypoints of a rectangle, m: the first leg runs `length` from (north, east) along `course` (rad), then right."""
    side = 1.0 if right else -1.0
    along = np.array([0.0, length, length, 0.0])
    across = side * np.array([0.0, 0.0, width, width])
    return (
        north + along * np.cos(course) - across * np.sin(course),
        east + along * np.sin(course) + across * np.cos(course),
    )


def init(p: Plan) -> State:
    """Before the first step: first row, first leg, nothing held."""
    return State(0, 0, FREE, 0.0, 0.0)


@merged
def _row(p: Plan, row: int, t: float) -> int:
    """Index of the last break point at or before t, searched forward from `row`."""
    while row + 1 < len(p.t_s) and p.t_s[row + 1] <= t:
        row += 1
    return row


@merged
def _between(p: Plan, column: Array, row: int, t: float) -> float:
    """The column at time t, linear between break points."""
    if row + 1 >= len(p.t_s):
        return column[row]
    part = clip((t - p.t_s[row]) / (p.t_s[row + 1] - p.t_s[row]), 0.0, 1.0)
    return column[row] + part * (column[row + 1] - column[row])


@merged
def _l1_bank(p: Plan, from_n: float, from_e: float, course: float, z: Measured) -> float:
    """Bank (rad) that steers onto the line through (from_n, from_e) with this course."""
    v = maximum(sqrt(z.velocity_north**2 + z.velocity_east**2), 1.0)
    l1 = p.gains.l1_damping * p.gains.l1_period * v / pi
    cross = -(z.north - from_n) * sin(course) + (z.east - from_e) * cos(course)  # right of the leg, m
    to_line = clip(-cross / l1, -1.0, 1.0)
    to_point = course + atan2(to_line, sqrt(maximum(1.0 - to_line * to_line, 0.0)))
    eta = clip(wrap(to_point - atan2(z.velocity_east, z.velocity_north)), -0.5 * pi, 0.5 * pi)
    accel = 4.0 * p.gains.l1_damping * p.gains.l1_damping * v * v / l1 * sin(eta)
    return clip(atan2(accel, GRAVITY), -p.gains.bank_max, p.gains.bank_max)


@merged
def _turn_lead(p: Plan, turn: float, z: Measured) -> float:
    """How far before a waypoint a turn by `turn` (rad) at the bank limit must begin, m."""
    v = sqrt(z.velocity_north**2 + z.velocity_east**2)
    radius = v * v / (GRAVITY * tan(p.gains.bank_max))
    return radius * tan(0.5 * minimum(abs(turn), 0.75 * pi)) + v * p.gains.turn_time


@merged
def _track(p: Plan, leg: int, z: Measured) -> tuple[int, int, int, float, float]:
    """The leg to fly now, its end, the end of the one after, its course, and the bank that flies it."""
    m = len(p.north)
    to = (leg + 1) % m
    after = (leg + 2) % m
    course = atan2(p.east[to] - p.east[leg], p.north[to] - p.north[leg])
    coming = atan2(p.east[after] - p.east[to], p.north[after] - p.north[to])
    left = (p.north[to] - z.north) * cos(course) + (p.east[to] - z.east) * sin(course)
    if left < _turn_lead(p, wrap(coming - course), z):
        leg, to, after, course = to, after, (leg + 3) % m, coming
    return leg, to, after, course, _l1_bank(p, p.north[leg], p.east[leg], course, z)


@merged
def _hold(s: State, request: int, z: Measured) -> State:
    """The next hold:

    taken on request, the heading once the wings are level, dropped when the request ends.
    """
    if request == 0:
        return State(s.row, s.leg, FREE, 0.0, 0.0)
    if s.hold == FREE:
        s = State(s.row, s.leg, LEVELLING, z.altitude, z.psi)
    if s.hold == LEVELLING and abs(z.phi) < LEVEL_BANK:
        s = State(s.row, s.leg, HOLDING, s.hold_altitude, z.psi)
    return s


@merged
def step(p: Plan, s: State, z: Measured, t: float, request: int) -> tuple[State, Reference]:
    """One control instant at time t (s): the Reference, with a core.Request taken into account.

    t must not decrease between steps. While a hold lasts the track goes on counting its legs.
    """
    row = _row(p, s.row, t)
    airspeed, altitude = _between(p, p.airspeed, row, t), _between(p, p.altitude, row, t)
    angle = _between(p, p.angle, row, t)
    leg, to, after, course, bank, lateral = s.leg, 0, 0, angle, 0.0, p.lateral
    if p.lateral == TRACK:
        leg, to, after, course, bank = _track(p, s.leg, z)
    elif p.lateral == BANK:
        course, bank = 0.0, angle
    s = _hold(State(row, leg, s.hold, s.hold_altitude, s.hold_heading), request, z)
    if s.hold != FREE:
        lateral = BANK if s.hold == LEVELLING else HEADING
        altitude, bank, course = s.hold_altitude, 0.0, s.hold_heading
    if lateral == TRACK:
        points = (p.north[leg], p.east[leg], p.north[to], p.east[to], p.north[after], p.east[after])
    else:
        points = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return s, Reference(
        airspeed,
        altitude,
        lateral,
        bank,
        course,
        points[0],
        points[1],
        points[2],
        points[3],
        points[4],
        points[5],
    )
