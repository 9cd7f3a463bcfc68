"""What every part of the plant speaks: the state, the air, the effects of faults, the outputs. All SI and radians."""

from __future__ import annotations

from typing import NamedTuple

N_SURFACES = 8
"""Places for surfaces in every plant; an aircraft with fewer leaves the rest at zero."""

Surfaces = tuple[float, float, float, float, float, float, float, float]
"""True deflections in rad, in the order of `aircraft.surfaces`, filled up with zeros."""


class State(NamedTuple):
    """The plant's 15 states; the time derivative has the same layout.

    north, east, down: position, m (flat Earth, altitude = -down). u, v, w: ground velocity in body axes, m/s.
    e0..e3: unit quaternion, body to north-east-down, scalar first. p, q, r: body rates, rad/s.
    engine: engine speed in rad/s for propellers, the lagged throttle (0-1) of a thrust law, unused (0) otherwise.
    fuel: fuel mass, kg (0 for an electric aircraft).
    """

    north: float
    east: float
    down: float
    u: float
    v: float
    w: float
    e0: float
    e1: float
    e2: float
    e3: float
    p: float
    q: float
    r: float
    engine: float
    fuel: float


class Wind(NamedTuple):
    """Velocity of the air: a part in north-east-down axes, a part in body axes (turbulence), and its rotation.

    All are velocities of the air over the ground (north > 0 blows towards north), m/s; p, q, r in rad/s, body axes.
    """

    north: float
    east: float
    down: float
    u: float
    v: float
    w: float
    p: float
    q: float
    r: float


STILL_AIR = Wind(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Effects(NamedTuple):
    """What faults other than those of surfaces do to the plant.

    lift_left, lift_right, drag_left, drag_right: factors on each wing half's lift and drag, 1 when healthy.
    icing: severity factor eta, 0 when clean. thrust: factor on the thrust, 1 when healthy.
    """

    lift_left: float
    lift_right: float
    drag_left: float
    drag_right: float
    icing: float
    thrust: float


HEALTHY_EFFECTS = Effects(1.0, 1.0, 1.0, 1.0, 0.0, 1.0)


class Outputs(NamedTuple):
    """What sensors may look at. Angles in rad; ax, ay, az: specific force at the centre of gravity, body axes, m/s2.

    airspeed, alpha, beta are relative to the air; groundspeed is horizontal; climb_rate is upwards; course is of the
    ground track, from north. density in kg/m3, dynamic_pressure in Pa.
    """

    airspeed: float
    alpha: float
    beta: float
    phi: float
    theta: float
    psi: float
    ax: float
    ay: float
    az: float
    altitude: float
    climb_rate: float
    groundspeed: float
    course: float
    density: float
    dynamic_pressure: float


class Coefficients(NamedTuple):
    """Six aerodynamic coefficients. CD, CL act along drag and lift, CY along body y (or wind y where the aircraft
    says wind axes); Cl, Cm, Cn about body axes at the aerodynamic reference point."""

    CD: float
    CY: float
    CL: float
    Cl: float
    Cm: float
    Cn: float
