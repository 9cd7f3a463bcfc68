"""What every controller promises, whatever its law: trim, limits, no windup, symmetry, purity, checked gains."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.aircraft import load_aircraft
from aerofdi.autopilot import (
    BANK,
    CONTROLLERS,
    COURSE,
    HEADING,
    TRACK,
    Measured,
    Reference,
    autopilot_of,
    control,
    controller,
    load_gains,
)
from aerofdi.autopilot.loops import wrap
from aerofdi.core import WrongUse

AIRCRAFT = {
    "vireo": "vireo",
    "ultrastick": "ultrastick120",
    "aerosonde": "aerosonde",
    "aerosim_mpc": "aerosonde_aerosim",
    "ducard": "ducard",
}
# Signs under reflection in the plane of symmetry: fields of Measured and Reference that change theirs.
ODD = (
    "p",
    "r",
    "phi",
    "psi",
    "beta",
    "east",
    "velocity_east",
    "bank",
    "course",
    "from_east",
    "to_east",
    "next_east",
)
SWAPPED = (
    ("aileron_left", "aileron_right"),
    ("elevator_left", "elevator_right"),
    ("elevon_left", "elevon_right"),
)

pilots = pytest.mark.parametrize("name", CONTROLLERS)


def pilot_of(name: str) -> Any:
    return autopilot_of(load_aircraft(AIRCRAFT[name]).autopilot, who=name)


def straight(speed: float = 20.0) -> Measured:
    return Measured(
        0.0,
        0.0,
        0.0,
        0.0,
        0.05,
        0.3,
        speed,
        0.05,
        0.0,
        100.0,
        0.0,
        10.0,
        20.0,
        speed * 0.9553,
        speed * 0.2955,
    )


def reference(z: Measured, lateral: int = HEADING, **change: Any) -> Reference:
    ref = Reference(z.airspeed, z.altitude, lateral, z.phi, z.psi, 0.0, 0.0, 500.0, 150.0, 400.0, 700.0)
    return ref._replace(**change)


def some_command(pilot: Any) -> Any:
    """Trim with every left-right pair apart, within limits."""
    fields = pilot.module.Command._fields
    values = {f: 0.02 for f in fields}
    values |= {f: 0.05 for f in fields if f.endswith("elevon_right")}
    values |= {f: -0.03 for f in fields if f == "aileron_left"} | {
        f: 0.03 for f in fields if f == "aileron_right"
    }
    return pilot.module.Command(**values | {"throttle": 0.4})


def mirrored(record: Any) -> Any:
    return record._replace(**{f: -getattr(record, f) for f in ODD if f in record._fields})


def mirrored_command(command: Any) -> Any:
    """Left and right exchanged; surfaces that are one for both sides and act sideways change sign."""
    swap = {a: b for pair in SWAPPED for a, b in (pair, pair[::-1])}
    fields = command._fields
    out = {f: getattr(command, swap[f]) if f in swap else getattr(command, f) for f in fields}
    return command._replace(**{f: -v if f.startswith("rudder") else v for f, v in out.items()})


def limits(pilot: Any) -> dict[str, tuple[float, float]]:
    """Command limits from the aircraft file."""
    aircraft = load_aircraft(AIRCRAFT[pilot.name])
    out = {
        f: (aircraft.surface(f).lower, aircraft.surface(f).upper)
        for f in pilot.module.Command._fields
        if f != "throttle"
    }
    return out | {"throttle": (0.0, 1.0)}


@pilots
def test_starts_in_trim_the_first_command_is_the_trim_and_stays_it(name: str) -> None:
    pilot, z = pilot_of(name), straight()
    trim = some_command(pilot)
    state = pilot.module.init(pilot.gains, trim, z)
    for _ in range(50):
        state, command = pilot.module.step(pilot.gains, state, reference(z), z, 1.0 / pilot.module.RATE_HZ)
        assert np.allclose(command, trim, atol=1e-12)
    assert state.bank_ref == pytest.approx(0.0, abs=1e-12) and state.pitch_ref == pytest.approx(z.theta)


@pilots
def test_starts_in_a_banked_trim_too(name: str) -> None:
    pilot = pilot_of(name)
    phi, speed = 0.4, 20.0
    rate = 9.80665 * math.tan(phi) / speed
    z = straight(speed)._replace(phi=phi, p=-0.01, q=rate * math.sin(phi), r=rate * math.cos(phi), beta=0.0)
    trim = some_command(pilot)
    state = pilot.module.init(pilot.gains, trim, z)
    _, command = pilot.module.step(pilot.gains, state, reference(z, BANK), z, 0.02)
    assert np.allclose(command, trim, atol=1e-12)


numbers = st.floats(-1.0, 1.0)


@pilots
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_mirrored_flight_gets_mirrored_commands(name: str, data: Any) -> None:
    """Over several steps, for any measurement and every lateral mode, with a symmetric trim."""
    pilot, dt = pilot_of(name), 0.02
    module = pilot.module
    trim = module.Command(*([0.02] * (len(module.Command._fields) - 1)), 0.4)
    trim = trim._replace(**{f: 0.0 for f in trim._fields if f.startswith(("aileron", "rudder"))})
    lateral = data.draw(st.sampled_from((BANK, HEADING, COURSE, TRACK)))
    z0 = straight()
    scale = np.array([2.0, 2.0, 2.0, 1.0, 0.4, 3.0, 5.0, 0.2, 0.3, 20.0, 5.0, 300.0, 300.0, 10.0, 10.0])
    a, b = (
        module.init(pilot.gains, trim, straight()._replace(psi=0.0)),
        module.init(pilot.gains, trim, straight()._replace(psi=0.0)),
    )
    for _ in range(4):
        z = Measured(*(np.array(z0) + scale * np.array([data.draw(numbers) for _ in z0])))
        ref = reference(
            z,
            lateral,
            bank=data.draw(numbers),
            course=3.0 * data.draw(numbers),
            airspeed=21.0,
            altitude=105.0,
        )
        a, left = module.step(pilot.gains, a, ref, z, dt)
        b, right = module.step(pilot.gains, b, mirrored(ref), mirrored(z), dt)
        assert np.allclose(mirrored_command(left), right, atol=1e-9)


@pilots
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_commands_and_state_stay_within_limits_for_any_finite_measurement(name: str, data: Any) -> None:
    pilot = pilot_of(name)
    bounds, z0 = limits(pilot), straight()
    state = pilot.module.init(pilot.gains, some_command(pilot), z0)
    scale = 10.0 ** data.draw(st.floats(-1.0, 3.0))
    for _ in range(5):
        z = Measured(*(np.array(z0) + scale * np.array([data.draw(numbers) for _ in z0])))
        ref = reference(
            z0, data.draw(st.sampled_from((BANK, HEADING, COURSE, TRACK))), bank=data.draw(numbers)
        )
        state, command = pilot.module.step(pilot.gains, state, ref, z, 0.02)
        assert all(math.isfinite(v) for v in (*state, *command))
        for field, value in command._asdict().items():
            lo, hi = bounds[field]
            assert lo - 1e-12 <= value <= hi + 1e-12, field
        assert abs(state.bank_ref) <= pilot.gains.bank_max + 1e-12
        assert pilot.gains.pitch_min - 1e-12 <= state.pitch_ref <= pilot.gains.pitch_max + 1e-12


@pilots
def test_no_loop_winds_up_errors_nobody_can_remove_leave_the_same_state_after_one_minute_and_two(
    name: str,
) -> None:
    """Bank, pitch, altitude, airspeed and sideslip errors of one sign drive every loop to a limit and no further."""
    pilot, z = pilot_of(name), straight()
    module, dt = pilot.module, 1.0 / pilot.module.RATE_HZ
    state = module.init(pilot.gains, some_command(pilot), z)
    far = z._replace(phi=-1.5, altitude=60.0, airspeed=8.0, beta=-0.5, theta=-0.5)
    ref, states = reference(z, BANK, bank=0.5), []
    for k in range(int(120.0 * module.RATE_HZ)):
        state, stuck = module.step(pilot.gains, state, ref, far, dt)
        if k == int(60.0 * module.RATE_HZ):
            states.append(state)
    assert np.allclose(states[0], state, atol=1e-9)
    assert stuck.throttle == 1.0 and state.pitch_ref == pytest.approx(pilot.gains.pitch_max)
    # Back at the reference, with a little speed too many, the throttle closes within two seconds.
    near = z._replace(airspeed=z.airspeed + 3.0)
    for _ in range(int(2.0 * module.RATE_HZ)):
        state, command = module.step(pilot.gains, state, reference(z, BANK), near, dt)
    assert command.throttle < 1.0


@pilots
def test_step_is_pure_and_the_same_uncompiled(name: str) -> None:
    pilot, z = pilot_of(name), straight()
    module = pilot.module
    state = module.init(pilot.gains, some_command(pilot), z)
    seen = z._replace(p=0.2, phi=0.3, theta=-0.1, altitude=95.0, airspeed=18.0, r=0.1, beta=0.05, east=-40.0)
    plain = getattr(module.step, "py_func", module.step)
    for lateral in (BANK, HEADING, COURSE, TRACK):
        ref = reference(z, lateral, bank=0.2)
        once, twice = (module.step(pilot.gains, state, ref, seen, 0.02) for _ in range(2))
        assert once == twice == control(pilot.gains, state, ref, seen, 0.02)
        other = plain(pilot.gains, state, ref, seen, 0.02)
        for a, b in zip(once, other, strict=True):
            assert np.allclose(a, b, rtol=1e-12, atol=1e-14)


@pilots
def test_commands_are_surfaces_of_the_aircraft_and_limits_agree_with_its_file(name: str) -> None:
    aircraft, pilot = load_aircraft(AIRCRAFT[name]), pilot_of(name)
    fields = pilot.module.Command._fields
    order = [s.name for s in aircraft.surfaces if s.name in fields]
    assert [*order, "throttle"] == list(fields)
    assert set(pilot.module.UNITS) >= set(pilot.gains._fields)
    assert pilot.module.State._fields[:2] == ("bank_ref", "pitch_ref")


@pilots
def test_turning_right_is_asked_for_with_right_bank_in_every_mode(name: str) -> None:
    pilot, z = pilot_of(name), straight()
    state = pilot.module.init(pilot.gains, some_command(pilot), z)
    for lateral, change in ((BANK, {"bank": 0.3}), (HEADING, {"course": 0.8}), (COURSE, {"course": 0.8})):
        after, _ = pilot.module.step(pilot.gains, state, reference(z, lateral, **change), z, 0.02)
        assert after.bank_ref > 0.2, lateral


def test_a_heading_error_across_south_turns_the_short_way() -> None:
    pilot, z = pilot_of("aerosonde"), straight()._replace(psi=3.1)
    state = pilot.module.init(pilot.gains, some_command(pilot), z)
    after, _ = pilot.module.step(pilot.gains, state, reference(z, HEADING, course=-3.1), z, 0.05)
    assert after.bank_ref == pytest.approx(pilot.gains.course_kp * wrap(-6.2)) and after.bank_ref > 0.0


def table() -> dict[str, Any]:
    return {k: dict(v) for k, v in load_aircraft("vireo").autopilot["gains"].items()}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"bank_kp": None}, "lack bank_kp"),
        ({"bank_kq": {"v": 1.0, "unit": "1", "src": "x"}}, "unknown bank_kq"),
        ({"bank_max": {"v": 40.0, "unit": "m", "src": "x"}}, "accepted: rad, deg"),
        ({"bank_kp": {"v": "much", "unit": "rad/rad", "src": "x"}}, "finite number"),
        ({"bank_kp": {"v": math.inf, "unit": "rad/rad", "src": "x"}}, "finite number"),
        ({"bank_kp": {"v": 1.0, "unit": "rad/rad"}}, "src = source"),
        ({"bank_kp": -0.34}, "src = source"),
    ],
)
def test_a_gain_table_with_a_mistake_is_refused_and_the_file_and_gain_are_named(
    change: dict[str, Any], says: str
) -> None:
    given = {k: v for k, v in (table() | change).items() if v is not None}
    with pytest.raises(WrongUse, match=says) as refused:
        load_gains("vireo", given, who="vireo.toml")
    assert "vireo.toml" in str(refused.value)


def test_degrees_become_radians_and_a_scenario_replaces_single_gains() -> None:
    own = load_aircraft("vireo").autopilot
    change = {"gains": {"bank_max": {"v": 30.0, "unit": "deg", "src": "scenario"}}}
    pilot = autopilot_of(own, change)
    assert pilot.gains.bank_max == pytest.approx(math.radians(30.0))
    assert pilot.gains.bank_kp == autopilot_of(own).gains.bank_kp == -0.34


def test_the_ultra_stick_has_its_baseline_as_a_variant() -> None:
    own = load_aircraft("ultrastick120").autopilot
    modified, baseline = autopilot_of(own), autopilot_of(own, variant="baseline")
    assert modified.gains.beta_ki > 0.0 and modified.gains.washout_kp == 0.0
    assert baseline.gains.beta_ki == 0.0 and baseline.gains.washout_kp == 0.065
    with pytest.raises(WrongUse, match="baseline"):
        autopilot_of(own, variant="sport")


def test_unknown_controllers_tables_and_missing_names_are_refused() -> None:
    with pytest.raises(WrongUse, match="ultrastick"):
        controller("ultra_stick")
    with pytest.raises(WrongUse, match="names no controller"):
        autopilot_of({})
    with pytest.raises(WrongUse, match="gians"):
        autopilot_of({"controller": "vireo", "gians": {}})
    with pytest.raises(WrongUse, match="lack"):
        autopilot_of(load_aircraft("vireo").autopilot, {"controller": "aerosonde"})
