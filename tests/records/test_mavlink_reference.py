"""Our decoder of MAVLink frames against pymavlink's parser, value by value."""

import struct

import numpy as np
import pytest

from aerofdi.records.mavlink import decode, frames


def reference(data):
    """pymavlink's messages by name, from its own parser fed with whole frames as buffers."""
    from pymavlink.dialects.v20 import ardupilotmega as mav

    parser = mav.MAVLink(None)
    parser.robust_parsing = True
    found: dict[str, list] = {}
    for frame in frames(data):
        stop = frame.body + frame.size + 2
        for message in parser.parse_buffer(bytearray(data[frame.at : stop])) or ():
            found.setdefault(message.get_type(), []).append(message)
    return found


def compare(data, skip=()):
    from pymavlink.dialects.v20 import ardupilotmega as mav

    compared = 0
    by_id: dict[int, list] = {}
    for frame in frames(data):
        by_id.setdefault(frame.msgid, []).append(frame)
    want = reference(data)
    for msgid, found in by_id.items():
        message = mav.mavlink_map[msgid]
        good, columns = decode(data, found, message)
        messages = want.get(message.msgname, [])
        assert len(good) == len(messages), message.msgname
        for name, column in columns.items():
            theirs = [getattr(m, name) for m in messages]
            if column.dtype.kind == "U":
                assert column.tolist() == [str(x).split("\0")[0] for x in theirs]
            else:
                np.testing.assert_array_equal(column, np.array(theirs, dtype=column.dtype), err_msg=name)
            compared += len(theirs)
    return compared


def test_tiny_log_agrees(tiny):
    assert compare(tiny.tlog(servo=True)) > 1500


def test_frames_with_a_wrong_checksum_are_left_out(tiny):
    from pymavlink.dialects.v20 import ardupilotmega as mav

    data = bytearray(tiny.tlog())
    found = [f for f in frames(bytes(data)) if f.msgid == mav.MAVLINK_MSG_ID_ATTITUDE]
    data[found[3].body] ^= 1
    good, columns = decode(bytes(data), found, mav.MAVLink_attitude_message)
    assert good.tolist() == [k for k in range(40) if k != 3] and len(columns["rollspeed"]) == 39


def test_garbage_between_frames_is_skipped(tiny):
    data = tiny.tlog()
    cut = next(iter(frames(data)))
    middle = data[: cut.at - 8] + b"\xfd\xfe garbage \xfe" + data[cut.at - 8 :]
    assert len(list(frames(middle))) >= len(list(frames(data))) - 1


def test_servo_time_goes_on_where_32_bits_end(tmp_path):
    from pymavlink.dialects.v20 import ardupilotmega as mav

    from aerofdi import records

    link = mav.MAVLink(None, srcSystem=1, srcComponent=1)
    out = []
    for i in range(60):
        boot_us = 2**32 - 500_000 + 20_000 * i
        for message in (
            mav.MAVLink_attitude_message(boot_us // 1000, 0, 0, 0, 0.1, 0, 0),
            mav.MAVLink_servo_output_raw_message(boot_us % 2**32, 0, 1500 + i, 1500, 1000, 1500, 0, 0, 0, 0),
        ):
            out.append(struct.pack(">Q", boot_us) + message.pack(link))
    (tmp_path / "a.tlog").write_bytes(b"".join(out))
    flight = records.read(tmp_path / "a.tlog")
    command, p = flight.measured["command.aileron"], flight.measured["p"]
    np.testing.assert_allclose(command.t_s, p.t_s, atol=2e-3)


@pytest.mark.data
def test_real_logs_agree(flights):
    assert compare((flights / "formats" / "vtol.tlog").read_bytes()[:150_000]) > 15_000
