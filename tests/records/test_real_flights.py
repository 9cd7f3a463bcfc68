"""The readers on real flights: the numbers their own documentation states, and signs that physics confirms."""

import time

import numpy as np
import pytest

from aerofdi import records
from aerofdi.core import UnreadableFile

pytestmark = pytest.mark.data


def grid(flight, names, t0, t1, dt):
    """The named channels on one clock, by the last value known."""
    t = np.arange(t0, t1, dt)
    out = []
    for name in names:
        series = flight.measured[name]
        k = np.clip(np.searchsorted(series.t_s, t, side="right") - 1, 0, None)
        out.append(series.value[k])
    return np.stack(out, axis=1)


def moment_of(flight, rate, others, commands, span, dt, delay):
    """Slope of the angular acceleration on each command at a delay of so many samples (least squares)."""
    t0, t1 = span
    x = grid(flight, [rate, *others, *commands], t0, t1, dt)
    x = x[np.isfinite(x).all(axis=1)]
    acceleration = (x[delay + 1 :, 0] - x[delay - 1 : -2, 0]) / (2 * dt)
    regressors = np.column_stack(
        [np.ones(len(acceleration)), x[delay:-1, : 1 + len(others)], x[1:-delay, 1 + len(others) :]]
    )
    return np.linalg.lstsq(regressors, acceleration, rcond=None)[0][-len(commands) :]


def assert_signs(flight, surface, axis, others, span, dt, delay):
    rate = {"roll": "p", "pitch": "q", "yaw": "r"}[axis]
    slope = moment_of(flight, rate, others, [f"command.{surface}"], span, dt, delay)[0]
    assert np.sign(slope) == flight.meta["surface_signs"][surface][axis], (surface, axis, slope)


def test_thor(flights):
    flight = records.read(next((flights / "umn_thor_flt75").glob("*.mat")))
    assert flight.meta["profile"] == "umn_thor"
    assert flight.duration_s == pytest.approx(696.2, abs=0.1)
    assert flight.measured["p"].period_s == pytest.approx(0.02, abs=1e-4)
    [(t0, t1)] = records.flown(flight)[0]
    assert (t0, t1) == pytest.approx((234.6, 533.0), abs=0.5)
    left, right = (flight.measured[f"command.aileron_{side}"].value for side in ("left", "right"))
    np.testing.assert_array_equal(left, -right)
    span = (240.0, 530.0)
    assert_signs(flight, "aileron_left", "roll", ["r", "beta"], span, 0.02, 3)
    assert_signs(flight, "aileron_right", "roll", ["r", "beta"], span, 0.02, 3)
    assert_signs(flight, "elevator", "pitch", ["alpha"], span, 0.02, 2)
    assert_signs(flight, "rudder", "yaw", ["p", "beta"], span, 0.02, 3)


def test_enac_elevon_log(flights):
    flight = records.read(next((flights / "enac_elevon_2017").glob("*.data")))
    assert flight.span_s == pytest.approx((2738.763, 2838.996), abs=1e-6)
    for side in ("left", "right"):
        command, sent = flight.measured[f"command.elevon_{side}"], flight.output[f"command.elevon_{side}"]
        healthy = command.t_s < 2813.0
        per_unit = flight.meta["servos"][f"elevon_{side}"]["us_per_unit"]
        k = np.searchsorted(sent.t_s, command.t_s[healthy], side="right") - 1
        error_us = per_unit * (command.value[healthy] - sent.value[k])
        assert np.abs(error_us).max() < 3.0 and np.std(per_unit * command.value[healthy]) > 20.0
    servo = flight.meta["servos"]["elevon_right"]
    sent = flight.output["command.elevon_right"]
    us = servo["neutral_us"] + servo["us_per_unit"] * sent.value
    stuck = (sent.t_s > 2813.09) & (sent.t_s < 2816.7)
    assert set(np.round(us[stuck])) == {1416.0, 1492.0}
    span = (2740.0, 2812.0)
    assert_signs(flight, "elevon_right", "roll", ["r"], span, 0.05, 1)
    assert_signs(flight, "elevon_left", "roll", ["r"], span, 0.05, 1)
    assert_signs(flight, "elevon_right", "pitch", [], span, 0.05, 1)
    command = flight.measured["command.elevon_right"]
    saturated = command.t_s[command.value >= 1.0]
    assert 2813.1 < saturated[0] < 2814.7


def test_enac_table_says_the_same_as_the_log(flights):
    log = records.read(next((flights / "enac_elevon_2017").glob("*.data")))
    table = records.read(next((flights / "enac_elevon_2017").glob("*.csv")))
    names = ["p", "command.elevon_left", "command.elevon_right", "theta"]
    # Both hold the last value; the table's own stamps are rounded to 10 ms.
    a, b = grid(log, names, 2745.0, 2812.0, 0.05), grid(table, names, 2745.0, 2812.0, 0.05)
    for j, name in enumerate(names):
        assert np.corrcoef(a[:, j], b[:, j])[0, 1] > 0.98, name
    assert table.measured["theta"].repeats and not table.measured["p"].repeats


def test_daredevil(flights):
    flight = records.read(next((flights / "enac_daredevil_2020").glob("*.csv.gz")))
    assert flight.span_s == pytest.approx((0.0, 2867.9))
    gain = flight.truth["gain.elevon_left"]
    assert gain.value.min() == pytest.approx(0.3) and "gain.elevon_left" not in flight.measured
    lost = flight.truth["fault.elevon_left.loss_of_effectiveness"]
    np.testing.assert_allclose(lost.value, 1.0 - gain.value)
    assert min(s.t_s[s.value < 1][0] for s in (gain, flight.truth["gain.elevon_right"])) == pytest.approx(
        355, abs=1
    )
    commands = ["command.elevon_right", "command.elevon_left"]
    roll = moment_of(flight, "p", ["q", "r"], commands, (180.0, 350.0), 0.1, 1)
    pitch = moment_of(flight, "q", ["p", "r"], commands, (180.0, 350.0), 0.1, 1)
    signs = [flight.meta["surface_signs"][c.partition(".")[2]] for c in commands]
    assert np.sign(roll).tolist() == [s["roll"] for s in signs]
    assert np.sign(pitch).tolist() == [s["pitch"] for s in signs]


def test_alfa_every_sequence(flights):
    folders = sorted((flights / "alfa").iterdir())
    assert len(folders) >= 20
    for folder in folders:
        flight = records.read(folder)
        commands = [name for name in flight.measured if name.startswith("command.")]
        assert commands == ["command.aileron"], folder.name
        assert {"command.elevator", "command.rudder", "command.aileron_left"} <= set(flight.output)
        assert "throttle" not in flight.measured
        absent = folder.name.startswith(("carbonZ_2018-09", "carbonZ_2018-10"))
        assert ("airspeed" in flight.measured) is not absent
        assert bool(flight.truth) is ("no_failure" not in folder.name)
        assert flight.span_s[0] == pytest.approx(0.0, abs=0.1)
        assert records.flown(flight)[0], folder.name


@pytest.mark.parametrize(("sequence", "healthy"), [("22_2_right", "left"), ("22_3_left", "right")])
def test_alfa_one_rule_gives_the_intended_aileron(flights, sequence, healthy):
    """After the onset the rule must follow the side that still moves; before it both sides are equal."""
    flight = records.read(next((flights / "alfa").glob(f"*{sequence}*")))
    onset = flight.truth["failure.aileron"].t_s[0]
    command, sound = flight.measured["command.aileron"], flight.output[f"command.aileron_{healthy}"]
    after = command.t_s > onset + 1.0
    assert after.sum() > 50 and np.std(command.value[after]) > 0.05
    np.testing.assert_array_equal(command.value[after], sound.value[after])
    before = command.t_s < onset - 1.0
    left, right = (flight.output[f"command.aileron_{side}"].value for side in ("left", "right"))
    np.testing.assert_array_equal(left[before], right[before])
    slope = moment_of(flight, "p", ["r"], ["command.aileron"], (2.0, onset), 0.1, 1)[0]
    assert np.sign(slope) == flight.meta["surface_signs"]["aileron"]["roll"]


def test_alfa_bag_and_folder_are_one_flight(flights):
    path = next((flights / "alfa").glob("*/*.bag"))
    bag, folder = records.read(path), records.read(path.parent)
    assert bag.measured.keys() == folder.measured.keys()
    for name, series in bag.measured.items():
        other = folder.measured[name]
        np.testing.assert_allclose(series.value, other.value, rtol=1e-6, atol=1e-6, err_msg=name)
        # The bag's clock starts at the first stamp of all its topics, and it has more topics than the folder.
        shift = series.t_s - other.t_s
        assert np.ptp(shift) < 1e-3 and abs(shift[0]) < 0.1


def test_arduplane_onboard_and_telemetry_agree(flights):
    onboard = records.read(flights / "arduplane_sitl" / "right_aileron_gain03.BIN")
    remote = records.read(flights / "arduplane_sitl" / "right_aileron_gain03.tlog")
    assert onboard.meta["groups"] == {"aileron": ["aileron_servo1", "aileron_servo5"]}
    assert not onboard.meta["assumed"] and len(remote.meta["assumed"]) == 1
    pairs = {
        "p": "p",
        "q": "q",
        "phi": "phi",
        "command.elevator": "command.elevator",
        "command.rudder": "command.rudder",
    }
    pairs["command.aileron_servo1"] = "command.aileron"
    for name, other in pairs.items():
        a, b = onboard.measured[name], remote.measured[other]
        t = np.arange(60.0, 180.0, 0.1)
        scores = []
        for shift in (-0.5, 0.0, 0.5):
            x, y = np.interp(t, a.t_s, a.value), np.interp(t + shift, b.t_s, b.value)
            scores.append(np.corrcoef(x, y)[0, 1])
        assert scores[1] > 0.97 and scores[1] > max(scores[0], scores[2]), (name, scores)
        assert onboard.measured[name].unit == remote.measured[other].unit
    span = (65.0, 110.0)
    assert_signs(onboard, "aileron_servo1", "roll", ["r"], span, 0.04, 1)
    # Without the angle of attack the elevator's sign cannot be seen here; the truth beside the log has it.
    truth = records.attach_truth(
        onboard, flights / "arduplane_sitl" / "right_aileron_gain03_truth.csv.gz"
    ).truth
    assert_signs(onboard.with_measured(alpha=truth["alpha"]), "elevator", "pitch", ["alpha"], span, 0.04, 1)


def test_arduplane_truth_beside_the_log(flights):
    folder = flights / "arduplane_sitl"
    flight = records.read(folder / "right_aileron_gain03.BIN")
    with_truth = records.attach_truth(flight, folder / "right_aileron_gain03_truth.csv.gz")
    fault = with_truth.truth["fault"]
    assert fault.t_s[fault.value > 0][0] == pytest.approx(35.87 + 80.0, abs=0.1)
    assert with_truth.measured.keys() == flight.measured.keys()
    # The truth's clock is the log's: its roll rate is the gyro's.
    t = np.arange(60.0, 180.0, 0.05)
    p, true = flight.measured["p"], with_truth.truth["p"]
    assert np.corrcoef(np.interp(t, p.t_s, p.value), np.interp(t, true.t_s, true.value))[0, 1] > 0.99
    stuck = records.attach_truth(
        records.read(folder / "aerosonde_stuck_left_aileron.BIN"),
        folder / "aerosonde_stuck_left_aileron_truth.csv.gz",
    ).truth["fault"]
    assert stuck.t_s[stuck.value > 0][0] == pytest.approx(86.84, abs=0.05)


@pytest.mark.parametrize("name", ["sample.ulg", "sample_log_small.ulg", "sample_px4_events.ulg"])
def test_px4_samples(flights, name):
    flight = records.read(flights / "formats" / name)
    assert {"p", "q", "r", "phi", "theta", "mode", "armed"} <= set(flight.measured)
    assert flight.events
    vtol = name == "sample_log_small.ulg"
    assert ("command.aileron" in flight.measured) is vtol
    assert any("no control surfaces" in text for text in flight.meta["notes"]) is not vtol
    # Attitude from the quaternion and rates from the gyro must belong together: phi' = p for small angles.
    phi, p = flight.measured["phi"], flight.measured["p"]
    if np.ptp(phi.value) > 0.1:
        t = np.arange(*flight.span_s, 0.02)
        slope = np.gradient(np.interp(t, phi.t_s, phi.value), t)
        assert np.corrcoef(slope, np.interp(t, p.t_s, p.value))[0, 1] > 0.9


def test_vtol_telemetry_uses_its_servo_parameters(flights):
    flight = records.read(flights / "formats" / "vtol.tlog")
    assert not flight.meta["assumed"]
    assert flight.meta["servos"]["elevator"]["us_per_unit"] < 0  # SERVO2_REVERSED is 1


def test_thirteen_megabytes_take_less_than_two_seconds(flights):
    path = flights / "arduplane_sitl" / "right_aileron_gain03.BIN"
    records.read(path)
    start = time.perf_counter()
    records.read(path)
    assert time.perf_counter() - start < 2.0


def test_every_real_log_cut_in_half_is_read_or_refused(flights, tmp_path):
    outcomes = []
    for source in sorted(
        p for p in flights.rglob("*") if p.suffix in (".ulg", ".BIN", ".tlog", ".bag", ".data", ".mat")
    ):
        path = tmp_path / source.name
        data = source.read_bytes()
        path.write_bytes(data[: len(data) // 2 + 1])
        try:
            outcomes.append(len(records.read(path).measured["p"].t_s) > 1)
        except UnreadableFile as error:
            outcomes.append(None)
            assert source.name in str(error)
    assert outcomes.count(True) >= 8
