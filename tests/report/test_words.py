"""Verdicts in words: what, where, when, how much, in units people read; and what would have been seen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerofdi.core import HEALTHY
from aerofdi.pipeline import FlightDiagnosis, Result
from aerofdi.report import words

from .conftest import LOSS, STUCK, event, flight, made_run, model


def test_names_as_people_say_them() -> None:
    assert words.spoken("rudder_top") == "top rudder"
    assert words.spoken("aileron_servo5") == "aileron (servo 5)"
    assert words.spoken("elevator") == "elevator"
    assert words.spoken("aileron_servos") == "aileron servos"


@given(st.floats(-1e4, 1e4), st.floats(1e-5, 1e3))
def test_the_interval_printed_holds_the_interval(value: float, std: float) -> None:
    v, s = (float(x) for x in words.plus_minus(value, std, "u").removesuffix(" u").split(" ± "))
    assert abs(s - std) <= 0.051 * std + 5e-7 and abs(v - value) <= 0.51 * std + 5e-7


@given(st.floats(1e-8, 1e8))
def test_numbers_keep_their_digits(x: float) -> None:
    assert math.isclose(float(words.number(x)), x, rel_tol=0.0051)
    assert words.number(-x) == "-" + words.number(x)


def test_a_position_is_told_as_servo_pulse_where_the_log_knows_the_servo() -> None:
    f = flight()
    assert words.deflection("elevon_right", 0.01, 0.17, "1", f, model()).startswith("1421 ± 82 µs (1 ± 17 %")
    assert words.deflection("elevon_left", 0.01, 0.17, "1", f, model()) == "1 ± 17 % of full command"
    assert words.deflection("elevon_right", -0.1, 0.05, "rad", f, None) == "-5.7 ± 2.9 deg"


def test_a_mirrored_group_has_no_one_pulse() -> None:
    pair = model()._replace(
        groups=(
            model()
            .groups[0]
            ._replace(name="aileron", channels=("command.left", "command.right"), weights=(0.5, -0.5)),
        )
    )
    servo = {"neutral_us": 1500.0, "us_per_unit": 400.0}
    assert words.pulse("aileron", 0.2, flight(servos={"left": servo, "right": servo}), pair) is None
    mirrored = flight(servos={"left": servo, "right": {"neutral_us": 1500.0, "us_per_unit": -400.0}})
    assert words.pulse("aileron", 0.2, mirrored, pair) == (1580.0, 400.0)


def test_fault(faulty: FlightDiagnosis) -> None:
    h = words.headline(faulty)
    assert h.verdict == "fault" and h.title == "Right elevon (elevon B) stuck at 1421 µs"
    assert "Alarm at 40.5 s" in h.detail and "1421 ± 82 µs" in h.detail
    texts = " ".join(words.evidence(faulty.results[1], faulty))
    # 20-40.5 s were judged but for one second of stale input.
    assert "Silent through 19.5 s" in texts and "STALE_INPUT" in texts and "right elevon stuck" in texts


def test_healthy_states_the_smallest_fault_it_would_have_seen(healthy: FlightDiagnosis) -> None:
    h = words.headline(healthy)
    assert h.verdict == "healthy" and "28 s judged" in h.detail
    assert "right elevon: loss of 35 % or more" in h.detail and "offset of 30 % of full command" in h.detail


def test_not_judged_says_why_and_nothing_else(unjudged: FlightDiagnosis) -> None:
    h = words.headline(unjudged)
    assert h == ("cannot_judge", "Could not be judged", "No surface command is logged.")


def test_blind_is_told_as_blind(healthy: FlightDiagnosis) -> None:
    r = Result("effectiveness", "healthy", "", {"elevon_right loss_of_effectiveness": 1.3})
    ((_, text, share),) = words.detectable(r, healthy)
    assert "not even a total loss" in text and share > 1


def test_an_alarm_without_a_name_claims_no_surface(faulty: FlightDiagnosis) -> None:
    run = made_run("parity", (HEALTHY,), 40.5)
    r = Result("parity", "fault", "", {}, [event(40.5, "detected", None)], run)
    h = words.headline(FlightDiagnosis("f", faulty.flight, [], [], [(20.0, 48.0)], None, [r]))
    assert "not isolable" in h.title and "elevon" not in h.title + h.detail


def test_the_headline_names_what_held_longest(faulty: FlightDiagnosis) -> None:
    run = made_run("effectiveness", (HEALTHY, LOSS, STUCK), 40.5)
    early = run.t_s < 41.0
    run.verdict.active[early & run.verdict.detected, 2] = False
    run.verdict.active[early & run.verdict.detected, 1] = True
    found = [
        event(40.5, "detected", None),
        event(40.5, "isolated", LOSS, estimate=0.1, estimate_std=0.1),
        event(41.0, "isolated", STUCK, estimate=0.01, estimate_std=0.1),
    ]
    d = FlightDiagnosis(
        "f",
        faulty.flight,
        [],
        [],
        [(20.0, 48.0)],
        None,
        [Result("effectiveness", "fault", "", {}, found, run)],
    )
    assert "stuck" in words.headline(d).title
    assert np.isclose(words.held(d.results[0], found[1]), 0.5) and words.held(d.results[0], found[2]) > 6.0


@pytest.mark.parametrize("kind", ["fault", "healthy", "cannot_judge"])
def test_no_verdict_is_called_healthy_that_is_not(make, kind: str) -> None:
    h = words.headline(make(kind))
    assert h.verdict == kind and (("No surface fault found" in h.title) == (kind == "healthy"))
