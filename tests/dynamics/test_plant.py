"""The plant as a whole: order of the method, mirror symmetry, wind, fuel, faults of wings, plain Python."""

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from aerofdi.aircraft import Aircraft, load_aircraft
from aerofdi.dynamics.build import fuel_capacity, plant_params, surfaces_tuple
from aerofdi.dynamics.plant import PlantParams, derivative, outputs, rk4_step, step, thrust
from aerofdi.dynamics.tables import TableAero
from aerofdi.dynamics.trim import Trim, trim
from aerofdi.dynamics.types import HEALTHY_EFFECTS, STILL_AIR, Effects, State, Wind

ALL = ("vireo", "aerosonde", "aerosonde_aerosim", "ducard", "ultrastick120")


@pytest.fixture(scope="module")
def flying() -> dict[str, tuple[Aircraft, PlantParams, Trim]]:
    out = {}
    for name in ALL:
        a = load_aircraft(name)
        p = plant_params(a)
        out[name] = (a, p, trim(a, params=p))
    return out


def moved(t: Trim, k: int) -> tuple[float, ...]:
    """Deflections that wander around trim, the same for every run."""
    return tuple(d + 0.03 * math.sin(0.7 * j + 0.05 * k) * (j < 5) for j, d in enumerate(t.surfaces))


@pytest.mark.parametrize("name", ["vireo", "aerosonde", "ducard"])
def test_the_step_is_of_fourth_order(name: str, flying: dict) -> None:
    _, p, t = flying[name]

    def after(dt: float) -> np.ndarray:
        x = t.state._replace(p=0.5, q=0.2, v=1.0)
        s = tuple(d + 0.05 * (j < 5) for j, d in enumerate(t.surfaces))
        for _ in range(round(1.6 / dt)):
            x = step(p, x, s, t.throttle, STILL_AIR, HEALTHY_EFFECTS, dt)
        return np.array(x)

    reference = after(0.0025)
    errors = [np.abs(after(dt) - reference).max() for dt in (0.08, 0.04, 0.02)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (orders > 3.6).all() and (orders < 5.5).all(), (errors, orders)
    assert errors[-1] > 1e-12


def test_moving_surfaces_are_followed_to_second_order(flying: dict) -> None:
    """A deflection that grows over the step acts as it grows, not as a late stair."""
    _, p, t = flying["vireo"]

    def after(n: int, held: bool) -> float:
        x, dt = t.state, 0.2 / n
        for k in range(n):
            now, nxt = (surfaces_tuple([t.surfaces[0] + 0.5 * f * dt, t.surfaces[1]]) for f in (k, k + 1))
            k1 = derivative(p, x, now, t.throttle, STILL_AIR, HEALTHY_EFFECTS)
            end = now if held else nxt
            x = rk4_step(p, x, k1, now, t.throttle, end, t.throttle, STILL_AIR, HEALTHY_EFFECTS, dt)
        return x.p

    exact = after(400, held=False)
    assert abs(after(20, held=False) / exact - 1.0) < 1e-5
    assert abs(after(20, held=True) / exact - 1.0) > 1e-2


def test_a_throttle_that_moves_is_followed_too(flying: dict) -> None:
    _, p, t = flying["aerosonde"]

    def after(n: int, held: bool) -> float:
        x, dt = t.state, 0.2 / n
        for k in range(n):
            now, end = t.throttle + 0.5 * k * dt, t.throttle + 0.5 * (k + (not held)) * dt
            k1 = derivative(p, x, t.surfaces, now, STILL_AIR, HEALTHY_EFFECTS)
            x = rk4_step(p, x, k1, t.surfaces, now, t.surfaces, end, STILL_AIR, HEALTHY_EFFECTS, dt)
        return x.u - t.state.u

    exact = after(400, held=False)
    assert exact > 0.05
    assert abs(after(20, held=False) / exact - 1.0) < 1e-5
    assert abs(after(20, held=True) / exact - 1.0) > 1e-2


def mirrored(a: Aircraft, p: PlantParams) -> PlantParams:
    """The same aircraft seen in a mirror: asymmetric coefficients, tables and propeller turned round."""
    body = p.body
    if isinstance(body.aero, TableAero):
        base = body.aero.base[:, ::-1, :].copy()
        base[:, :, [1, 3, 5]] *= -1.0
        assert np.array_equal(body.aero.beta, -body.aero.beta[::-1])
        aero = body.aero._replace(base=base)
    else:
        c = body.aero.clean
        aero = body.aero._replace(clean=c._replace(CY_0=-c.CY_0, Cl_0=-c.Cl_0, Cn_0=-c.Cn_0))
    prop = body.propulsion
    if hasattr(prop, "rotation"):
        prop = prop._replace(rotation=-prop.rotation)
    return p._replace(body=body._replace(aero=aero, propulsion=prop))


def partner(a: Aircraft, d: tuple[float, ...]) -> tuple[float, ...]:
    """Deflections in the mirror: left and right change places, rudders change sign."""
    out = []
    for s in a.surfaces:
        other = s.name.replace("left", "*").replace("right", "left").replace("*", "right")
        out.append(d[a.surface_index(other)] * (-1.0 if s.group == "rudder" else 1.0))
    return surfaces_tuple(out)


def reflected(x: State) -> State:
    return x._replace(east=-x.east, v=-x.v, p=-x.p, r=-x.r, e1=-x.e1, e3=-x.e3)


@pytest.mark.parametrize("name", ALL)
def test_flight_in_the_mirror_is_the_mirror_of_flight(name: str, flying: dict) -> None:
    a, p, t = flying[name]
    if hasattr(p.body.propulsion, "rotation"):
        p = p._replace(body=p.body._replace(propulsion=p.body.propulsion._replace(rotation=-1.0)))
    if not isinstance(p.body.aero, TableAero):
        clean = p.body.aero.clean._replace(CY_0=0.01, Cl_0=0.002, Cn_0=-0.001)
        p = p._replace(body=p.body._replace(aero=p.body.aero._replace(clean=clean)))
    q = mirrored(a, p)
    wind = Wind(2.0, -3.0, 0.5, 0.3, 0.8, -0.2, 0.02, 0.01, -0.03)
    other_wind = wind._replace(east=3.0, v=-0.8, p=-0.02, r=0.03)
    effects = Effects(0.9, 1.0, 1.1, 1.0, 0.1, 0.95)
    other_effects = Effects(1.0, 0.9, 1.0, 1.1, 0.1, 0.95)
    x = t.placed(heading=0.4, wind=wind)
    y = reflected(x)
    for k in range(500):
        s = moved(t, k)
        x = step(p, x, s, t.throttle, wind, effects, 0.01)
        y = step(q, y, partner(a, s), t.throttle, other_wind, other_effects, 0.01)
    assert abs(x.p) + abs(x.r) + abs(x.v) > 1e-2  # it did not fly straight
    scale = np.maximum(np.abs(np.array(x)), 1.0)
    assert (np.abs(np.array(reflected(y)) - np.array(x)) / scale).max() < 1e-12


@pytest.mark.parametrize("name", ALL)
def test_a_steady_wind_only_carries_the_aircraft_along(name: str, flying: dict) -> None:
    _, p, t = flying[name]
    # Where air or engine change with height, a wind that lifts the aircraft would change the flight.
    down = 0.0 if name in ("aerosonde_aerosim", "ultrastick120") else -1.0
    wind = STILL_AIR._replace(north=-4.0, east=3.0, down=down)
    x, y = t.placed(heading=0.3), t.placed(heading=0.3, wind=wind)
    for k in range(500):
        s = moved(t, k)
        x = step(p, x, s, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01)
        y = step(p, y, s, t.throttle, wind, HEALTHY_EFFECTS, 0.01)
    assert abs(x.p) + abs(x.q) + abs(x.r) > 1e-2  # it turned in the wind
    assert np.allclose(
        [y.north - x.north, y.east - x.east, y.down - x.down], [-20.0, 15.0, 5.0 * down], atol=1e-6
    )
    assert np.allclose(x[6:14], y[6:14], atol=1e-8)


@pytest.mark.parametrize("name", ALL)
def test_trimmed_flight_stays_trimmed(name: str, flying: dict) -> None:
    _, p, t = flying[name]
    x = t.state
    for _ in range(200):
        x = step(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01)
    assert x.north == pytest.approx(2.0 * t.airspeed, rel=1e-4)
    assert -x.down == pytest.approx(t.altitude, abs=2e-2)
    z = outputs(p, x, derivative(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS), STILL_AIR)
    g = p.body.air.gravity
    # What an accelerometer feels in steady level flight is the weight, turned into body axes.
    assert z.ax == pytest.approx(g * math.sin(z.theta), abs=2e-2)
    assert z.az == pytest.approx(-g * math.cos(z.theta) * math.cos(z.phi), abs=2e-2)
    assert z.alpha == pytest.approx(t.alpha, abs=1e-3) and z.airspeed == pytest.approx(t.airspeed, abs=2e-2)


def test_burnt_fuel_is_lost_mass_and_nothing_else(flying: dict) -> None:
    _, p, t = flying["aerosonde_aerosim"]
    x = t.state
    burnt = flow = 0.0
    for _ in range(3000):
        k = derivative(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS)
        y = rk4_step(
            p, x, k, t.surfaces, t.throttle, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01
        )
        flow = -k.fuel
        burnt += 0.01 * flow
        x = y
    assert flow > 1e-5
    assert t.state.fuel - x.fuel == pytest.approx(burnt, rel=1e-4)
    # Fuel that leaves without a push changes no velocity.
    adrift = p._replace(body=p.body._replace(air=p.body.air._replace(density0=0.0, gravity=0.0)))
    y = t.state
    for _ in range(1000):
        y = step(adrift, y._replace(engine=546.0), t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01)
    assert y.fuel < t.state.fuel
    assert (y.u, y.v, y.w) == (t.state.u, t.state.v, t.state.w)


def test_an_empty_tank_stops_the_engine_and_stays_empty(flying: dict) -> None:
    _, p, t = flying["aerosonde_aerosim"]
    x = t.state._replace(fuel=2e-7)
    for _ in range(300):
        x = step(p, x, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS, 0.01)
    assert x.fuel == 0.0
    assert x.engine < 0.95 * t.state.engine
    assert thrust(p, x, t.throttle, STILL_AIR, HEALTHY_EFFECTS) < 0.5 * thrust(
        p, t.state, t.throttle, STILL_AIR, HEALTHY_EFFECTS
    )


def test_mass_inertia_and_balance_go_from_full_to_empty(flying: dict) -> None:
    a, p, _ = flying["aerosonde_aerosim"]
    m = p.body.mass
    full = fuel_capacity(a)
    assert full == 5.0
    assert m.mass + full == 13.5
    assert m.inertia.Jx + full * m.inertia_slope.Jx == pytest.approx(0.8244)
    assert m.cg_z + full * m.cg_z_slope == pytest.approx(0.09)


@pytest.mark.parametrize("name", ALL)
def test_a_fault_of_one_wing_rolls_and_yaws_towards_it(name: str, flying: dict) -> None:
    _, p, t = flying[name]

    def rates(**change: float) -> State:
        return derivative(p, t.state, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS._replace(**change))

    healthy = rates()
    lift = rates(lift_right=0.9)
    assert lift.p > healthy.p + 0.1  # less lift on the right: the right wing drops
    assert lift.w > healthy.w  # and the aircraft sinks
    drag = rates(drag_right=1.3)
    assert drag.r > healthy.r + 1e-3  # more drag on the right: the nose goes right
    assert drag.u < healthy.u
    left = rates(lift_left=0.9)
    assert left.p - healthy.p == pytest.approx(-(lift.p - healthy.p), rel=1e-9)
    both = rates(lift_left=0.9, lift_right=0.9)
    assert both.p == pytest.approx(healthy.p, abs=1e-9)
    weak = rates(thrust=0.5)
    assert weak.u == pytest.approx(
        healthy.u
        - 0.5
        * thrust(p, t.state, t.throttle, STILL_AIR, HEALTHY_EFFECTS)
        / (p.body.mass.mass + t.state.fuel),
        rel=1e-4,  # alpha-dot derivatives answer the lost thrust a little
    )


def test_a_wing_fault_is_the_force_of_that_half_at_its_centre(flying: dict) -> None:
    """moving_horizon: the extra moment is r x (F_faulty - F_healthy) at half_y, for half of the whole lift."""
    _, p, t = flying["ducard"]
    w, m = p.body.wing, p.body.mass

    def rates(f: float) -> State:
        return derivative(
            p, t.state, t.surfaces, t.throttle, STILL_AIR, HEALTHY_EFFECTS._replace(lift_right=f)
        )

    d = np.array(rates(0.8)) - np.array(rates(1.0))
    # Lift of level flight: weight less the vertical part of the thrust.
    T = thrust(p, t.state, t.throttle, STILL_AIR, HEALTHY_EFFECTS)
    L = m.mass * p.body.air.gravity - T * math.sin(t.alpha)
    F = -0.2 * 0.5 * L * np.array([-math.sin(t.alpha), 0.0, math.cos(t.alpha)]) * -1.0
    J = np.array([[m.inertia.Jx, 0, -m.inertia.Jxz], [0, m.inertia.Jy, 0], [-m.inertia.Jxz, 0, m.inertia.Jz]])
    moment = np.cross([0.0, w.half_y, 0.0], F)
    assert np.allclose(d[3:6], F / m.mass, atol=1e-9)
    assert np.allclose(J @ d[10:13], moment, atol=1e-9)


PLAIN = """
import json
from aerofdi.aircraft import load_aircraft
from aerofdi.dynamics.build import plant_params
from aerofdi.dynamics.plant import step, derivative, outputs
from aerofdi.dynamics.types import *
from aerofdi.parts.ops import COMPILED
import sys
out = {"compiled": COMPILED}
for name, state, surfaces, throttle in json.loads(sys.stdin.read()):
    p = plant_params(load_aircraft(name))
    x, s = State(*state), tuple(surfaces)
    wind = Wind(2.0, -3.0, 0.5, 0.3, 0.8, -0.2, 0.02, 0.01, -0.03)
    for _ in range(20):
        x = step(p, x, s, throttle, wind, HEALTHY_EFFECTS, 0.01)
    k = derivative(p, x, s, throttle, wind, HEALTHY_EFFECTS)
    out[name] = [*x, *k, *outputs(p, x, k, wind)]
print(json.dumps(out))
"""


def test_plain_python_gives_the_same(flying: dict) -> None:
    ask = json.dumps([[n, list(t.state), list(t.surfaces), t.throttle] for n, (_, _, t) in flying.items()])

    def run(disable: str) -> dict:
        env = {**os.environ, "NUMBA_DISABLE_JIT": disable}
        done = subprocess.run(
            [sys.executable, "-c", PLAIN], input=ask, env=env, capture_output=True, text=True, check=True
        )
        return json.loads(done.stdout)

    fast, plain = run("0"), run("1")
    assert fast.pop("compiled") and not plain.pop("compiled")
    for name in ALL:
        assert np.allclose(fast[name], plain[name], rtol=1e-10, atol=1e-12), name
