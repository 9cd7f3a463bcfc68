"""What `describe` and `flown` say of flights whose answer is known."""

import json

import numpy as np
import pytest

from aerofdi import records
from aerofdi.core import Flight, Series


def flight_with(**changes):
    """100 s at 10 Hz: speed from 10 to 90 s, autopilot from 30 to 80 s, command moving but for 50 to 60 s."""
    t = np.arange(0.0, 100.0, 0.1)
    command = np.where((t > 50) & (t < 60), 0.2, 0.2 + 0.1 * np.sin(t))
    mode = np.where((t >= 30) & (t < 80), 1.0, 0.0)
    measured = {
        "p": Series(t, np.sin(t), "rad/s"),
        "airspeed": Series(t, np.where((t > 10) & (t < 90), 20.0, 0.0), "m/s"),
        "mode": Series(t, mode, "1", {0: "MANUAL", 1: "AUTO"}),
        "command.elevator": Series(t, command, "1"),
    }
    measured.update(changes)
    return Flight({k: v for k, v in measured.items() if v is not None}, meta={"autopilot_modes": ["AUTO"]})


def test_flown_needs_speed_autopilot_and_moving_surfaces():
    spans, said = records.flown(flight_with())
    assert [pytest.approx(span, abs=0.5) for span in ((30.0, 55.0), (60.0, 80.0))] == spans
    assert any("airspeed" in text for text in said) and any("by mode" in text for text in said)


def test_flown_without_mode_says_that_it_does_not_know():
    spans, said = records.flown(flight_with(mode=None))
    assert [pytest.approx(span, abs=0.5) for span in ((10.0, 55.0), (60.0, 90.0))] == spans
    assert any("no mode" in text for text in said)


def test_a_disarmed_or_grounded_aircraft_was_not_flown():
    t = np.array([0.0, 40.0, 70.0])
    armed = Series(t, np.array([0.0, 1.0, 0.0]), "1", {0: "disarmed", 1: "armed"})
    assert records.flown(flight_with(armed=armed))[0] == [
        pytest.approx((40, 55), abs=0.5),
        pytest.approx((60, 70), abs=0.5),
    ]
    airborne = Series(np.array([0.0, 45.0]), np.array([1.0, 0.0]), "1")
    assert records.flown(flight_with(airborne=airborne))[0] == [pytest.approx((30, 45), abs=0.5)]


def test_an_empty_flight_has_no_spans():
    assert records.flown(Flight({}))[0] == []
    assert records.describe(Flight({}))["channels"] == []


def test_describe_counts_gaps_repeats_and_missing_values():
    t = np.concatenate([np.arange(0, 10, 0.1), np.arange(14, 20, 0.1)])
    value = np.repeat(np.arange(80.0), 2)
    value[5] = np.nan
    flight = flight_with(p=Series(t, value, "rad/s", repeats=True))
    channel = next(c for c in records.describe(flight)["channels"] if c["name"] == "p")
    assert channel["count"] == 160 and channel["rate_hz"] == pytest.approx(10.0)
    assert channel["gaps"]["count"] == 1
    assert channel["gaps"]["longest_s"] == pytest.approx(4.1) and channel["gaps"]["at_s"] == pytest.approx(
        9.9
    )
    assert channel["repeated_share"] == pytest.approx(79 / 159)
    assert channel["nonfinite_share"] == pytest.approx(1 / 160)
    assert channel["range"] == [0.0, 79.0]


def test_describe_is_json_and_names_modes_and_assumptions(tmp_path, tiny):
    (tmp_path / "a.tlog").write_bytes(tiny.tlog())
    said = records.describe(records.read(tmp_path / "a.tlog"))
    again = json.loads(json.dumps(said, allow_nan=False))
    assert again["modes"][0]["mode"] == "AUTO"
    assert "outputs 1 aileron" in again["assumed"][0]
    assert again["surface_signs"]["aileron"] == {"roll": 1}
    mode = next(c for c in again["channels"] if c["name"] == "mode")
    assert mode["values"] == ["AUTO"] and mode["range"] is None
