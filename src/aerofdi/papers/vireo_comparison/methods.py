"""Methods A, B and C of the paper, with its own numbers; each function takes the aircraft's name.

Units. The paper states SI for its matrices and none for (13), (14). Its 0.08 and 0.04 make sense in radians
only: a roll rate residual of sqrt(0.08) rad/s = 16 deg/s opens the gate, and an evidence of 0.04 RES a sample
at 92 Hz turns 0.98 against 0.01 over in seconds, as its figures show; in degrees the gate would be open on
noise (0.28 deg/s) and one sample would decide. Likewise W = diag(1, 0, 36) weighs a roll angle of 1 rad like
a roll rate of 6 rad/s.

Delay of p. The models' p runs four samples ahead of the delayed r and phi; the paper holds its prediction back by one
step, here one sample beyond the one the prediction itself looks ahead. None or four samples instead change the median
detection time by 0.04 s and nothing else (table `variants`).
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

from ...aircraft import load_aircraft
from ...core import Array, Design, Diagnoser
from ...design.io import load_design
from ...design.mmae import Tuning, design_mmae
from ...design.mmae_aircraft import servo_of
from ...diagnosers import lpv_observer, mmae, parity

DEG = math.pi / 180.0
DT_S = 1.0 / 92.0
PAIR = ("elevon_left", "elevon_right")
# (16): x = [v, p, r, phi], input the aileron, and (17): the same with separate elevons.
A_LAT = np.array(
    [
        [-0.574, 1.12, -15.3, 9.78],
        [-3.99, -11.3, 2.5, 0.0],
        [0.311, -1.49, -0.944, 0.0],
        [0.0, 1.0, 0.0683, 0.0],
    ]
)
B_LAT = np.array([[-0.49], [-201.0], [-9.61], [0.0]])
STATES = ("v", "p", "r", "phi")
CHOSEN = "stuck_lpv"
# Method B judges to this far (m/s) outside the airspeeds of its design, held at the edge: what an airspeed sensor is
# good to. Slower than that (an elevon stuck far up does it) the aircraft is below the stall speed and B says so.
SPEED_MARGIN = 0.5
MIX = np.array([[-0.5, 0.5]])
# Section 3.3.2; the probabilities' lower limit is its "lower limits are set as 0.01".
PAPER_TUNING = Tuning(
    state_std={"v": 0.7, "p": 2 * DEG, "r": 2 * DEG, "phi": 2 * DEG},
    measured={"r": 0.2 * DEG, "phi": 0.2 * DEG},
    weight={"p": 1.0, "r": 0.0, "phi": 36.0},
    stuck_std=1e-3,
    delay=4,
    compare_delay=1,
    low_pass=5.0,
    gain=0.04,
    threshold=0.08,
    quorum=2,
    prior=0.98,
    floor=0.01,
)


def servos(aircraft: str = "vireo", dt_s: float = DT_S) -> Array:
    """(2, 8): the elevons' actuator models, limits and rates included."""
    table = [load_aircraft(aircraft).surface(name) for name in PAIR]
    return np.array([servo_of(s, dt_s) for s in table])


def method_a(
    aircraft: str = "vireo", *, threshold: float = 12.5 * DEG, bandwidth: float = 2.0, dt_s: float = DT_S
) -> Diagnoser:
    """Roll rate predicted from the aileron command against the measured one, section 3.1."""
    delay = load_aircraft(aircraft).surface(PAIR[0]).delay
    commands = [f"command.{s}" for s in PAIR]
    return parity.from_linear(
        A_LAT, B_LAT, np.array([[0.0, 1.0, 0.0, 0.0]]), dt_s=dt_s, commands=commands,
        servo=servos(aircraft, dt_s), delay_s=delay, mix=MIX, outputs=["p"], threshold=[threshold],
        bandwidth=bandwidth, max_age_s=dict.fromkeys(["p", *commands], 0.2), name="method_a",
    )  # fmt: skip


@cache
def filters(name: str) -> Design:
    """A saved design of method B, by the name of its file in `designs`."""
    return load_design(Path(__file__).parent / "designs" / f"{name}.toml")


def method_b(
    aircraft: str = "vireo",
    *,
    design: str = CHOSEN,
    threshold: float = 5 * DEG,
    bandwidth: float = 10.0,
    speed_bandwidth: float = 1.0,
    trim_shift: float = 0.0,
    name: str = "method_b",
) -> Diagnoser:
    """Elevons estimated by two robust LPV filters against their actuator models, section 3.2.

    design: a file of `designs`; default the robust LPV filters with the fault as an input of their synthesis, chosen by
    stuck faults over the airspeeds (see there). "robust_lpv" has the paper's own weights and nothing else.
    trim_shift: rad, added to the trimmed elevator of the design, for an aircraft that trims elsewhere.
    """
    delay = load_aircraft(aircraft).surface(PAIR[0]).delay
    made = filters(design)
    made = made._replace(params=made.params | {"trim.elevator": made.params["trim.elevator"] + trim_shift})
    return lpv_observer.from_design(
        made, PAIR, servos(aircraft), delay, DT_S, group="elevon", threshold=threshold,
        low_pass=bandwidth, speed_bandwidth=speed_bandwidth, speed_margin=SPEED_MARGIN, name=name,
    )  # fmt: skip


def method_c_design(aircraft: str = "vireo", dt_s: float = DT_S, **change: object) -> Design:
    """The filter bank of section 3.3; `change` replaces fields of PAPER_TUNING."""
    tuning = PAPER_TUNING._replace(**change)  # type: ignore[arg-type]
    return design_mmae(
        A_LAT, B_LAT @ MIX, STATES, PAIR, PAIR, servos(aircraft, dt_s), dt_s, tuning, group="elevon"
    )


def method_c(aircraft: str = "vireo", *, name: str = "method_c", **change: object) -> Diagnoser:
    """Three Kalman filters and their probabilities, section 3.3."""
    return mmae.from_design(method_c_design(aircraft, **change), name)  # type: ignore[arg-type]
