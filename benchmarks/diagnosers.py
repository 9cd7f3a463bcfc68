"""Parity and effectiveness over an hour of 100 Hz flight, and one online step compiled and in plain Python."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time

import numpy as np

from aerofdi.aircraft.identified import AxisModel, IdentifiedModel, SurfaceGroup
from aerofdi.core import Flight, Series, bind, step
from aerofdi.core import run as run_diagnoser
from aerofdi.diagnosers import effectiveness_setup, parity_setup
from aerofdi.parts.rate_filter import Disturbance

HOUR_S, RATE_HZ = 3600.0, 100.0


def model() -> IdentifiedModel:
    """Three axes, three groups, airspeed: as large as identified aircraft are."""
    groups = tuple(
        SurfaceGroup(s, (f"command.{s}",), (1.0,), "rad", -0.4, 0.4, 0.0, 0.05, True)
        for s in ("aileron", "elevator", "rudder")
    )
    names = ("p", "q", "r", "command.aileron", "command.elevator", "command.rudder", "trim")
    b = {"p": (40.0, 0.0, 2.0), "q": (0.0, -45.0, 0.0), "r": (2.0, 0.0, -20.0)}
    axes = []
    for i, r in enumerate("pqr"):
        rates = [0.1, 0.1, 0.1]
        rates[i] = -8.0
        order = (r, *(x for x in "pqr" if x != r), *names[3:])
        value = np.array([-8.0, 0.1, 0.1, *b[r], 0.2])
        noise = Disturbance(0.8, 2.0, 60.0, 0.1, 0.005)
        axes.append(AxisModel(r, order, value, 1e-4 * np.eye(7), noise, 0.03, 0.6, 0.5, 0.6))
    return IdentifiedModel(
        "bench", 0.02, 0.05, 0.04, 20.0, groups, tuple(axes), 300.0, {"airspeed": (15.0, 25.0)}, ()
    )


def flight() -> Flight:
    rng = np.random.default_rng(0)
    t = np.arange(0.0, HOUR_S, 1.0 / RATE_HZ)
    channels = {r: Series(t, 0.1 * rng.standard_normal(len(t)), "rad/s") for r in "pqr"}
    for s in ("aileron", "elevator", "rudder"):
        channels[f"command.{s}"] = Series(t, 0.05 * rng.standard_normal(len(t)), "rad")
    channels["airspeed"] = Series(t, 20.0 + 0.3 * rng.standard_normal(len(t)), "m/s")
    return Flight(channels)


def built():
    m = model()
    ages = dict.fromkeys(m.channels, 0.1)
    return parity_setup.from_identified(m, ages, (0.5, 0.5, 0.5)), effectiveness_setup.from_identified(
        m, ages
    )


def online_us() -> dict[str, float]:
    """Microseconds of one kernel step, in this process (compiled or not, as NUMBA_DISABLE_JIT says)."""
    from aerofdi.core.run import empty_verdict

    out = {}
    plain = os.environ.get("NUMBA_DISABLE_JIT", "0") == "1"
    for d in built():
        sample = bind(flight().between(0.0, 60.0), d.inputs, d.dt_s)
        state, buffers = d.init(d.params), empty_verdict(d, 1)
        times = []
        for k in range(len(sample.t_s)):
            t0 = time.perf_counter_ns()
            d.step_into(d.params, state, sample.z[k], sample.age[k], buffers, 0)
            times.append(time.perf_counter_ns() - t0)
        out[d.name] = statistics.median(times[len(times) // 2 :]) / 1e3
        if not plain:
            t0 = time.perf_counter()
            for k in range(500):
                state, _ = step(d, state, sample.z[k], sample.age[k])
            out[f"{d.name} pure step"] = (time.perf_counter() - t0) / 500 * 1e6
    return out


def run_hour() -> dict[str, float]:
    f = flight()
    times: dict[str, list[float]] = {"bind": [], "parity": [], "effectiveness": []}
    diagnosers = built()
    for d in diagnosers:
        run_diagnoser(d, bind(f.between(0.0, 5.0), d.inputs, d.dt_s))
    for _ in range(5):
        for d in diagnosers:
            t0 = time.perf_counter()
            sample = bind(f, d.inputs, d.dt_s)
            t1 = time.perf_counter()
            run_diagnoser(d, sample)
            times[d.name].append(time.perf_counter() - t1)
            times["bind"].append(t1 - t0)
    return {k: statistics.median(v) for k, v in times.items()} | {"samples": float(len(sample.t_s))}


def run() -> dict:
    """Medians of interleaved runs."""
    hour = run_hour()
    fast = online_us()
    code = "import json, benchmarks.diagnosers as b; print(json.dumps(b.online_us()))"
    env = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    text = subprocess.run(
        [sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True
    ).stdout
    plain = json.loads(text.splitlines()[-1])
    total = hour["parity"] + hour["effectiveness"] + 2 * hour["bind"]
    out = {
        "diagnosers_hour": {
            "ours": total,
            "unit": "s",
            "peers": {},
            "conditions": f"one hour of 100 Hz, both diagnosers with binding; {hour['samples']:.0f} samples at 0.02 s",
        }
    }
    for name in ("parity", "effectiveness"):
        ns = hour[name] / hour["samples"] * 1e9
        out[f"{name}_offline"] = {
            "ours": ns, "unit": "ns/sample", "peers": {}, "conditions": "compiled loop, three axes, three groups"
        }  # fmt: skip
        out[f"{name}_online"] = {
            "ours": fast[name],
            "unit": "us/step",
            "peers": {
                "plain Python": {"value": plain[name], "ratio": plain[name] / fast[name]},
                "pure step (copies)": {
                    "value": fast[f"{name} pure step"], "ratio": fast[f"{name} pure step"] / fast[name]
                },
            },
            "conditions": "one kernel call from Python, argument unpacking included",
        }  # fmt: skip
    return out
