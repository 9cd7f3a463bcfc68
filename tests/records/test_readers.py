"""Every reader on a tiny log of its format: names, units, signs, clock, tables, events."""

import numpy as np
import pytest

from aerofdi import records
from aerofdi.core import UnreadableFile, WrongUse
from aerofdi.records.servos import pwm_to_command


def put(path, data):
    path.write_bytes(data)
    return path


def test_px4_servos_are_named_and_signed_by_the_parameters(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.ulg", tiny.ulog("servos")))
    m = flight.measured
    assert m["p"].unit == "rad/s"
    np.testing.assert_allclose(m["p"].value[:3], [0.0, 0.1, 0.2], atol=1e-7)
    np.testing.assert_allclose(m["p"].t_s[:2], [2.0, 2.02], atol=1e-9)
    np.testing.assert_allclose(m["phi"].value, 0.25, atol=1e-6)
    np.testing.assert_allclose(m["command.aileron_left"].value, 0.5)
    np.testing.assert_allclose(m["command.elevator"].value, -0.25)
    assert flight.meta["surface_signs"] == {"aileron_left": {"roll": -1}, "elevator": {"pitch": 1}}
    assert m["mode"].codes[int(m["mode"].value[0])] == "AUTO_MISSION"
    assert (m["armed"].value == 1).all()
    assert [e.text for e in flight.events] == ["INFO: hello from PX4"]
    assert flight.events[0].t_s == pytest.approx(2.5)
    assert flight.meta["clock"] == "autopilot boot time"


def test_px4_old_vtol_gives_axis_demands_and_says_so(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.ulg", tiny.ulog("controls")))
    np.testing.assert_allclose(flight.measured["command.aileron"].value, 0.5)
    np.testing.assert_allclose(flight.measured["command.rudder"].value, 0.125)
    assert any("before the mixer" in text for text in flight.meta["assumed"])


def test_px4_multicopter_has_no_surfaces(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.ulg", tiny.ulog("none")))
    assert not [name for name in flight.measured if name.startswith("command.")]
    assert any("no control surfaces" in text for text in flight.meta["notes"])


def test_px4_absolute_stamps_start_at_zero(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.ulg", tiny.ulog("servos", start_us=1_700_000_000_000_000)))
    assert flight.span_s[0] == 0.0
    assert flight.span_s[1] == pytest.approx(0.98 + 0.001, abs=1e-6)
    assert flight.meta["clock"].startswith("0 at the earliest stamp")


@pytest.mark.parametrize("form", ["binary", "text"])
def test_dataflash_pulses_become_commands_by_the_servo_parameters(tmp_path, tiny, form):
    data = tiny.dataflash() if form == "binary" else tiny.dataflash_text()
    flight = records.read(put(tmp_path / ("a.BIN" if form == "binary" else "a.log"), data))
    m = flight.measured
    assert flight.meta["profile"] == "ardupilot_dataflash"
    np.testing.assert_allclose(m["p"].value, 0.01 * np.arange(40), atol=1e-7)
    np.testing.assert_allclose(m["p"].t_s, 1.0 + 0.04 * np.arange(40))
    np.testing.assert_allclose(m["phi"].value, np.deg2rad(10.0))
    np.testing.assert_allclose(m["theta"].value, np.deg2rad(5.0))
    np.testing.assert_allclose(m["psi"].value, np.deg2rad(91.0))
    # Outputs 1 and 5 carry one function: both are there, named by output, as one group.
    np.testing.assert_allclose(m["command.aileron_servo1"].value, 10 * np.arange(40) / 400.0)
    np.testing.assert_array_equal(m["command.aileron_servo1"].value, m["command.aileron_servo5"].value)
    assert flight.meta["groups"] == {"aileron": ["aileron_servo1", "aileron_servo5"]}
    # Reversed about a trim of 1400: 1700 us is half way to 2000 us, and asks for nose down.
    np.testing.assert_allclose(m["command.elevator"].value, -0.5)
    np.testing.assert_allclose(m["throttle"].value, 0.25)
    assert m["mode"].codes[int(m["mode"].value[0])] == "FBWA"
    assert flight.parameters["SERVO2_TRIM"] == 1400
    assert flight.meta["info"]["firmware"] == "ArduPlane V4.5.0"


def test_output_pulse_is_undone_whatever_the_travel():
    """The forward map is what the autopilot's output stage does; the inverse must undo it on both sides of trim."""
    command = np.linspace(-1.0, 1.0, 41)
    for low, trim, high in ((1100.0, 1500.0, 1900.0), (1000.0, 1200.0, 2000.0)):
        for reverse in (False, True):
            asked = -command if reverse else command
            pwm = np.where(asked > 0, trim + asked * (high - trim), trim - (-asked) * (trim - low))
            np.testing.assert_allclose(
                pwm_to_command(pwm, low, trim, high, reverse, False), command, atol=1e-12
            )
    assert np.isnan(pwm_to_command(np.array([0.0]), 1100.0, 1500.0, 1900.0, False, False)).all()


def test_telemetry_without_parameters_assumes_the_default_outputs(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.tlog", tiny.tlog()))
    m = flight.measured
    np.testing.assert_allclose(m["p"].value, 0.01 * np.arange(40), atol=1e-6)
    np.testing.assert_allclose(m["p"].t_s, 10.0 + 0.04 * np.arange(40), atol=1e-3)
    np.testing.assert_allclose(m["az"].value, -9.80665)
    np.testing.assert_allclose(m["command.aileron"].value, np.arange(40) / 40.0)
    np.testing.assert_allclose(m["command.elevator"].value, 0.5)
    assert len(flight.meta["assumed"]) == 1 and "assumed" in flight.meta["assumed"][0]
    assert m["mode"].codes[int(m["mode"].value[0])] == "AUTO"
    assert (m["armed"].value == 1).all()
    assert len(m["mode"].t_s) == 2  # the ground station's heartbeats are not the autopilot's


def test_telemetry_with_parameters_agrees_with_the_onboard_log(tmp_path, tiny):
    onboard = records.read(put(tmp_path / "a.BIN", tiny.dataflash()))
    remote = records.read(put(tmp_path / "a.tlog", tiny.tlog(servo=True)))
    assert not remote.meta["assumed"]
    for name in ("command.aileron_servo1", "command.aileron_servo5", "command.elevator", "throttle"):
        np.testing.assert_allclose(remote.measured[name].value, onboard.measured[name].value, atol=1e-12)
    assert remote.meta["groups"] == onboard.meta["groups"]
    assert remote.meta["surface_signs"] == onboard.meta["surface_signs"]


def test_telemetry_keeps_the_longest_stretch_between_restarts(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.tlog", tiny.tlog(restart=True)))
    assert len(flight.measured["p"].t_s) == 40
    assert any("restarted" in text for text in flight.meta["notes"])


def test_a_copter_has_no_surfaces_and_no_plane_modes(tmp_path, tiny):
    data = tiny.dataflash().replace(b"ArduPlane V4.5.0", b"ArduCopterV4.5.0")
    flight = records.read(put(tmp_path / "a.BIN", data))
    assert not [name for name in flight.measured if name.startswith("command.")]
    assert flight.measured["mode"].codes is None
    assert any("no control surfaces" in text for text in flight.meta["notes"])


def test_parsers_that_print_are_silenced(tmp_path, tiny, capsys):
    import io

    from pyulog import ULog

    data = bytearray(tiny.ulog("servos"))
    data[7] = 9  # a file version that pyulog warns of on stdout
    ULog(io.BytesIO(bytes(data)))
    assert "unknown file version" in capsys.readouterr().out
    assert records.read(put(tmp_path / "a.ulg", bytes(data))).measured
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("version", [1, 2, 3])
def test_ros_bags_turn_forward_left_up_into_forward_right_down(tmp_path, tiny, version):
    path = tiny.bag(tmp_path / ("a.bag" if version == 1 else "a"), version)
    if version == 3:
        path = next(path.glob("*.mcap"))
    flight = records.read(path)
    m = flight.measured
    np.testing.assert_allclose(m["p"].value, 0.1 * np.arange(30))
    np.testing.assert_allclose([m["q"].value[0], m["r"].value[0]], [-0.2, 0.3])
    np.testing.assert_allclose([m[k].value[0] for k in ("ax", "ay", "az")], [1.0, -2.0, -9.8])
    np.testing.assert_allclose(m["p"].t_s, 0.1 * np.arange(30), atol=1e-9)
    np.testing.assert_allclose([m[k].value[0] for k in ("phi", "theta", "psi")], [0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(m["command.aileron"].value, 0.1)
    np.testing.assert_allclose(m["command.elevator"].value, -0.1)
    assert m["mode"].codes[int(m["mode"].value[0])] == "AUTO"


def test_alfa_forms_one_aileron_command_and_hides_the_outputs(tmp_path, tiny):
    flight = records.read(tiny.alfa(tmp_path / "carbonZ_1"))
    m = flight.measured
    want = np.where(np.arange(60) % 2, 60, -40) / 400.0
    np.testing.assert_allclose(
        m["command.aileron"].value, want
    )  # the healthy side's, before and after the fault
    assert [n for n in m if n.startswith("command.")] == ["command.aileron"]
    np.testing.assert_allclose(flight.output["command.aileron_right"].value[40:], 0.0)
    np.testing.assert_allclose([m["q"].value[0], m["r"].value[0]], [-0.2, -0.3])
    np.testing.assert_allclose(m["reference.phi"].value[:2], np.deg2rad([0.0, 1.0]))
    assert m["phi"].repeats and not m["reference.phi"].repeats
    assert "airspeed" not in m and any("airspeed is left out" in text for text in flight.meta["notes"])
    assert flight.truth["failure.aileron"].t_s[0] == pytest.approx(4.0, abs=1e-6)
    assert flight.span_s[0] == 0.0


def test_paparazzi_commands_are_mixed_and_pulses_stay_recoverable(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.data", tiny.paparazzi()))
    m = flight.measured
    np.testing.assert_allclose(m["p"].t_s[:2], [100.0, 100.05])
    np.testing.assert_allclose(m["command.elevon_right"].value, 0.75 * 0.01 * np.arange(40), atol=1e-12)
    np.testing.assert_array_equal(m["command.elevon_right"].value, m["command.elevon_left"].value)
    servo = flight.meta["servos"]["elevon_right"]
    sent = servo["neutral_us"] + servo["us_per_unit"] * flight.output["command.elevon_right"].value
    np.testing.assert_allclose(sent, np.where(np.arange(40) < 30, 1500, 1416))
    assert flight.meta["aliases"]["elevon_right"] == "elevon B"
    assert [e.kind for e in flight.events] == ["settings"]
    assert m["mode"].codes[int(m["mode"].value[0])] == "AUTO2"


def test_matlab_structure_on_its_own_clock(tmp_path, tiny):
    flight = records.read(tiny.mat(tmp_path / "a.mat"))
    m = flight.measured
    np.testing.assert_allclose(m["p"].t_s, 0.02 * np.arange(40))
    assert m["command.aileron_left"].unit == "rad"
    np.testing.assert_array_equal(m["command.aileron_left"].value, -m["command.aileron_right"].value)
    assert flight.meta["groups"] == {"aileron": ["aileron_left", "aileron_right"]}
    assert flight.meta["surface_signs"]["elevator"] == {"pitch": -1}


@pytest.mark.parametrize("packed", [False, True])
def test_csv_that_speaks_the_names_of_the_house_needs_no_profile(tmp_path, tiny, packed):
    path = put(tmp_path / ("a.csv.gz" if packed else "a.csv"), tiny.csv_gz() if packed else tiny.csv())
    flight = records.read(path)
    m = flight.measured
    np.testing.assert_allclose(m["p"].t_s, 0.02 * np.arange(40))
    np.testing.assert_allclose(m["q"].value, np.pi / 2)
    np.testing.assert_allclose(m["phi"].value, np.pi)
    np.testing.assert_allclose(m["airspeed"].value, 10.0)
    assert m["command.elevator"].unit == "rad"
    assert flight.truth["gain"].value[-1] == 0.5 and "gain" not in m


def test_foreign_parquet_is_read_like_a_csv(tmp_path, tiny):
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table({"t_s": [0.0, 0.1], "p": [1, 2], "r": [0.5, None]}), tmp_path / "a.parquet")
    flight = records.read(tmp_path / "a.parquet")
    np.testing.assert_array_equal(flight.measured["p"].value, [1.0, 2.0])
    assert np.isnan(flight.measured["r"].value[1])


def test_content_decides_before_the_suffix(tmp_path, tiny):
    flight = records.read(put(tmp_path / "misnamed.csv", tiny.dataflash()))
    assert flight.meta["format"] == "dataflash"


def test_a_profile_of_ones_own_by_path(tmp_path, tiny):
    own = tmp_path / "own.toml"
    own.write_text(
        'name = "own"\nreader = "csv"\n[time]\nfield = "table.t_s"\n[channels]\n'
        'r = { from = "table.p", unit = "deg/s", sign = -1, scale = 2, offset = 0.1 }\n'
    )
    flight = records.read(put(tmp_path / "a.csv", tiny.csv()), profile=own)
    want = -2 * np.deg2rad(0.1 * np.arange(40) - 0.1)
    np.testing.assert_allclose(flight.measured["r"].value, want, atol=1e-12)
    assert list(flight.measured) == ["r"]


def test_truth_beside_a_flight_never_becomes_measured(tmp_path, tiny):
    flight = records.read(put(tmp_path / "a.data", tiny.paparazzi()))
    put(tmp_path / "truth.csv", b"t,p,broken\n100,1,0\n101,2,1\n")
    with_truth = records.attach_truth(flight, tmp_path / "truth.csv")
    assert with_truth.measured.keys() == flight.measured.keys()
    np.testing.assert_array_equal(with_truth.measured["p"].value, flight.measured["p"].value)
    np.testing.assert_array_equal(with_truth.truth["broken"].value, [0.0, 1.0])
    assert not flight.truth


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.ulg", b"", "empty"),
        ("a.xyz", b"hello", "neither its content nor its suffix"),
        ("a.csv", b"x,y\n1,2\n", "no shipped profile fits"),
        ("a.csv", b"t_s,p\n", "no rows"),
        ("a.csv", b"\x00\x01\x02" * 30, "binary"),
        ("a.tlog", b"not a telemetry log at all, just words", "telemetry"),
        ("a.BIN", b"\xa3\x95" + bytes(100), "dataflash"),
        ("a.log", b"just\nsome\nlines\n", "dataflash"),
        ("a.data", b"just\nsome\nlines\n", "Paparazzi"),
        ("a.mat", b"MATLAB 7.3 MAT-file, Platform", "-v7"),
        ("a.bag", b"#ROSBAG V2.0\n", "ROS bag"),
        ("a.parquet", b"PAR1 and nothing else", "Parquet"),
    ],
)
def test_bad_files_are_refused_in_a_sentence(tmp_path, name, data, says):
    with pytest.raises(UnreadableFile, match=says) as caught:
        records.read(put(tmp_path / name, data))
    assert name in str(caught.value)
    assert caught.value.exit_code == 2


def test_missing_file_and_wrong_profile(tmp_path, tiny):
    with pytest.raises(UnreadableFile, match="cannot be opened"):
        records.read(tmp_path / "nowhere.ulg")
    path = put(tmp_path / "a.csv", tiny.csv())
    with pytest.raises(WrongUse, match=r"neither a readable file nor one of .*umn_thor"):
        records.read(path, profile="nonsense")
    with pytest.raises(WrongUse, match="reads ulog"):
        records.read(path, profile="px4")


def test_cut_off_logs_keep_what_came_before(tmp_path, tiny):
    whole = tiny.dataflash()
    flight = records.read(put(tmp_path / "a.BIN", whole[: int(len(whole) * 0.7)]))
    assert 5 < len(flight.measured["p"].t_s) < 40
    assert any("no message" in text for text in flight.meta["notes"])
    whole = tiny.ulog("servos")
    flight = records.read(put(tmp_path / "a.ulg", whole[: int(len(whole) * 0.7)]))
    assert 5 < len(flight.measured["p"].t_s) < 50


def test_a_flipped_stamp_does_not_stretch_the_flight(tmp_path, tiny):
    data = bytearray(tiny.dataflash())
    at = data.rindex(b"\xa3\x95\x82") + 3  # the stamp of the last IMU message
    data[at + 6] ^= 0x40
    flight = records.read(put(tmp_path / "a.BIN", bytes(data)))
    assert flight.duration_s < 10.0
    assert any("far from all others" in text for text in flight.meta["notes"])
