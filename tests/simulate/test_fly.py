"""A flight is what its scenario says: reproducible, causal, in closed loop, with its faults where they
belong.
"""

import math
import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerofdi.core import WrongUse
from aerofdi.dynamics.faults import Fault
from aerofdi.scenarios import Gust, Rates, Start, WindSpec, load_scenario
from aerofdi.simulate import changed, fly
from aerofdi.simulate.prepare import prepare

DEMO = load_scenario("demo")
SHORT = replace(DEMO, duration_s=6.0, faults=())
CALM = replace(SHORT, wind=WindSpec(), noise_factor=0.0)


def same(a, b):
    return all(
        np.array_equal(x[n].t_s, y[n].t_s) and np.array_equal(x[n].value, y[n].value, equal_nan=True)
        for x, y in ((a.measured, b.measured), (a.truth, b.truth))
        for n in {**x, **y}
    )


def test_same_seed_and_run_same_bits_and_others_differ():
    first = fly(SHORT, seed=5)
    assert same(first, fly(SHORT, seed=5))
    for other in (fly(SHORT, seed=6), fly(SHORT, seed=5, run=1)):
        assert not np.array_equal(first.measured["p"].value, other.measured["p"].value)
        assert not np.array_equal(first.truth["wind_down"].value, other.truth["wind_down"].value)


def test_calm_trimmed_flight_stays_in_trim():
    """Nothing moves where nothing disturbs: the loop adds no kick of its own."""
    flight = fly(replace(CALM, guidance=CALM.guidance._replace(lateral="heading", track=None)))
    trim = prepare(CALM).trim
    for name, value in (("airspeed", 15.4), ("altitude", 100.0), ("alpha", trim.alpha), ("phi", 0.0)):
        np.testing.assert_allclose(flight.truth[name].value, value, atol=1e-6)
    np.testing.assert_allclose(flight.truth["surface.elevon_left"].value, trim.surfaces[0], atol=1e-8)


def test_noise_free_sensors_read_the_truth_and_noisy_ones_have_their_sigma():
    flight = fly(replace(SHORT, noise_factor=0.0))
    for name in ("p", "theta", "airspeed", "altitude", "az", "velocity_east"):
        np.testing.assert_array_equal(flight.measured[name].value, flight.truth[name].value)
    noisy = fly(replace(SHORT, duration_s=20.0))
    error = noisy.measured["p"].value - noisy.truth["p"].value
    sigma = prepare(SHORT).aircraft.sensors["p"].noise
    assert error.std() == pytest.approx(sigma, rel=5 / math.sqrt(2 * len(error)))


def test_channels_units_and_clocks():
    flight = fly(SHORT)
    want = {"p": "rad/s", "phi": "rad", "airspeed": "m/s", "command.elevon_left": "rad", "throttle": "1"}
    assert all(flight.measured[n].unit == u for n, u in want.items())
    assert "alpha" not in flight.measured  # the Vireo has no vanes
    t = flight.measured["p"].t_s
    np.testing.assert_allclose(t, np.arange(len(t)) / 92.0, rtol=1e-12)
    assert flight.measured["mode"].codes == {0: "auto", 1: "hold_level"}
    slow = fly(replace(SHORT, sensors={"altitude": {"rate_hz": 4.0}}))
    np.testing.assert_allclose(slow.measured["altitude"].t_s, np.arange(24) / 4.0)


def test_angles_of_attack_and_wind_are_consistent():
    """Ground velocity minus wind, turned into body axes, has the airspeed, alpha and beta of the truth."""
    flight = fly(SHORT)
    x = {n: flight.truth[n].value for n in flight.truth}
    cf, sf, ct, st_, cp, sp = (f(x[n]) for n in ("phi", "theta", "psi") for f in (np.cos, np.sin))
    air = np.array([x["velocity_north"], x["velocity_east"], -x["climb_rate"]])
    air -= [x["wind_north"], x["wind_east"], x["wind_down"]]
    body = np.array(
        [
            [ct * cp, ct * sp, -st_],
            [sf * st_ * cp - cf * sp, sf * st_ * sp + cf * cp, sf * ct],
            [cf * st_ * cp + sf * sp, cf * st_ * sp - sf * cp, cf * ct],
        ]
    )
    u, v, w = np.einsum("ijk,jk->ik", body, air)
    np.testing.assert_allclose([u, v, w], [x["u"], x["v"], x["w"]], atol=1e-9)
    np.testing.assert_allclose(np.sqrt(u**2 + v**2 + w**2), x["airspeed"], rtol=1e-12)


def test_steady_wind_shifts_the_ground_track_only():
    level = replace(CALM, guidance=CALM.guidance._replace(lateral="heading", track=None))
    still, windy = fly(level), fly(replace(level, wind=WindSpec(speed=4.0, direction=math.radians(270))))
    t = still.truth["east"].t_s
    np.testing.assert_allclose(windy.truth["east"].value - still.truth["east"].value, 4.0 * t, atol=1e-6)
    np.testing.assert_allclose(windy.truth["airspeed"].value, still.truth["airspeed"].value, atol=1e-6)


def test_side_gust_from_starboard_gives_positive_sideslip():
    gust = Gust(1.0, (0.0, -1.5, 0.0), (1.0, 1.0, 1.0))
    level = replace(CALM, guidance=CALM.guidance._replace(lateral="heading", track=None))
    flight = fly(replace(level, wind=WindSpec(gusts=(gust,))))
    beta, t = flight.truth["beta"].value, flight.truth["beta"].t_s
    assert abs(beta[t < 1.0]).max() < 1e-6
    assert beta[t < 1.12].max() == pytest.approx(math.atan(1.5 / 15.4), rel=0.05)


def test_stuck_elevon_stays_stuck_and_the_autopilot_answers_with_the_other():
    flight = fly(DEMO)
    t = flight.truth["surface.elevon_right"].t_s
    after = t > 61.0
    stuck = flight.meta["trim"]["elevon_right"] - math.radians(5.0)
    np.testing.assert_allclose(flight.truth["surface.elevon_right"].value[after], stuck, atol=1e-6)
    assert flight.meta["faults"][0]["value"] == pytest.approx(stuck)
    size = flight.truth["fault.elevon_right.stuck"].value
    assert np.isnan(size[t < 59.99]).all() and (size[t > 60.001] == pytest.approx(stuck))
    assert not flight.meta["diverged"] and flight.truth["altitude"].value.min() > 80.0
    left, right = (flight.truth[f"surface.elevon_{s}"].value for s in ("left", "right"))
    assert np.std(left[after]) > 0.01 > np.std(right[after])
    healthy = fly(replace(DEMO, faults=()))
    before = t < 60.0
    for name in ("p", "surface.elevon_left", "airspeed"):
        np.testing.assert_array_equal(flight.truth[name].value[before], healthy.truth[name].value[before])


def test_a_hopeless_fault_ends_the_flight_with_an_event_or_keeps_it_finite():
    hard = Fault("elevon_right", "hardover", 1.0, value=-1.0)
    both = (hard, hard._replace(target="elevon_left", value=1.0))
    flight = fly(replace(SHORT, faults=both))
    assert all(np.isfinite(s.value).all() for n, s in flight.truth.items() if not n.startswith("fault."))
    diverged = [e for e in flight.events if e.kind == "diverged"]
    assert bool(diverged) == flight.meta["diverged"]
    assert np.abs(flight.truth["p"].value).max() > 2.0  # it did roll


@settings(max_examples=8, deadline=None)
@given(speed=st.floats(14.0, 18.0), altitude=st.floats(20.0, 250.0), heading=st.floats(-3.0, 3.0))
def test_any_start_begins_trimmed(speed, altitude, heading):
    s = replace(
        CALM,
        duration_s=0.5,
        start=Start(speed, altitude, heading),
        guidance=CALM.guidance._replace(
            lateral="heading", track=None, points=(CALM.guidance.points[0]._replace(
                airspeed=speed, altitude=altitude, angle=heading),)
        ),
    )  # fmt: skip
    flight = fly(s)
    np.testing.assert_allclose(flight.truth["airspeed"].value, speed, atol=1e-6)
    np.testing.assert_allclose(flight.truth["altitude"].value, altitude, atol=1e-6)


def test_halving_the_step_changes_little():
    """The deflection is linear over a step and the rest fourth order: 184 Hz is fine enough."""
    coarse, fine = (fly(replace(CALM, rates=Rates(f, 92.0, 92.0))) for f in (184.0, 736.0))
    for name in ("p", "theta", "altitude"):
        scale = np.ptp(fine.truth[name].value) + 1e-9
        assert np.abs(coarse.truth[name].value - fine.truth[name].value).max() < 0.02 * scale


def test_rates_that_do_not_divide_are_refused():
    with pytest.raises(WrongUse, match="whole fraction"):
        fly(replace(SHORT, rates=Rates(100.0, 92.0, 92.0)))


def test_parameters_change_the_aircraft_and_nothing_else():
    heavy = prepare(changed(SHORT, {"parameters.mass.mass": 1.1}))
    light = prepare(SHORT)
    assert heavy.params.plant.body.mass.mass == pytest.approx(1.1 * light.params.plant.body.mass.mass)
    assert heavy.trim.alpha > light.trim.alpha
    with pytest.raises(WrongUse, match="no number"):
        prepare(changed(SHORT, {"parameters.mass.masss": 1.1}))
    with pytest.raises(WrongUse, match="has no 'sped'"):
        changed(SHORT, {"wind.sped": 1.0})
    with pytest.raises(WrongUse, match="no entry"):
        changed(SHORT, {"faults.3.value": 1.0})


def test_an_aircraft_file_that_changes_is_read_again(tmp_path):
    from aerofdi.aircraft.load import HOME

    path = tmp_path / "mine.toml"
    text = (HOME / "vireo.toml").read_text()
    path.write_text(text)
    s = replace(SHORT, aircraft=str(path))
    first = prepare(s)
    assert prepare(s) is first
    path.write_text(text.replace("mass = { v = 1.28", "mass = { v = 1.40"))
    os.utime(path, ns=(1, 1))
    assert prepare(s).aircraft.number("mass.mass") == 1.40
