"""Coefficients, tables, stall, icing, thrust: each against a value worked out by hand or from the source's rule."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.aircraft import load_aircraft
from aerofdi.dynamics.aero import AirData, Derivatives, aero_inputs, coefficients, iced, stall_blend
from aerofdi.dynamics.atmosphere import Air, density, pressure
from aerofdi.dynamics.build import plant_params, surfaces_tuple
from aerofdi.dynamics.lookup import bilinear, linear, locate
from aerofdi.dynamics.plant import PlantParams
from aerofdi.dynamics.propulsion import Thrust, propulsion
from aerofdi.dynamics.types import Coefficients

DEG = math.pi / 180.0
ULTRASTICK = load_aircraft("ultrastick120")
ULTRASTICK_PARAMS = plant_params(ULTRASTICK)


def at(alpha: float, beta: float = 0.0, V: float = 20.0) -> AirData:
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    return AirData(V * cb * ca, V * sb, V * cb * sa, V, V * cb, alpha, beta, ca, sa, cb, sb, 0.0, 0.0, 0.0)


def coefs(
    p: PlantParams,
    air: AirData,
    d: dict[int, float] | None = None,
    hats: tuple[float, ...] = (0.0, 0.0, 0.0),
    eta: float = 0.0,
) -> Coefficients:
    values = [0.0] * 8
    for i, x in (d or {}).items():
        values[i] = x
    inputs = aero_inputs(p.control, surfaces_tuple(values), eta)
    return coefficients(p.body.aero, iced(p.body.aero, eta), air, inputs, *hats)


def test_standard_air() -> None:
    isa = Air(1.225, 0.0065 / 288.15, 4.25587971, 9.80665)
    # ISO 2533 at 1000, 5000, 10000 m.
    table = (
        (0.0, 1.225, 101325.0),
        (1000.0, 1.11164, 89874.6),
        (5000.0, 0.736116, 54019.9),
        (10000.0, 0.412707, 26436.3),
    )
    for h, rho, p in table:
        assert density(isa, h) == pytest.approx(rho, rel=2e-5)
        assert pressure(h) == pytest.approx(p, rel=2e-5)
    constant = Air(1.2682, 0.0, 0.0, 9.81)
    assert density(constant, 5000.0) == 1.2682


def test_stall_blend_goes_from_wing_to_flat_plate() -> None:
    assert stall_blend(50.0, 0.4712, 0.0) < 1e-9
    assert stall_blend(50.0, 0.4712, 0.4712) == pytest.approx(0.5, abs=1e-9)
    assert stall_blend(50.0, 0.4712, 0.9) == pytest.approx(1.0, abs=1e-8)
    assert stall_blend(50.0, 0.4712, -0.9) == pytest.approx(1.0, abs=1e-8)
    p = plant_params(load_aircraft("aerosonde"))
    for alpha in (0.9, -0.9):
        plate = 2.0 * math.copysign(math.sin(alpha) ** 2 * math.cos(alpha), alpha)
        assert pytest.approx(plate, abs=1e-6) == coefs(p, at(alpha)).CL
    assert pytest.approx(0.28 + 3.45 * 0.1, abs=1e-6) == coefs(p, at(0.1)).CL


def test_icing_multiplies_each_coefficient_by_its_own_factor() -> None:
    """(1 + eta K) C; Table 2 and Table 3 of unknown_input by hand."""
    p = plant_params(load_aircraft("aerosonde"))
    eta, alpha, beta = 0.2, 0.1, 0.05
    hats = (0.01, 0.02, -0.03)
    d = {0: -0.1, 1: 0.06, 2: -0.06, 3: 0.04}  # elevator, aileron_left, aileron_right, rudder: da = 0.06
    c = coefs(p, at(alpha, beta), d, hats, eta)

    def x(value: float, K: float) -> float:
        return value * (1.0 + eta * K)

    assert pytest.approx(0.28 + x(3.45, -0.5) * alpha + x(-0.36, -0.477) * -0.1, abs=1e-6) == c.CL
    assert pytest.approx(x(0.03, 2.561) + 0.3 * alpha, abs=1e-12) == c.CD
    assert c.Cm == pytest.approx(
        -0.02338 + x(-0.38, -0.496) * alpha + x(-3.6, -0.1755) * 0.02 + x(-0.5, -0.5) * -0.1
    )
    assert pytest.approx(x(-0.98, -1.0) * beta + x(-0.17, -0.4) * 0.04) == c.CY
    assert c.Cl == pytest.approx(
        x(-0.12, -0.5) * beta
        + x(-0.26, -0.5) * 0.01
        + 0.14 * -0.03
        + x(0.08, -0.5) * 0.06
        + x(0.105, -0.4) * 0.04
    )
    assert c.Cn == pytest.approx(
        x(0.25, -1.0) * beta
        + 0.022 * 0.01
        + x(-0.35, -0.3056) * -0.03
        + 0.06 * 0.06
        + x(-0.032, -0.4167) * 0.04
    )
    clean = coefs(p, at(alpha, beta), d, hats)
    assert clean.CD < c.CD and abs(clean.CL) > abs(c.CL)


def test_every_derivative_of_a_file_arrives_at_its_place() -> None:
    a = load_aircraft("aerosonde_aerosim")
    clean = plant_params(a).body.aero.clean
    for name in Derivatives._fields:
        assert getattr(clean, name) == a.number(f"aero.derivatives.{name}", 0.0)
    wing = plant_params(a).body.wing
    assert (wing.CL_alpha_dot, wing.Cm_alpha_dot) == (1.9724, -10.3796)


def test_drag_of_a_deflection_does_not_depend_on_its_sign() -> None:
    p = plant_params(load_aircraft("aerosonde_aerosim"))
    none, left, both = (coefs(p, at(0.05), d).CD for d in ({}, {1: 0.2}, {1: 0.2, 2: -0.2}))
    assert left - none == pytest.approx(0.5 * 0.0302 * 0.2)
    assert both - none == pytest.approx(0.0302 * 0.2)
    assert left == coefs(p, at(0.05), {1: -0.2}).CD


def test_half_an_elevon_is_half_an_elevator_and_half_an_aileron() -> None:
    a = load_aircraft("vireo")
    p = plant_params(a)
    zero = coefs(p, at(0.07))
    right = coefs(p, at(0.07), {a.surface_index("elevon_right"): 0.1})
    assert right.Cm - zero.Cm == pytest.approx(0.05 * a.number("aero.control.elevator.Cm"))
    assert right.Cl - zero.Cl == pytest.approx(0.05 * a.number("aero.control.aileron.Cl"))
    assert right.Cl < zero.Cl  # trailing edge down on the right lifts the right wing: rolls left


@settings(deadline=None)
@given(st.integers(0, 15), st.integers(0, 12))
def test_tables_are_met_at_their_entries(i: int, j: int) -> None:
    a, p = ULTRASTICK, ULTRASTICK_PARAMS
    alpha, beta = a.tables["base.alpha"][i], a.tables["base.beta"][j]
    c = coefs(p, at(alpha, beta))
    assert np.allclose(c, a.tables["base.data"][i, j] + [*elevator_zero(a, i)], atol=1e-12)


def elevator_zero(a, i: int) -> tuple[float, ...]:
    """Elevator and flap increments at zero deflection (CD, CY, CL, Cl, Cm, Cn), which need not vanish."""
    e, f = a.tables["elevator.data"][i, 1, 2], a.tables["flap.data"][i, 0, 2]
    return (e[0] + f[0], 0.0, e[1] + f[1], 0.0, e[2] + f[2], 0.0)


def by_the_rules_of_the_source(
    alpha: float, beta: float, d: dict[str, float], p_hat: float, q_hat: float, r_hat: float
) -> np.ndarray:
    """CD, CY, CL, Cl, Cm, Cn by the rules of the source, written out apart from the package; advance ratio 0.7."""
    from scipy.interpolate import RegularGridInterpolator

    t = ULTRASTICK.tables

    def look(name: str, axes: tuple[str, ...], *at: float) -> np.ndarray:
        data = t[f"{name}.data"]
        if f"{name}.advance_ratio" in t:
            data = data.take(-1, axis=len(axes))
        grid = [t[f"{name}.{a}"] for a in axes]
        return RegularGridInterpolator(grid, data)(np.array([at]))[0]

    sgn = np.sign
    C = look("base", ("alpha", "beta"), alpha, beta).copy()
    for name, deflection in (("elevator", d["elevator"]), ("flap", d["flap"])):
        C[[0, 2, 4]] += look(name, ("alpha", "deflection"), alpha, deflection)
    for x in (d["right"], -d["left"]):
        C[3] += 0.5 * sgn(x) * look("aileron", ("alpha", "beta", "deflection"), alpha, sgn(x) * beta, abs(x))
    for x, arm in ((d["top"], 0.0845), (d["bottom"], -0.0153)):
        CY, Cn = -sgn(x) * look("rudder", ("alpha", "beta", "deflection"), alpha, -sgn(x) * beta, -abs(x))
        C += [0.0, 0.5 * CY, 0.0, 0.5 * CY * arm / 1.917192, 0.0, 0.5 * Cn]
    C[[1, 3, 5]] += sgn(p_hat) * look("roll_rate", ("alpha", "p_hat"), alpha, abs(p_hat))
    C[[1, 3, 5]] += sgn(r_hat) * look("yaw_rate", ("alpha", "r_hat"), alpha, abs(r_hat))
    C[4] += -7.8542450 * q_hat
    return C


def test_tables_follow_the_rules_of_the_source() -> None:
    random = np.random.default_rng(3)
    for _ in range(200):
        alpha, beta = random.uniform(-2.0, 29.0) * DEG, random.uniform(-29.0, 29.0) * DEG
        hats = (random.uniform(-0.09, 0.09), random.uniform(-0.05, 0.05), random.uniform(-0.13, 0.13))
        d = {k: random.uniform(-19.0, 19.0) * DEG for k in ("left", "right", "top", "bottom")}
        d |= {"elevator": random.uniform(-9.0, 19.0) * DEG, "flap": random.uniform(0.0, 20.0) * DEG}
        order = ("elevator", "left", "right", "top", "bottom", "flap", "flap")
        ours = coefs(ULTRASTICK_PARAMS, at(alpha, beta), {i: d[k] for i, k in enumerate(order)}, hats)
        assert np.allclose(ours, by_the_rules_of_the_source(alpha, beta, d, *hats), rtol=1e-7, atol=1e-9)


def test_table_surfaces_have_the_published_signs_and_sizes() -> None:
    """Slopes the source gives around 23 m/s: aileron Cl -0.178 (5 deg), rudder Cn -0.0274 (5 deg), -0.0385 (20 deg)."""
    a = load_aircraft("ultrastick120")
    p = plant_params(a)
    place = {s.name: i for i, s in enumerate(a.surfaces)}
    alpha = 4.644 * DEG
    zero = coefs(p, at(alpha), {place["elevator"]: -3.652 * DEG})

    def slope(degrees: float, **weights: float) -> Coefficients:
        d = {place["elevator"]: -3.652 * DEG} | {place[k]: w * degrees * DEG for k, w in weights.items()}
        return Coefficients(*((np.array(coefs(p, at(alpha), d)) - np.array(zero)) / (degrees * DEG)))

    aileron = slope(5.0, aileron_right=1.0, aileron_left=-1.0)
    assert aileron.Cl == pytest.approx(-0.17802, abs=2e-5)
    assert slope(-5.0, aileron_right=1.0, aileron_left=-1.0).Cl == pytest.approx(aileron.Cl)
    assert slope(5.0, aileron_right=1.0).Cl == pytest.approx(0.5 * aileron.Cl)
    both = {"rudder_top": 1.0, "rudder_bottom": 1.0}
    assert slope(5.0, **both).Cn == pytest.approx(-0.02735, abs=2e-5)
    assert slope(20.0, **both).Cn == pytest.approx(-0.03854, abs=2e-5)
    assert pytest.approx(0.08565, abs=2e-5) == slope(20.0, **both).CY
    top, bottom = slope(20.0, rudder_top=1.0), slope(20.0, rudder_bottom=1.0)
    assert top.Cn == pytest.approx(bottom.Cn) == pytest.approx(0.5 * -0.03854, abs=1e-5)
    assert top.Cl == pytest.approx(0.0018875, abs=2e-6) and bottom.Cl == pytest.approx(-0.00034176, abs=2e-6)


def test_tables_hold_their_edges_and_deflections_go_on() -> None:
    p = plant_params(load_aircraft("ultrastick120"))
    assert coefs(p, at(60 * DEG)) == coefs(p, at(42 * DEG))
    low, high = (coefs(p, at(4 * DEG), {0: d * DEG}).Cm for d in (-10.0, -20.0))
    slope = coefs(p, at(4 * DEG), {0: -5 * DEG}).Cm - coefs(p, at(4 * DEG), {0: 0.0}).Cm
    assert high - low == pytest.approx(2.0 * slope)
    assert abs(slope) > 0.01


@settings(deadline=None)
@given(st.floats(-3.0, 9.0), st.floats(-2.0, 8.0))
def test_interpolation_is_exact_for_planes_and_holds_edges(x: float, y: float) -> None:
    rows, columns = np.array([0.0, 1.0, 2.5, 6.0]), np.array([-1.0, 0.5, 5.0])
    plane = 2.0 + 3.0 * rows[:, None] - 0.5 * columns[None, :]
    i, f = locate(rows, x)
    assert rows[i] + f * (rows[i + 1] - rows[i]) == pytest.approx(x, abs=1e-12)
    xs, ys = min(max(x, 0.0), 6.0), min(max(y, -1.0), 5.0)
    assert bilinear(rows, columns, plane, x, y) == pytest.approx(2.0 + 3.0 * xs - 0.5 * ys)
    assert linear(rows, 2.0 + 3.0 * rows, x) == pytest.approx(2.0 + 3.0 * xs)


def push(name: str, V: float, throttle: float, engine: float, h: float = 0.0, rho: float = 1.225) -> Thrust:
    return propulsion(plant_params(load_aircraft(name)).body.propulsion, V, rho, h, throttle, engine, 3.0)


def test_thrust_of_every_kind() -> None:
    assert push("vireo", 15.4, 0.5, 0.5).thrust == pytest.approx(3.0)
    assert push("vireo", 20.0, 0.5, 0.5).thrust == pytest.approx(3.0 * 15.4 / 20.0)
    assert push("vireo", 0.0, 0.5, 0.5).thrust == push("vireo", 8.0, 0.5, 0.5).thrust
    assert push("vireo", 15.4, 0.8, 0.5).engine_rate == pytest.approx(3.0)
    T = push("aerosonde", 18.0, 0.254048, 0.0, rho=1.2682)
    assert T.thrust == pytest.approx(11.447, abs=5e-4)
    T = push("ducard", 30.0, 0.5, 60.637 * 2.0 * math.pi)
    assert T.thrust == pytest.approx(35.459, rel=2e-4)
    assert T.engine_rate == pytest.approx((0.5 * 80.0 - 60.637) * 2.0 * math.pi / 0.4)
    T = push("ultrastick120", 23.0, 0.5018, 1027.3, rho=1.2133)
    assert T.thrust == pytest.approx(10.14, abs=5e-3)
    assert T.torque == pytest.approx(0.436, abs=1e-3) and T.momentum < 0.0
    T = push("aerosonde_aerosim", 25.0, 0.62455, 546.66)
    assert T.thrust == pytest.approx(10.13, abs=5e-3)
    assert abs(T.engine_rate) < 1.0


def test_engine_map_at_its_entries() -> None:
    a = load_aircraft("aerosonde_aerosim")
    p = plant_params(a).body.propulsion
    throttle = (80e3 - 60e3) / (101325.0 - 60e3)
    T = propulsion(p, 25.0, 1.225, 0.0, throttle, p.speed[3], 1.0)
    assert T.fuel_flow == pytest.approx(87e-3 / 3600.0)  # 3500 rpm, 80 kPa
    torque = 245.57 / p.speed[3]
    n = p.speed[3] / (2.0 * math.pi)
    J = 25.0 / (n * 0.508)
    Q = 1.225 * n**2 * 0.508**5 / (2.0 * math.pi) * np.interp(J, p.J, p.CP)
    assert T.engine_rate == pytest.approx((torque - Q) / 0.0021)


def test_steady_reaction_of_the_engine_is_the_torque_of_the_propeller() -> None:
    p = plant_params(load_aircraft("ultrastick120")).body.propulsion
    T = propulsion(p, 23.0, 1.2133, 100.0, 0.501768, 1027.27, 0.0)
    n = 1027.27 / (2.0 * math.pi)
    J = 23.0 / (n * p.diameter)
    CP = np.polyval(p.CP[::-1], J)
    assert T.torque == pytest.approx(1.2133 * n**2 * p.diameter**5 * CP / (2.0 * math.pi), rel=1e-3)
