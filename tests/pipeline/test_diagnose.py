"""The whole job on flights made here: spans, training, judging, words, exit codes; and every way it must not go."""

import json

import numpy as np
import pytest
import synthetic as syn

from aerofdi.core import Flight, Series, Status, UnreadableFile, WrongUse, empty_verdict
from aerofdi.pipeline import Run, diagnose, exit_code, learn
from aerofdi.pipeline.judge import events, minimum_detectable
from aerofdi.pipeline.spans import inside, parse_span, split, without

EVENT = {"t_s", "event", "fault", "mode", "estimate", "estimate_std", "unit"}


@pytest.fixture(scope="module")
def healthy():
    return diagnose([syn.fly(200.0, seed=40)])[0]


@pytest.fixture(scope="module")
def stuck():
    return diagnose([syn.fly(200.0, seed=41, stuck={"aileron": 0.1}, start_s=140.0)])[0]


def test_healthy_flight_is_healthy_and_says_the_smallest_fault_it_would_have_seen(healthy):
    assert healthy.verdict == "healthy" and exit_code([healthy]) == 0
    effectiveness = healthy.results[1]
    assert set(effectiveness.minimum_detectable) == {
        "aileron loss_of_effectiveness",
        "elevator loss_of_effectiveness",
    }
    assert "would have seen" in effectiveness.reason


def test_training_is_the_first_forty_per_cent_and_never_judged(healthy):
    ((t0, t1),) = healthy.trained
    assert (t1 - t0) == pytest.approx(0.4 * sum(b - a for a, b in healthy.flown), rel=1e-6)
    assert all(a >= t1 for a, _ in healthy.judged)
    assert healthy.results[0].run.t_s[0] >= t1 - 1e-6


def test_a_stuck_surface_is_reported_in_events_and_words(stuck):
    assert stuck.verdict == "fault" and exit_code([stuck]) == 10
    r = stuck.results[1]
    assert [e["event"] for e in r.events[:2]] == ["detected", "isolated"]
    assert 140.0 <= r.events[0]["t_s"] < 148.0
    named = r.events[1]
    assert (named["fault"], named["mode"], named["unit"]) == ("aileron", "stuck", "rad")
    assert "aileron stuck" in r.reason and "deg" in r.reason


def test_json_has_the_promised_keys_and_plain_values(stuck, healthy):
    for d in (stuck, healthy):
        j = json.loads(json.dumps(d.to_json(), allow_nan=False))
        assert set(j) == {"file", "duration_s", "trained", "judged", "results"}
        for r in j["results"]:
            assert set(r) == {"diagnoser", "verdict", "reason", "minimum_detectable", "events"}
            assert r["verdict"] in {"healthy", "fault", "cannot_judge"}
            assert all(set(e) >= EVENT for e in r["events"])


def test_a_fault_inside_the_training_is_not_learnt_as_healthy():
    d = diagnose([syn.fly(200.0, seed=42, stuck={"aileron": 0.12}, start_s=40.0)])[0]
    assert d.verdict == "cannot_judge" and exit_code([d]) == 3
    assert "--healthy" in d.results[0].reason and "not of one piece" in d.results[0].reason


def test_a_saved_model_judges_the_next_flight_without_training(healthy, tmp_path):
    from aerofdi.aircraft.identified import save_identified

    save_identified(healthy.model, tmp_path / "a.toml")
    good, bad = diagnose(
        [syn.fly(90.0, seed=43), syn.fly(90.0, seed=44, gain={"elevator": 0.2}, start_s=30.0)],
        aircraft=tmp_path / "a.toml",
    )
    assert good.trained == [] and good.verdict == "healthy"
    assert bad.verdict == "fault" and bad.results[1].events[1]["fault"] == "elevator"
    assert exit_code([good, bad]) == 10


def test_another_flight_can_be_the_healthy_one(healthy):
    d = diagnose(
        [syn.fly(60.0, seed=45, stuck={"aileron": -0.1}, start_s=20.0)], healthy_flight=syn.fly(90.0, seed=46)
    )[0]
    assert d.verdict == "fault" and d.judged[0][0] < 5.0


def test_no_commands_is_cannot_judge_with_both_sides_named():
    f = syn.fly(60.0, seed=47)
    bare = Flight(
        {k: s for k, s in f.measured.items() if not k.startswith("command")}, meta={"source": "bare.csv"}
    )
    d = diagnose([bare])[0]
    assert (
        exit_code([d]) == 3
        and "surface commands" in d.results[0].reason
        and "bare.csv" in d.results[0].reason
    )


def test_commands_that_never_move_are_cannot_judge():
    f = syn.fly(60.0, seed=48)
    still = {
        n: Series(s.t_s, np.full(len(s.t_s), 0.1), s.unit)
        for n, s in f.measured.items()
        if n.startswith("command")
    }
    d = diagnose([f.with_measured(**still)])[0]
    assert d.verdict == "cannot_judge" and "surface commands moving" in d.results[0].reason


@pytest.mark.parametrize("gain", [None, {"aileron": 0.0, "elevator": 0.0}])
def test_hardly_any_excitation_is_not_called_healthy(healthy, gain):
    """Where nothing is asked for, not even a surface without any effect can show, and that is what is said."""
    quiet, lively = (
        diagnose(syn.fly(60.0, seed=61, gust=g, lively=g, gain=gain, start_s=0.0), aircraft=healthy.model,
                 judge_span="5:60")[0].results[1]
        for g in (0.02, 1.0)
    )  # fmt: skip
    assert quiet.verdict == "cannot_judge" and "too little excitation" in quiet.reason and not quiet.events
    assert len(quiet.minimum_detectable) == 2 and min(quiet.minimum_detectable.values()) > 1.0
    assert np.mean(quiet.run.verdict.status == Status.OK) > 0.95, "no data were missing"
    assert lively.verdict == ("fault" if gain else "healthy")


def test_the_less_is_judged_the_larger_the_fault_that_might_stay_unseen(healthy):
    f = syn.fly(200.0, seed=49)
    few, some = (
        diagnose(f, aircraft=healthy.model, judge_span=s)[0].results[1] for s in ("100:104", "100:140")
    )
    assert set(few.minimum_detectable) == set(some.minimum_detectable)
    assert all(few.minimum_detectable[k] > some.minimum_detectable[k] + 0.1 for k in some.minimum_detectable)


def test_a_group_nobody_answers_is_named_and_never_accused():
    """A rudder moves at random and turns nothing: no hypothesis is about it, and alone it is no ground to judge on."""
    f = syn.fly(160.0, seed=62, gain={"aileron": 0.2}, start_s=110.0)
    t = f.measured["p"].t_s
    steps = np.repeat(np.random.default_rng(0).normal(0.0, 0.1, len(t) // 25 + 1), 25)[: len(t)]
    idle = f.with_measured(**{"command.rudder": Series(t, steps, "rad")})
    d = diagnose(idle, healthy="0:100")[0]
    assert {g.name: g.identifiable for g in d.model.groups} == {
        "aileron": True,
        "elevator": True,
        "rudder": False,
    }
    assert any("rudder" in n and "cannot be judged" in n for n in d.notes)
    r = d.results[1]
    assert {h.fault for h in r.run.diagnoser.hypotheses} == {"none", "aileron", "elevator"}
    assert not any("rudder" in key for result in d.results for key in result.minimum_detectable)
    assert (
        r.verdict == "fault" and r.events[0]["t_s"] > 110.0 and "rudder" not in {e["fault"] for e in r.events}
    )
    alone = Flight(
        {k: s for k, s in idle.measured.items() if k not in ("command.aileron", "command.elevator")}
    )
    only = diagnose(alone, healthy="0:100")[0]
    assert [r.verdict for r in only.results] == ["cannot_judge"] * 2 and exit_code([only]) == 3


def test_a_published_aircraft_is_used_with_this_flights_noise():
    from aerofdi.simulate import fly

    d = diagnose([fly("demo")], aircraft="vireo")[0]
    assert d.model.name == "vireo" and d.model.axes[0].coefficient("p") == pytest.approx(-11.3, rel=0.03)
    named = next(e for e in d.results[1].events if e["event"] == "isolated")
    assert 60.0 <= named["t_s"] <= 66.0 and (named["fault"], named["mode"]) == ("elevon_right", "stuck")


def test_a_fault_inside_the_training_is_refused_by_published_and_saved_models_too(healthy):
    from aerofdi.simulate import fly

    faulty = syn.fly(90.0, seed=55, stuck={"aileron": 0.12}, start_s=20.0)
    for flight, model, span in ((fly("demo"), "vireo", (5.0, 75.0)), (faulty, healthy.model, (0.0, 60.0))):
        d = diagnose(flight, aircraft=model, healthy=span)[0]
        assert d.verdict == "cannot_judge" and "may already be faulty" in d.results[0].reason


def test_thresholds_no_deflection_would_reach_are_not_called_healthy(healthy):
    wide = {**healthy.model.calibration, "parity_threshold": (1e3, 1e3)}
    d = diagnose(syn.fly(60.0, seed=56), aircraft=healthy.model._replace(calibration=wide))[0]
    assert d.results[0].verdict == "cannot_judge" and "full deflection" in d.results[0].reason
    assert d.results[1].verdict == "healthy"


def test_a_published_aircraft_refuses_commands_it_cannot_use():
    f = syn.fly(60.0, seed=50)
    with pytest.raises(WrongUse, match="not a surface of vireo"):
        diagnose([f], aircraft="vireo")


@pytest.mark.parametrize("text", ["5", "a:b", "10:5", "1:2:3", ""])
def test_a_span_that_is_none_is_refused_with_the_option_named(text):
    with pytest.raises(WrongUse, match="--judge"):
        parse_span(text, "--judge")


def test_fewer_false_alarms_are_bought_with_larger_faults_unseen(healthy):
    flight = syn.fly(60.0, seed=59)

    def judged(rate):
        d = diagnose(
            flight, aircraft=healthy.model, healthy_flight=syn.fly(60.0, seed=54), false_alarms_per_hour=rate
        )[0]
        return d.model.calibration, [r.minimum_detectable for r in d.results]

    (often, small), (default, middle), (seldom, large) = (judged(r) for r in (10.0, None, 0.01))
    assert default == judged(0.1)[0]
    for key in default:
        assert all(a <= b <= c for a, b, c in zip(often[key], default[key], seldom[key], strict=True))
        assert often[key] < seldom[key]
    for few, some, many in zip(small, middle, large, strict=True):
        assert all(few[k] <= some[k] <= many[k] and few[k] < many[k] for k in some)
    # Each factor of e in the rate is one unit of log-likelihood.
    assert seldom["effectiveness_alarm"][0] - default["effectiveness_alarm"][0] == pytest.approx(np.log(10.0))


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf"), 61.0])
def test_a_rate_of_false_alarms_that_is_none_is_refused(rate):
    with pytest.raises(WrongUse, match=r"--false-alarms-per-hour .* per hour"):
        diagnose(syn.fly(40.0, seed=60), false_alarms_per_hour=rate)
    with pytest.raises(WrongUse, match=r"--false-alarms-per-hour .* per hour"):
        learn([syn.fly(40.0, seed=60)], false_alarms_per_hour=rate)


def test_a_model_that_brings_its_thresholds_takes_no_rate_without_healthy_flight(healthy):
    with pytest.raises(WrongUse, match="--healthy-flight"):
        diagnose(syn.fly(40.0, seed=60), aircraft=healthy.model, false_alarms_per_hour=1.0)


def test_the_flight_learnt_from_is_not_judged_with_it(tmp_path):
    from aerofdi.records import write_flight

    flight = syn.fly(90.0, seed=46)
    write_flight(flight, tmp_path / "one.parquet")
    write_flight(flight, tmp_path / "copy.parquet")
    other = syn.fly(60.0, seed=45)
    for same, source in ((flight, flight), (tmp_path / "copy.parquet", tmp_path / "one.parquet")):
        refused: list = []
        found = diagnose([same, other], healthy_flight=source, refused=lambda *what: refused.append(what))  # noqa: B023
        assert [d.file for d in found] == [other.name] and found[0].verdict == "healthy"
        ((_, error),) = refused
        assert isinstance(error, WrongUse) and "independent" in str(error) and "--healthy T0:T1" in str(error)


def test_a_flight_that_cannot_be_used_does_not_take_the_others_with_it(healthy, tmp_path):
    empty, odd, good = tmp_path / "empty.ulg", syn.fly(60.0, seed=57), syn.fly(60.0, seed=58)
    empty.write_bytes(b"")
    odd = odd.with_measured(p=odd.measured["p"]._replace(unit="deg/s"))
    refused: list = []
    found = diagnose(
        [empty, odd, good], aircraft=healthy.model, refused=lambda name, error: refused.append((name, error))
    )
    assert [d.file for d in found] == [good.name] and found[0].verdict == "healthy"
    assert [name for name, _ in refused] == [str(empty), odd.name]
    assert all(error.exit_code == 2 for _, error in refused)
    with pytest.raises(UnreadableFile, match=r"empty\.ulg"):
        diagnose([good, empty], aircraft=healthy.model)


def test_a_fault_is_never_hidden_by_a_file_that_cannot_be_read(healthy, stuck):
    silent = diagnose(Flight({}, meta={"source": "nothing"}))[0]
    for found, refused, code in (
        ([healthy], 0, 0), ([healthy, silent], 0, 3), ([healthy, silent], 1, 2), ([], 1, 2), ([healthy], 1, 2),
        ([stuck, silent], 1, 10),
    ):  # fmt: skip
        assert exit_code(found, refused) == code


def test_an_unknown_diagnoser_is_refused_with_the_choice():
    with pytest.raises(WrongUse, match="choose from parity, effectiveness"):
        diagnose([], with_diagnosers=["magic"])


def test_spans_add_up():
    flown = [(0.0, 30.0), (40.0, 80.0), (90.0, 100.0)]
    train, judge = split(flown)
    total = sum(b - a for a, b in flown)
    assert sum(b - a for a, b in train) == pytest.approx(0.4 * total)
    assert sum(b - a for a, b in train + judge) == pytest.approx(total)
    assert without(flown, train) == judge
    assert inside(flown, (20.0, 50.0)) == [(20.0, 30.0), (40.0, 50.0)]


def test_what_was_learnt_from_is_never_judged_even_when_asked():
    d = diagnose(syn.fly(90.0, seed=51), healthy="0:45", judge_span="30:80", with_diagnosers=["parity"])[0]
    assert d.trained == [(0.0, 45.0)] and d.judged == [(45.0, 80.0)]
    assert d.results[0].run.t_s[0] >= 45.0 - 1e-6


@pytest.mark.parametrize("option", ["healthy", "judge_span"])
def test_a_span_outside_the_flight_is_named_with_the_flights_own(healthy, option):
    d = diagnose(syn.fly(60.0, seed=52), aircraft=healthy.model, **{option: "900:950"})[0]
    assert d.verdict == "cannot_judge" and d.trained == []
    assert "900:950" in d.results[0].reason and "0.0 to 60.0 s" in d.results[0].reason


def test_a_model_given_with_healthy_flight_keeps_its_numbers_and_gets_new_thresholds(healthy):
    d = diagnose(syn.fly(60.0, seed=53), aircraft=healthy.model, healthy_flight=syn.fly(60.0, seed=54))[0]
    assert d.model.axes == healthy.model.axes and d.model.calibration != healthy.model.calibration


def _run_of(diagnoser, detected, status, breaks=(0,)):
    n = len(detected)
    v = empty_verdict(diagnoser, n)._replace(detected=np.array(detected), status=np.array(status))
    return Run(diagnoser, diagnoser.dt_s * np.arange(n), np.zeros((n, 0)), v, breaks)


def test_a_gap_or_the_end_of_a_span_does_not_clear_an_alarm(healthy):
    d = healthy.results[0].run.diagnoser
    ok, stale = int(Status.OK), int(Status.STALE_INPUT)
    gap = _run_of(d, [False, True, False, True, False], [ok, ok, stale, ok, ok])
    assert [e["event"] for e in events(gap)] == ["detected", "cleared"]
    spans = _run_of(d, [False, True, False, True], [ok] * 4, breaks=(0, 2))
    assert [e["event"] for e in events(spans)] == ["detected", "detected"]


def test_a_name_that_does_not_last_a_second_is_not_given(stuck):
    d = stuck.results[1].run.diagnoser
    n = round(1.0 / d.dt_s)
    for held, named in ((n, True), (n - 1, False)):
        r = _run_of(d, [True] * (held + 5), [int(Status.OK)] * (held + 5))
        r.verdict.active[5:, 1] = True
        assert ("isolated" in [e["event"] for e in events(r)]) == named


def test_the_smallest_visible_fault_counts_every_span(healthy):
    r = healthy.results[1].run
    lively, quiet = r.diagnoser.init(r.diagnoser.params), r.diagnoser.init(r.diagnoser.params)
    lively.information[:], lively.scalars[4] = 1000.0, 100.0
    quiet.scalars[4] = 100.0
    one, both, none = (
        minimum_detectable(r.diagnoser, s, healthy.model, 200.0) for s in ([lively], [lively, quiet], [quiet])
    )
    for k in one:
        assert one[k] < both[k] < 1.0 < none[k]
