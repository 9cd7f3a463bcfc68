"""Tiny logs of every format, written here byte by byte or by the format's own writer; no data folder needed."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ABSOLUTE_S = 1_600_000_000


# --- PX4 ULog -------------------------------------------------------------------------------------------------


def _ulog_message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), kind[0]) + body


def ulog_bytes(wings: str = "servos", start_us: int = 2_000_000, n: int = 50) -> bytes:
    """A PX4 log. wings: 'servos' (new fixed wing), 'controls' (old VTOL), 'none' (multicopter)."""
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", start_us)]
    out.append(_ulog_message(b"B", bytes(40)))
    info = b"char[3] sys_name"
    out.append(_ulog_message(b"I", bytes([len(info)]) + info + b"PX4"))
    rates = "vehicle_angular_velocity:uint64_t timestamp;float[3] xyz;"
    attitude = "vehicle_attitude:uint64_t timestamp;float[4] q;"
    status = "vehicle_status:uint64_t timestamp;uint8_t nav_state;uint8_t arming_state;"
    status += "uint8_t vehicle_type;bool is_vtol;uint8_t[4] _padding0;"
    servos = "actuator_servos:uint64_t timestamp;float[8] control;"
    controls = "actuator_controls_1:uint64_t timestamp;float[8] control;"
    for text in (rates, attitude, status, servos, controls):
        out.append(_ulog_message(b"F", text.encode()))
    parameters = {"CA_SV_CS_COUNT": 2, "CA_SV_CS0_TYPE": 1, "CA_SV_CS1_TYPE": 3}
    if wings == "servos":
        for name, value in parameters.items():
            key = f"int32_t {name}".encode()
            out.append(_ulog_message(b"P", bytes([len(key)]) + key + struct.pack("<i", value)))
        for name, torque in {"CA_SV_CS0_TRQ_R": -0.5, "CA_SV_CS1_TRQ_P": 1.0}.items():
            key = f"float {name}".encode()
            out.append(_ulog_message(b"P", bytes([len(key)]) + key + struct.pack("<f", torque)))
    topics = ["vehicle_angular_velocity", "vehicle_attitude", "vehicle_status"]
    topics += {"servos": ["actuator_servos"], "controls": ["actuator_controls_1"], "none": []}[wings]
    for k, name in enumerate(topics):
        out.append(_ulog_message(b"A", struct.pack("<BH", 0, k) + name.encode()))
    vehicle_type, vtol = {"servos": (2, 0), "controls": (1, 1), "none": (1, 0)}[wings]
    half = 0.25
    quaternion = (np.cos(half / 2), np.sin(half / 2), 0.0, 0.0)
    for i in range(n):
        t = start_us + 20_000 * i
        out.append(_ulog_message(b"D", struct.pack("<HQ3f", 0, t, 0.1 * i, -0.2, 0.3)))
        out.append(_ulog_message(b"D", struct.pack("<HQ4f", 1, t + 1000, *quaternion)))
        out.append(_ulog_message(b"D", struct.pack("<HQ4B", 2, t, 3, 2, vehicle_type, vtol)))
        if wings != "none":
            control = [0.5, -0.25, 0.125, 0.75, 0, 0, 0, 0]
            out.append(_ulog_message(b"D", struct.pack("<HQ8f", 3, t, *control)))
    out.append(_ulog_message(b"L", b"6" + struct.pack("<Q", start_us + 500_000) + b"hello from PX4"))
    return b"".join(out)


# --- ArduPilot dataflash --------------------------------------------------------------------------------------

FORMATS = (
    (129, "PARM", "QNf", "TimeUS,Name,Value"),
    (130, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    (131, "ATT", "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    (132, "RCOU", "QHHHHH", "TimeUS,C1,C2,C3,C4,C5"),
    (133, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    (134, "MSG", "QZ", "TimeUS,Message"),
    (135, "ARSP", "QBf", "TimeUS,I,Airspeed"),
)
CODES = {"Q": "Q", "N": "16s", "f": "f", "B": "B", "c": "h", "C": "H", "H": "H", "M": "B", "Z": "64s"}
SERVO = {
    "SERVO1_FUNCTION": 4,
    "SERVO2_FUNCTION": 19,
    "SERVO3_FUNCTION": 70,
    "SERVO4_FUNCTION": 21,
    "SERVO5_FUNCTION": 4,
    "SERVO1_MIN": 1100,
    "SERVO1_TRIM": 1500,
    "SERVO1_MAX": 1900,
    "SERVO1_REVERSED": 0,
    "SERVO2_MIN": 1000,
    "SERVO2_TRIM": 1400,
    "SERVO2_MAX": 2000,
    "SERVO2_REVERSED": 1,
    "SERVO3_MIN": 1000,
    "SERVO3_TRIM": 1000,
    "SERVO3_MAX": 2000,
    "SERVO3_REVERSED": 0,
}
SERVO |= {f"SERVO{n}_{key}": us for n in (4, 5) for key, us in (("MIN", 1100), ("TRIM", 1500), ("MAX", 1900))}


def dataflash_messages(n: int = 40) -> list[tuple[str, tuple]]:
    messages: list[tuple[str, tuple]] = [
        ("PARM", (1_000_000, k.encode(), float(v))) for k, v in SERVO.items()
    ]
    messages.append(("MSG", (1_000_000, b"ArduPlane V4.5.0")))
    messages.append(("MODE", (1_000_000, 5, 5, 1)))
    for i in range(n):
        t = 1_000_000 + 40_000 * i
        messages.append(("IMU", (t, 0, 0.01 * i, -0.5, 0.25, 1.0, 2.0, -9.8)))
        messages.append(("IMU", (t, 1, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0)))
        messages.append(("ATT", (t + 1000, 100, 1000, -200, 500, 9000, 9100)))
        messages.append(("RCOU", (t + 2000, 1500 + 10 * i, 1700, 1250, 1480, 1500 + 10 * i)))
        messages.append(("ARSP", (t, 0, 20.0 + 0.1 * i)))
    return messages


def dataflash_bytes(n: int = 40) -> bytes:
    head = b"\xa3\x95"
    numbers = {name: (kind, fields) for kind, name, fields, _ in FORMATS}
    out = []
    for kind, name, fields, labels in ((128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"), *FORMATS):
        length = 89 if name == "FMT" else 3 + struct.calcsize("<" + "".join(CODES[c] for c in fields))
        body = struct.pack("<BB4s16s64s", kind, length, name.encode(), fields.encode(), labels.encode())
        out.append(head + b"\x80" + body)
    for name, values in dataflash_messages(n):
        kind, fields = numbers[name]
        packed = struct.pack("<" + "".join(CODES[c] for c in fields), *values)
        out.append(head + bytes([kind]) + packed)
    return b"".join(out)


def dataflash_text(n: int = 40) -> bytes:
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    fields_of = {}
    for kind, name, fields, labels in FORMATS:
        lines.append(f"FMT, {kind}, 50, {name}, {fields}, {labels}")
        fields_of[name] = fields
    for name, values in dataflash_messages(n):
        cells = []
        for code, value in zip(fields_of[name], values, strict=True):
            scaled = value * 0.01 if code in "cC" else value
            cells.append(scaled.decode() if isinstance(scaled, bytes) else repr(scaled))
        lines.append(", ".join([name, *cells]))
    return ("\n".join(lines) + "\n").encode()


# --- MAVLink telemetry ----------------------------------------------------------------------------------------


def tlog_bytes(n: int = 40, servo: bool = False, restart: bool = False) -> bytes:
    from pymavlink.dialects.v20 import ardupilotmega as mav

    link = mav.MAVLink(None, srcSystem=1, srcComponent=1)
    ground = mav.MAVLink(None, srcSystem=255, srcComponent=190)
    out: list[bytes] = []

    def put(source, message, t_s: float) -> None:
        stamp = struct.pack(">Q", int((ABSOLUTE_S + t_s) * 1e6))
        out.append(stamp + message.pack(source))
        source.seq = (source.seq + 1) % 256

    if servo:
        for name, value in SERVO.items():
            put(link, mav.MAVLink_param_value_message(name.encode(), float(value), 9, 900, 1), 0.0)
    for i in range(n):
        t = 10.0 + 0.04 * i
        boot = int(t * 1000)
        if i % 25 == 0:
            put(link, mav.MAVLink_heartbeat_message(1, 3, 128 + 1, 10, 4, 3), t)
            put(ground, mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), t)
        put(link, mav.MAVLink_attitude_message(boot, 0.1, 0.05, 1.0, 0.01 * i, -0.2, 0.3), t)
        put(link, mav.MAVLink_raw_imu_message(boot * 1000, 100, 0, -1000, 0, 0, 0, 0, 0, 0), t)
        pwm = (1500 + 10 * i, 1700, 1250, 1480, 1500 + 10 * i, 0, 0, 0)
        put(link, mav.MAVLink_servo_output_raw_message(boot * 1000, 0, *pwm), t)
        put(link, mav.MAVLink_vfr_hud_message(21.0, 22.0, 90, 50, 100.0, 1.0), t)
    put(link, mav.MAVLink_statustext_message(6, b"ArduPlane V4.5.0"), 20.0)
    if restart:
        for i in range(5):
            put(link, mav.MAVLink_attitude_message(100 + i, 0.1, 0.05, 1.0, 9.0, 9.0, 9.0), 21.0)
    return b"".join(out)


# --- ROS bags and the ALFA folder -----------------------------------------------------------------------------

MAVROS = {
    "mavros_msgs/msg/NavDataPair": "std_msgs/Header header\nfloat32 commanded\nfloat32 measured\n",
    "mavros_msgs/msg/RCOut": "std_msgs/Header header\nuint16[] channels\n",
    "mavros_msgs/msg/State": (
        "std_msgs/Header header\nbool connected\nbool armed\nbool guided\nbool manual_input\n"
        "string mode\nuint8 system_status\n"
    ),
}


def write_bag(path: Path, version: int, n: int = 30) -> Path:
    """A mavros bag: path.bag for ROS 1; a folder (SQLite) or .mcap file's folder for ROS 2."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.LATEST)
    types = {}
    for name, text in MAVROS.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    t = store.types
    stamp = t["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    head = {"seq": 0} if version == 1 else {}
    header = t["std_msgs/msg/Header"](stamp=stamp, frame_id="", **head)
    vector = t["geometry_msgs/msg/Vector3"]
    quaternion = t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    zeros = np.zeros(9)

    def imu(i: int):
        return t["sensor_msgs/msg/Imu"](
            header,
            quaternion,
            zeros,
            vector(x=0.1 * i, y=0.2, z=-0.3),
            zeros,
            vector(x=1.0, y=2.0, z=9.8),
            zeros,
        )

    def rc(i: int):
        return t["mavros_msgs/msg/RCOut"](header, np.array([1540, 1460, 1300, 1500], dtype=np.uint16))

    def state(i: int):
        return t["mavros_msgs/msg/State"](header, True, True, True, False, "AUTO", 4)

    topics = {
        "/mavros/imu/data": ("sensor_msgs/msg/Imu", imu),
        "/mavros/rc/out": ("mavros_msgs/msg/RCOut", rc),
        "/mavros/state": ("mavros_msgs/msg/State", state),
    }
    serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
    if version == 1:
        writer = Writer1(path)
    else:
        plugin = StoragePlugin.SQLITE3 if version == 2 else StoragePlugin.MCAP
        writer = Writer2(path, version=8, storage_plugin=plugin)
    with writer:
        connections = {n: writer.add_connection(n, kind, typestore=store) for n, (kind, _) in topics.items()}
        for i in range(n):
            for name, (kind, make) in topics.items():
                nanoseconds = ABSOLUTE_S * 10**9 + i * 100_000_000
                writer.write(connections[name], nanoseconds, serialize(make(i), kind))
    return path


def write_alfa(folder: Path, n: int = 60, stuck_from: int = 40) -> Path:
    """An ALFA folder; from sample `stuck_from` on the right aileron output stays at 1500 us."""
    folder.mkdir()
    start = ABSOLUTE_S * 10**9

    def put(topic: str, header: str, rows: list[str]) -> None:
        text = "\n".join([f"%time,{header}", *rows]) + "\n"
        (folder / f"{folder.name}-{topic}.csv").write_text(text)

    stamps = [start + i * 100_000_000 for i in range(n)]
    put(
        "mavros-nav_info-roll",
        "field.commanded,field.measured",
        [f"{t + 5},{i},{i // 4}" for i, t in enumerate(stamps)],
    )
    put("mavros-nav_info-pitch", "field.commanded,field.measured", [f"{t + 6},1.5,2.5" for t in stamps])
    put("mavros-nav_info-airspeed", "field.commanded,field.measured", [f"{t + 7},15.0,0.0" for t in stamps])
    axes = ",".join(f"field.angular_velocity.{a}" for a in "xyz")
    put("mavros-imu-data_raw", axes, [f"{t},0.1,0.2,0.3" for t in stamps])
    rows = []
    for i, t in enumerate(stamps):
        aileron = 1500 + (60 if i % 2 else -40)
        right = 1500 if i >= stuck_from else aileron
        rows.append(f"{t + 9},1500,1460,1300,1510,{aileron},{right},1500,1900")
    put("mavros-rc-out", ",".join(f"field.channels{k}" for k in range(8)), rows)
    put("mavros-state", "field.armed,field.mode", [f"{t + 11},1,GUIDED" for t in stamps])
    put("failure_status-aileron", "field.data", [f"{t},1" for t in stamps[stuck_from:]])
    return folder


# --- text and MATLAB ------------------------------------------------------------------------------------------


def paparazzi_bytes(n: int = 40) -> bytes:
    lines = []
    for i in range(n):
        t = 100.0 + 0.05 * i
        lines.append(f"{t:.4f} 52 IMU_GYRO {0.01 * i:.6f} -0.200000 0.300000")
        lines.append(f"{t:.4f} 52 ACTUATORS 1500,1486,1{500 if i < 30 else 416}")
        lines.append(f"{t:.4f} 52 COMMANDS 4800,0,{96 * i}")
        lines.append(f"{t:.4f} 52 ATTITUDE 0.1 1.5 0.05")
    lines.append("102.0000 52 PPRZ_MODE 2 3 3 2 0 21")
    lines.append("102.0000 52 SETTINGS 1.0 2.0")
    return ("\n".join(lines) + "\n").encode()


def csv_bytes(n: int = 40) -> bytes:
    lines = ["t_s,p,q [deg/s],phi_deg,command.elevator [rad],airspeed (km/h),truth.gain,comment"]
    lines += [f"{0.02 * i:.3f},{0.1 * i:.3f},90,180,0.25,36,{1 if i < 20 else 0.5},word" for i in range(n)]
    return ("\n".join(lines) + "\n").encode()


def write_mat(path: Path, n: int = 40) -> Path:
    from scipy.io import savemat

    t = 0.02 * np.arange(n)
    data = {"time": t, "p": 0.1 * t, "q": t, "r": t, "de": 0.01 + t, "dr": t, "da_l": t, "da_r": -t, "aoa": t}
    data |= {"mode": np.where(t < 0.4, 1, 2).astype(np.uint8), "motor_time": np.arange(3.0)}
    savemat(path, {"flight_data": data})
    return path


@pytest.fixture(scope="session")
def tiny() -> SimpleNamespace:
    """The makers above."""
    return SimpleNamespace(
        ulog=ulog_bytes,
        dataflash=dataflash_bytes,
        dataflash_text=dataflash_text,
        tlog=tlog_bytes,
        bag=write_bag,
        alfa=write_alfa,
        paparazzi=paparazzi_bytes,
        csv=csv_bytes,
        csv_gz=lambda: gzip.compress(csv_bytes(), mtime=0),
        mat=write_mat,
        start_unix_s=ABSOLUTE_S,
    )
