"""The records between the loop, the guidance and every controller: Measured, Reference, lateral modes."""

from __future__ import annotations

from typing import NamedTuple

# What `Reference.lateral` may be. A controller without its own path logic flies TRACK as BANK.
BANK, HEADING, COURSE, TRACK = 0, 1, 2, 3


class Measured(NamedTuple):
    """What the autopilot's sensors say at one control instant; SI and rad, body axes forward-right-down, NED.

    p, q, r: rad/s. phi, theta, psi: rad. airspeed: m/s. alpha, beta: rad. altitude: m. climb_rate: m/s.
    north, east: m. velocity_north, velocity_east: m/s over ground. A controller reads only what its aircraft
    has; the others may be anything finite.
    """

    p: float
    q: float
    r: float
    phi: float
    theta: float
    psi: float
    airspeed: float
    alpha: float
    beta: float
    altitude: float
    climb_rate: float
    north: float
    east: float
    velocity_north: float
    velocity_east: float


class Reference(NamedTuple):
    """What the guidance asks of a controller at one control instant.

    airspeed: m/s. altitude: m. lateral: BANK, HEADING, COURSE or TRACK. bank: rad, to be flown in BANK and
    (by a controller without its own path logic) in TRACK. course: rad, the heading (HEADING) or course over
    ground (COURSE, TRACK). from_, to_, next_north/east: m, the active leg runs from -> to, the one after it
    to -> next (TRACK only, else 0).
    """

    airspeed: float
    altitude: float
    lateral: int
    bank: float
    course: float
    from_north: float
    from_east: float
    to_north: float
    to_east: float
    next_north: float
    next_east: float
