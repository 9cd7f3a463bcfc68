"""Every autopilot in the nonlinear closed loop: track, steps, turbulence and HOLD_LEVEL, no limit cycle."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from aerofdi.autopilot.guidance import rectangle
from aerofdi.core import Flight, Request
from aerofdi.dynamics.faults import Fault
from aerofdi.scenarios import Guidance, Point, Scenario, Start, Track, Turbulence, WindSpec
from aerofdi.simulate import fly
from aerofdi.simulate.fly import assemble, start
from aerofdi.simulate.loop import advance
from aerofdi.simulate.prepare import prepare


class Case(NamedTuple):
    """Where each aircraft flies, and what it must hold: m, m/s, rad."""

    aircraft: str
    airspeed: float
    altitude: float
    length: float
    width: float
    bank: float
    altitude_calm: float
    altitude_rough: float
    airspeed_rough: float


CASES = (
    Case("vireo", 15.4, 100.0, 400.0, 200.0, 40.0, 0.6, 1.5, 1.0),
    Case("ultrastick120", 23.0, 100.0, 600.0, 300.0, 45.0, 2.0, 4.0, 2.0),
    Case("aerosonde", 18.0, 50.0, 600.0, 300.0, 30.0, 0.6, 2.0, 1.0),
    Case("aerosonde_aerosim", 25.0, 100.0, 1500.0, 800.0, 30.0, 1.2, 3.0, 2.5),
    Case("ducard", 30.0, 100.0, 1200.0, 600.0, 40.0, 1.0, 4.0, 4.0),
)
aircraft = pytest.mark.parametrize("case", CASES, ids=lambda c: c.aircraft)


def scenario(case: Case, duration: float, **change: Any) -> Scenario:
    north, east = rectangle(case.length, case.width)
    track = Guidance(
        "track", (Point(0.0, case.airspeed, case.altitude, 0.0),), Track(tuple(north), tuple(east))
    )
    given = {"guidance": track, "noise_factor": 0.0} | change
    return Scenario("test", "test", case.aircraft, duration, 1, Start(case.airspeed, case.altitude), **given)


def truth(flight: Flight, name: str) -> np.ndarray:
    return flight.truth[name].value


def distance_to_track(case: Case, flight: Flight) -> np.ndarray:
    """Distance to the nearest side of the rectangle, m."""
    n, e = truth(flight, "north"), truth(flight, "east")
    dn = np.minimum(np.abs(n), np.abs(n - case.length)) + np.maximum(np.maximum(-e, e - case.width), 0.0)
    de = np.minimum(np.abs(e), np.abs(e - case.width)) + np.maximum(np.maximum(-n, n - case.length), 0.0)
    return np.minimum(dn, de)


@aircraft
def test_calm_rectangle_altitude_airspeed_and_straight_legs_are_held_and_corners_banked(case: Case) -> None:
    lap = 2.0 * (case.length + case.width) / case.airspeed
    flight = fly(scenario(case, 1.3 * lap))
    assert not flight.meta["diverged"]
    phi = truth(flight, "phi")
    assert np.max(np.abs(truth(flight, "altitude") - case.altitude)) < case.altitude_calm
    assert np.max(np.abs(truth(flight, "airspeed") - case.airspeed)) < 1.0
    assert np.radians(0.8 * case.bank) < np.max(phi) < np.radians(1.2 * case.bank)
    level = np.abs(phi) < np.radians(3.0)
    assert np.mean(level) > 0.5
    assert np.median(distance_to_track(case, flight)[level]) < 1.5


@aircraft
def test_no_limit_cycle_a_disturbed_flight_settles_to_rest(case: Case) -> None:
    """Steps of heading, altitude and airspeed without noise: at the end nothing moves any more."""
    V, h = case.airspeed, case.altitude
    points = (
        Point(0.0, V, h, 0.0), Point(5.0, V, h, 0.0), Point(5.0, V, h + 10.0, 0.0), Point(35.0, V, h + 10.0, 0.0),
        Point(35.0, 1.06 * V, h + 10.0, 1.0),
    )  # fmt: skip
    flight = fly(scenario(case, 160.0, guidance=Guidance("heading", points)))
    last = flight.truth["p"].t_s > 150.0
    for name in ("p", "q", "r"):
        assert np.max(np.abs(truth(flight, name)[last])) < 2e-3, name
    for name, series in flight.truth.items():
        if name.startswith("surface."):
            assert np.ptp(series.value[last]) < math.radians(0.05), name
    assert abs(truth(flight, "altitude")[-1] - h - 10.0) < 0.3
    assert abs(truth(flight, "airspeed")[-1] - 1.06 * V) < 0.1
    assert abs(truth(flight, "psi")[-1] - 1.0) < 0.02


@aircraft
def test_wind_and_turbulence_of_twenty_percent_are_held_with_noisy_sensors(case: Case) -> None:
    V = case.airspeed
    wind = WindSpec(0.2 * V, math.radians(40.0), turbulence=Turbulence("dryden", wind_20ft=0.2 * V))
    flight = fly(scenario(case, 150.0, wind=wind, noise_factor=1.0))
    assert not flight.meta["diverged"]
    altitude, airspeed = truth(flight, "altitude") - case.altitude, truth(flight, "airspeed") - V
    assert np.max(np.abs(altitude)) < case.altitude_rough and np.max(np.abs(airspeed)) < case.airspeed_rough
    assert np.std(airspeed) > 0.05  # the weather was there
    assert np.max(np.abs(truth(flight, "phi"))) < np.radians(1.3 * case.bank)
    level = np.abs(truth(flight, "phi")) < np.radians(8.0)
    assert np.median(distance_to_track(case, flight)[level]) < 6.0


@aircraft
def test_hold_level_in_a_corner_flies_straight_and_level_until_released(case: Case) -> None:
    s = scenario(case, case.length / case.airspeed + 75.0)
    r, motion = start(prepare(s), 1, 0)
    hz = 1.0 / r.params.dt
    k, banked = 0, False
    while not banked:  # on until the first corner is half flown
        k += round(0.5 * hz)
        motion = advance(r.params, r.memory, r.record, motion, 1, 0, k, int(Request.NONE))
        x = motion.plant
        banked = math.atan2(2.0 * (x.e0 * x.e1 + x.e2 * x.e3), 1.0 - 2.0 * (x.e1**2 + x.e2**2)) > 0.4
    begin = k
    hold = begin + round(30.0 * hz)
    motion = advance(r.params, r.memory, r.record, motion, 1, 0, hold, int(Request.HOLD_LEVEL))
    motion = advance(r.params, r.memory, r.record, motion, 1, 0, r.prepared.steps, int(Request.NONE))
    flight = assemble(r, motion.k)
    t = flight.truth["phi"].t_s
    phi, psi, h = truth(flight, "phi"), truth(flight, "psi"), truth(flight, "altitude")
    held = (t > (begin / hz + 12.0)) & (t < hold / hz)
    assert np.max(np.abs(phi[held])) < np.radians(3.0)
    assert np.ptp(psi[held]) < np.radians(4.0)
    assert np.max(np.abs(h[held] - h[np.searchsorted(t, begin / hz)])) < case.altitude_calm
    assert np.max(np.abs(phi[t > hold / hz + 1.0])) > np.radians(15.0)  # and goes back to its track


@pytest.mark.parametrize("angle", [-7.0, -5.0, -1.0, 1.0, 3.0, 5.0])
@pytest.mark.parametrize("surface", ["elevon_left", "elevon_right"])
def test_vireo_stays_wings_level_with_an_elevon_stuck_anywhere_in_the_tolerable_set(
    surface: str, angle: float
) -> None:
    """Straight flight near its altitude, slower or faster as the pitching moment wants; the fault is seen meanwhile."""
    fault = Fault(surface, "stuck", 20.0, value=math.radians(angle), about="trim")
    level = Guidance("heading", (Point(0.0, 15.4, 100.0, 0.0),))
    flight = fly(scenario(CASES[0], 130.0, guidance=level, faults=(fault,)))
    t, phi = flight.truth["phi"].t_s, truth(flight, "phi")
    end = t > 90.0
    assert not flight.meta["diverged"]
    assert np.max(np.abs(phi)) < np.radians(50.0) and np.std(phi[end]) < np.radians(3.0)
    assert abs(np.mean(phi[end])) < np.radians(2.0)
    assert np.max(np.abs(truth(flight, "altitude")[end] - 100.0)) < 22.0
    change = np.mean(truth(flight, "airspeed")[end]) - 15.4
    assert np.sign(change) == np.sign(angle) or abs(angle) <= 1.0
    assert np.max(np.abs(truth(flight, "p")[(t > 20.0) & (t < 23.0)])) > 0.02


@pytest.mark.parametrize(("surface", "side"), [("rudder_top", 1.0), ("rudder_bottom", -1.0)])
def test_ultra_stick_flies_on_straight_with_half_its_rudder_hard_over(surface: str, side: float) -> None:
    """As the split-rudder paper describes: yaw left, roll right, sideslip; then the other half balances.

    The ailerons' change from trim at the end, +-0.31 deg, is what the paper tells the halves apart by.
    """
    fault = Fault(surface, "stuck", 5.0, value=math.radians(25.0))
    level = Guidance("heading", (Point(0.0, 23.0, 100.0, math.radians(155.0)),))
    s = scenario(CASES[1], 150.0, guidance=level, faults=(fault,))
    flight = fly(Scenario(**{**s.__dict__, "start": Start(23.0, 100.0, math.radians(155.0))}))
    t = flight.truth["p"].t_s
    soon = np.searchsorted(t, 5.4)
    assert (
        truth(flight, "r")[soon] < -0.2
        and truth(flight, "p")[soon] > 0.02
        and truth(flight, "beta")[soon] > 0.05
    )
    command = {n: np.degrees(flight.measured[f"command.{n}"].value) for n in ("rudder_top", "aileron_right")}
    assert command["rudder_top"][-1] == pytest.approx(-25.0, abs=0.3)
    assert abs(math.degrees(truth(flight, "beta")[-1])) < 0.05
    assert abs(math.degrees(truth(flight, "psi")[-1]) - 155.0) < 0.1
    change = command["aileron_right"][-1] - command["aileron_right"][0]
    assert change == pytest.approx(side * 0.313, abs=0.04)
    assert np.max(np.abs(truth(flight, "phi"))) < math.radians(15.0)
