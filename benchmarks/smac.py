"""SMAC: the whole method, its filter with the detector, the same without a compiler, and the banks it
replaces.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time

import numpy as np

from aerofdi.core import bind, copy_state, empty_verdict
from aerofdi.diagnosers import smac as online
from aerofdi.papers.smac import banks
from aerofdi.papers.smac.flights import flown
from aerofdi.papers.smac.methods import diagnoser
from aerofdi.parts.ops import lean

REPEATS = 15
PLAIN = """
import time, numpy as np
from aerofdi.core import empty_verdict
from aerofdi.papers.smac.methods import diagnoser
d = diagnoser("together")
random = np.random.default_rng(1)
n, nz = 1500, len(d.inputs.names)
z = 0.002 * random.standard_normal((n, nz))
level = {"airspeed": 30.0, "altitude": 200.0, "alpha": 0.0882, "theta": 0.0882}
level |= {"command.elevator_left": -0.02355, "command.elevator_right": -0.02355}
for j, name in enumerate(d.inputs.names):
    z[:, j] = 0.0 if name.startswith(("excitation", "event")) else z[:, j] + level.get(name, 0.0)
age, out, state, took = np.zeros(nz), empty_verdict(d, n), d.init(d.params), []
for k in range(n):
    began = time.perf_counter()
    d.step_into(d.params, state, z[k], age, out, k)
    took.append(time.perf_counter() - began)
assert (out.status[500:] == 0).all() and not out.detected.any()
print(1e6 * float(np.median(took[500:])))
"""


@lean
def filter_and_detector(params, state, z):
    """The part that runs all the time: filter, residuals, Gamma2."""
    for k in range(len(z)):
        online.follow_wind(params, state, z[k])
        online.residuals(params, state, z[k])
        online.detect(params.detector, state)


def _micro(once) -> float:
    began = time.perf_counter()
    steps = once()
    return (time.perf_counter() - began) / steps * 1e6


def _plain_us() -> float:
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", PLAIN], env=env, check=True, capture_output=True, text=True)
    return float(done.stdout)


def run() -> dict:
    """Medians of interleaved runs over the still-air flight of the paper (300 s at 50 Hz)."""
    flight = flown("ordered").flight
    jobs = {}
    for name, d, f in (
        ("smac", diagnoser("ordered"), flight),
        ("lateral bank", banks.diagnoser("lateral"), banks.with_sums(flight)),
        ("extended bank", banks.diagnoser("extended"), banks.with_sums(flight)),
    ):
        s = bind(f, d.inputs, d.dt_s, who=d.name)
        jobs[name] = (d, np.ascontiguousarray(s.z), np.ascontiguousarray(s.age))

    def whole(name):
        d, z, age = jobs[name]
        state, out = copy_state(d.init(d.params)), empty_verdict(d, len(z))

        def once():
            d.run_into(d.params, state, z, age, out)
            return len(z)

        return once

    def part():
        d, z, _ = jobs["smac"]
        state = d.init(d.params)

        def once():
            filter_and_detector(d.params, state, z)
            return len(z)

        return once

    times = {name: [] for name in (*jobs, "filter")}
    for k in range(REPEATS + 1):
        for name, found in times.items():
            us = _micro(part() if name == "filter" else whole(name))
            if k:
                found.append(us)
    us = {name: statistics.median(found) for name, found in times.items()}
    peers = {n: {"value": us[n], "ratio": us[n] / us["smac"]} for n in ("lateral bank", "extended bank")}
    conditions = f"300 s at 50 Hz, five failures, medians of {REPEATS} interleaved runs"
    return {
        "smac_step": {"ours": us["smac"], "unit": "us a step", "peers": peers, "conditions": conditions},
        "smac_filter_and_detector": {"ours": us["filter"], "unit": "us a step", "peers": {}, "conditions": conditions},
        "smac_plain_python": {
            "ours": _plain_us(), "unit": "us a step", "peers": {}, "conditions": "no compiler, healthy, median step",
        },
    }  # fmt: skip
