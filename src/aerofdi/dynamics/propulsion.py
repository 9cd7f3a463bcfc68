"""Propulsion: five kinds, each a NamedTuple and one function `propulsion(params, V, rho, altitude, throttle, ...)`.

Propellers: T = rho n^2 D^4 CT(J), Q = rho n^2 D^5 CP(J) / 2 pi, J = V/(n D), n = engine speed / 2 pi.
The reaction of the engine's torque and the rotor's angular momentum act on the airframe; `rotation` is +1 for a
propeller that turns clockwise seen from behind (reaction rolls left), -1 for the other way, 0 where unknown.
Not modelled: inflow angle of the disc, slipstream over the tail, battery voltage, engine temperature.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..core.types import Array
from ..parts.dispatch import by_type
from ..parts.ops import clip, exp, inline, log, maximum, pi, where
from .atmosphere import pressure
from .lookup import bilinear, linear

TINY_SPEED = 1.0


class Thrust(NamedTuple):
    """thrust along body x, N; torque of reaction on the airframe about body x, N m; momentum of the rotor along
    body x, N m s; rate of the engine state per s; fuel_flow, kg/s."""

    thrust: float
    torque: float
    momentum: float
    engine_rate: float
    fuel_flow: float


class ThrustLaw(NamedTuple):
    """T = max_thrust * s * (V/airspeed0)^exponent, s the throttle behind a first-order lag time_constant (s).

    exponent = 0 is constant thrust, -1 constant power. The law is held below min_airspeed.
    """

    max_thrust: float
    airspeed0: float
    exponent: float
    min_airspeed: float
    time_constant: float


class ActuatorDisc(NamedTuple):
    """T = 1/2 rho area efficiency ((speed * throttle)^2 - V^2); Beard & McLain 1st edition, unknown_input (11)."""

    area: float
    efficiency: float
    speed: float


class PropellerSpeed(NamedTuple):
    """CT a quadratic of J; the engine speed follows throttle * max_speed (rad/s) with a first-order lag."""

    diameter: float
    CT_0: float
    CT_1: float
    CT_2: float
    max_speed: float
    time_constant: float


class PropellerPower(NamedTuple):
    """CT and CP fourth-order polynomials of J (lowest power first, J held in [0, J_max]); throttle sets shaft power.

    power: quadratic of throttle, W, lowest power first, held in [0, max_power]; inertia of rotor and propeller, kg m2.
    """

    diameter: float
    CT: tuple[float, float, float, float, float]
    CP: tuple[float, float, float, float, float]
    J_max: float
    power: tuple[float, float, float]
    max_power: float
    max_speed: float
    inertia: float
    rotation: float


class EngineMap(NamedTuple):
    """CT and CP tables over J; power (W) and fuel flow (kg/s) tables over engine speed and manifold pressure.

    J, CT, CP: (m,). speed: (n,) rad/s. manifold: (k,) Pa. power, fuel_flow: (n, k). The manifold pressure goes from
    the table's first entry at closed throttle to the static pressure at full throttle.
    """

    diameter: float
    J: Array
    CT: Array
    CP: Array
    speed: Array
    manifold: Array
    power: Array
    fuel_flow: Array
    inertia: float
    rotation: float


propulsion = by_type("propulsion")
"""propulsion(params, V, rho, altitude, throttle, engine, fuel) -> Thrust, by the kind."""


@propulsion.register(ThrustLaw)
@inline
def thrust_law(
    prop: ThrustLaw, V: float, rho: float, altitude: float, throttle: float, engine: float, fuel: float
) -> Thrust:
    """See ThrustLaw."""
    ratio = maximum(V, prop.min_airspeed) / prop.airspeed0
    T = prop.max_thrust * engine * exp(prop.exponent * log(ratio))
    return Thrust(T, 0.0, 0.0, (throttle - engine) / prop.time_constant, 0.0)


@propulsion.register(ActuatorDisc)
@inline
def actuator_disc(
    prop: ActuatorDisc, V: float, rho: float, altitude: float, throttle: float, engine: float, fuel: float
) -> Thrust:
    """See ActuatorDisc."""
    exit_speed = prop.speed * throttle
    T = 0.5 * rho * prop.area * prop.efficiency * (exit_speed * exit_speed - V * V)
    return Thrust(T, 0.0, 0.0, 0.0, 0.0)


@propulsion.register(PropellerSpeed)
@inline
def propeller_speed(
    prop: PropellerSpeed, V: float, rho: float, altitude: float, throttle: float, engine: float, fuel: float
) -> Thrust:
    """See PropellerSpeed."""
    n = maximum(engine, TINY_SPEED) / (2.0 * pi)
    nD = n * prop.diameter
    J = V / nD
    CT = prop.CT_0 + (prop.CT_1 + prop.CT_2 * J) * J
    T = rho * nD * nD * prop.diameter * prop.diameter * CT
    return Thrust(T, 0.0, 0.0, (throttle * prop.max_speed - engine) / prop.time_constant, 0.0)


@inline
def _quartic(c: Any, x: float) -> float:
    return c[0] + (c[1] + (c[2] + (c[3] + c[4] * x) * x) * x) * x


@propulsion.register(PropellerPower)
@inline
def propeller_power(
    prop: PropellerPower, V: float, rho: float, altitude: float, throttle: float, engine: float, fuel: float
) -> Thrust:
    """See PropellerPower."""
    speed = clip(engine, TINY_SPEED, prop.max_speed)
    nD = speed / (2.0 * pi) * prop.diameter
    J = clip(V / nD, 0.0, prop.J_max)
    disc = rho * nD * nD * prop.diameter * prop.diameter
    T = disc * _quartic(prop.CT, J)
    Q = disc * prop.diameter / (2.0 * pi) * _quartic(prop.CP, J)
    P = clip(prop.power[0] + (prop.power[1] + prop.power[2] * throttle) * throttle, 0.0, prop.max_power)
    torque = P / speed
    return Thrust(
        T,
        -prop.rotation * torque,
        prop.rotation * prop.inertia * speed,
        (torque - Q) / prop.inertia,
        0.0,
    )


@propulsion.register(EngineMap)
@inline
def engine_map(
    prop: EngineMap, V: float, rho: float, altitude: float, throttle: float, engine: float, fuel: float
) -> Thrust:
    """See EngineMap. Without fuel the engine gives no power and the propeller windmills."""
    speed = maximum(engine, TINY_SPEED)
    nD = speed / (2.0 * pi) * prop.diameter
    J = V / nD
    disc = rho * nD * nD * prop.diameter * prop.diameter
    T = disc * linear(prop.J, prop.CT, J)
    Q = disc * prop.diameter / (2.0 * pi) * linear(prop.J, prop.CP, J)
    lowest = prop.manifold[0]
    manifold = lowest + throttle * maximum(pressure(altitude) - lowest, 0.0)
    running = where(fuel > 0.0, 1.0, 0.0)
    torque = running * bilinear(prop.speed, prop.manifold, prop.power, speed, manifold) / speed
    flow = running * bilinear(prop.speed, prop.manifold, prop.fuel_flow, speed, manifold)
    return Thrust(
        T,
        -prop.rotation * torque,
        prop.rotation * prop.inertia * speed,
        (torque - Q) / prop.inertia,
        flow,
    )
