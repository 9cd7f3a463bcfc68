"""State counts and measured time a step; method C at half the rate."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ...core import Diagnoser, bind, copy_state, empty_verdict
from ...diagnosers import lpv_observer, mmae
from ..claims import Findings, Ours
from . import methods
from .flights import METHODS, NAMES, flown, judge, judged

HALF_S = 2.0 * methods.DT_S


def step_time_us(d: Diagnoser, repeats: int = 7) -> float:
    """Median time of one step over FLT32, microseconds: the compiled loop, buffers made before, best of `repeats`."""
    sample = bind(flown("FLT32"), d.inputs, d.dt_s)
    z, age = np.ascontiguousarray(sample.z), np.ascontiguousarray(sample.age)
    fresh, out = d.init(d.params), empty_verdict(d, len(z))
    times = []
    for _ in range(repeats + 1):
        state = copy_state(fresh)
        began = time.perf_counter()
        d.run_into(d.params, state, z, age, out)
        times.append((time.perf_counter() - began) / len(z) * 1e6)
    return min(times[1:])


def find(quick: bool, progress: Callable[[str, float], None]) -> Findings:
    """Counts as the paper counts them (low passes apart), times measured here."""
    progress("counting states and timing steps", 0.0)
    a, b = methods.method_a(), methods.method_b(design="robust_lpv")
    full = methods.method_c_design()
    half = methods.method_c_design(dt_s=HALF_S, delay=2)
    counts = {
        "A": {"model": len(a.params.a), "actuator": 2, "total": len(a.params.a) + 2},
        "B": lpv_observer.state_count(b),
        "B, fault as input": lpv_observer.state_count(methods.method_b()),
        "C": mmae.state_count(full),
        "C at 46 Hz": mmae.state_count(half),
    }
    times = {m: step_time_us(make()) for m, make in METHODS.items()}
    slow = mmae.from_design(half, "method_c_46Hz")
    both = [
        (x, y)
        for n in NAMES
        for x, y in zip(judged(n, "C").score.detections, judge(flown(n), slow).score.detections, strict=True)
        if not x.missed
    ]
    share = float(np.mean([not y.missed for _, y in both]))
    ours = {
        "states_A": Ours(counts["A"]["total"]),
        "states_B": Ours(counts["B"]["total"]),
        "states_C": Ours(counts["C"]["total"]),
        "states_C_46Hz": Ours(counts["C at 46 Hz"]["total"]),
        "runtime_order": Ours(float(times["A"] < times["B"] < times["C"]), reason=str(times)),
        "downsampled_C": Ours(share),
    }
    progress("states done", 1.0)
    rows = [{"method": k} | v for k, v in counts.items()]
    return Findings(ours, {"states": rows, "step_time_us": {m: round(t, 3) for m, t in times.items()}})
