"""The most that any detector could see of the paper's faults within a second, with the sensors of its Table 1.

In still air, with the exact linear model and a known time of onset, no test is better than the likelihood
ratio of the innovations of a Kalman filter. Its signal-to-noise ratio after n samples is

    SNR^2 = sum over k of nu(k)' S^-1 nu(k)

with nu the innovations that the fault alone leaves and S their covariance. At a false-alarm probability
alpha for each decision it detects with probability Phi(SNR - z), z the upper alpha point of the normal
distribution. Here alpha is one false alarm an hour at one decision a second. The deviation of the surface
from its command comes from the noise-free closed loop, so a command that runs away from a stuck surface
counts.

three states    any filter of p, q, r that takes alpha and beta from the vanes, as the paper's does: their
                noise moves the predicted rates
whole model     any filter at all, with every rigid-body state
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...aircraft import load_aircraft
from ...core import Array, Flight
from ...design.smac import commanded_surfaces
from ...dynamics.linearise import linearise
from ...dynamics.trim import trim
from ...simulate import fly
from .flights import scenario
from .methods import AIRCRAFT

DT_S = 0.02
TABLE_1 = {"p": 0.08, "q": 0.08, "r": 0.08, "airspeed": 5.0, "alpha": 0.049, "beta": 0.049}
RATES = ("p", "q", "r")
STATES = ("u", "w", "q", "theta", "v", "p", "r", "phi")
WITHIN_S = 1.0
FALSE_ALARM = 1.0 / 3600.0  # a decision


def deviation(flight: Flight, surface: str, start_s: float) -> Array:
    """What the surface lacks of its command in the samples of the first second, rad."""
    t = start_s + DT_S * np.arange(round(WITHIN_S / DT_S))

    def at(series: Any) -> Array:
        return np.asarray(np.interp(t + 0.5 * DT_S, series.t_s, series.value))

    return at(flight.truth[f"surface.{surface}"]) - at(flight.measured[f"command.{surface}"])


def innovations_snr(A: Array, B: Array, C: Array, Q: Array, R: Array, deviation: Array) -> float:
    """SNR after all samples of a deviation (n,) at the first input of x' = A x + B u, y = C x + noise of covariance
    R a sample; Q: variance a sample of white noise at the other inputs.
    """
    from scipy.linalg import expm, solve_discrete_are

    n, nu = B.shape
    phi = expm(np.block([[A, B], [np.zeros((nu, n + nu))]]) * DT_S)
    F, G, W = phi[:n, :n], phi[:n, n], phi[:n, n + 1 :]
    # The identity keeps the equation solvable where only the sensors are noisy, far below what matters.
    P = solve_discrete_are(F.T, C.T, W @ Q @ W.T + 1e-12 * np.eye(n), R)
    S = C @ P @ C.T + R
    K = F @ P @ C.T @ np.linalg.inv(S)
    x, total = np.zeros(n), 0.0
    for d in deviation:
        left = C @ x
        total += float(left @ np.linalg.solve(S, left))
        x = F @ x + G * d - K @ left
    return math.sqrt(total)


def best_possible() -> dict[str, dict[str, float]]:
    """Per surface of the sequence: SNR within a second and the share of flights in which the best test notices it."""
    from scipy.stats import norm

    aircraft = load_aircraft(AIRCRAFT)
    model = linearise(
        aircraft, trim(aircraft), states=STATES, inputs=commanded_surfaces(aircraft), outputs=tuple(TABLE_1)
    )
    rates = [model.states.index(s) for s in RATES]
    # A change of alpha or beta at constant airspeed, in body velocities.
    V, alpha = model.trim.airspeed, model.trim.alpha
    turn = np.zeros((len(STATES), 2))
    turn[model.states.index("u"), 0], turn[model.states.index("w"), 0] = (
        -V * math.sin(alpha),
        V * math.cos(alpha),
    )
    turn[model.states.index("v"), 1] = V
    vanes = (model.A @ turn)[rates]
    noise = np.square(list(TABLE_1.values()))
    flight = fly(replace(scenario(0.0), noise_factor=0.0))
    out = {}
    for f in flight.meta["faults"]:
        b = model.B[:, [model.inputs.index(f["target"])]]
        gap = deviation(flight, f["target"], f["start_s"])
        snr = {
            "three_states": innovations_snr(
                model.A[np.ix_(rates, rates)], np.hstack([b[rates], vanes]), np.eye(3),
                np.diag(noise[4:]), np.diag(noise[:3]), gap,
            ),
            "whole_model": innovations_snr(model.A, b, model.C, np.zeros((0, 0)), np.diag(noise), gap),
        }  # fmt: skip
        out[f["target"]] = {f"snr_{k}": v for k, v in snr.items()} | {
            f"noticed_{k}": float(norm.cdf(v - norm.isf(FALSE_ALARM))) for k, v in snr.items()
        }
    return out
