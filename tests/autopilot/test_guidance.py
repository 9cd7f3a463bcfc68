"""The plan over time, the track with its banked corners, and HOLD_LEVEL."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aerofdi.autopilot import BANK, COURSE, HEADING, TRACK, Measured, Reference, guidance
from aerofdi.autopilot.guidance import Gains, plan, rectangle
from aerofdi.core import Request, WrongUse

STILL = Measured(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.0, 20.0, 0.0)
G = 9.80665


def references(p: guidance.Plan, times: list[float]) -> list[Reference]:
    state, out = guidance.init(p), []
    for t in times:
        state, ref = guidance.step(p, state, STILL, t, int(Request.NONE))
        out.append(ref)
    return out


def fly_point(
    p: guidance.Plan, speed: float, wind: tuple[float, float], until: float, bank_lag: float = 0.3
) -> Any:
    """A point that banks with a lag and turns coordinated: rows of t, north, east, bank, leg, cross-track error."""
    dt, state = 0.02, guidance.init(p)
    north, east, psi, phi, rows = float(p.north[0]), float(p.east[0]), 0.0, 0.0, []
    psi = math.atan2(p.east[1] - p.east[0], p.north[1] - p.north[0])
    for k in range(int(until / dt)):
        vn, ve = speed * math.cos(psi) + wind[0], speed * math.sin(psi) + wind[1]
        z = STILL._replace(
            phi=phi, psi=psi, airspeed=speed, north=north, east=east, velocity_north=vn, velocity_east=ve
        )
        state, ref = guidance.step(p, state, z, k * dt, 0)
        cross = -(north - ref.from_north) * math.sin(ref.course) + (east - ref.from_east) * math.cos(
            ref.course
        )
        rows.append((k * dt, north, east, phi, state.leg, cross))
        phi += dt / bank_lag * (ref.bank - phi)
        psi += dt * G * math.tan(phi) / speed
        north, east = north + dt * vn, east + dt * ve
    return np.array(rows)


def test_references_ramp_between_points_step_at_repeated_times_and_hold_the_last() -> None:
    p = plan([0.0, 10.0, 10.0, 20.0], [15.0, 15.0, 16.0, 18.0], 100.0, [0.0, 0.0, 1.0, 1.0], COURSE)
    before, at, middle, after = references(p, [9.999, 10.0, 15.0, 1e4])
    assert before.airspeed == 15.0 and before.course == 0.0
    assert at.airspeed == 16.0 and at.course == 1.0
    assert middle.airspeed == pytest.approx(17.0)
    assert after.airspeed == 18.0 and after.altitude == 100.0 and after.lateral == COURSE


def test_a_bank_plan_gives_bank_and_a_plan_before_its_first_time_gives_the_first_point() -> None:
    ref = references(plan([5.0, 6.0], 20.0, [90.0, 95.0], [0.2, 0.4], BANK), [0.0])[0]
    assert (ref.lateral, ref.bank, ref.altitude) == (BANK, 0.2, 90.0)


def test_a_plan_has_contiguous_columns_whatever_it_is_made_from() -> None:
    table = np.array([[0.0, 15.0, 100.0, 0.1], [10.0, 16.0, 110.0, 0.2]])
    p = plan(*table.T, lateral=TRACK, north=table.ravel()[::3], east=table.ravel()[2::3].tolist() + [7.0])
    columns = (p.t_s, p.airspeed, p.altitude, p.angle, p.north, p.east)
    assert all(a.flags.c_contiguous and a.dtype == np.float64 for a in columns)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"t_s": [1.0, 0.0]}, "never decrease"),
        ({"airspeed": [1.0, 2.0, 3.0]}, "airspeed"),
        ({"altitude": math.nan}, "altitude"),
        ({"lateral": 7}, "lateral"),
        ({"lateral": TRACK, "north": [0.0, 1.0], "east": [0.0, 0.0]}, "three"),
        ({"lateral": TRACK, "north": [0.0, 0.0, 5.0], "east": [0.0, 0.0, 5.0]}, "different"),
        ({"gains": Gains(12.0, 0.75, 2.0, 0.5)}, "bank_max"),
    ],
)
def test_a_plan_that_cannot_be_flown_is_refused(change: dict[str, Any], says: str) -> None:
    given = {"t_s": [0.0, 1.0], "airspeed": 20.0, "altitude": 100.0} | change
    with pytest.raises(WrongUse, match=says):
        plan(**given)


def test_small_cross_track_errors_obey_the_second_order_law_of_the_docstring() -> None:
    gains = Gains(l1_period=14.0, l1_damping=0.7, bank_max=0.6, turn_time=0.0)
    north, east = rectangle(1e5, 1e4)
    p = plan([0.0], 20.0, 100.0, lateral=TRACK, north=north, east=east, gains=gains)
    dt, y, speed, psi, state, ys = 0.005, 1.0, 20.0, 0.0, guidance.init(p), []
    for k in range(4000):
        z = STILL._replace(
            north=1000.0 + k * dt * speed, east=y, psi=psi, velocity_north=speed, velocity_east=speed * psi
        )
        state, ref = guidance.step(p, state, z, k * dt, 0)
        ys.append(y)
        psi += dt * G * math.tan(ref.bank) / speed
        y += dt * speed * math.sin(psi)
    w, zeta, t = 2.0 * math.pi / 14.0, 0.7, dt * np.arange(4000)
    wd = w * math.sqrt(1.0 - zeta**2)
    exact = np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))
    assert np.max(np.abs(np.array(ys) - exact)) < 0.02
    assert min(ys) < -0.02  # it did overshoot as a damping of 0.7 must


@pytest.mark.parametrize("wind", [(0.0, 0.0), (-2.0, 3.0)])
def test_rectangle_is_flown_with_straight_legs_and_banked_corners(wind: tuple[float, float]) -> None:
    gains = Gains(l1_period=12.0, l1_damping=0.75, bank_max=0.7, turn_time=0.4)
    north, east = rectangle(400.0, 200.0)
    p = plan([0.0], 15.4, 100.0, lateral=TRACK, north=north, east=east, gains=gains)
    rows = fly_point(p, 15.4, wind, 240.0)
    t, n, e, bank, leg, cross = rows.T
    assert len(np.flatnonzero(np.diff(leg))) >= 10  # two rounds
    assert min(n.min(), e.min()) > -12.0 and n.max() < 412.0 and e.max() < 212.0
    since_turn = (
        t - t[np.maximum.accumulate(np.where(np.diff(leg, prepend=leg[0]) != 0, np.arange(len(t)), 0))]
    )
    settled = since_turn > 10.0
    assert np.max(np.abs(cross[settled])) < 1.5
    assert np.max(np.abs(bank[settled])) < 0.12
    turning = (since_turn > 1.0) & (since_turn < 2.5) & (t > 20.0)
    assert np.max(bank[turning]) > 0.6 and np.min(bank) > -0.25  # right-hand corners, sharply banked


def test_a_track_to_the_left_is_the_mirror_image_of_one_to_the_right() -> None:
    tracks = [rectangle(400.0, 200.0, right=side) for side in (True, False)]
    right, left = (
        fly_point(plan([0.0], 15.4, 100.0, lateral=TRACK, north=n, east=e), 15.4, (0.0, 0.0), 60.0)
        for n, e in tracks
    )
    assert np.allclose(right[:, 1], left[:, 1], atol=1e-9)
    assert np.allclose(right[:, 2:4], -left[:, 2:4], atol=1e-9)
    assert np.max(right[:, 3]) > 0.5


def test_hold_level_levels_then_holds_heading_and_altitude_and_lets_go() -> None:
    north, east = rectangle(400.0, 200.0)
    p = plan([0.0], 15.4, 120.0, lateral=TRACK, north=north, east=east)
    z = STILL._replace(phi=0.6, psi=1.0, altitude=118.0)
    s, ref = guidance.step(p, guidance.init(p), z, 0.0, int(Request.NONE))
    assert ref.lateral == TRACK
    s, ref = guidance.step(p, s, z, 0.1, int(Request.HOLD_LEVEL))
    assert (ref.lateral, ref.bank, ref.altitude, ref.airspeed) == (BANK, 0.0, 118.0, 15.4)
    s, ref = guidance.step(p, s, z._replace(phi=0.04, psi=1.3, altitude=117.0), 0.2, int(Request.HOLD_LEVEL))
    assert (ref.lateral, ref.course, ref.altitude) == (HEADING, 1.3, 118.0)
    s, ref = guidance.step(p, s, z._replace(phi=-0.3, psi=1.1), 0.3, int(Request.HOLD_LEVEL))
    assert (ref.lateral, ref.course) == (HEADING, 1.3)  # a gust does not move the heading held
    s, ref = guidance.step(p, s, z, 0.4, int(Request.NONE))
    assert ref.lateral == TRACK and ref.altitude == 120.0
    s, ref = guidance.step(p, s, z._replace(phi=0.0, psi=2.0, altitude=90.0), 0.5, int(Request.HOLD_LEVEL))
    assert (ref.course, ref.altitude) == (2.0, 90.0)  # a new request starts anew
