"""A known aircraft in closed loop and gusts is recovered; real flight is fitted as well as its noise allows."""

import numpy as np
import pytest
import synthetic as syn

from aerofdi.aircraft.identified import load_identified, save_identified
from aerofdi.core import CannotJudge, Flight, MissingChannel, Series, UnreadableFile, WrongUse
from aerofdi.identify import equation_error as ee
from aerofdi.identify import identify
from aerofdi.identify.data import group_commands, prepare, shift, smooth


@pytest.fixture(scope="module")
def flight():
    return syn.fly(150.0, seed=1)


@pytest.fixture(scope="module")
def model(flight):
    return identify([(flight, 0.0, 150.0)], "synthetic")


def test_the_known_aircraft_is_recovered_in_closed_loop(model):
    roll, pitch = model.axes
    assert roll.coefficient("command.aileron") == pytest.approx(40.0, rel=0.15)
    assert pitch.coefficient("command.elevator") == pytest.approx(-45.0, rel=0.15)
    assert roll.coefficient("p") == pytest.approx(-9.0, rel=0.35)
    static = roll.coefficient("command.aileron") / roll.coefficient("p")
    assert static == pytest.approx(40.0 / -9.0, rel=0.2)
    assert model.delay_s + model.lag_s == pytest.approx(syn.DELAY_S, abs=0.03)


def test_equation_error_alone_is_pulled_towards_zero_by_gusts(flight, model):
    training = prepare([(flight, 0.0, 150.0)])
    _, theta = ee.scan(training)
    first = theta[0][ee.names(training, 0).index("command.aileron")]
    final = model.axes[0].coefficient("command.aileron")
    assert abs(final - 40.0) < 0.5 * abs(first - 40.0), "filter error removes most of the closed-loop bias"


def test_cross_effects_that_are_not_there_are_within_their_uncertainty(model):
    roll, pitch = model.axes
    for axis, name in ((roll, "command.elevator"), (pitch, "command.aileron")):
        assert abs(axis.coefficient(name)) < 4.0 * axis.deviation(name)


def test_fit_quality_is_reported_and_held_out(model):
    calm = identify([(syn.fly(60.0, seed=2, gust=0.15), 0.0, 60.0)])
    for axis, rough in zip(calm.axes, model.axes, strict=True):
        assert axis.r2 > 0.8 and axis.r2_held_out > 0.75
        assert rough.r2 < axis.r2, "gusts are not explained by commands"
        assert axis.innovation_std > syn.NOISE


def test_the_model_file_round_trips(model, tmp_path):
    save_identified(model._replace(calibration={"effectiveness_alarm": (12.5,)}), tmp_path / "a.toml")
    again = load_identified(tmp_path / "a.toml")
    assert again.groups == model.groups and again.calibration == {"effectiveness_alarm": (12.5,)}
    for a, b in zip(again.axes, model.axes, strict=True):
        np.testing.assert_array_equal(a.value, b.value)
        np.testing.assert_array_equal(a.covariance, b.covariance)
    assert not (tmp_path / "a.toml.part").exists()


@pytest.mark.parametrize("spoil", [lambda s: s.replace("kind = \"identified\"", "kind = \"full\""),
                                   lambda s: s.replace("dt_s = ", "dt = "), lambda s: s[: len(s) // 2]])  # fmt: skip
def test_a_spoilt_model_file_is_refused_with_its_name(model, tmp_path, spoil):
    save_identified(model, tmp_path / "a.toml")
    (tmp_path / "b.toml").write_text(spoil((tmp_path / "a.toml").read_text()))
    with pytest.raises((WrongUse, UnreadableFile), match=r"b\.toml") as error:
        load_identified(tmp_path / "b.toml")
    assert error.value.exit_code == 2


def test_mirrored_commands_become_one_group_and_a_mixed_rudder_is_counted_with_it():
    rng = np.random.default_rng(0)
    x = rng.normal(size=500)
    u = np.column_stack((x, -x, 0.3 * x + 1e-4 * rng.normal(size=500), rng.normal(size=500)))
    names = ("command.aileron_left", "command.aileron_right", "command.rudder", "command.elevator")
    groups, notes = group_commands(names, ("1",) * 4, u)
    assert [g.name for g in groups] == ["aileron", "elevator"]
    assert groups[0].weights == (0.5, -0.5)
    assert any("rudder" in n and "cannot be told apart" in n for n in notes)


def test_constant_commands_are_left_out():
    u = np.column_stack((np.full(100, 0.1), np.random.default_rng(0).normal(size=100)))
    groups, _ = group_commands(("command.aileron", "command.elevator"), ("1", "rad"), u)
    assert [(g.name, g.unit) for g in groups] == [("elevator", "rad")]


def test_surfaces_of_two_units_are_no_pair():
    x = np.random.default_rng(0).normal(size=100)
    names = ("command.aileron_left", "command.aileron_right")
    groups, notes = group_commands(names, ("rad", "1"), np.column_stack((0.4 * x, -x)))
    assert [(g.channels, g.unit) for g in groups] == [(("command.aileron_left",), "rad")]
    assert len(notes) == 1 and "aileron_right" in notes[0] and "cannot be told apart" in notes[0]


def without(flight, *names, **meta):
    return Flight({k: s for k, s in flight.measured.items() if k not in names}, meta=meta)


def test_of_unlike_flights_what_all_hold_is_used_and_the_rest_named(model):
    t = syn.DT * np.arange(3000)
    first = without(syn.fly(60.0, seed=3), source="first.csv").with_measured(
        r=Series(t, 0.1 * np.sin(t), "rad/s"), alpha=Series(t, 0.1 * np.sin(t), "rad"),
        airspeed=Series(t, 20.0 + np.sin(t), "m/s"), **{"command.rudder": Series(t, 0.1 * np.sin(3 * t), "rad")},
    )  # fmt: skip
    second = without(syn.fly(60.0, seed=4), source="second.csv")
    for flights in ((first, second), (second, first)):
        m = identify([(f, 0.0, 60.0) for f in flights])
        assert [a.rate for a in m.axes] == ["p", "q"] and {g.name for g in m.groups} == {
            "aileron",
            "elevator",
        }
        assert not {"alpha", "airspeed", "command.rudder", "r"} & set(m.channels)
        assert m.axes[0].coefficient("command.aileron") == pytest.approx(40.0, rel=0.2)
        for name in ("r", "command.rudder"):
            assert f"{name} is left out: second.csv does not have it" in m.notes


def test_of_flights_at_two_rates_the_slower_one_sets_the_period():
    fast, slow = syn.fly(60.0, seed=3), syn.fly(60.0, seed=4)
    slow = slow.with_measured(
        **{n: s._replace(t_s=s.t_s[::2], value=s.value[::2]) for n, s in slow.measured.items()}
    )
    for flights in ((fast, slow), (slow, fast)):
        m = identify([(f, 0.0, 60.0) for f in flights])
        assert m.dt_s == pytest.approx(0.04)
        assert m.axes[0].coefficient("command.aileron") == pytest.approx(40.0, rel=0.25)


def test_flights_that_do_not_fit_together_are_refused_with_both_named():
    first = without(syn.fly(30.0, seed=3), source="first.csv")
    c = first.measured["command.elevator"]
    other = first.with_measured(**{"command.elevator": c._replace(unit="1")})
    second = Flight(other.measured, meta={"source": "second.csv"})
    with pytest.raises(
        WrongUse, match=r"'command.elevator', but first.csv has it in 'rad' and second.csv in '1'"
    ):
        identify([(first, 0.0, 30.0), (second, 0.0, 30.0)])
    a, b = (
        without(first, "command.aileron", source="a.csv"),
        without(first, "command.elevator", source="b.csv"),
    )
    with pytest.raises(MissingChannel, match=r"a.csv has command.elevator; b.csv has command.aileron"):
        identify([(a, 0.0, 30.0), (b, 0.0, 30.0)])
    bare = without(first, "command.elevator", "command.aileron", source="bare.csv")
    with pytest.raises(MissingChannel, match=r"surface commands.*bare.csv"):
        identify([(first, 0.0, 30.0), (bare, 0.0, 30.0)])


def test_units_are_those_of_each_group_not_of_the_first_command():
    f = syn.fly(30.0, seed=5)
    c = f.measured["command.elevator"]
    m = identify(
        [(f.with_measured(**{"command.elevator": c._replace(value=c.value / 0.4, unit="1")}), 0.0, 30.0)]
    )
    assert {g.name: g.unit for g in m.groups} == {"aileron": "rad", "elevator": "1"}


def test_delay_and_lag_are_what_their_names_say():
    x = np.zeros(50)
    x[10:] = 1.0
    assert np.flatnonzero(shift(x, 0.02, 0.06))[0] == 13
    assert shift(x, 0.02, 0.07)[13] == pytest.approx(0.5)
    y = smooth(x, 0.02, 0.1)
    assert y[10 + 4] == pytest.approx(1 - np.exp(-0.1 / 0.1), abs=1e-12)


def test_what_is_missing_is_named(flight):
    bare = Flight({k: s for k, s in flight.measured.items() if not k.startswith("command")})
    with pytest.raises(MissingChannel, match="surface commands"):
        identify([(bare, 0.0, 100.0)])
    with pytest.raises(MissingChannel, match="angular rates"):
        identify([(Flight({"command.aileron": Series(np.arange(9.0), np.arange(9.0), "1")}), 0.0, 9.0)])
    with pytest.raises(CannotJudge, match="less than 10 s"):
        identify([(flight, 0.0, 6.0)])


def test_a_fitted_sign_that_contradicts_the_profile_is_said(flight):
    right = {"aileron": {"roll": 1}, "elevator": {"pitch": -1}}
    wrong = {"aileron": {"roll": -1}, "elevator": {"pitch": -1}}
    for signs, count in ((right, 0), (wrong, 1)):
        f = Flight(flight.measured, meta={"surface_signs": signs})
        notes = [n for n in identify([(f, 0.0, 60.0)]).notes if "contradicts" in n]
        assert len(notes) == count and all("aileron" in n and "roll" in n for n in notes)


@pytest.mark.data
def test_a_real_flight_fits_as_well_as_its_turbulence_allows(flights):
    from aerofdi.records import read

    f = read(next((flights / "umn_thor_flt75").glob("*.mat")))
    m = identify([(f, 234.6, 384.0)])
    fit = {a.rate: a for a in m.axes}
    assert fit["p"].r2 >= 0.5 and fit["q"].r2 >= 0.35
    assert fit["p"].r2_held_out >= 0.5 and fit["q"].r2_held_out >= 0.35
    assert 0.02 <= m.delay_s + m.lag_s <= 0.10
    assert next(g for g in m.groups if g.name == "aileron").channels == (
        "command.aileron_left", "command.aileron_right",
    )  # fmt: skip
