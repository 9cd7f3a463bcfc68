"""Time a step of methods A to D on the Vireo, method C next to the same filter bank in filterpy.

    python -m benchmarks vireo [--json]

One 60 s flight with a stuck elevon, 92 Hz; the loop over all samples, buffers made before, in turns with the peer. The
peer runs the same matrices (textbook rule; all filters padded to one size, as it needs) and its own probabilities.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from aerofdi.core import Diagnoser, Flight, Sample, bind, copy_state, empty_verdict
from aerofdi.diagnosers import mmae
from aerofdi.papers.vireo_comparison import flights, joint, methods
from aerofdi.parts.servo import servo_step
from aerofdi.simulate import fly

HEALTHY_S, FAULT_S = 45.0, 15.0
DEG = methods.DEG


def flight(healthy_s: float = HEALTHY_S) -> Flight:
    """The track of the paper, the right elevon stuck 5 deg below trim after so long."""
    base = flights.scenario("FLT32")
    fault = base.faults[0]._replace(start_s=healthy_s, end_s=float("inf"))
    return fly(replace(base, faults=(fault,), duration_s=healthy_s + FAULT_S))


def ours(d: Diagnoser, sample: Sample) -> Callable[[], None]:
    """The compiled loop over the whole sample."""
    fresh, out = d.init(d.params), empty_verdict(d, len(sample.z))

    def run() -> None:
        d.run_into(d.params, copy_state(fresh), sample.z, sample.age, out)

    run()
    return run


def bank() -> Any:
    """filterpy's bank of the same three filters."""
    from filterpy.kalman import KalmanFilter, MMAEFilterBank

    p = methods.method_c_design(rule=mmae.TEXTBOOK).params
    measured = np.flatnonzero(p["measured"])
    n = p["A"].shape[1]
    filters = []
    for i in range(3):
        f = KalmanFilter(dim_x=n, dim_z=2, dim_u=2)
        f.F, f.B, f.H = p["A"][i], p["B"][i], p["H"][i][measured]
        f.R = np.eye(2) * (0.2 * DEG) ** 2
        f.Q = np.zeros((n, n))
        f.Q[:4, :4] = np.diag([0.7**2] + [(2 * DEG) ** 2] * 3)
        f.Q[-1, -1] = 1e-6 if i else 0.0
        f.P = np.eye(n) * 1e-3
        filters.append(f)
    return MMAEFilterBank(filters, [0.98, 0.01, 0.01], n)


def peer(sample: Sample) -> np.ndarray:
    """Its probabilities (n, 3); the actuator models are ours."""
    b, servos = bank(), methods.servos()
    x = np.array([[u, 0.0] for u in sample.z[0, 3:5]])
    out = np.empty((len(sample.z), 3))
    for k, z in enumerate(sample.z):
        b.predict(x[:, :1])
        b.update(z[1:3].reshape(2, 1))
        out[k] = b.p
        for a in range(2):
            x[a] = servo_step(servos[a], x[a, 0], x[a, 1], z[3 + a])
    return out


def recovers(healthy_s: float) -> tuple[bool, bool]:
    """Whether (ours, peer) name the right elevon at the end of a fault that comes after so long a healthy flight."""
    d = methods.method_c(rule=mmae.TEXTBOOK)
    sample = bind(flight(healthy_s), d.inputs, d.dt_s)
    out = empty_verdict(d, len(sample.z))
    d.run_into(d.params, d.init(d.params), sample.z, sample.age, out)
    return bool(out.score[-1, 2] > 0.5), bool(peer(sample)[-1, 2] > 0.5)


def run(rounds: int = 5) -> dict[str, Any]:
    """{method: {ours, unit, peers, conditions}} in microseconds a step."""
    f = flight()
    made = {
        "A": methods.method_a(), "B": methods.method_b(), "C": methods.method_c(),
        "C textbook rule": methods.method_c(rule=mmae.TEXTBOOK), "D": joint.method_d(),
    }  # fmt: skip
    samples = {k: bind(f, d.inputs, d.dt_s) for k, d in made.items()}
    loops = {k: ours(d, samples[k]) for k, d in made.items()}
    taken: dict[str, list[float]] = {k: [] for k in (*loops, "filterpy")}
    n = len(samples["C"].z)
    for _ in range(rounds):
        for k, loop in (*loops.items(), ("filterpy", lambda: peer(samples["C"]))):
            began = time.perf_counter()
            loop()
            taken[k].append((time.perf_counter() - began) / n * 1e6)
    median = {k: statistics.median(v) for k, v in taken.items()}
    after = {s: recovers(s) for s in (5.0, 20.0, 60.0)}
    said = "; ".join(f"after {s:g} s healthy: ours {a}, filterpy {b}" for s, (a, b) in after.items())
    out: dict[str, Any] = {}
    for k in loops:
        peers = {"filterpy": {"value": median["filterpy"], "ratio": median["filterpy"] / median[k]}}
        note = f"; names the elevon {said}" if k == "C textbook rule" else ""
        out[f"vireo method {k}"] = {
            "ours": median[k],
            "unit": "us a step",
            "peers": peers if k.startswith("C") else {},
            "conditions": f"{n} samples at 92 Hz, median of {rounds} interleaved runs, one thread{note}",
        }
    return out
