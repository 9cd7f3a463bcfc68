"""The aircraft as a plant: derivative, one Runge-Kutta step, outputs. Every argument is a scalar, tuple or array.

    params    PlantParams from `build.plant_params(aircraft)`; its type decides which aerodynamics and propulsion run
    x         State, 15 floats
    surfaces  8 floats, true deflections in rad in the order of `aircraft.surfaces` (rest 0), after actuators and faults
    throttle  0 to 1, after faults
    wind      Wind (north-east-down part, body-axes turbulence, its rotation)
    effects   Effects (wing lift and drag factors, icing severity, thrust factor)

A loop keeps the derivative at the start of a step and uses it three times:

    k = derivative(params, x, surfaces, throttle, wind, effects)
    z = outputs(params, x, k, wind)                                # what sensors see now
    x = rk4_step(params, x, k, surfaces, throttle, surfaces_next, throttle_next, wind, effects, dt)

All are `@jit` and choose their parts by the types inside `params`, so a compiled loop that takes `params` works for
every aircraft and is cached on disk. Flat Earth, rigid body, x-z plane of symmetry, no ground.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..parts.ops import atan2, inline, maximum, merged, sqrt, where
from .aero import AirData, aero_inputs, air_data, coefficients, iced
from .atmosphere import Air, density
from .propulsion import propulsion
from .rigid_body import (
    Inertia,
    angular_acceleration,
    euler,
    quaternion_rate,
    to_body,
    to_ned,
)
from .types import Coefficients, Effects, Outputs, State, Surfaces, Wind


class MassProperties(NamedTuple):
    """Mass, inertia and centre of gravity, each linear in the fuel mass: value = empty + slope * fuel.

    Masses in kg, inertias about the centre of gravity in kg m2, cg_x (aft) and cg_z (up) in m from the datum.
    """

    mass: float
    inertia: Inertia
    inertia_slope: Inertia
    cg_x: float
    cg_z: float
    cg_x_slope: float
    cg_z_slope: float


class Wing(NamedTuple):
    """Reference area (m2), chord, span (m); aerodynamic reference point x (aft), z (up) and arm of each wing half, m.

    wind_axes: 1 where CD, CY, CL are along wind axes, 0 where drag and lift are turned by alpha only and CY is along
    body y. CL_alpha_dot, Cm_alpha_dot: derivatives to alpha_dot c/2V. hub_x, hub_z: propeller, m from the datum.
    """

    area: float
    chord: float
    span: float
    ref_x: float
    ref_z: float
    half_y: float
    wind_axes: float
    CL_alpha_dot: float
    Cm_alpha_dot: float
    hub_x: float
    hub_z: float


class Body(NamedTuple):
    """What the equations of motion need, all of it scalars unless a kind brings tables."""

    air: Air
    mass: MassProperties
    wing: Wing
    aero: Any
    propulsion: Any


class PlantParams(NamedTuple):
    """Everything the plant needs; control, aero, propulsion are of the kinds in aero, tables, propulsion."""

    control: Any
    body: Body


class Load(NamedTuple):
    """A force (N) and the moment (N m) it makes, body axes."""

    X: float
    Y: float
    Z: float
    L: float
    M: float
    N: float


@inline
def _aerodynamic_load(
    wing: Wing, C: Coefficients, a: AirData, qbar: float, effects: Effects, arm_x: float, arm_z: float
) -> Load:
    """Aerodynamic force and its moment about the centre of gravity; each wing half carries half of lift and drag.

    arm_x, arm_z: position of the reference point relative to the centre of gravity, body axes. A half whose lift or
    drag is multiplied by a factor f adds (f - 1)/2 of it at its own centre, half_y to the side (moving_horizon).
    """
    qS = qbar * wing.area
    ca, sa = a.ca, a.sa
    sb = wing.wind_axes * a.sb
    cb = 1.0 + wing.wind_axes * (a.cb - 1.0)
    lift_l, lift_r = 0.5 * (effects.lift_left - 1.0), 0.5 * (effects.lift_right - 1.0)
    drag_l, drag_r = 0.5 * (effects.drag_left - 1.0), 0.5 * (effects.drag_right - 1.0)
    # Lift and drag directions in body axes.
    X_D, X_L = -ca * cb, sa
    Z_D, Z_L = -sa * cb, -ca
    D, Y, L = qS * C.CD, qS * C.CY, qS * C.CL
    X = X_D * D - ca * sb * Y + X_L * L
    Z = Z_D * D - sa * sb * Y + Z_L * L
    Xl, Zl = X_D * drag_l * D + X_L * lift_l * L, Z_D * drag_l * D + Z_L * lift_l * L
    Xr, Zr = X_D * drag_r * D + X_L * lift_r * L, Z_D * drag_r * D + Z_L * lift_r * L
    X += Xl + Xr
    Z += Zl + Zr
    Yb = cb * Y - sb * D * (1.0 + drag_l + drag_r)
    return Load(
        X,
        Yb,
        Z,
        qS * wing.span * C.Cl - arm_z * Yb + wing.half_y * (Zr - Zl),
        qS * wing.chord * C.Cm + arm_z * X - arm_x * Z,
        qS * wing.span * C.Cn + arm_x * Yb - wing.half_y * (Xr - Xl),
    )


@inline
def _inertia(mp: MassProperties, fuel: float) -> Inertia:
    """The inertia with that much fuel."""
    return Inertia(
        mp.inertia.Jx + mp.inertia_slope.Jx * fuel,
        mp.inertia.Jy + mp.inertia_slope.Jy * fuel,
        mp.inertia.Jz + mp.inertia_slope.Jz * fuel,
        mp.inertia.Jxz + mp.inertia_slope.Jxz * fuel,
    )


@inline
def _rates(
    body: Body,
    ice: Any,
    x: State,
    inputs: Any,
    throttle: float,
    wind: Wind,
    effects: Effects,
) -> State:
    """The derivative for aerodynamic inputs already gathered from the surfaces."""
    wing, mp, air = body.wing, body.mass, body.air
    e0, e1, e2, e3 = x.e0, x.e1, x.e2, x.e3
    wu, wv, ww = to_body(e0, e1, e2, e3, wind.north, wind.east, wind.down)
    a = air_data(x, wind, wu, wv, ww)
    rho = density(air, -x.down)
    half = 0.5 / a.V
    p_hat, q_hat, r_hat = a.p * wing.span * half, a.q * wing.chord * half, a.r * wing.span * half
    C = coefficients(body.aero, ice, a, inputs, p_hat, q_hat, r_hat)
    m = mp.mass + x.fuel
    cg_x, cg_z = mp.cg_x + mp.cg_x_slope * x.fuel, mp.cg_z + mp.cg_z_slope * x.fuel
    qbar = 0.5 * rho * a.V * a.V
    F = _aerodynamic_load(wing, C, a, qbar, effects, cg_x - wing.ref_x, cg_z - wing.ref_z)
    T = propulsion(body.propulsion, a.V, rho, -x.down, throttle, x.engine, x.fuel)
    thrust = T.thrust * effects.thrust
    gx, gy, gz = to_body(e0, e1, e2, e3, 0.0, 0.0, air.gravity)
    per_m = 1.0 / m
    u_dot = (F.X + thrust) * per_m + gx + x.r * x.v - x.q * x.w
    v_dot = F.Y * per_m + gy + x.p * x.w - x.r * x.u
    w_dot = F.Z * per_m + gz + x.q * x.u - x.p * x.v
    M = F.M + (cg_z - wing.hub_z) * thrust
    if wing.CL_alpha_dot != 0.0 or wing.Cm_alpha_dot != 0.0:
        # u_dot and w_dot depend on the lift they make, which is linear in alpha_dot and solved here exactly.
        # The steady wind is carried by the turning body axes, so its body components change too.
        us_dot = u_dot - (x.r * wv - x.q * ww)
        ws_dot = w_dot - (x.q * wu - x.p * wv)
        qSc = qbar * wing.area * wing.chord * half
        alpha_dot = (a.ca * ws_dot - a.sa * us_dot) / (a.V_xz + qSc * wing.CL_alpha_dot * per_m)
        lift = qSc * wing.CL_alpha_dot * alpha_dot
        u_dot += lift * a.sa * per_m
        w_dot -= lift * a.ca * per_m
        M += qSc * wing.chord * wing.Cm_alpha_dot * alpha_dot
        M += lift * ((cg_z - wing.ref_z) * a.sa + (cg_x - wing.ref_x) * a.ca)
    J = _inertia(mp, x.fuel)
    p_dot, q_dot, r_dot = angular_acceleration(J, T.momentum, x.p, x.q, x.r, F.L + T.torque, M, F.N)
    n_dot, e_dot, d_dot = to_ned(e0, e1, e2, e3, x.u, x.v, x.w)
    r0, r1, r2, r3 = quaternion_rate(e0, e1, e2, e3, x.p, x.q, x.r)
    return State(
        n_dot, e_dot, d_dot,
        u_dot, v_dot, w_dot,
        r0, r1, r2, r3,
        p_dot, q_dot, r_dot,
        T.engine_rate, -T.fuel_flow,
    )  # fmt: skip


@inline
def derivative(
    params: PlantParams, x: State, surfaces: Surfaces, throttle: float, wind: Wind, effects: Effects
) -> State:
    """Time derivative of the state, same layout as the state. See the top of this file for the arguments."""
    ice = iced(params.body.aero, effects.icing)
    inputs = aero_inputs(params.control, surfaces, effects.icing)
    return _rates(params.body, ice, x, inputs, throttle, wind, effects)


@inline
def _along(x: State, k: State, h: float) -> State:
    """x + h k."""
    return State(
        x.north + h * k.north, x.east + h * k.east, x.down + h * k.down,
        x.u + h * k.u, x.v + h * k.v, x.w + h * k.w,
        x.e0 + h * k.e0, x.e1 + h * k.e1, x.e2 + h * k.e2, x.e3 + h * k.e3,
        x.p + h * k.p, x.q + h * k.q, x.r + h * k.r,
        x.engine + h * k.engine, x.fuel + h * k.fuel,
    )  # fmt: skip


@inline
def _between(a: Coefficients, b: Coefficients, f: float) -> Coefficients:
    """a + f (b - a)."""
    return Coefficients(
        a.CD + f * (b.CD - a.CD),
        a.CY + f * (b.CY - a.CY),
        a.CL + f * (b.CL - a.CL),
        a.Cl + f * (b.Cl - a.Cl),
        a.Cm + f * (b.Cm - a.Cm),
        a.Cn + f * (b.Cn - a.Cn),
    )


@inline
def _settled(y: State) -> State:
    """The quaternion set back to length one and no negative fuel."""
    s = 1.0 / sqrt(y.e0 * y.e0 + y.e1 * y.e1 + y.e2 * y.e2 + y.e3 * y.e3)
    return State(
        y.north, y.east, y.down,
        y.u, y.v, y.w,
        y.e0 * s, y.e1 * s, y.e2 * s, y.e3 * s,
        y.p, y.q, y.r,
        y.engine, maximum(y.fuel, 0.0),
    )  # fmt: skip


@merged
def rk4_step(
    params: PlantParams,
    x: State,
    k1: State,
    surfaces: Surfaces,
    throttle: float,
    surfaces_next: Surfaces,
    throttle_next: float,
    wind: Wind,
    effects: Effects,
    dt: float,
) -> State:
    """The state dt later by the classical fourth-order Runge-Kutta method; the quaternion is set back to length one.

    k1 is `derivative(params, x, surfaces, throttle, wind, effects)`. Deflections and throttle go linearly from their
    values now to their values at the end of the step; wind and effects are held.
    """
    eta = effects.icing
    ice = iced(params.body.aero, eta)
    start = aero_inputs(params.control, surfaces, eta)
    end = aero_inputs(params.control, surfaces_next, eta)
    k = total = k1
    # A loop over the last three stages compiles the equations of motion once, not three times.
    for stage in range(3):
        f = where(stage == 2, 1.0, 0.5)
        y = _along(x, k, f * dt)
        inputs = _between(start, end, f)
        k = _rates(params.body, ice, y, inputs, throttle + f * (throttle_next - throttle), wind, effects)
        total = _along(total, k, where(stage == 2, 1.0, 2.0))
    return _settled(_along(x, total, dt / 6.0))


@inline
def step(
    params: PlantParams,
    x: State,
    surfaces: Surfaces,
    throttle: float,
    wind: Wind,
    effects: Effects,
    dt: float,
) -> State:
    """The state dt later with everything held; `rk4_step` with its first stage included."""
    k1 = derivative(params, x, surfaces, throttle, wind, effects)
    return rk4_step(params, x, k1, surfaces, throttle, surfaces, throttle, wind, effects, dt)


@merged
def outputs(params: PlantParams, x: State, k: State, wind: Wind) -> Outputs:
    """What sensors may look at; k is the derivative at x."""
    e0, e1, e2, e3 = x.e0, x.e1, x.e2, x.e3
    wu, wv, ww = to_body(e0, e1, e2, e3, wind.north, wind.east, wind.down)
    a = air_data(x, wind, wu, wv, ww)
    rho = density(params.body.air, -x.down)
    phi, theta, psi = euler(e0, e1, e2, e3)
    gx, gy, gz = to_body(e0, e1, e2, e3, 0.0, 0.0, params.body.air.gravity)
    vn, ve, vd = to_ned(e0, e1, e2, e3, x.u, x.v, x.w)
    return Outputs(
        a.V, a.alpha, a.beta,
        phi, theta, psi,
        k.u + x.q * x.w - x.r * x.v - gx,
        k.v + x.r * x.u - x.p * x.w - gy,
        k.w + x.p * x.v - x.q * x.u - gz,
        -x.down, -vd, sqrt(vn * vn + ve * ve), atan2(ve, vn),
        rho, 0.5 * rho * a.V * a.V,
    )  # fmt: skip


@inline
def thrust(params: PlantParams, x: State, throttle: float, wind: Wind, effects: Effects) -> float:
    """Thrust along body x, N."""
    wu, wv, ww = to_body(x.e0, x.e1, x.e2, x.e3, wind.north, wind.east, wind.down)
    a = air_data(x, wind, wu, wv, ww)
    rho = density(params.body.air, -x.down)
    T = propulsion(params.body.propulsion, a.V, rho, -x.down, throttle, x.engine, x.fuel)
    return T.thrust * effects.thrust
