"""Envelopes and allowable times, on motions whose exits are known by hand."""

import math

import numpy as np
import pytest

from aerofdi.core import Flight, MissingChannel, Series, UnreadableFile, WrongUse
from aerofdi.evaluate.requirements import (
    Envelope,
    allowable,
    exit_time,
    load_envelopes,
    outside,
    scaled,
    widened,
)

DEG = math.pi / 180


def motion(**channels):
    """30 s at 50 Hz; channels not given are zero."""
    t = np.arange(0, 30, 0.02)
    units = {"phi": "rad", "theta": "rad", "p": "rad/s", "q": "rad/s", "r": "rad/s"}
    values = {n: np.broadcast_to(channels.get(n, 0.0), t.shape).astype(float) for n in units}
    return Flight({n: Series(t, values[n], u) for n, u in units.items()}), t


def test_the_shipped_envelopes_say_what_is_assumed():
    table = {e.name: e for e in load_envelopes()}
    assert set(table) == {"unusual_attitude", "dynamic_pitch", "dynamic_roll"}
    assert table["dynamic_roll"].horizon_s == 1.0 and table["dynamic_roll"].assumed
    assert table["unusual_attitude"].theta == (-10 * DEG, 25 * DEG)


def test_a_roll_leaves_the_dynamic_envelope_before_the_attitude_one():
    _, t = motion()
    rate = 10 * DEG
    flight, _ = motion(phi=np.maximum(t - 5, 0) * rate, p=np.where(t >= 5, rate, 0.0))
    table = {e.name: e for e in load_envelopes()}
    roll = exit_time(flight, 5.0, [table["dynamic_roll"]])
    bank = exit_time(flight, 5.0, [table["unusual_attitude"]])
    assert roll[0] == pytest.approx(3.5, abs=0.03) and bank[0] == pytest.approx(4.5, abs=0.03)
    assert exit_time(flight, 5.0, table.values())[1] == "dynamic_roll"
    assert exit_time(flight, 5.0, [table["dynamic_pitch"]]) == (math.inf, "none")


def test_rates_are_euler_rates():
    # A steady banked turn: q and r are large, yet phi and theta stay.
    phi, turn = 60 * DEG, 0.5
    flight, _ = motion(phi=phi, q=turn * math.sin(phi), r=turn * math.cos(phi))
    level = Envelope("x", "", (0.0, 61 * DEG), (-1 * DEG, 1 * DEG), 1.0, "", True)
    x = {n: s.value for n, s in flight.measured.items()}
    assert not outside(level, x).any()


def test_an_envelope_is_widened_by_what_the_healthy_aircraft_does():
    flight, _ = motion(phi=50 * DEG)
    for e, wide in zip(load_envelopes(), widened(load_envelopes(), [flight])):
        assert not outside(wide, {n: s.value for n, s in flight.measured.items()}).any()
        assert wide.theta == e.theta
        if math.isfinite(e.phi[1]):
            assert wide.phi[1] == pytest.approx(55 * DEG) and wide.assumed
            assert wide.phi[0] == pytest.approx(-55 * DEG)


def test_a_small_aircraft_looks_less_far_ahead():
    small = {e.name: e for e in scaled(load_envelopes(), 34.0 / 4)}
    assert small["dynamic_roll"].horizon_s == pytest.approx(0.5)
    assert small["unusual_attitude"] == load_envelopes()[0]
    with pytest.raises(WrongUse):
        scaled(load_envelopes(), 0.0)


def test_truth_goes_before_measurements():
    measured, _ = motion()
    truth, _ = motion(phi=80 * DEG)
    flight = Flight(measured.measured, truth=truth.measured)
    assert exit_time(flight, 1.0, load_envelopes())[0] == pytest.approx(0.0, abs=0.03)
    with pytest.raises(MissingChannel, match="theta"):
        exit_time(Flight({"phi": measured.measured["phi"]}), 0.0, load_envelopes())


def test_allowable_times_never_grow_with_the_size():
    a = allowable({-2.0: [9.0, 4.0], -1.0: [3.5, 8.0], 1.0: [8.0], 2.0: [], 3.0: [2.0]})
    assert a.sizes.tolist() == [-2.0, -1.0, 1.0, 2.0, 3.0]
    assert a.seconds.tolist() == [3.5, 3.5, 8.0, 8.0, 2.0]
    assert (
        a.at(2.0) == 8.0 and a.at(2.5) == 2.0 and a.at(99.0) == 2.0 and a.at(-9.0) == 3.5 and a.at(0.5) == 3.5
    )
    with pytest.raises(WrongUse):
        allowable({})


def test_a_broken_file_is_refused(tmp_path):
    path = tmp_path / "e.toml"
    path.write_text("[a]\nphi_deg = [1.0]\n")
    with pytest.raises(UnreadableFile, match=r"e\.toml"):
        load_envelopes(path)
