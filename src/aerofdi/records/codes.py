"""Code tables of autopilots: numbers in logs -> names. Facts of the MAVLink and PX4 message definitions."""

from __future__ import annotations

ARDUPLANE_MODE = {
    0: "MANUAL",
    1: "CIRCLE",
    2: "STABILIZE",
    3: "TRAINING",
    4: "ACRO",
    5: "FBWA",
    6: "FBWB",
    7: "CRUISE",
    8: "AUTOTUNE",
    10: "AUTO",
    11: "RTL",
    12: "LOITER",
    13: "TAKEOFF",
    14: "AVOID_ADSB",
    15: "GUIDED",
    16: "INITIALISING",
    17: "QSTABILIZE",
    18: "QHOVER",
    19: "QLOITER",
    20: "QLAND",
    21: "QRTL",
    22: "QAUTOTUNE",
    23: "QACRO",
    24: "THERMAL",
    25: "LOITER_ALT_QLAND",
    26: "AUTOLAND",
}

PX4_NAV_STATE = {
    0: "MANUAL",
    1: "ALTCTL",
    2: "POSCTL",
    3: "AUTO_MISSION",
    4: "AUTO_LOITER",
    5: "AUTO_RTL",
    6: "POSITION_SLOW",
    8: "ALTITUDE_CRUISE",
    10: "ACRO",
    12: "DESCEND",
    13: "TERMINATION",
    14: "OFFBOARD",
    15: "STAB",
    17: "AUTO_TAKEOFF",
    18: "AUTO_LAND",
    19: "AUTO_FOLLOW_TARGET",
    20: "AUTO_PRECLAND",
    21: "ORBIT",
    22: "AUTO_VTOL_TAKEOFF",
}

PPRZ_MODE = {0: "MANUAL", 1: "AUTO1", 2: "AUTO2", 3: "HOME", 4: "NOGPS", 5: "FAILSAFE"}

CODE_TABLES: dict[str, dict[int, str]] = {
    "arduplane_mode": ARDUPLANE_MODE,
    "px4_nav_state": PX4_NAV_STATE,
    "paparazzi_mode": PPRZ_MODE,
    "armed": {0: "disarmed", 1: "armed"},
    "airborne": {0: "on ground", 1: "airborne"},
}
