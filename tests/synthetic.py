"""A known aircraft flown in closed loop through gusts, so that a fit or a verdict can be checked against the truth."""

from __future__ import annotations

import math

import numpy as np

from aerofdi.core import Flight, Series
from aerofdi.parts.lti import held_noise, hold

DT = 0.02
A = {"p": -9.0, "q": -7.0}
B = {"p": (40.0, 0.0), "q": (0.0, -45.0)}
TRIM = {"p": 0.6, "q": -1.5}
GUST = {"p": (0.8, 2.0), "q": (0.8, 0.9)}
NOISE = 0.004
DELAY_S = 0.06


def fly(duration_s=120.0, seed=0, gain=None, stuck=None, start_s=math.inf, gust=1.0, speed=None, lively=1.0):
    """Aileron and elevator aircraft with an attitude-like random reference and rate feedback.

    gain: {surface: g}; stuck: {surface: position in rad}; both from start_s on. gust scales the gusts, lively the
    reference. speed: airspeed over its mean as a function of time; where given, an airspeed channel is recorded.
    """
    rng = np.random.default_rng(seed)
    n = round(duration_s / DT)
    rates, command = {r: np.zeros(n) for r in A}, np.zeros((n, 2))
    state = {r: np.zeros(2) for r in A}
    plant = {r: _plant(r, gust) for r in A}
    queue = [np.zeros(2)] * (round(DELAY_S / DT) + 1)
    reference = np.zeros(2)
    t = DT * np.arange(n)
    for k in range(n):
        v = speed(t[k]) if speed else 1.0
        if k % 75 == 0:
            reference = lively * rng.normal(0.0, (0.7, 0.4))
        for r in A:
            rates[r][k] = state[r][0] + NOISE * rng.standard_normal()
        want = np.array([0.10 * (reference[0] - rates["p"][k]), -0.08 * (reference[1] - rates["q"][k])])
        command[k] = np.clip(want + np.array([-0.015, -0.033]), -0.4, 0.4)
        queue = [*queue[1:], command[k]]
        true = queue[0].copy()
        if t[k] >= start_s:
            for i, surface in enumerate(("aileron", "elevator")):
                if gain and surface in gain:
                    true[i] *= gain[surface]
                if stuck and surface in stuck:
                    true[i] = stuck[surface]
        for r in A:
            ad, bd, root = plant[r]
            u = v * v * (B[r][0] * true[0] + B[r][1] * true[1] + TRIM[r]) + (v - 1.0) * A[r] * state[r][0]
            state[r] = ad @ state[r] + bd * u + root @ rng.standard_normal(2)
    channels = {r: Series(t, rates[r], "rad/s") for r in A}
    channels |= {
        f"command.{s}": Series(t, command[:, i], "rad") for i, s in enumerate(("aileron", "elevator"))
    }
    if speed:
        v = 20.0 * np.array([speed(x) for x in t]) + 0.3 * rng.standard_normal(n)
        channels["airspeed"] = Series(t, v, "m/s")
    return Flight(channels, meta={"source": f"synthetic {seed}", "aircraft": "synthetic"})


def _plant(r, gust):
    t_d, s_d = GUST[r][0], GUST[r][1] * gust
    f = np.array([[A[r], 1.0], [0.0, -1.0 / t_d]])
    ad, bd = hold(f, np.array([[1.0], [0.0]]), DT)
    q = held_noise(f, np.diag([0.0, 2.0 * s_d**2 / t_d]), DT)
    return ad, bd[:, 0], np.linalg.cholesky(q + 1e-16 * np.eye(2))
