"""Method D, not in the paper: one bank for roll, yaw and pitch together, judged by likelihood.

Method C sees only the difference of the elevons, so with an elevator that stands still a left and a right stuck elevon
look the same to it. Here the same three hypotheses are filtered with (15) and (16) joined, gyros and bank measured:

    x = [v, p, r, phi, q, w, v_g, w_g, l, m, n]     v_g, w_g gusts seen as air velocity (first-order, scale lengths of
                                                    Dryden at 100 m), l, m, n slow angular accelerations (trim, drift)

and the textbook rule (4)-(7) with a floor: log p_i falls no lower than log(floor), which makes it a cumulative-sum test
of log(1/floor) nats. The delay stands before the actuators, where it is, not behind the aircraft.

Chosen, not fitted to faults: sensor noise as in the aircraft file; gusts 0.7 and 0.5 m/s; slow accelerations
1.5 rad/s^2 over 10 s; what is left of the model's error 0.2 rad/s^2 per square root of Hz. Calibrated: the
floor, by `calibrate` on healthy flights only, with CALIBRATION_SEEDS, which none of its results uses.

Its stuck position follows slowly and its standard deviation leaves out the error of the pitch trim (1 to 5 deg after a
few seconds of fault): for the angle, ask method C.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core import Array, Design, Diagnoser, bind, run
from ...design.mmae import Tuning, design_mmae
from ...diagnosers import mmae
from .methods import A_LAT, B_LAT, DEG, DT_S, MIX, PAIR, servos

STATES = ("v", "p", "r", "phi", "q", "w", "gust_v", "gust_w", "roll", "pitch", "yaw")
A_LON = np.array([[-5.487, -12.86], [13.85, -5.688]])
B_LON = np.array([[-185.7], [-24.52]])
SPEED, TRIM = 15.4, -3.575 * DEG
LENGTH_V, LENGTH_W, SLOW_S = 100.0, 50.0, 10.0
GUST_V, GUST_W, SLOW, ERROR = 0.7, 0.5, 1.5, 0.2
# 27.6 nats; the largest healthy excursion of `calibrate` is 16.4: 1.5 times it, and 3 nats.
FLOOR = 1e-12


# FLT32 and FLT33 fly with seeds 32 and 33.
CALIBRATION_SEEDS = tuple(s for s in range(1, 43) if s not in (32, 33))


def matrices() -> tuple[Array, Array]:
    """Continuous (A, B) of STATES; inputs: left and right elevon."""
    A, B = np.zeros((11, 11)), np.zeros((11, 2))
    A[:4, :4], A[4:6, 4:6] = A_LAT, A_LON
    # Forces see the velocity through the air: v - v_g, w - w_g.
    A[:3, 6], A[4:6, 7] = -A_LAT[:3, 0], -A_LON[:, 1]
    A[6, 6], A[7, 7] = -SPEED / LENGTH_V, -SPEED / LENGTH_W
    A[1, 8] = A[4, 9] = A[2, 10] = 1.0
    A[8, 8] = A[9, 9] = A[10, 10] = -1.0 / SLOW_S
    B[:4], B[4:6] = B_LAT @ MIX, B_LON @ np.array([[0.5, 0.5]])
    return A, B


def tuning(floor: float = FLOOR, noise: float = 0.5 * DEG) -> Tuning:
    """Standard deviations per sample from densities: sigma sqrt(2 / tau) sqrt(dt) for a first-order process."""
    root = math.sqrt(DT_S)
    slow = SLOW * math.sqrt(2.0 / SLOW_S) * root
    std = {
        "v": 0.05 * root, "p": ERROR * root, "r": 0.3 * ERROR * root, "phi": 0.02 * root, "q": ERROR * root,
        "w": 0.1 * root, "gust_v": GUST_V * math.sqrt(2.0 * SPEED / LENGTH_V) * root,
        "gust_w": GUST_W * math.sqrt(2.0 * SPEED / LENGTH_W) * root, "roll": slow, "pitch": slow, "yaw": 0.1 * slow,
    }  # fmt: skip
    measured = dict.fromkeys(("p", "r", "phi", "q"), noise)
    return Tuning(
        std, measured, {"p": 1.0}, stuck_std=0.05 * DEG * root, command_delay=0.05 / DT_S, rule=mmae.TEXTBOOK,
        floor=floor, prior=1.0 - 3.0 * floor,
    )  # fmt: skip


def design(aircraft: str = "vireo", floor: float = FLOOR) -> Design:
    """The bank; 11 states and a stuck elevon for each of the two faults."""
    A, B = matrices()
    return design_mmae(
        A, B, STATES, PAIR, PAIR, servos(aircraft), DT_S, tuning(floor), trim=(TRIM, TRIM), group="elevon"
    )


def method_d(aircraft: str = "vireo") -> Diagnoser:
    """Method D online."""
    return mmae.from_design(design(aircraft), "method_d")


def calibrate(
    seeds: Iterable[int] = CALIBRATION_SEEDS, progress: Callable[[str, float], None] | None = None
) -> float:
    """Largest excursion of log p_i above its floor in healthy flight, nats: 300 s a seed, wind as in the campaign.

    The floor is then exp(-(1.5 excursion + 3)): half as far again as healthy flight ever went, and a little more.
    """
    from ...evaluate.campaign import load_campaign
    from ...evaluate.draws import apply
    from ...scenarios import load_scenario
    from ...simulate import fly

    here = Path(__file__).parent
    draw, track = load_campaign(here / "monte_carlo.toml").draw, load_scenario(here / "track.toml")
    lowest = -80.0
    d = method_d()
    settings = d.params.settings.copy()
    settings[mmae.FLOOR] = lowest
    d = d._replace(params=d.params._replace(settings=settings, prior=np.array([0.0, lowest, lowest])))
    largest, seeds = 0.0, list(seeds)
    for k, seed in enumerate(seeds):
        healthy = replace(apply(draw, track, seed), faults=(), duration_s=300.0)
        sample = bind(fly(healthy, seed=seed), d.inputs, d.dt_s)
        p = run(d, sample)[1].score[sample.t_s > 2.0 * d.settle_s, 1:]
        largest = max(largest, float(np.log(p.max())) - lowest)
        if progress:
            progress(f"healthy flight {k + 1} of {len(seeds)}: {largest:.1f} nats", (k + 1) / len(seeds))
    return largest
