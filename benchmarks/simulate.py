"""The simulator: time per closed-loop step against JSBSim, and a campaign of 1,400 flights on two threads.

Ours is the Aerosonde with everything on: Runge-Kutta at 100 Hz, Dryden turbulence, sensors with noise at 20 Hz, four
servos, autopilot and guidance at 20 Hz, truth recorded at 20 Hz. JSBSim flies its own script of the c172x (c1723,
120 Hz, with its own autopilot) through the Python wheel, one `run()` a step. Both alternate in one process.
"""

from __future__ import annotations

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from aerofdi.scenarios import load_scenario
from aerofdi.simulate.fly import start
from aerofdi.simulate.loop import advance
from aerofdi.simulate.prepare import Prepared, prepare

ROUNDS = 9
RUNS, THREADS = 1400, 2


def _scenario() -> Any:
    return replace(load_scenario("aerosonde_elevator"), duration_s=250.0, faults=())


def _ours(prepared: Prepared, run: int) -> float:
    """Microseconds a step of one whole flight."""
    r, motion = start(prepared, 1, run)
    t0 = time.thread_time()
    motion = advance(r.params, r.memory, r.record, motion, 1, run, prepared.steps, 0)
    spent = time.thread_time() - t0
    assert motion.k == prepared.steps
    return 1e6 * spent / prepared.steps


class _JSBSim:
    """The c172x under a script of the wheel, advanced piece by piece."""

    def __init__(self) -> None:
        import jsbsim

        with _silent():
            jsbsim.FGJSBBase().debug_lvl = 0
            self.fdm = jsbsim.FGFDMExec(None)
            self.fdm.set_debug_level(0)
            # The script writes a file of its own, into the working folder unless told otherwise.
            self.folder = tempfile.TemporaryDirectory()
            self.fdm.set_output_path(self.folder.name)
            self.fdm.load_script("scripts/c1723.xml")
            self.fdm.run_ic()
            self.fdm.disable_output()

    def steps(self, n: int) -> float:
        """Microseconds a step over n steps; the script's messages are thrown away."""
        with _silent():
            t0 = time.thread_time()
            for _ in range(n):
                self.fdm.run()
            return 1e6 * (time.thread_time() - t0) / n


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """JSBSim writes to the process's standard output."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def step() -> dict[str, Any]:
    """One closed-loop step."""
    prepared = prepare(_scenario())
    _ours(prepared, 0)
    peer = _JSBSim()
    peer.steps(500)
    ours, theirs = [], []
    for i in range(ROUNDS):
        ours.append(_ours(prepared, i))
        theirs.append(peer.steps(1500))
    a, b = statistics.median(ours), statistics.median(theirs)
    return {
        "ours": a,
        "unit": "us a step",
        "peers": {"JSBSim script c1723 (c172x)": {"value": b, "ratio": b / a}},
        "conditions": f"processor time, median of {ROUNDS} interleaved rounds, one thread; Aerosonde at 100 Hz "
        f"with Dryden turbulence, sensors, servos and autopilot; JSBSim at 120 Hz through its Python wheel",
    }


_CAMPAIGN = """
import json, resource, sys, time
from benchmarks.simulate import _scenario, RUNS, THREADS
from aerofdi.simulate import fly, fly_many
fly(_scenario())
t0 = time.perf_counter()
fly_many(_scenario(), RUNS, None, ("airspeed", "p", "command.elevator"), 0.5, sys.argv[1], THREADS, progress=False)
spent = time.perf_counter() - t0
print(json.dumps([spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""


def campaign() -> dict[str, Any]:
    """1,400 flights of 250 s into a Parquet dataset, in a process of their own, so that memory is theirs alone."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", _CAMPAIGN, str(Path(folder) / "flights")],
            capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1],
        )  # fmt: skip
        size = sum(p.stat().st_size for p in Path(folder).rglob("*.parquet")) / 2**20
    spent, memory = json.loads(done.stdout)
    return {
        "ours": spent,
        "unit": "s",
        "peers": {},
        "conditions": f"{RUNS} Aerosonde flights of 250 s at 100 Hz, {THREADS} threads, three channels at 2 Hz to "
        f"{size:.0f} MiB of Parquet; {RUNS * 250 / 3600:.0f} flight hours, peak memory {memory:.0f} MiB",
    }


def cold_and_warm() -> dict[str, Any]:
    """A short flight of the demo in a new process: compiled before, and compiling."""
    code = (
        "from dataclasses import replace; from aerofdi.scenarios import load_scenario; "
        "from aerofdi.simulate import fly; fly(replace(load_scenario('demo'), duration_s=5.0))"
    )

    def spent(**env: str) -> float:
        t0 = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, **env})
        return time.perf_counter() - t0

    spent()
    warm = statistics.median(spent() for _ in range(5))
    with tempfile.TemporaryDirectory() as empty:
        cold = spent(NUMBA_CACHE_DIR=empty)
    return {
        "ours": warm,
        "unit": "s",
        "peers": {"first run ever (compiling)": {"value": cold, "ratio": cold / warm}},
        "conditions": "a new Python process that flies 5 s of the demo; median of 5",
    }


def run() -> dict[str, dict[str, Any]]:
    """Everything above."""
    return {"simulate.step": step(), "simulate.campaign": campaign(), "simulate.start": cold_and_warm()}
