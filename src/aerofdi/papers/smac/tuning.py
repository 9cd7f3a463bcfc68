"""The tuning rules (10), (12), (13), (18)-(20) with the paper's numbers, on the aircraft of Table A1."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...aircraft import load_aircraft
from ...design import smac_tuning as tune
from ...design.smac import PAPER, aircraft_rate_model, commanded_surfaces
from ...dynamics.trim import trim
from ..claims import Findings, Ours
from .bound import best_possible
from .methods import AIRCRAFT, design

LARGEST_DEG = 25.0


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Residuals that faults leave, what the printed thresholds ask for, and what the sensors can show at all."""
    progress("tuning rules", 0.5)
    aircraft = load_aircraft(AIRCRAFT)
    condition, surfaces = trim(aircraft), commanded_surfaces(aircraft)
    model = aircraft_rate_model(aircraft, condition, surfaces, PAPER)
    per_degree = np.abs(tune.residual_response(model, condition.airspeed).real) * math.radians(1.0)
    stiff = tune.stiffness(model, condition.airspeed)
    axis = {"p": (0, 0, PAPER.axis[0]), "q": (1, 2, PAPER.axis[1]), "r": (2, 4, PAPER.axis[2])}  # type: ignore[index]
    needed = {name: threshold / per_degree[a, i] for name, (a, i, threshold) in axis.items()}
    amplitude = math.radians(PAPER.amplitude_deg)
    noise = {k: v["noise_rad_s"] for k, v in design("ordered").certificate["axes"].items()}
    table = {
        "L_minus_a_1_per_s": dict(zip("pqr", stiff.tolist(), strict=True)),
        "residual_rad_s_per_deg": {
            "aileron": per_degree[0, 0],
            "elevator": per_degree[1, 2],
            "rudder": per_degree[2, 4],
        },
        "residual_noise_rad_s": noise,
        "deviation_deg_at_printed_thresholds": needed,
        "smallest_stuck_angle_deg": {
            k: v["smallest_stuck_angle_deg"] for k, v in design("ordered").certificate["surfaces"].items()
        },
    }
    ours = {
        "stable": Ours(float((stiff > 0).all())),
        "lambda_max": Ours(tune.lambda_max(amplitude)),
        "p_threshold": Ours(float(needed["p"] < 2.0)),
        "q_threshold": Ours(float(needed["q"] < LARGEST_DEG)),
        "r_threshold": Ours(float(needed["r"] < LARGEST_DEG)),
    }
    return Findings(ours, {"tuning": table, "best_within_1_s": best_possible()})
