"""The model-predictive guidance: its program solved exactly, its model true, its paths flown."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aerofdi.aircraft import load_aircraft
from aerofdi.autopilot import COURSE, HEADING, TRACK, Measured, Reference, aerosim_mpc, autopilot_of, guidance

N = aerosim_mpc.HORIZON
GRAVITY = 9.80665


@pytest.fixture(scope="module")
def pilot() -> Any:
    return autopilot_of(load_aircraft("aerosonde_aerosim").autopilot)


def at(
    north: float, east: float, psi: float, speed: float = 25.0, wind: tuple[float, float] = (0.0, 0.0)
) -> Measured:
    vn, ve = speed * math.cos(psi) + wind[0], speed * math.sin(psi) + wind[1]
    return Measured(0.0, 0.0, 0.0, 0.0, 0.05, psi, speed, 0.05, 0.0, 100.0, 0.0, north, east, vn, ve)


def legs(lateral: int = TRACK, course: float = 0.0) -> Reference:
    return Reference(25.0, 100.0, lateral, 0.0, course, 0.0, 0.0, 1500.0, 0.0, 1500.0, 800.0)


def program(pilot: Any, ref: Reference, z: Measured, last: float) -> tuple[np.ndarray, ...]:
    H, f, lo, hi = np.zeros((N, N)), np.zeros(N), np.zeros(N), np.zeros(N)
    aerosim_mpc.guidance_qp(pilot.gains, ref, z, last, H, f, lo, hi)
    return H, f, lo, hi


def cases() -> list[tuple[Reference, Measured, float]]:
    rng = np.random.default_rng(4)
    out = []
    for k in range(30):
        z = at(
            rng.uniform(0, 1600),
            rng.uniform(-300, 300),
            rng.uniform(-3, 3),
            rng.uniform(20, 30),
            tuple(rng.uniform(-6, 6, 2)),
        )
        out.append(
            (legs((TRACK, TRACK, COURSE, HEADING)[k % 4], rng.uniform(-3, 3)), z, rng.uniform(-0.2, 0.2))
        )
    return out


def test_the_command_is_the_first_move_of_the_exact_solution(pilot: Any) -> None:
    cp = pytest.importorskip("cvxpy")
    limited = 0
    for ref, z, last in cases():
        H, f, lo, hi = program(pilot, ref, z, last)
        assert np.allclose(H, H.T) and np.linalg.eigvalsh(H)[0] > 0.0
        assert (
            hi[0] == pytest.approx(GRAVITY * math.tan(pilot.gains.bank_max) / z.airspeed)
            and (lo == -hi).all()
        )
        v = cp.Variable(N)
        cp.Problem(cp.Minimize(0.5 * cp.quad_form(v, cp.psd_wrap(H)) + f @ v), [v >= lo, v <= hi]).solve(
            solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11
        )
        r0 = aerosim_mpc.guide(pilot.gains, ref, z, last)
        assert r0 == pytest.approx(v.value[0], abs=2e-6)
        limited += int(abs(abs(r0) - hi[0]) < 1e-12)
    assert 3 < limited < 27  # the constraint mattered, not always


def test_the_program_is_the_stated_sum_of_squares_for_any_yaw_rates(pilot: Any) -> None:
    g, rng = pilot.gains, np.random.default_rng(1)
    for ref, z, last in cases():
        H, f, _, _ = program(pilot, ref, z, last)
        Y, E, y, e = np.zeros((N, N)), np.zeros((N, N)), np.zeros(N), np.zeros(N)
        aerosim_mpc.predict(g, ref, z, last, Y, E, y, e)
        w_y = 1.0 / g.track_scale**2 if ref.lateral == TRACK else 0.0

        def cost(
            r: np.ndarray,
            Y: Any = Y,
            E: Any = E,
            y: Any = y,
            e: Any = e,
            w_y: float = w_y,
            last: float = last,
        ) -> float:
            moves = np.diff(r, prepend=last)
            return (
                w_y * np.sum((y + Y @ r) ** 2)
                + np.sum((e + E @ r) ** 2) / g.heading_scale**2
                + np.sum(moves**2) / g.rate_scale**2
            )

        a, b = rng.uniform(-0.2, 0.2, N), rng.uniform(-0.2, 0.2, N)
        ours = (a @ H @ a - b @ H @ b) + 2.0 * f @ (a - b)
        assert ours == pytest.approx(cost(a) - cost(b), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (4.0, -3.0)])
def test_prediction_is_the_linearisation_of_the_stated_model(pilot: Any, wind: tuple[float, float]) -> None:
    """About the nominal sequence: simulate the model with slightly different yaw rates and compare."""
    g, last = pilot.gains, 0.05
    z, ref = at(700.0, 60.0, 0.4, 25.0, wind), legs()
    Y, E, y, e = np.zeros((N, N)), np.zeros((N, N)), np.zeros(N), np.zeros(N)
    aerosim_mpc.predict(g, ref, z, last, Y, E, y, e)
    T, lag, V = g.guidance_period, g.bank_lag, 25.0
    ground = math.hypot(z.velocity_north, z.velocity_east)
    crab = lambda c: c - math.asin((-wind[0] * math.sin(c) + wind[1] * math.cos(c)) / V)
    r_max = GRAVITY * math.tan(g.bank_max) / V

    def simulate(r: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        psi, n, east, before, cross, heading, used = z.psi, z.north, z.east, last, [], [], []
        for k in range(N):
            course = 0.0 if z.north + ground * T * (k + 1) <= 1500.0 else math.pi / 2.0
            point = (1500.0, 0.0)
            nominal = np.clip((crab(course) - psi - lag * before) / (T - lag), -r_max, r_max)
            rate = nominal if r is None else r[k]
            new = psi + (T - lag) * rate + lag * before
            n += T * (V * math.cos(0.5 * (psi + new)) + wind[0])
            east += T * (V * math.sin(0.5 * (psi + new)) + wind[1])
            psi, before = new, rate
            used.append(rate)
            cross.append(-(n - point[0]) * math.sin(course) + (east - point[1]) * math.cos(course))
            heading.append(psi - crab(course))
        return np.array(used), np.array(cross), np.array(heading)

    r_bar, cross, heading = simulate(None)
    assert np.allclose(y + Y @ r_bar, cross, atol=1e-9) and np.allclose(e + E @ r_bar, heading, atol=1e-9)
    small = 1e-5 * np.random.default_rng(0).standard_normal(N)
    _, cross, heading = simulate(r_bar + small)
    assert np.allclose(y + Y @ (r_bar + small), cross, atol=1e-6)
    assert np.allclose(e + E @ (r_bar + small), heading, atol=1e-12)


def fly(pilot: Any, wind: tuple[float, float], until: float, start: tuple[float, float, float]) -> np.ndarray:
    """A point whose bank lags: rows of t, north, east, bank, yaw-rate command, cross-track, leg, distance left."""
    g, dt = pilot.gains, 0.05
    north, east = guidance.rectangle(1500.0, 800.0)
    p = guidance.plan([0.0], 25.0, 100.0, lateral=TRACK, north=north, east=east, gains=pilot.guidance)
    gs, (n, e, psi), phi, r, rows = guidance.init(p), start, 0.0, 0.0, []
    for k in range(int(until / dt)):
        z = at(n, e, psi, 25.0, wind)
        gs, ref = guidance.step(p, gs, z, k * dt, 0)
        if k % 40 == 0:
            r = aerosim_mpc.guide(g, ref, z, r)
        phi += dt / g.bank_lag * (math.atan2(25.0 * r, GRAVITY) - phi)
        psi += dt * GRAVITY * math.tan(phi) / 25.0
        n, e = n + dt * z.velocity_north, e + dt * z.velocity_east
        c = math.atan2(ref.to_east - ref.from_east, ref.to_north - ref.from_north)
        cross = -(n - ref.from_north) * math.sin(c) + (e - ref.from_east) * math.cos(c)
        left = (ref.to_north - n) * math.cos(c) + (ref.to_east - e) * math.sin(c)
        rows.append((k * dt, n, e, phi, r, cross, gs.leg, left))
    return np.array(rows)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (3.0, -5.0)])
def test_waypoints_are_flown_in_wind_with_banked_corners_and_straight_legs(
    pilot: Any, wind: tuple[float, float]
) -> None:
    rows = fly(pilot, wind, 300.0, (0.0, 0.0, 0.0))
    leg, left, cross, bank = rows[:, 6], rows[:, 7], rows[:, 5], rows[:, 3]
    assert len(np.flatnonzero(np.diff(leg))) >= 5
    length = np.where(leg % 2 == 0, 1500.0, 800.0)
    middle = (left > 250.0) & (left < length - 450.0)
    assert np.sqrt(np.mean(cross[middle] ** 2)) < 1.5
    assert np.max(np.abs(bank)) > math.radians(25.0)
    assert np.std(rows[middle, 4]) < 0.02  # no chatter: less than 3 deg of bank
    assert np.max(np.abs(rows[:, 4])) <= GRAVITY * math.tan(pilot.gains.bank_max) / 25.0 + 1e-12


def test_a_large_offset_is_flown_off_without_a_limit_cycle(pilot: Any) -> None:
    rows = fly(pilot, (0.0, 0.0), 45.0, (0.0, 150.0, 1.2))
    cross = rows[:, 5]
    assert cross.min() > -20.0 and np.max(np.abs(cross[rows[:, 0] > 35.0])) < 3.0


@pytest.mark.parametrize(("lateral", "wind"), [(HEADING, (5.0, 5.0)), (COURSE, (5.0, 5.0))])
def test_heading_or_course_is_held_without_a_track(
    pilot: Any, lateral: int, wind: tuple[float, float]
) -> None:
    psi, r, dt = 0.0, 0.0, 0.05
    for k in range(1200):
        z = at(0.0, 0.0, psi, 25.0, wind)
        if k % 40 == 0:
            r = aerosim_mpc.guide(pilot.gains, legs(lateral, 1.0), z, r)
        psi += dt * r
    held = psi if lateral == HEADING else math.atan2(z.velocity_east, z.velocity_north)
    assert held == pytest.approx(1.0, abs=0.01)
    assert (abs(psi - 1.0) > 0.02) == (lateral == COURSE)


def test_the_program_is_solved_every_two_seconds_and_at_once_after_a_bank_command(pilot: Any) -> None:
    module, z = aerosim_mpc, at(0.0, 0.0, 0.3)
    state = module.init(pilot.gains, module.Command(0.0, 0.0, 0.0, 0.0, 0.5), z)
    rates = []
    for k in range(120):
        z = at(0.0, 0.0, 0.3 - 0.002 * k)
        state, _ = module.step(pilot.gains, state, legs(HEADING, 1.0), z, 0.05)
        rates.append(state.yaw_rate_ref)
    changes = np.flatnonzero(np.diff(rates)) + 1
    assert changes.tolist() == [40, 80]
    state, _ = module.step(pilot.gains, state, legs(0)._replace(bank=0.0), z, 0.05)
    assert state.bank_ref == 0.0
    state, _ = module.step(pilot.gains, state, legs(HEADING, 1.0), z, 0.05)
    assert state.yaw_rate_ref > 0.05
