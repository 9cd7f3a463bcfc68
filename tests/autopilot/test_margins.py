"""The stated criteria of every loop, re-derived from the controllers' code and the aircraft's linear models."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from aerofdi.autopilot import BANK, HEADING

THREE, FOUR = ("elevator", "aileron", "throttle"), ("elevator", "aileron", "rudder", "throttle")


@pytest.mark.parametrize(
    ("name", "airspeed", "names", "gain_db", "phase_deg"),
    [
        ("vireo", 15.4, THREE, 6.0, 60.0),
        ("ultrastick", 23.0, FOUR, 20.0, 60.0),
        ("aerosonde", 18.0, THREE, 20.0, 45.0),
        ("aerosonde", 25.0, THREE, 19.0, 45.0),
        ("aerosim_mpc", 22.0, FOUR, 18.0, 60.0),
        ("aerosim_mpc", 25.0, FOUR, 18.0, 60.0),
        ("aerosim_mpc", 30.0, FOUR, 18.0, 60.0),
        ("ducard", 30.0, FOUR, 11.8, 40.0),
    ],
)
def test_every_loop_has_the_margins_its_docstring_states(
    make_loop: Any, name: str, airspeed: float, names: tuple[str, ...], gain_db: float, phase_deg: float
) -> None:
    lateral = (
        BANK if name == "aerosim_mpc" else HEADING
    )  # its heading is held by the guidance, not by a linear loop
    found = make_loop(name, airspeed).loops(names, lateral=lateral)
    for loop, m in found.items():
        assert m.gain_up > gain_db and m.phase > phase_deg, (loop, m)
        assert m.gain_down > 10.0, (loop, m)
    assert all(math.isfinite(m.crossover) for n, m in found.items() if n != "rudder")  # the loops are closed


def test_light_aerosim_aircraft_keeps_its_margins(make_loop: Any) -> None:
    for m in make_loop("aerosim_mpc", 25.0, fuel=0.2).loops(FOUR, lateral=BANK).values():
        assert m.gain_up > 18.0 and m.phase > 60.0


def test_vireo_pitch_damper_gives_the_published_short_period_and_the_printed_sign_would_lose_it(
    make_loop: Any, controller_of: Any
) -> None:
    loop = make_loop("vireo", 15.4)
    c = controller_of(loop.pilot, loop.command, loop.z)
    q = 1  # place of q in the measurement
    elevator = 0.5 * (c.D[0, q] + c.D[1, q])
    m = loop.model().select(("q", "w"), None, ("q",))
    B = m.B[:, 0] + m.B[:, 1]
    damped = np.linalg.eigvals(m.A + np.outer(B * elevator, [1.0, 0.0]))
    printed = np.linalg.eigvals(m.A - np.outer(B * elevator, [1.0, 0.0]))
    assert elevator == pytest.approx(0.05, rel=1e-6)
    assert np.allclose(damped[np.argmax(damped.imag)], -10.2 + 11.9j, atol=0.06)
    assert np.allclose(printed[np.argmax(printed.imag)], -0.945 + 13.09j, atol=0.01)


def test_vireo_roll_law_is_the_published_one_at_every_frequency(make_loop: Any, controller_of: Any) -> None:
    loop = make_loop("vireo", 15.4)
    c = controller_of(loop.pilot, loop.command, loop.z, BANK)
    for w in (0.1, 1.0, 10.0):
        z = np.exp(1j * w * loop.dt)
        K = c.C @ np.linalg.solve(z * np.eye(len(c.A)) - c.A, c.B) + c.D
        aileron = 0.5 * (K[1] - K[0])
        p, phi = aileron[0], aileron[3]
        # BANK holds the bank of trim: the reference stays, so phi enters with the sign of feedback.
        assert abs(phi - (0.34 + 0.086 / (1j * w))) < 0.086 * loop.dt
        assert abs(p - 0.06) < 1e-9


@pytest.mark.parametrize(
    ("name", "reference", "output", "lateral", "wide"),
    [
        ("vireo", "bank", "phi", BANK, 1.8),
        ("vireo", "altitude", "altitude", HEADING, 1.1),
        ("vireo", "course", "psi", HEADING, 0.63),
        ("aerosonde", "bank", "phi", BANK, 3.5),
        ("aerosonde", "altitude", "altitude", HEADING, 0.9),
        ("aerosonde", "airspeed", "airspeed", HEADING, 2.2),
        ("aerosonde", "course", "psi", HEADING, 0.7),
        ("aerosim_mpc", "bank", "phi", BANK, 3.1),
        ("aerosim_mpc", "altitude", "altitude", BANK, 0.7),
        ("aerosim_mpc", "airspeed", "airspeed", BANK, 0.36),
        ("ducard", "altitude", "altitude", HEADING, 0.41),
        ("ducard", "airspeed", "airspeed", HEADING, 0.44),
        ("ducard", "course", "psi", HEADING, 0.26),
    ],
)
def test_bandwidths_are_those_of_the_docstrings(
    make_loop: Any, name: str, reference: str, output: str, lateral: int, wide: float
) -> None:
    assert make_loop(name).bandwidth(reference, output, lateral) == pytest.approx(wide, rel=0.08)


def lateral_poles(loop: Any, controller: Any, rudder_chord: float) -> np.ndarray:
    """Lateral closed-loop poles with first-order servos at the control period, rad/s.

    The rudder's slope is that of a chord of this size (rad): its tables are nearly dead within 5 deg.
    """
    chords = {n: rudder_chord for n in ("rudder_top", "rudder_bottom")}
    names = ("p", "r", "phi", "psi", "beta")
    m = loop.model(steps=chords).select(
        ("v", "p", "r", "phi", "psi"), loop.pilot.module.Command._fields[1:5], names
    )
    n, nu = m.B.shape
    servo = loop.aircraft.surface("aileron_left").bandwidth
    A = np.block([[m.A, m.B], [np.zeros((nu, n)), -servo * np.eye(nu)]])
    B = np.vstack([np.zeros((n, nu)), servo * np.eye(nu)])
    step = expm(np.block([[A, B], [np.zeros((nu, n + 2 * nu))]]) * loop.dt)
    Ad, Bd = step[: n + nu, : n + nu], step[: n + nu, n + nu :]
    C = np.hstack([m.C, np.zeros((len(names), nu))])
    seen = [("p", "q", "r", "phi", "theta", "psi", "airspeed", "alpha", "beta").index(x) for x in names]
    Kb, Kc, Kd = controller.B[:, seen], controller.C[1:5], controller.D[1:5][:, seen]
    closed = np.block([[Ad + Bd @ Kd @ C, Bd @ Kc], [Kb @ C, controller.A]])
    z = np.linalg.eigvals(closed).astype(complex)
    # Stored references have no dynamics (0); integrals of the longitudinal loops have no input here (1).
    z = z[(np.abs(z) > 1e-9) & (np.abs(z - 1.0) > 1e-8)]
    return np.log(z) / loop.dt


def test_ultra_stick_sideslip_loop_settles_in_the_papers_twelve_seconds_and_is_well_damped(
    make_loop: Any, controller_of: Any
) -> None:
    loop = make_loop("ultrastick")
    s = lateral_poles(loop, controller_of(loop.pilot, loop.command, loop.z), math.radians(20.0))
    slowest = s[np.argmax(s.real)]
    assert slowest.real == pytest.approx(-0.0813, rel=0.02) and abs(slowest.imag) < 1e-9
    assert -1.0 / slowest.real == pytest.approx(12.3, abs=0.3)
    assert np.min(-s.real / np.abs(s)) == pytest.approx(0.69, abs=0.03)


def test_ultra_stick_baseline_leaves_sideslip_to_the_fin_but_is_stable(
    make_loop: Any, controller_of: Any
) -> None:
    loop = make_loop("ultrastick", None, "baseline")
    s = lateral_poles(loop, controller_of(loop.pilot, loop.command, loop.z), math.radians(20.0))
    assert np.max(s.real) < -0.2
    assert np.min(-s.real / np.abs(s)) == pytest.approx(0.32, abs=0.04)


def test_ducard_answers_an_excitation_of_any_surface_at_one_hertz(make_loop: Any) -> None:
    """The answer in the surface's own command is well above the 0.55 at which the health evaluator's threshold lies."""
    loop = make_loop("ducard")
    G, K = loop.response(np.array([2.0 * math.pi]))
    answer = np.linalg.solve(np.eye(6) - K @ G, K @ G)[0]
    ratio = dict(zip(loop.pilot.module.Command._fields, np.abs(np.diag(answer)), strict=True))
    assert ratio["aileron_left"] == pytest.approx(0.65, abs=0.03)
    assert ratio["aileron_right"] == pytest.approx(ratio["aileron_left"], rel=1e-6)
    assert ratio["elevator_left"] == pytest.approx(0.65, abs=0.03)
    assert ratio["rudder"] == pytest.approx(0.76, abs=0.04)
    for name in ("aileron_left", "elevator_left", "rudder"):
        left = 2.0 / math.pi * math.radians(2.0) * (1.0 - ratio[name])
        assert left < 0.009 < 0.01 < 2.0 / math.pi * math.radians(2.0)


def test_ducard_loops_are_no_more_peaked_than_stated(make_loop: Any) -> None:
    found = make_loop("ducard").loops(FOUR)
    assert max(m.peak for m in found.values()) < 1.65
    assert max(m.peak for m in found.values()) > 1.5  # the width is paid for


def test_ducard_filter_gains_are_the_steady_state_kalman_gains_stated_in_the_file(make_loop: Any) -> None:
    from scipy.linalg import solve_discrete_are

    g = make_loop("ducard").pilot.gains
    dt, R = 0.02, np.diag([math.radians(0.1) ** 2, 0.08**2])
    for density, kind in ((0.06, "attitude"), (0.0004, "heading")):
        Q = density * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        P = solve_discrete_are(np.array([[1.0, dt], [0.0, 1.0]]).T, np.eye(2), Q, R)
        L = P @ np.linalg.inv(P + R)
        given = [[getattr(g, f"{kind}_{a}_{b}") for b in ("angle", "rate")] for a in ("angle", "rate")]
        assert np.allclose(given, L, atol=6e-5)
